"""Rules that every drawn floor plan satisfies."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from shapely.geometry import Polygon
from shapely.ops import unary_union

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.drawn_plan import drawn_plan
from pbrs_farm.generate.floor_plan import OpeningKind, Plan, RoomType
from pbrs_farm.generate.programme import Wishes

SEEDS = range(12)


@cache
def plan(seed: int) -> Plan:
    return drawn_plan(np.random.default_rng(seed))


def test_the_same_seed_gives_the_same_plan() -> None:
    assert drawn_plan(np.random.default_rng(3)) == drawn_plan(np.random.default_rng(3))


@pytest.mark.quick(4)
@pytest.mark.parametrize("seed", SEEDS)
def test_rooms_overlap_neither_another_nor_a_wall(seed: int) -> None:
    rooms = [Polygon(room.polygon) for room in plan(seed).rooms]
    # Walls that meet at a slant are mitred: unmitred, their ends would reach into a room.
    has_slants = any(min(map(abs, wall.normal)) > 1e-6 for wall in plan(seed).walls)
    ends = {"to_start": not has_slants, "to_end": not has_slants}
    walls = unary_union([Polygon(wall.corners(**ends)) for wall in plan(seed).walls])
    assert all(room.is_valid for room in rooms)
    assert unary_union(rooms).area == pytest.approx(sum(room.area for room in rooms), abs=1e-6)
    # Corners are rounded to a tenth of a millimetre.
    assert unary_union(rooms).intersection(walls).area < (3e-4 if has_slants else 1e-6)


@pytest.mark.quick(4)
@pytest.mark.parametrize("seed", SEEDS)
def test_every_room_is_reached_from_the_entrance(seed: int) -> None:
    drawn = plan(seed)
    hall = next(i for i, room in enumerate(drawn.rooms) if room.type is RoomType.HALL)
    assert [o.room for o in drawn.openings if o.kind is OpeningKind.ENTRANCE] == [hall]
    # Walk through doors, and from the living room into an open kitchen.
    joined = [{o.room, o.other} for o in drawn.openings if o.other is not None]
    living = next(
        i for i, r in enumerate(drawn.rooms) if r.type in (RoomType.LIVING, RoomType.STUDIO)
    )
    kitchen = next(i for i, r in enumerate(drawn.rooms) if r.type is RoomType.KITCHEN)
    gap = Polygon(drawn.rooms[living].polygon).distance(Polygon(drawn.rooms[kitchen].polygon))
    if gap < 0.01:
        joined.append({living, kitchen})
    reached = {hall}
    for _ in drawn.rooms:
        reached |= {room for pair in joined if pair & reached for room in pair}
    assert reached == set(range(len(drawn.rooms)))


@pytest.mark.quick(4)
@pytest.mark.parametrize("seed", SEEDS)
def test_rooms_to_live_in_have_daylight(seed: int) -> None:
    drawn = plan(seed)
    for number, room in enumerate(drawn.rooms):
        glass = sum(
            o.width * o.height
            for o in drawn.openings
            if o.room == number and o.kind in (OpeningKind.WINDOW, OpeningKind.FRENCH_WINDOW)
        )
        if room.type.is_habitable:
            assert glass >= room.area / 8 * 0.95, room.name


@pytest.mark.quick(4)
@pytest.mark.parametrize("seed", SEEDS)
def test_openings_lie_in_their_walls_and_apart(seed: int) -> None:
    drawn = plan(seed)
    for number, wall in enumerate(drawn.walls):
        spans = sorted(
            (o.along - o.width / 2, o.along + o.width / 2)
            for o in drawn.openings
            if o.wall == number
        )
        ends = [0.0, *(end for _start, end in spans)]
        assert all(start >= end - 1e-6 for (start, _), end in zip(spans, ends, strict=False))
        assert not spans or spans[-1][1] <= wall.length + 1e-6


def test_wishes_that_no_home_meets_are_refused_with_the_nearest() -> None:
    with pytest.raises(BadInput, match="28 to 60"):
        Wishes(bedrooms=(0, 0), area=(200, 300))
