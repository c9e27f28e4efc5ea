"""Scans of RoomPlan in USD are read as those in its JSON."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Kind, Tf, Usd, UsdGeom

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import BOX_ONLY, House, ItemKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.generate.floor_plan import OpeningKind
from pbrs_farm.generate.plans.plan_format import Part
from pbrs_farm.prepare.plan_house import plan_of_file
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.common.format import PLAN, GivenFile
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.usd.stage_files import StageFolder, diagnostics_in
from tests.inputs.scanned_stages import dining_group, thing, write_scanned_stage
from tests.inputs.usd_files import UsdHome, walls_of


def read(path: Path) -> House:
    return read_house(resolve(str(path)), ReadFields())


def test_each_object_of_a_group_is_an_item_that_gets_a_stand_in(tmp_path: Path) -> None:
    source = resolve(str(write_scanned_stage(tmp_path, objects=dining_group())))
    house = read_house(source, ReadFields())
    boxes = [i for i in house.items if BOX_ONLY in i.tags]
    assert sorted(i.name for i in boxes) == ["chair", "chair", "chair", "storage", "table"]
    (table,) = (i for i in boxes if i.name == "table")
    assert table.box is not None
    assert np.allclose(2 * table.box.half, [1.2, 0.74, 0.8], atol=1e-5)
    assert source.kind == PLAN


def test_the_room_is_as_large_as_scanned_and_named_by_its_section(tmp_path: Path) -> None:
    path = write_scanned_stage(tmp_path, objects=dining_group(), label="diningRoom")
    (room,) = read(path).rooms
    assert np.allclose(np.ptp(room.polygon, axis=0), [4, 3], atol=1e-3)
    assert (room.name, room.ceiling_y - room.floor_y) == ("Dining room", pytest.approx(2.4))


@pytest.mark.parametrize("opening", ["hole", "Opening0"])
def test_an_opening_is_a_passage(tmp_path: Path, opening: str) -> None:
    plan = plan_of_file(GivenFile(write_scanned_stage(tmp_path, opening=opening)), Part()).plan
    kinds = sorted(o.kind.value for o in plan.openings)
    assert kinds == ["entrance", "passage", "window"]
    (passage,) = (o for o in plan.openings if o.kind is OpeningKind.PASSAGE)
    assert passage.width == pytest.approx(0.9, abs=1e-3)
    assert passage.height == pytest.approx(2.0, abs=1e-3)


def test_a_wall_without_a_hole_has_no_passage(tmp_path: Path) -> None:
    house = read(write_scanned_stage(tmp_path, opening="none"))
    assert len(house.openings) == 2


def test_a_scan_without_walls_is_refused_in_one_line(tmp_path: Path) -> None:
    path = write_scanned_stage(tmp_path)
    path.write_text(path.read_text().replace('Mesh "Wall', 'Mesh "Shelf'))
    with pytest.raises(BadHouse, match="without a wall"):
        read(path)


def test_warnings_of_the_library_are_one_note_and_do_not_reach_the_terminal(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_scanned_stage(tmp_path, objects=(thing("Sofa0", (2, 0.8, 0.9), 0, 0.5),))
    scene = tmp_path / "scene.usda"
    # Without the group of its walls it is a scene like any other.
    scene.write_text(path.read_text().replace("Arch_grp", "Building"))
    house = read(scene)
    (note,) = (n for n in house.notes if n.kind == "library-warning")
    assert "8 times" in note.text
    assert "MaterialBindingAPI" in note.text
    assert "Warning" not in capfd.readouterr().err


def test_warnings_do_not_tell_where_the_file_is(tmp_path: Path) -> None:
    folder = StageFolder.of(write_scanned_stage(tmp_path), "")
    notes = Notes("room.usda", strict=True)
    with diagnostics_in(folder, notes):
        Tf.Warn(f"Asset @{folder.path}@ has a deprecated version")
    assert [n.text for n in notes.all()] == ["USD warns Asset @room.usda@ has a deprecated version"]


def test_items_of_a_group_with_their_name_are_apart(tmp_path: Path) -> None:
    home = UsdHome(tmp_path / "a.usda", 1.0, "Y")
    walls_of(home, "/World/Room", 0, 4, 0, 3)
    group = UsdGeom.Xform.Define(home.stage, "/World/Chair_grp")
    Usd.ModelAPI(group).SetKind(Kind.Tokens.group)
    for k in range(3):
        home.box(f"/World/Chair_grp/Chair{k}", [k + 0.2, 0, 1], [k + 0.6, 0.9, 1.4])
    chairs = [i for i in read(home.save()).items if i.kind is ItemKind.OBJECT]
    assert [i.name for i in chairs] == ["Chair0", "Chair1", "Chair2"]
