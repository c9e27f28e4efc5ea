"""What a view may look like without its labels changing."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
import torch

from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.training_loop import augmented, turned_hue
from tests.study.training.made_views import small_plan

pytestmark = pytest.mark.study


def _pixel(*rgb: float) -> torch.Tensor:
    return torch.tensor(rgb).view(1, 3, 1, 1)


def test_grey_stays_grey_whatever_the_turn() -> None:
    angles = torch.linspace(-pi, pi, 9)
    grey = torch.full((9, 3, 2, 2), 0.4)
    assert torch.allclose(turned_hue(grey, angles), grey, atol=1e-6)


def test_a_third_of_a_turn_makes_red_paint_green() -> None:
    turned = turned_hue(_pixel(0.7, 0.2, 0.1), torch.tensor([2 * pi / 3]))
    assert turned.flatten().tolist() == pytest.approx([0.1, 0.7, 0.2], abs=1e-6)


def test_other_paint_is_as_light_as_before() -> None:
    paint = _pixel(0.5, 0.4, 0.45)
    for angle in (0.3, 1.0, -2.5):
        assert float(turned_hue(paint, torch.tensor([angle])).mean()) == pytest.approx(0.45)


def test_hue_changes_pictures_and_no_label() -> None:
    plan = small_plan(hue="1", flip="false", gain="0", gamma="0", tint="0", noise="0")
    rng = np.random.default_rng(0)
    colour = torch.from_numpy(rng.random((3, 3, 4, 4), np.float32))
    labels = {"normal": torch.ones(3, 4, 4, 3), "valid": torch.ones(3, 4, 4, dtype=torch.bool)}
    dice = torch.Generator().manual_seed(5)
    changed = augmented({"colour": colour, **labels}, task_of("normals"), plan, dice)
    assert not torch.allclose(changed["colour"], colour, atol=0.01)
    assert all(torch.equal(changed[name], label) for name, label in labels.items())
