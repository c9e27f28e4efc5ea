"""Rooms end at doorways: gaps between walls as wide as doors."""

from __future__ import annotations

from itertools import pairwise

import pytest
import shapely
from shapely.geometry import LineString, Polygon, box
from shapely.ops import unary_union

from pbrs_farm.geometry.doorways import doorways, parted_at_doorways, rooms_by_walls

GROUND = box(0.2, 0.2, 7.8, 5.8)
OUTER = box(0, 0, 8, 6).difference(GROUND)


def parts(*walls: Polygon) -> list[float]:
    """Areas of the rooms between the outer walls and these."""
    standing = unary_union([OUTER, *walls])
    (piece,) = shapely.get_parts(GROUND.difference(standing))
    pieces = parted_at_doorways(piece, doorways(standing))
    assert sum(p.area for p in pieces) == pytest.approx(piece.area)
    return sorted(p.area for p in pieces)


@pytest.mark.parametrize(("width", "n"), [(0.7, 2), (0.9, 2), (1.25, 2), (0.3, 1), (1.6, 1)])
def test_a_gap_as_wide_as_a_door_parts_two_rooms(width: float, n: int) -> None:
    low, high = box(3.9, 0.2, 4.1, 2.0), box(3.9, 2.0 + width, 4.1, 5.8)
    assert len(parts(low, high)) == n


@pytest.mark.parametrize(
    ("width", "leaf", "n"),
    [
        (1.6, box(3.0, 2.0, 4.0, 2.05), 2),  # open, at right angles to its gap
        (2.4, box(3.97, 2.0, 4.03, 4.4), 2),
        (1.6, box(1.0, 2.0, 1.8, 2.05), 1),  # elsewhere
        (3.2, box(3.97, 2.0, 4.03, 5.2), 1),
    ],
)
def test_a_door_in_a_wider_gap_parts_two_rooms(width: float, leaf: Polygon, n: int) -> None:
    walls = unary_union([OUTER, box(3.9, 0.2, 4.1, 2.0), box(3.9, 2.0 + width, 4.1, 5.8)])
    (piece,) = shapely.get_parts(GROUND.difference(walls))
    assert len(parted_at_doorways(piece, doorways(walls, doors=[leaf]))) == n


def test_a_doorway_beside_a_corner_parts_two_rooms() -> None:
    areas = parts(box(3.9, 0.2, 4.1, 4.9))
    assert areas == pytest.approx([3.7 * 5.6 + 0.1 * 0.9] * 2)


def test_rooms_that_doorways_join_in_a_ring_are_three() -> None:
    walls = [box(3.9, 0.2, 4.1, 1.0), box(3.9, 1.9, 4.1, 4.0), box(3.9, 4.9, 4.1, 5.8),
             box(4.1, 2.9, 5.5, 3.1), box(6.4, 2.9, 7.8, 3.1)]  # fmt: skip
    assert len(parts(*walls)) == 3


def test_a_pillar_and_a_niche_part_nothing() -> None:
    pillar, cheek = box(1.0, 2.0, 1.4, 2.4), box(0.2, 4.8, 0.7, 5.0)
    assert len(parts(pillar, cheek)) == 1


def test_an_area_too_small_to_stand_in_is_no_room() -> None:
    # A closet of 0.6 m by 1.2 m, open towards the room.
    assert len(parts(box(7.0, 0.2, 7.2, 0.6), box(7.0, 1.4, 7.8, 1.6))) == 1


def test_walls_without_thickness_part_a_ground_and_close_at_doorways() -> None:
    # Two faces of one wall, a doorway in it; another wall stops short of both its neighbours.
    lines = [
        LineString([(3.95, 0.05), (3.95, 2.0)]), LineString([(4.05, 2.0), (4.05, 0.05)]),
        LineString([(3.95, 2.9), (3.95, 5.95)]), LineString([(4.05, 5.95), (4.05, 2.9)]),
        LineString([(4.15, 3.5), (7.9, 3.5)]), *(LineString(s) for s in _sides(box(0, 0, 8, 6))),
    ]  # fmt: skip
    rooms = rooms_by_walls(box(0, 0, 8, 6), lines)
    # Except for the jambs, whose corners belong to one room each.
    assert all(a.intersection(b).area < 0.01 for k, a in enumerate(rooms) for b in rooms[:k])
    assert sorted(r.area for r in rooms) == pytest.approx(
        [3.95 * 2.5, 3.95 * 3.5, 3.95 * 6], rel=0.02
    )


def test_walls_along_the_edge_part_nothing() -> None:
    ground = box(0, 0, 8, 6)
    assert rooms_by_walls(ground, [LineString(s) for s in _sides(ground)]) == []


def _sides(shape: Polygon) -> list[list[tuple[float, ...]]]:
    ring = list(shape.exterior.coords)
    return [[a, b] for a, b in pairwise(ring)]
