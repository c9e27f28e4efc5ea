"""A home as one GLB reads back equal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import OUTSIDE, Box, House, ItemKind
from pbrs_farm.core.recipe import ReadFields, Recipe
from pbrs_farm.export.export_homes import export_homes
from pbrs_farm.export.home_glb import glb_of_pieces
from pbrs_farm.export.home_pieces import exported_home, rooms_json
from pbrs_farm.formats.glb import gltf_from_glb
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.gltf.scene import read_gltf
from tests.export.homes import differences, repaired_home, stored


def written(house: House) -> bytes:
    home = exported_home(house)
    return glb_of_pieces(house, home.pieces, with_lamps=True, rooms=rooms_json(house))


def test_a_home_reads_back_equal_from_the_glb_that_the_verb_writes(tmp_path: Path) -> None:
    house = repaired_home()
    root = stored(tmp_path / "root", house)
    assert main(["export", str(root), "--to", "gltf", "--out", str(tmp_path / "out")]) == 0
    (path,) = (tmp_path / "out").glob("*/*.glb")
    assert path.parent.name == house.id
    assert differences(house, read_house(resolve(str(path)), ReadFields(strict=True))) == []


def test_a_home_read_back_is_repaired_without_a_leak_or_a_lost_wall(tmp_path: Path) -> None:
    house = repaired_home()
    path = tmp_path / "home.glb"
    path.write_bytes(written(house))
    again, report = repaired_house(resolve(str(path)), Recipe())
    assert not report.is_leaking
    assert report.structure.walls_lost == ()
    n = [sum(i.kind is ItemKind.WINDOW for i in h.items) for h in (house, again)]
    assert n[0] == n[1] > 0


@pytest.mark.long
def test_a_turned_piece_has_its_turn_in_its_node_and_its_box_back() -> None:
    house = repaired_home()
    index = next(k for k, i in enumerate(house.items) if i.kind is ItemKind.OBJECT)
    item = house.items[index]
    c, s = np.cos(0.4), np.sin(0.4)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    middle = item.bounds.mean(0)
    surfaces = tuple(
        replace(
            x, positions=((x.positions - middle) @ turn.T + middle).astype(np.float32), normals=None
        )
        for x in item.surfaces
    )
    half = np.diff(item.bounds, axis=0)[0] / 2
    turned = replace(item, surfaces=surfaces, box=Box(middle, half, turn))
    items = [*house.items[:index], turned, *house.items[index + 1 :]]
    house = house.with_items(items)
    gltf = gltf_from_glb(written(house), "home.glb")
    assert gltf.document["nodes"][index]["rotation"][1] == pytest.approx(np.sin(0.2))
    got = read_gltf(written(house), "home.glb", fields=ReadFields())
    assert differences(house, got) == []


def test_names_of_pieces_are_unique_and_fit_every_file_system() -> None:
    house = repaired_home()
    items = [replace(i, name="Sofa / été\n..") for i in house.items]
    names = [p.name for p in exported_home(house.with_items(items)).pieces]
    assert len({n.lower() for n in names}) == len(names)
    assert all(n.isascii() and n.replace("_", "").isalnum() and n[0].isalpha() for n in names)


def test_outdoor_surroundings_are_not_exported() -> None:
    house = repaired_home()
    street = replace(house.items[0], id="outside_street", kind=ItemKind.GROUND, tags=(OUTSIDE,))
    with_street = house.with_items([*house.items, street])
    assert len(exported_home(with_street).pieces) == len(house.items)


@pytest.mark.long
def test_items_have_collision_parts_and_the_floor_between_them_is_walkable() -> None:
    home = exported_home(repaired_home())
    for piece in home.things:
        parts = np.concatenate(piece.colliders)
        low, high = -piece.size / 2, piece.size / 2
        low[1], high[1] = 0, piece.size[1]
        # The parts fill the box and stay inside it.
        assert (parts.min(0) > low - 0.02).all()
        assert (parts.max(0) < high + 0.02).all()
        assert (parts.max(0) - parts.min(0) > 0.9 * piece.size - 0.02).all()
        assert 0.05 <= piece.mass_kg <= 150
    assert all(home.navigable[room.id] for room in home.house.rooms)


def test_a_folder_without_a_home_and_options_of_views_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(BadInput, match=r"has no house.glb"):
        export_homes(tmp_path, tmp_path / "out", "gltf")
    assert main(["export", str(tmp_path), "--to", "gltf", "--split"]) == 1
    assert "--to gltf exports homes" in capsys.readouterr().err
