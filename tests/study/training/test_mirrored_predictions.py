"""Predictions averaged with those of the mirrored picture."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from pbrs_farm.study.networks.network_choice import network_of
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.prediction import is_mirror_cheap, predict
from tests.study.training.made_views import small_plan

pytestmark = pytest.mark.study


@pytest.mark.parametrize("task_name", ["normals", "segmentation", "boundaries", "depth"])
@pytest.mark.parametrize("rays", ["false", "true"])
def test_a_mirrored_picture_gets_the_mirrored_prediction(task_name: str, rays: str) -> None:
    plan, task = small_plan(task_name, rays=rays, network="small"), task_of(task_name)
    torch.manual_seed(0)
    network = network_of(plan.network, task.n_out(plan), rays=plan.rays)
    colour = np.random.default_rng(0).integers(0, 256, (2, 32, 40, 3)).astype(np.uint8)
    # The second camera is that of the mirrored picture.
    cameras = np.array([[30, 30, 18, 16], [30, 30, 22, 16]], np.float32)
    colour[1] = colour[0, :, ::-1]
    plain, mean = (
        list(predict(network, colour, task, plan, (), cameras, mirror=mirror))
        for mirror in (False, True)
    )
    flipped = mean[1][:, ::-1] * ([-1, 1, 1] if task_name == "normals" else 1)
    np.testing.assert_allclose(mean[0], flipped, atol=2e-5)
    assert not np.allclose(plain[0], mean[0], atol=1e-3) or task_name == "segmentation"
    if task_name == "normals":
        np.testing.assert_allclose(np.linalg.norm(mean[0], axis=-1), 1, atol=1e-5)
        both = plain[0] + plain[1][:, ::-1] * [-1, 1, 1]
        both /= np.linalg.norm(both, axis=-1, keepdims=True)
        np.testing.assert_allclose(mean[0], both, atol=1e-4)
    if task_name == "boundaries":
        np.testing.assert_allclose(mean[0], (plain[0] + plain[1][:, ::-1]) / 2, atol=1e-4)


def test_classes_are_those_of_the_mean_probability() -> None:
    # 0.9 and 0.3 for class 1: the means are 0.6 and 0.4.
    probability = torch.tensor([[[[0.9]], [[0.1]]], [[[0.3]], [[0.7]]]])
    scores = probability.log()
    task = task_of("segmentation")
    mean = task.mirror_mean(scores[:1], scores[1:])
    torch.testing.assert_close(mean.ravel(), torch.tensor([0.6, 0.4]))
    assert task.predictions(mean).item() == 1


def test_the_mirror_is_off_where_a_pass_takes_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, task = small_plan(), task_of("normals")
    network = network_of(plan.network, task.n_out(plan))
    assert is_mirror_cheap(network, task, plan)
    monkeypatch.setattr("pbrs_farm.study.training.prediction._MIRROR_S", 0.0)
    assert not is_mirror_cheap(network, task, plan)
