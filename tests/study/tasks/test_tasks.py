"""Tasks: mirrored targets, baselines, pictures, and refused views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.networks.network_choice import network_of
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.prediction import network_output
from tests.study.training.made_views import sample, small_plan, views

pytestmark = pytest.mark.study


def test_mirroring_keeps_a_normals_angle_to_its_ray() -> None:
    """A pixel's ray and normal are mirrored together, so that their product is unchanged."""
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
    name, baseline = task.baseline(targets, plan)
    assert name == "mean normal"
    np.testing.assert_allclose(np.linalg.norm(baseline, axis=-1), 1, atol=1e-6)
    # Floors are below, walls above.
    assert baseline[-1, :, 1].mean() < -0.9
    assert abs(baseline[0, :, 1].mean()) < 0.1


def test_the_most_frequent_class_is_named() -> None:
    task, plan = task_of("segmentation"), small_plan("segmentation")
    arrays = views(6, plan)
    name, baseline = task.baseline([{"labels": row} for row in arrays.targets["labels"]], plan)
    counts = np.bincount(arrays.targets["labels"].ravel())
    assert (baseline == counts.argmax()).all()
    assert name.startswith("always ")


def test_thirteen_classes_are_nyu40_grouped() -> None:
    task, plan = task_of("segmentation"), small_plan("segmentation", n_classes="13")
    labels = np.full((32, 40), 22, np.uint8)
    labels[:16], labels[0] = 14, 0
    grouped = task.targets(replace(sample(3), class40=labels), plan)["labels"]
    assert [NYU13_NAMES[k] for k in grouped[[0, 1, 16], 0]] == ["none", "table", "ceiling"]
    name, baseline = task.baseline([{"labels": grouped}], plan)
    assert name == "always ceiling"
    assert (baseline == 3).all()


def test_depth_is_judged_up_to_a_scale_and_trained_halfway_so() -> None:
    task, plan = task_of("depth"), small_plan("depth")
    depth = torch.tensor([[[1.0, 2.0], [4.0, 0.0]]])
    twice = torch.log(2 * torch.where(depth > 0, depth, 7.0))[:, None]
    scorer = task.scorer(plan)
    error = scorer.add(task.predictions(twice)[0], {"depth": depth[0].numpy()})
    figures = scorer.figures()
    assert error == pytest.approx(0, abs=1e-6)
    assert figures["abs_rel"] == pytest.approx(1)
    assert figures["below_1_25"] == 0
    assert figures["rms_m"] == pytest.approx(np.sqrt(7))  # 1, 2 and 4 metres too far
    loss = task.loss(twice, {"depth": depth}, plan)
    torch.testing.assert_close(loss, torch.tensor([np.log(2) ** 2 / 2], dtype=torch.float32))
    # One of two pixels at e times its depth: the logarithms differ by a half.
    half = np.array([[1.0, 2.0]], np.float32)
    assert scorer.add(half * [[1, np.e]], {"depth": half}) == pytest.approx(0.5)


def test_the_mean_depth_is_one_of_logarithms_over_known_pixels() -> None:
    task, plan = task_of("depth"), small_plan("depth")
    depths = [np.array(row, np.float32) for row in ([[1, 0, 0]], [[4, 8, 0]])]
    name, baseline = task.baseline([{"depth": depth} for depth in depths], plan)
    assert name == "mean depth"
    np.testing.assert_allclose(baseline, [[2, 8, 32 ** (1 / 3)]], rtol=1e-6)


def test_a_plan_for_depth_turns_no_camera() -> None:
    with pytest.raises(BadInput, match="turn_deg"):
        small_plan("depth", turn_deg="6")


def test_a_class_that_the_network_lacks_names_the_view() -> None:
    plan = small_plan("segmentation", n_classes="12")
    labels = np.full((32, 40), 22, np.uint8)
    with pytest.raises(BadInput, match=r"home-3-00000000/3: class40: has class 22 \(ceiling\)"):
        task_of("segmentation").targets(replace(sample(3), class40=labels), plan)


@pytest.mark.parametrize("name", ["normals", "segmentation", "boundaries", "depth"])
def test_the_truth_as_a_prediction_is_perfect(name: str) -> None:
    task, plan = task_of(name), small_plan(name)
    arrays = views(3, plan)
    scorer = task.scorer(plan)
    for k in range(3):
        truth = {key: array[k] for key, array in arrays.targets.items()}
        scorer.add(task.prediction_of(truth), truth)
        assert task.picture(task.prediction_of(truth)).shape == (32, 40, 3)
    assert task.error(scorer.figures()) < 0.06


def test_an_unknown_task_is_refused() -> None:
    with pytest.raises(BadInput, match="no such task"):
        task_of("albedo")


def test_an_enlarged_picture_gives_a_map_of_its_size() -> None:
    plan = small_plan("boundaries", enlarge="2")
    network = network_of(plan.network, 1).eval()
    colour = torch.rand(1, 3, 32, 40)
    with torch.no_grad():
        output = network_output(network, colour, plan)
        plain = network_output(network, colour, small_plan("boundaries"))
    assert output.shape == plain.shape == (1, 6, 32, 40)
