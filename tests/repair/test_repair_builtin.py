"""Effects of repair on the built-in home, measured on its triangles."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.house import Enclosure, House, ItemKind, MaterialKind, geometry_from_house
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.repair import RepairReport, repair
from tests.repair.shells import leaning_area, unpaired_edges

Repaired = tuple[House, RepairReport]


def _same(a: House, b: House) -> bool:
    x, y = geometry_from_house(a), geometry_from_house(b)
    return all(
        getattr(x, f).tobytes() == getattr(y, f).tobytes()
        for f in ("positions", "normals", "uvs", "faces", "face_item", "face_material")
    )


def test_the_same_house_gives_the_same_bytes(home: House, repaired: Repaired) -> None:
    again, report = repair(home, RepairFields())
    assert _same(again, repaired[0])
    assert report.structure == repaired[1].structure


def test_repairing_twice_is_repairing_once(repaired: Repaired) -> None:
    again, report = repair(repaired[0], RepairFields())
    assert again is repaired[0]
    assert report.was_repaired


def test_the_plant_goes_and_everything_else_stays(home: House, repaired: Repaired) -> None:
    before = [i.id for i in home.items if i.kind is not ItemKind.PLANT]
    assert [i.id for i in repaired[0].items] == before
    assert [r.reason for r in repaired[1].removed] == ["plant"]


def test_default_walls_are_white_and_named_colours_stay(repaired: Repaired) -> None:
    house = repaired[0]
    looks = {
        (m.is_default, m.diffuse)
        for i in house.items
        if i.kind is ItemKind.WALL
        for m in (house.materials[s.material] for s in i.surfaces)
    }
    assert looks == {(True, (1.0, 1.0, 1.0)), (False, (0.93, 0.88, 0.78))}


def test_uv_area_is_surface_area_on_every_wall(repaired: Repaired) -> None:
    for item in repaired[0].items:
        if item.kind is not ItemKind.WALL:
            continue
        for s in item.surfaces:
            assert s.uvs is not None
            flat = np.concatenate([s.uvs, np.zeros((len(s.uvs), 1), np.float32)], 1)
            assert face_areas(flat[s.faces]) == pytest.approx(
                face_areas(triangle_corners(s.positions, s.faces)), abs=1e-5
            )


def test_structure_is_one_closed_surface(repaired: Repaired) -> None:
    assert len(unpaired_edges(repaired[0])) == 0
    assert leaning_area(repaired[0]) == 0.0


def test_openings_go_through_both_faces_and_have_reveals(repaired: Repaired) -> None:
    house, report = repaired
    assert report.structure.n_openings_cut == report.structure.n_openings == 4
    wall = next(i for i in house.items if i.id == "wall_0")
    area = {s.name: face_areas(triangle_corners(s.positions, s.faces)).sum() for s in wall.surfaces}
    # wall_0 is 9.0 x 2.5 m inside and 9.4 x 2.5 m outside; its window 1.8 x 1.2 m, 0.2 m deep.
    assert area["left"] == pytest.approx(9.4 * 2.5 - 1.8 * 1.2, abs=1e-4)
    assert area["reveal"] == pytest.approx(0.2 * 2 * (1.8 + 1.2), abs=1e-4)


def test_each_lamp_has_a_bulb_and_nothing_else_glows(repaired: Repaired) -> None:
    house = repaired[0]
    for item in house.items:
        glowing = {
            k
            for k, s in enumerate(item.surfaces)
            if house.materials[s.material].kind is MaterialKind.BULB
        }
        assert glowing == {k for light in item.lights for k in light.emitting}
        assert bool(glowing) == (item.kind is ItemKind.LAMP)


def test_rooms_are_closed_lit_and_tight(repaired: Repaired) -> None:
    house, report = repaired
    assert [r.enclosure for r in house.rooms] == [Enclosure.CLOSED] * 2
    assert [r.lit_by for r in house.rooms] == [("lamps", "windows")] * 2
    assert report.leaks is not None
    assert report.leaks.n_rays > 100_000
    assert report.leaks.n_sky == 0
    assert report.is_leaking is False
    assert report.leaks.closed_share == 1.0
