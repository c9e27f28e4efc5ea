"""`repair.add_ceilings`: walled rooms without a ceiling get one; undersides of floors are ceilings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.classes import CEILING
from pbrs_farm.core.classes import FLOOR as FLOOR_CLASS
from pbrs_farm.core.house import House, Item, ItemKind, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.geometry.plan_surfaces import horizontal
from pbrs_farm.geometry.solids import box
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.repair import repair, summary_of_report
from tests.read.sweethome3d.sh3d_source import WALLS, home_xml
from tests.repair.wall_rooms import FLOOR, covers, house, room, walls_around

RECT = (0.0, 0.0, 4.0, 3.0)
ON = RepairFields(add_ceilings=True, lamp_in_every_room=True)


def _open(name: str = "Living room", *, walls: list[Item] | None = None, **more: float) -> House:
    """A room of 4 x 3 m with walls and a floor, without a ceiling."""
    r = replace(room("0_0", RECT, **more), name=name, has_ceiling=False)
    stands = walls_around(RECT) if walls is None else walls
    return house([*stands, *covers(r, ceiling=False)], [r])


def _ceilings(of: House) -> list[Item]:
    return [i for i in of.items if i.kind is ItemKind.CEILING]


def _area_seen_from_below(items: list[Item]) -> float:
    corners = corners_of_surfaces([s for i in items for s in i.surfaces])
    down = corners[area_vectors(corners)[:, 1] < 0]
    return float(shapely.area(shapely.union_all(shapely.polygons(down[:, :, [0, 2]]))))


def test_a_roofless_room_is_closed_at_its_walls_height_with_its_lamp() -> None:
    after, report = repair(_open(ceiling_y=2.9), ON)
    (ceiling,) = _ceilings(after)
    assert ceiling.bounds[0, 1] == pytest.approx(
        2.5, abs=1e-6
    )  # height of the walls, rather than the room's 2.9
    assert (ceiling.nyu40, ceiling.room_id) == (CEILING, "0_0")
    assert after.rooms[0].has_ceiling
    assert (after.rooms[0].ceiling_y, report.added_ceilings) == (2.5, ("0_0",))
    assert report.rooms[0].enclosure == "closed"
    (lamp,) = [i for i in after.items if i.kind is ItemKind.LAMP]
    assert lamp.lights[0].position[1] == pytest.approx(2.3, abs=1e-3)
    assert "1 room had walls and no ceiling" in summary_of_report(report)


def test_without_the_field_the_sky_stays() -> None:
    after, report = repair(_open(), RepairFields(lamp_in_every_room=True))
    assert (_ceilings(after), report.added_ceilings) == ([], ())
    # No lamp is added to it.
    assert [i for i in after.items if i.kind is ItemKind.LAMP] == []
    assert report.added_lamps == ()


@pytest.mark.parametrize(
    ("name", "walls"),
    [
        ("Terrasse", None),
        ("Hobby", walls_around(RECT, top=1.1)),
        ("Carport side", walls_around(RECT)[:2]),
    ],
)
def test_outdoors_parapets_and_free_edges_stay_open(name: str, walls: list[Item] | None) -> None:
    after, _report = repair(_open(name, walls=walls), ON)
    assert _ceilings(after) == []


def test_a_ceiling_slopes_with_the_tops_of_the_walls() -> None:
    # The wall along y = 0 is 2.5 m high, the opposite one 2 m; the others slope between them.
    walls = WALLS.replace("id='b'", "id='b' height='250' heightAtEnd='200'")
    walls = walls.replace("id='c'", "id='c' height='200'")
    walls = walls.replace("id='d'", "id='d' height='200' heightAtEnd='250'")
    bare = "<room name='Loft' ceilingVisible='false'><point x='5' y='5'/><point x='395' y='5'/><point x='395' y='295'/><point x='5' y='295'/></room>"
    drawn = read_home(home_xml(walls), "a.sh3d")
    roofless = read_home(home_xml(walls, room=bare), "a.sh3d")
    (expected,) = _ceilings(drawn)
    (ceiling,) = _ceilings(repair(roofless, ON)[0])
    (built,) = _ceilings(repair(drawn, ON)[0])
    assert ceiling.bounds == pytest.approx(built.bounds, abs=0.02)
    assert np.ptp(expected.bounds[:, 1]) > 0.4


def _two_storeys(*, upper_ceiling: bool) -> House:
    """One room above another, the lower one without a ceiling."""
    low = replace(room("0_0", RECT), has_ceiling=False)
    high = replace(room("1_0", RECT, floor_y=2.6, ceiling_y=5.1), has_ceiling=upper_ceiling)
    upper_walls = [replace(w, level_id="1") for w in walls_around(RECT, "u", bottom=2.6, top=5.1)]
    items = [*walls_around(RECT, top=2.6), *upper_walls]
    items += [*covers(low, ceiling=False), *covers(high, ceiling=upper_ceiling)]
    return house(items, [low, high])


def test_the_underside_of_the_upper_floor_is_ceiling() -> None:
    before = _two_storeys(upper_ceiling=True)
    after, _report = repair(before, RepairFields())
    (under,) = [i for i in _ceilings(after) if i.id != "ceiling_1_0"]
    assert (under.id, under.nyu40, under.room_id) == ("underside_floor_1_0", CEILING, "0_0")
    assert _area_seen_from_below([under]) >= 12.0 - 1e-6
    assert _area_seen_from_below([i for i in after.items if i.id == "floor_1_0"]) == 0.0
    # Existing items keep their instance ids.
    assert [i.id for i in after.items][: len(before.items)] == [i.id for i in before.items]


def test_the_visible_part_of_a_half_hidden_floor_is_a_ceiling() -> None:
    before = _two_storeys(upper_ceiling=True)
    low, high = before.rooms
    hung = covers(room("0_0", (0.0, 0.0, 2.0, 3.0), ceiling_y=2.3), floor=False)
    low = replace(low, has_ceiling=True)
    after, _report = repair(replace(before, rooms=(low, high)).with_items([*before.items, *hung]), RepairFields())  # fmt: skip
    assert "underside_floor_1_0" in [i.id for i in after.items]
    # A ceiling over the whole room hides it.
    whole = covers(room("0_0", RECT, ceiling_y=2.3), floor=False)
    after, _report = repair(replace(before, rooms=(low, high)).with_items([*before.items, *whole]), RepairFields())  # fmt: skip
    assert "underside_floor_1_0" not in [i.id for i in after.items]


def test_the_underside_of_a_balcony_is_ceiling_over_the_ground() -> None:
    before = _two_storeys(upper_ceiling=True)
    low, high = before.rooms
    balcony = room("1_1", (4.2, 0.0, 6.0, 3.0), floor_y=2.6, ceiling_y=5.1)
    (slab,) = covers(balcony, ceiling=False)
    land = horizontal("land", [[room("0_9", (-9.0, -9.0, 9.0, 9.0)).polygon]], -0.2, FLOOR, up=True)
    ground = Item("land", "", ItemKind.GROUND, "0", (land,), nyu40=FLOOR_CLASS)
    rooms = (low, high, replace(balcony, has_ceiling=False))
    after, _report = repair(replace(before, rooms=rooms).with_items([*before.items, slab, ground]), RepairFields())  # fmt: skip
    (under,) = [i for i in after.items if i.id == "underside_floor_1_1"]
    assert (under.nyu40, under.room_id) == (CEILING, None)
    # The lowest floor is not visible from below.
    assert "underside_floor_0_0" not in [i.id for i in after.items]


def test_each_of_two_roofless_storeys_gets_a_ceiling() -> None:
    after, report = repair(_two_storeys(upper_ceiling=False), ON)
    assert sorted(report.added_ceilings) == ["0_0", "1_0"]
    heights = {i.room_id: round(float(i.bounds[0, 1]), 3) for i in _ceilings(after)}
    assert heights == {"0_0": 2.48, "1_0": 5.1}  # below the slab of the upper floor


def test_a_void_whose_ceiling_is_a_storey_higher_and_stairs_stay_open() -> None:
    # The upper floor covers only the left half; over the right half its ceiling is visible.
    before = _two_storeys(upper_ceiling=True)
    low, high = before.rooms
    half = replace(high, polygon=room("1_0", (0.0, 0.0, 2.0, 3.0)).polygon)
    stairs = Item("steps", "", ItemKind.STAIRS, "0", (box("steps", np.array([1.0, 1.4, 0.5]), np.array([0.5, 1.4, 0.5]), 0),))  # fmt: skip
    items = [i for i in before.items if i.id != "floor_1_0"]
    after, _report = repair(
        replace(before, items=(*items, *covers(half, ceiling=False), stairs), rooms=(low, high)), ON
    )
    (ceiling,) = [i for i in after.items if i.id == "added_ceiling_0_0"]
    visible_m2 = _area_seen_from_below([ceiling])
    assert 4.5 < visible_m2 < 6.5  # half of 12 m2, minus the stairs, plus the area over the walls


def test_undrawn_rooms_are_the_areas_enclosed_by_walls() -> None:
    # A transverse wall divides the home; a fence around it encloses nothing.
    across = "<wall id='e' xStart='200' yStart='0' xEnd='200' yEnd='298' thickness='10'/>"
    fence = "".join(
        f"<wall id='f{k}' xStart='{a}' yStart='{b}' xEnd='{c}' yEnd='{d}' thickness='5' height='120'/>"
        for k, (a, b, c, d) in enumerate([(-300, -300, 700, -300), (700, -300, 700, 600), (700, 600, -300, 600), (-300, 600, -300, -300)])
    )  # fmt: skip
    read = read_home(home_xml(WALLS + across + fence, room=""), "a.sh3d")
    assert [round(shapely.Polygon(r.polygon).area, 2) for r in read.rooms] == [5.51, 5.51]
    assert [n.kind for n in read.notes] == ["rooms-from-walls"]
    _after, report = repair(read, RepairFields())
    assert [r.enclosure for r in report.rooms] == ["closed", "closed"]
