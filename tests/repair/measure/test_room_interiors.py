"""Start points of the leak meter's rays: inside rooms, also under solid roofs."""

from __future__ import annotations

import shapely

from pbrs_farm.core.house import Room
from pbrs_farm.repair.measure.room_interiors import interiors_of_room
from pbrs_farm.repair.structure.planar_surfaces import Cover
from pbrs_farm.repair.structure.prisms import Plane, level_plane
from tests.repair.wall_rooms import room

ROOM: Room = room("0_0", (0, 0, 6, 4), ceiling_y=3.0)
# Two roofs that rise from 1 m to 3 m at x = 2 and fall to 1 m at x = 4, both extending over
# everything.
RISING, FALLING = Plane(1.0, 0.0, 1.0), Plane(-1.0, 0.0, 5.0)
ALL = shapely.box(-1, -1, 7, 5)


def heights_at(covers: list[Cover], x: float) -> list[float]:
    """The heights of the parts of the room at a place."""
    place = shapely.Point(x, 2.0)
    parts = interiors_of_room(ROOM, [], [], covers)
    return [
        round(float(p.high.at(shapely.get_coordinates(place))[0]), 6)
        for p in parts
        if p.area.buffer(1e-3).contains(place)
    ]


def test_without_a_ceiling_the_nominal_height_counts() -> None:
    assert heights_at([], 0.5) == [3.0]


def test_where_two_roofs_meet_each_counts_on_its_side_of_the_ridge() -> None:
    roofs = [Cover(True, shapely.box(-1, -1, 7, 5), p) for p in (RISING, FALLING)]
    assert heights_at(roofs, 0.5) == [1.5]
    assert heights_at(roofs, 3.5) == [1.5]


def test_of_two_equal_ceilings_one_counts() -> None:
    low = Cover(True, shapely.box(0, 0, 3, 4), level_plane(2.2))
    assert heights_at([low, low], 1.0) == [2.2]
    assert heights_at([low, low], 4.0) == [3.0]


def test_floors_and_rugs_are_no_ceiling() -> None:
    low = [Cover(False, ALL, level_plane(2.2)), Cover(True, ALL, level_plane(0.05))]
    assert heights_at(low, 1.0) == [3.0]
