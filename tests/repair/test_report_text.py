"""The report in words, the picture of the cut, and the audit of the furniture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.geometry.solids import box
from pbrs_farm.repair import RepairReport, repair, section_svg, summary_of_report
from pbrs_farm.repair.measure import furniture_audit as furniture_audit_module
from pbrs_farm.repair.measure.furniture_audit import furniture_audit
from pbrs_farm.repair.repair_report import LeakReport
from pbrs_farm.repair.section_drawing import section_of_items, solid_polygons
from tests.repair.wall_rooms import covers, house, room, walls_around

RECT = (0.0, 0.0, 4.0, 3.0)


def _piece(item_id: str, centre: tuple[float, float, float], half: float = 0.25) -> Item:
    surface = box("box", np.array(centre), np.full(3, half), 0)
    return Item(item_id, item_id, ItemKind.OBJECT, "0", (surface,), source_class="box")


def _furnished(*pieces: Item) -> House:
    r = room("0_0", RECT)
    return house([*walls_around(RECT), *covers(r), *pieces], [r])


def test_overlapping_pieces_are_reported_with_their_volume() -> None:
    audit = furniture_audit(_furnished(_piece("a", (1, 0.25, 1)), _piece("b", (1.4, 0.25, 1))))
    (overlap,) = audit.overlaps
    assert (overlap.a, overlap.b) == ("a", "b")
    assert overlap.volume_m3 == pytest.approx(0.1 * 0.5 * 0.5, rel=1e-3)
    assert overlap.share == pytest.approx(0.2, rel=1e-3)


def test_pieces_that_touch_do_not_overlap() -> None:
    audit = furniture_audit(_furnished(_piece("a", (1, 0.25, 1)), _piece("b", (1.5, 0.25, 1))))
    assert audit.overlaps == ()


def test_a_piece_in_the_air_floats_and_one_on_another_does_not() -> None:
    pieces = (_piece("a", (1, 0.25, 1)), _piece("on_a", (1, 0.75, 1)), _piece("air", (3, 1.25, 1)))
    audit = furniture_audit(_furnished(*pieces))
    assert [(f.item_id, f.gap_m) for f in audit.floating] == [("air", 1.0)]


def test_a_piece_placed_twice_is_a_duplicate() -> None:
    audit = furniture_audit(_furnished(_piece("a", (1, 0.25, 1)), _piece("b", (1, 0.25, 1))))
    assert audit.duplicates == (("a", "b"),)
    assert audit.overlaps[0].share == 1.0


def test_a_crowd_is_audited_in_part_with_a_note_of_the_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(furniture_audit_module, "MAX_PIECES", 4)
    monkeypatch.setattr(furniture_audit_module, "MAX_PAIRS", 2)
    crowd = [_piece(f"p{k}", (1 + 0.01 * k, 0.25, 1)) for k in range(9)]
    audit = furniture_audit(_furnished(*crowd))
    assert len(audit.overlaps) == 2
    assert (audit.n_unaudited, audit.n_unmeasured) == (5, 1)
    text = summary_of_report(RepairReport(house_id="h", furniture=audit))
    assert "only a part of it was checked, 5 pieces not checked." in text


def test_leaks_without_rays_are_unmeasured_rather_than_zero() -> None:
    text = summary_of_report(RepairReport(house_id="h", leaks=LeakReport()))
    assert "Leaks were not measured" in text
    assert "No light leaks" not in text


def test_the_summary_lists_the_faults(repaired: tuple[House, RepairReport]) -> None:
    text = summary_of_report(repaired[1])
    assert "1 person or plant removed." in text
    assert "2 floors and 2 ceilings had no thickness" in text
    assert "1 lamp had no emitter and got a bulb." in text
    assert "none reached the sky; 100 % of the floor area is in closed rooms" in text
    leaks = repaired[1].leaks
    assert leaks is not None
    leaking = repaired[1].model_copy(update={"leaks": leaks.model_copy(update={"n_sky": 7})})
    assert "LIGHT LEAKS IN: 7 of" in summary_of_report(leaking)


def test_the_cut_shows_the_walls_with_their_openings(home: House) -> None:
    after, _ = repair(home, RepairFields())
    segments = section_of_items([i for i in after.items if i.kind.is_structure], 1.2)
    polygons = solid_polygons(segments)
    # Outer walls 9.4 x 4.4 m around 9 x 4 m, one wall of 0.1 m between; holes at 1.2 m height.
    walls = 9.4 * 4.4 - 9.0 * 4.0 + 0.1 * 4.0
    holes = 0.2 * 1.8 + 0.2 * 1.2 + 0.2 * 0.95 + 0.1 * 0.9
    assert shapely.union_all(polygons).area == pytest.approx(walls - holes, abs=2e-3)
    svg = section_svg(home, after, "0")
    assert svg.startswith("<svg")
    assert svg.count("<path") == 5 + 1
    assert svg == section_svg(home, after, "0")


def test_a_planar_wall_is_drawn_as_a_line() -> None:
    source = _furnished()
    flat = replace(source.items[0], surfaces=source.items[0].surfaces[:1])
    svg = section_svg(source.with_items([flat]), source, "0")
    assert 'fill="none" stroke="#c02020"' in svg
