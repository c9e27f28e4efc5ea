"""Augmentation keeps the labels of a view."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
import torch

from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.augmentation import augment, rotate_cameras, rotate_hue
from tests.study.training.made_views import small_plan

pytestmark = pytest.mark.study


def _pixel(*rgb: float) -> torch.Tensor:
    return torch.tensor(rgb).view(1, 3, 1, 1)


def test_grey_stays_grey_for_any_turn() -> None:
    angles = torch.linspace(-pi, pi, 9)
    grey = torch.full((9, 3, 2, 2), 0.4)
    assert torch.allclose(rotate_hue(grey, angles), grey, atol=1e-6)


def test_a_third_of_a_turn_makes_red_paint_green() -> None:
    turned = rotate_hue(_pixel(0.7, 0.2, 0.1), torch.tensor([2 * pi / 3]))
    assert turned.flatten().tolist() == pytest.approx([0.1, 0.7, 0.2], abs=1e-6)


def test_other_paint_is_as_light_as_before() -> None:
    paint = _pixel(0.5, 0.4, 0.45)
    for angle in (0.3, 1.0, -2.5):
        assert float(rotate_hue(paint, torch.tensor([angle])).mean()) == pytest.approx(0.45)


def test_hue_changes_pictures_and_no_label() -> None:
    plan = small_plan(hue="1", flip="false", gain="0", gamma="0", tint="0", noise="0")
    rng = np.random.default_rng(0)
    colour = torch.from_numpy(rng.random((3, 3, 4, 4), np.float32))
    labels = {"normal": torch.ones(3, 4, 4, 3), "valid": torch.ones(3, 4, 4, dtype=torch.bool)}
    dice = torch.Generator().manual_seed(5)
    changed = augment({"colour": colour, **labels}, task_of("normals"), plan, dice)
    assert not torch.allclose(changed["colour"], colour, atol=0.01)
    assert all(torch.equal(changed[name], label) for name, label in labels.items())


def test_some_views_have_less_noise_than_others() -> None:
    plan = small_plan(
        hue="0", flip="false", gain="0", gamma="0", tint="0", noise="0.1", turn_deg="0"
    )
    batch = {"colour": torch.full((64, 3, 16, 16), 0.5)}
    changed = augment(batch, task_of("normals"), plan, torch.Generator().manual_seed(5))
    strengths = changed["colour"].std((1, 2, 3))
    assert float(strengths.min()) < 0.01
    assert 0.09 < float(strengths.max()) < 0.11


def sphere(height: int = 96, width: int = 128, hfov_deg: float = 60.0) -> dict[str, torch.Tensor]:
    """A view from the middle of a sphere coloured by direction: no rotation changes its normals."""
    half = np.tan(np.radians(hfov_deg / 2))
    x = ((np.arange(width) + 0.5) * 2 / width - 1) * half
    y = ((np.arange(height) + 0.5) * 2 / height - 1) * half * height / width
    rays = np.stack([*np.broadcast_arrays(x[None, :], y[:, None], 1.0)], -1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return {
        "colour": torch.from_numpy((rays + 1).transpose(2, 0, 1)[None] / 2).float(),
        "normal": torch.from_numpy(np.rint(-rays * 32767).astype(np.int16))[None],
        "valid": torch.ones(1, height, width, dtype=torch.bool),
    }


@pytest.mark.parametrize(("pitch", "roll"), [(0.1, 0.0), (0.0, 0.15), (-0.08, 0.2)])
def test_a_turned_camera_sees_the_same_sphere_from_its_middle(pitch: float, roll: float) -> None:
    old = sphere()
    new = rotate_cameras(old, task_of("normals"), torch.tensor([[pitch, roll]]), 60.0)
    valid = new["valid"][0]
    assert 0.6 < float(valid.float().mean()) < 1
    # Every normal points at the camera in any direction; up to a pixel, since labels are nearest.
    difference = (new["normal"] - old["normal"])[0][valid].abs().max() / 32767
    assert float(difference) < 1.2 * 2 * np.tan(np.radians(30)) / 128
    assert not new["normal"][0][~valid].any()


def test_a_camera_that_pitches_up_sees_higher_points_and_rolls_clockwise() -> None:
    old, task = sphere(), task_of("normals")
    up = rotate_cameras(old, task, torch.tensor([[0.2, 0.0]]), 60.0)["colour"][0, :, 48, 64]
    assert float(up[1]) == pytest.approx((1 - np.sin(0.2)) / 2, abs=0.01)
    # Rolled clockwise, the camera's right points down: y grows along its rows.
    row = rotate_cameras(old, task, torch.tensor([[0.0, 0.2]]), 60.0)["colour"][0, 1, 48]
    assert float(row[100]) > float(row[64]) > float(row[28])


def test_classes_and_edges_have_no_direction_to_turn() -> None:
    for name in ("segmentation", "boundaries"):
        batch = {"labels": torch.ones(1, 2, 2)}
        assert task_of(name).turned(batch, torch.eye(3)[None]) is batch
