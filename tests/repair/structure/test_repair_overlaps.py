"""Rooms with overlapping outlines and separate walls (SUNCG) lose no wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import Enclosure, House, Item, ItemKind
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.repair import RepairReport, repair, summary_of_report
from pbrs_farm.repair.structure import plan_geometry, watertight
from pbrs_farm.repair.structure.booleans import subtract
from pbrs_farm.repair.structure.prisms import level_plane, solid_prisms
from tests.repair.embree import EmbreeOccluder
from tests.repair.shells import coinciding_share, seen_from, unpaired_edges
from tests.repair.wall_rooms import Rect, covers, house, room, turned, wall, walls_around

LIVING: Rect = (0.0, 0.0, 10.0, 6.0)
BATH: Rect = (7.0, 3.0, 10.0, 6.0)  # in a corner of the living room's outline
IN_LIVING, IN_BATH = (3.0, 1.3, 2.0), (8.5, 1.3, 4.5)


def _owned(walls: list[Item], room_id: str) -> list[Item]:
    return [replace(w, room_id=room_id) for w in walls]


def _repaired(source: House) -> tuple[House, RepairReport]:
    return repair(source, RepairFields(fallback_light=False), occluder_from=EmbreeOccluder)


def bath_in_living() -> House:
    """A bathroom inside the outline of a living room; each room has four separate walls."""
    a, b = room("0_0", LIVING), room("0_1", BATH)
    walls = _owned(walls_around(LIVING, "living", thickness=0.1), "0_0")
    walls += _owned(walls_around(BATH, "bath", thickness=0.1), "0_1")
    return house([*walls, *covers(a), *covers(b)], [a, b])


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_partitions_inside_another_rooms_outline_stay(angle: float) -> None:
    after, report = _repaired(turned(bath_in_living(), angle))
    assert report.structure.walls_lost == ()
    rows = {a.item_id: a for a in report.structure.areas}
    # Two walls of the bathroom are inside the living room's outline: 3.2 x 2.5 m each.
    for name in ("bath0", "bath3"):
        assert rows[name].before_m2 == pytest.approx(3.2 * 2.5, abs=0.3)
        assert rows[name].after_m2 == pytest.approx(rows[name].before_m2, rel=0.02)
    assert {r.enclosure for r in after.rooms} == {Enclosure.CLOSED}
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
    assert len(unpaired_edges(after)) == 0
    assert "WALL LOST" not in summary_of_report(report)


def test_the_smaller_room_sees_its_walls_and_the_larger_one_the_partitions() -> None:
    after, _ = _repaired(bath_in_living())
    assert {i for i, _ in seen_from(after, IN_BATH) if i.startswith("living")} == set()
    visible = {i for i, _ in seen_from(after, IN_LIVING)}
    assert {"bath0", "bath3", "living0", "living1", "living2", "living3"} <= visible
    for origin in (IN_BATH, IN_LIVING):
        assert coinciding_share(after, origin) < 1e-3


def test_adjacent_rooms_see_their_sides_of_the_wall() -> None:
    # Both walls fill the slab between the rooms; one reaches 3 cm into the other room.
    left, right = (0.0, 0.0, 4.0, 3.0), (4.07, 0.0, 8.0, 3.0)
    a, b = room("0_0", left), room("0_1", right)
    walls = _owned(walls_around(left, "a", thickness=0.1), "0_0")
    walls += _owned(walls_around(right, "b", thickness=0.1), "0_1")
    after, report = _repaired(house([*walls, *covers(a), *covers(b)], [a, b]))
    assert report.structure.walls_lost == ()
    for origin, prefix in (((2.0, 1.3, 1.5), "a"), ((6.0, 1.3, 1.5), "b")):
        walls_seen = {i for i, _ in seen_from(after, origin) if not i.startswith(("floor", "ceil"))}
        assert {i[0] for i in walls_seen} == {prefix}
        assert coinciding_share(after, origin) < 1e-3


def test_a_wall_half_in_another_room_keeps_that_half() -> None:
    # The long wall continues from the living room's edge through its middle.
    a, b = room("0_0", LIVING), room("0_1", (2.0, -3.0, 8.0, 0.0))
    corner = replace(a, polygon=np.array([[0, 0], [5, 0], [5, -2], [10, -2], [10, 6], [0, 6.0]]))
    long = wall("long", (2.0, -0.05), (8.0, -0.05), thickness=0.1)
    walls = _owned([long], "0_1")
    after, report = _repaired(house([*walls, *covers(corner)], [corner, b]))
    (row,) = [x for x in report.structure.areas if x.item_id == "long"]
    assert row.after_m2 == pytest.approx(row.before_m2, rel=0.01) == pytest.approx(15.0, rel=0.01)
    low, high = next(i for i in after.items if i.id == "long").bounds
    assert (high - low)[0] == pytest.approx(6.0, abs=0.01)


def test_a_lost_wall_is_in_report_note_and_summary(monkeypatch: pytest.MonkeyPatch) -> None:
    def whole_outline(walls, rooms, table):  # type: ignore[no-untyped-def]
        """The former behaviour of repair: cut with all of the other room."""
        areas = {r.id: plan_geometry.polygon_of_room(r.polygon) for r in rooms}
        cut = []
        for w in walls:
            other_outlines = [a for i, a in areas.items() if i != w.room_id]
            planes = level_plane(-0.05), level_plane(2.55)
            cutters = solid_prisms(other_outlines, *planes, (w.tag("hidden"),) * 3, table)
            cut.append(replace(w, solid=subtract(w.solid, cutters)))
        return cut

    monkeypatch.setattr(watertight, "with_own_sides_visible", whole_outline)
    after, report = _repaired(bath_in_living())
    assert {w.item_id for w in report.structure.walls_lost} == {"bath0", "bath3"}
    assert [n.place for n in after.notes if n.kind == "wall-lost"] == ["bath0", "bath3"]
    assert "WALL LOST: of wall bath0 repair kept 0." in summary_of_report(report)


def test_every_structure_item_is_measured_before_and_after() -> None:
    source = bath_in_living()
    _, report = _repaired(source)
    rows = {a.item_id: a for a in report.structure.areas}
    assert rows.keys() == {i.id for i in source.items if i.kind.is_structure}
    assert rows["floor_0_0"].before_m2 == pytest.approx(60.0)
    assert {a.kind for a in rows.values()} == {ItemKind.WALL, ItemKind.FLOOR, ItemKind.CEILING}
