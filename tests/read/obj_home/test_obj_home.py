"""Homes as OBJ: groups, units, the up axis, and single models, which are not homes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve, words_of_homes
from tests.inputs.obj_files import BOXES, write_obj_home
from tests.inputs.pictures import picture


def house(path: Path) -> House:
    return read_house(resolve(str(path)), ReadFields())


@pytest.mark.parametrize(
    ("per_metre", "is_z_up", "comment"),
    [
        (1, False, ""),
        (100, False, ""),
        (39.37, True, "File units = inches"),
        (1000, True, ""),
        (100, False, "Units: centimetre"),
    ],
)
def test_groups_are_items_in_metres_with_y_up(
    tmp_path: Path, per_metre: float, is_z_up: bool, comment: str
) -> None:
    (tmp_path / "cloth red.png").write_bytes(picture("PNG"))
    path = write_obj_home(tmp_path, per_metre=per_metre, is_z_up=is_z_up, comment=comment)
    home = house(path)
    items = {i.name: i for i in home.items}
    assert NYU40_NAMES[items["sofa"].nyu40] == "sofa"
    assert NYU40_NAMES[items["desk"].nyu40] == "desk"
    np.testing.assert_allclose(
        items["sofa"].bounds, np.array(BOXES["Mesh12 sofa Model"][1:]), atol=0.01
    )
    assert len(home.rooms) == 1
    (cloth,) = [m for m in home.materials if m.name == "linen"]
    assert cloth.texture_id is not None
    assert [n.kind for n in home.notes] == ([] if comment else ["assumed-unit"])


def test_a_home_may_begin_with_a_group(tmp_path: Path) -> None:
    path = tmp_path / "home.obj"
    path.write_text("g floor\nv 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\ng wall\nf 1 2 3\n")
    assert resolve(str(path)).kind == "obj-home"


def test_a_changed_picture_or_library_changes_the_source(tmp_path: Path) -> None:
    path = write_obj_home(tmp_path)
    prints = {resolve(str(path)).fingerprint}
    (tmp_path / "cloth red.png").write_bytes(picture("PNG"))
    prints.add(resolve(str(path)).fingerprint)
    (tmp_path / "home.mtl").write_text("newmtl oak\nKd 0 0 0\n")
    prints.add(resolve(str(path)).fingerprint)
    assert len(prints) == 3


def test_a_single_model_is_no_home_and_named_so(tmp_path: Path) -> None:
    path = tmp_path / "lamp.obj"
    path.write_text("g floor_lamp\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(BadHouse, match="pbrs-farm objects"):
        house(path)


def test_groups_far_into_a_file_and_in_later_libraries_count(tmp_path: Path) -> None:
    path = write_obj_home(tmp_path)
    (tmp_path / "first.mtl").write_text("newmtl other\nKd 0 0 0\n")
    text = path.read_text().replace("mtllib home.mtl", "mtllib first.mtl home.mtl")
    path.write_text("# a long comment\n" * 300_000 + text)
    assert words_of_homes([str(tmp_path)]) == [str(path)]
    home = house(path)
    desk = next(i for i in home.items if i.name == "desk")
    red, green, blue = home.materials[desk.surfaces[0].material].diffuse
    assert red > green > blue
