"""Floating objects in a home: share of the view that they hide, and the home is unchanged."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh

from pbrs_farm.core.house import FLOATING, House, Item, ItemKind, Room, corners_of_surfaces
from pbrs_farm.dress.floating import FEW, with_floating_things
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.dress.furniture import DEPTH, HEIGHT, WIDTH, house, room, solid

FLOOR = replace(solid("floor", [0, -0.1, 0], [WIDTH, 0, DEPTH]), kind=ItemKind.FLOOR)


SIZE = (7.0, 3.0, 6.0)


def floating(of: House) -> list[Item]:
    return [item for item in of.items if item.is_floating]


def large_room() -> Room:
    """A room of 7 x 6 x 3 m: many objects, so that chance matters little."""
    x, y, z = SIZE
    polygon = np.array([[0.0, 0.0], [0.0, z], [x, z], [x, 0.0]])
    return replace(room(), polygon=polygon, ceiling_y=y)


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_about_the_given_share_of_the_view_is_hidden(share: float) -> None:
    x, y, z = SIZE
    floor = replace(solid("floor", [0, -0.1, 0], [x, 0, z]), kind=ItemKind.FLOOR)
    after = with_floating_things(replace(house(floor), rooms=(large_room(),)), share, 1)
    corners = corners_of_surfaces(s for item in floating(after) for s in item.surfaces)
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    # Cosine-distributed rays that enter an empty room anywhere through its walls: mean length 4 V /
    # S.
    rng = np.random.default_rng(2)
    size, n = np.array(SIZE), 20_000
    areas = np.array([y * z, x * z, x * y])
    axis = rng.choice(3, n, p=areas / areas.sum())
    side = rng.integers(0, 2, n)
    rows = np.arange(n)
    begin = rng.random((n, 3)) * size
    begin[rows, axis] = side * size[axis]
    radius, angle = np.sqrt(rng.random(n)), rng.uniform(0, 2 * np.pi, n)
    along = np.zeros((n, 3))
    along[rows, axis] = np.sqrt(1 - radius**2) * (1 - 2 * side)
    along[rows, axis - 1], along[rows, axis - 2] = radius * np.cos(angle), radius * np.sin(angle)
    hidden = mesh.ray.intersects_first(begin, along) >= 0
    assert hidden.mean() == pytest.approx(share, rel=0.25)


def test_the_home_is_unchanged_and_floating_items_come_last() -> None:
    before = builtin_home()
    after = with_floating_things(before, 0.1, 1)
    for old, new in zip(before.items, after.items, strict=False):
        assert (old.id, old.tags, old.nyu40, old.room_id) == (
            new.id,
            new.tags,
            new.nyu40,
            new.room_id,
        )
        for a, b in zip(old.surfaces, new.surfaces, strict=True):
            assert np.array_equal(a.positions, b.positions)
            assert before.materials[a.material] == after.materials[b.material]
    added = after.items[len(before.items) :]
    assert added
    assert [item for item in after.items if item.is_floating] == list(added)
    rooms = {room.id for room in before.rooms}
    for item in added:
        assert FLOATING in item.tags
        assert item.nyu40 > 0
        assert not item.lights
        assert item.room_id in rooms
        assert 0.15 <= 2 * item.oriented_box.half.max() <= 1.0 + 1e-6


def test_a_seed_repeats_its_items_and_another_gives_others() -> None:
    def places(seed: int) -> list[list[float]]:
        after = with_floating_things(house(FLOOR), 0.1, seed)
        return [item.oriented_box.centre.tolist() for item in floating(after)]

    assert places(1) == places(1)
    assert places(1) != places(2)


def test_nothing_floats_outdoors_or_in_a_closet() -> None:
    terrace = replace(house(FLOOR), rooms=(room("Terrace"),))
    assert not floating(with_floating_things(terrace, 0.3, 1))
    polygon = np.array([[0.0, 0.0], [0.0, 1.0], [1.5, 1.0], [1.5, 0.0]])
    closet = replace(house(FLOOR), rooms=(replace(room(), polygon=polygon),))
    assert not floating(with_floating_things(closet, 0.3, 1))


def test_a_room_without_space_is_reported() -> None:
    thirds = np.linspace(0, WIDTH, 4)
    blocks = [solid(f"b {a}", [a, 0.01, 0], [b, HEIGHT - 0.2, DEPTH]) for a, b in pairwise(thirds)]
    after = with_floating_things(house(FLOOR, *blocks), 0.3, 1)
    (note,) = [n for n in after.notes if n.kind == FEW]
    assert note.place == "0_0"
    assert "no more free space" in note.text
