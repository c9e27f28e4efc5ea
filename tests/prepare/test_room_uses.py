"""Unnamed rooms are typed by their furniture, in every format."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.core.recipe import Recipe
from pbrs_farm.prepare.passes import PASS, FinishedHouse, Preparation
from pbrs_farm.prepare.source import resolve
from tests.read.gltf.gltf_scenes import two_rooms
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, WALLS, home_xml, piece, sh3d


def _finish(*_: object) -> FinishedHouse:
    raise AssertionError("no plugin asks for another house")


def types_as_read(path: Path) -> list[tuple[str, ...]]:
    work = Preparation(resolve(str(path)), Recipe(), lambda _share: None, _finish)
    return [room.types for room in PASS["read"].run(work).house.rooms]


@pytest.mark.parametrize(("name", "types"), [("Bed", ("bedroom",)), ("Vase", ())])
def test_a_room_between_walls_is_typed_by_its_furniture(
    tmp_path: Path, name: str, types: tuple[str, ...]
) -> None:
    path = tmp_path / "home.sh3d"
    thing = piece(f"name='{name}'")
    path.write_bytes(sh3d(home_xml(WALLS + thing, room=""), {"1": BOX_OBJ}))
    assert types_as_read(path) == [types]


def test_a_name_precedes_the_furniture_of_a_room(tmp_path: Path) -> None:
    path = tmp_path / "home.sh3d"
    bed = piece("name='Bed'")
    path.write_bytes(sh3d(home_xml(WALLS + bed), {"1": BOX_OBJ}))
    assert types_as_read(path) == [("Hall",)]


def test_rooms_of_a_scene_are_typed_by_their_furniture(tmp_path: Path) -> None:
    scene = two_rooms()
    scene.node("Bed", mesh=scene.box([0.5, 0.0, 0.5], [2.0, 0.5, 2.5]))
    scene.node("Toilet", mesh=scene.box([5.0, 0.0, 0.2], [5.4, 0.8, 0.9]))
    path = tmp_path / "scene.glb"
    path.write_bytes(scene.glb())
    assert types_as_read(path) == [("bedroom",), ("bathroom",)]
