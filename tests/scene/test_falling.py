"""Falling items in a home: free fall until contact, then rest, and errors otherwise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.check import verify
from pbrs_farm.core.errors import BadInput
from tests.scene.homes import can, crate, small_home

AT = (2.6, 1.2, 2.0)  # above an empty part of the living room's floor


@pytest.fixture(scope="module")
def floating_home(tmp_path_factory: pytest.TempPathFactory) -> pf.Home:
    """A home with a crate in the air."""
    return small_home().place(crate(tmp_path_factory.mktemp("models")), at=AT)


@pytest.fixture(scope="module")
def falling(floating_home: pf.Home) -> pf.Home:
    return floating_home.drop("crate 1", from_s=0.5)


def bounds(home: pf.Home, time_s: float, name: str = "crate 1") -> np.ndarray:
    return home.at(time_s).items[name].bounds


def test_an_item_falls_by_half_g_t_squared_and_rests_on_the_floor(
    floating_home: pf.Home, falling: pf.Home
) -> None:
    rest = floating_home.items["crate 1"].bounds
    for time_s in (0.0, 0.5):
        assert bounds(falling, time_s) == pytest.approx(rest, abs=1e-6)
    for fallen_s in (0.1, 0.2, 0.3, 0.4):
        drop = rest[0, 1] - bounds(falling, 0.5 + fallen_s)[0, 1]
        # Steps of 2 ms are half a step ahead.
        assert drop == pytest.approx(9.81 / 2 * fallen_s**2, abs=0.001 * 9.81 * fallen_s + 1e-3)
    end = bounds(falling, 99.0)
    # It rests on the rug.
    assert end[0, 1] == pytest.approx(floating_home.items["rug"].bounds[1, 1], abs=0.006)
    assert np.linalg.norm(end[1] - end[0]) == pytest.approx(
        np.linalg.norm(rest[1] - rest[0]), abs=0.1
    )


def test_a_push_and_a_spin_have_their_given_values(floating_home: pf.Home) -> None:
    pushed = floating_home.drop("crate 1", push=(0.5, 0, -0.25), spin=(0, 3.0, 0))
    before, after = bounds(pushed, 0.0).mean(0), bounds(pushed, 0.2).mean(0)
    assert (after - before)[[0, 2]] == pytest.approx([0.1, -0.05], abs=2e-3)
    (motion,) = pushed.house.motions
    turn = motion.matrix_at(0.2)[:3, :3]
    assert np.arctan2(turn[0, 2], turn[0, 0]) == pytest.approx(0.6, abs=0.01)


def test_an_item_on_a_table_stays_and_falls_when_pushed_off(tmp_path: Path) -> None:
    home = small_home().place(can(tmp_path), on="dining table", seed=1)
    rest = home.items["can 1"].bounds
    assert bounds(home.drop("can 1"), 9.0, "can 1") == pytest.approx(rest, abs=0.008)
    off = home.drop("can 1", push=(3.5, 0, 0), seconds=8)
    assert bounds(off, 9.0, "can 1")[0, 1] == pytest.approx(0.0, abs=0.02)


def test_a_fall_travels_with_the_home(falling: pf.Home, floating_home: pf.Home) -> None:
    assert falling.id != floating_home.id
    assert floating_home.drop("crate 1", from_s=0.5).id == falling.id
    with pytest.raises(BadInput, match="has recorded motion"):
        falling.move("crate 1", by=(0.1, 0, 0))
    assert len(falling.without("crate 1").motions) == 0
    assert falling.motions.column("from_s") == [0.5]


@pytest.mark.long
def test_restless_flying_and_overlapping_items_are_named(
    floating_home: pf.Home, tmp_path: Path
) -> None:
    with pytest.raises(BadInput, match=r"crate 1.*still moves after 0.2 s"):
        floating_home.drop("crate 1", seconds=0.2)
    with pytest.raises(BadInput, match="drop: push: expected at most 50 m/s"):
        floating_home.drop("crate 1", push=(0, 500, 0))
    table = floating_home.items["dining table"].bounds
    x, _y, z = table.mean(0)
    inside = floating_home.place(can(tmp_path), at=(x, table[1, 1] - 0.06, z))
    with pytest.raises(BadInput, match=r"can 1: starts \d+ mm inside dining table"):
        inside.drop("can 1")


@pytest.mark.long
def test_a_film_of_a_fall_has_labels_that_verify_finds_right(
    falling: pf.Home, tmp_path: Path
) -> None:
    eye = np.array([2.6, 1.0, 3.7])
    camera = pf.Camera.look_at(eye, target=(2.6, 0.75, 2.0), size=(96, 72))
    frames = pf.film(
        falling,
        camera,
        fps=8,
        seconds=1.25,
        modes=[],
        layers=["flow_forward", "scene_flow", "nocs"],
    )
    n_pixels = [f.mask("crate 1").sum() for f in frames]
    assert min(n_pixels) > 30
    assert {
        f.instances.column("id")[f.instances.column("item").index("crate 1")] for f in frames
    } == {len(falling.house.items)}
    frames.save(tmp_path / "root")
    certificate = verify(tmp_path / "root", all_pixels=True)
    assert certificate.is_clean, certificate.text()
