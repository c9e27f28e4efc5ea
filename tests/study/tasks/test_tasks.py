"""What the tasks make of a view: mirrored targets, baselines, pictures, and what they refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.networks.network_choice import network_of
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.prediction import network_output
from tests.study.training.made_views import sample, small_plan, views

pytestmark = pytest.mark.study


def test_mirroring_keeps_a_normals_angle_to_its_ray() -> None:
    """A pixel's ray and normal are mirrored together, so that their product stays."""
    task, plan = task_of("normals"), small_plan()
    batch = {k: torch.from_numpy(v) for k, v in views(2, plan).targets.items()}
    turned = task.mirrored(batch, torch.tensor([True, False]))
    x = (np.arange(40) + 0.5 - 20) / 32
    rays = np.stack(np.broadcast_arrays(x, np.zeros((32, 1)), np.ones((32, 1))), -1)
    before = (batch["normal"].numpy() * rays).sum(-1)
    after = (turned["normal"].numpy() * rays).sum(-1)
    np.testing.assert_allclose(after[0], before[0, :, ::-1], rtol=1e-6)
    np.testing.assert_array_equal(turned["normal"][1], batch["normal"][1])
    np.testing.assert_array_equal(turned["valid"][0], batch["valid"][0].flip(1))


def test_the_mean_normal_has_unit_length_everywhere() -> None:
    task, plan = task_of("normals"), small_plan()
    arrays = views(5, plan)
    targets = [{k: v[n] for k, v in arrays.targets.items()} for n in range(5)]
    name, baseline = task.baseline(targets)
    assert name == "mean normal"
    np.testing.assert_allclose(np.linalg.norm(baseline, axis=-1), 1, atol=1e-6)
    # Floors are below, walls above.
    assert baseline[-1, :, 1].mean() < -0.9
    assert abs(baseline[0, :, 1].mean()) < 0.1


def test_the_most_frequent_class_is_named() -> None:
    task, plan = task_of("segmentation"), small_plan("segmentation")
    arrays = views(6, plan)
    name, baseline = task.baseline([{"labels": row} for row in arrays.targets["labels"]])
    counts = np.bincount(arrays.targets["labels"].ravel())
    assert (baseline == counts.argmax()).all()
    assert name.startswith("always ")


def test_a_class_that_the_network_lacks_names_the_view() -> None:
    plan = small_plan("segmentation", n_classes="13")
    labels = np.full((32, 40), 22, np.uint8)
    with pytest.raises(BadInput, match=r"home-3-00000000/3: class40: holds class 22 \(ceiling\)"):
        task_of("segmentation").targets(replace(sample(3), class40=labels), plan)


@pytest.mark.parametrize("name", ["normals", "segmentation", "boundaries"])
def test_the_truth_as_a_prediction_is_perfect(name: str) -> None:
    task, plan = task_of(name), small_plan(name)
    arrays = views(3, plan)
    scorer = task.scorer(plan)
    for k in range(3):
        truth = {key: array[k] for key, array in arrays.targets.items()}
        scorer.add(task.prediction_of(truth), truth)
        assert task.picture(task.prediction_of(truth)).shape == (32, 40, 3)
    assert task.error(scorer.figures()) < 0.06


def test_a_task_that_is_none_is_refused() -> None:
    with pytest.raises(BadInput, match="no such task"):
        task_of("depth")


def test_an_enlarged_picture_gives_a_map_of_its_own_size() -> None:
    plan = small_plan("boundaries", enlarge="2")
    network = network_of(plan.network, 1).eval()
    colour = torch.rand(1, 3, 32, 40)
    with torch.no_grad():
        output = network_output(network, colour, plan)
        plain = network_output(network, colour, small_plan("boundaries"))
    assert output.shape == plain.shape == (1, 6, 32, 40)
