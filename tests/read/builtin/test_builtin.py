"""The built-in home is complete and labelled, and repair has work to do in it."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh

from pbrs_farm.core.house import Item, ItemKind, MaterialKind, Surface, geometry_from_house
from pbrs_farm.read.builtin.builtin_home import builtin_home

HOME = builtin_home()


def mesh_of(surfaces: tuple[Surface, ...]) -> trimesh.Trimesh:
    mesh = trimesh.util.concatenate(
        [trimesh.Trimesh(s.positions, s.faces, process=False) for s in surfaces]
    )
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh


def of(*kinds: ItemKind) -> list[Item]:
    return [i for i in HOME.items if i.kind in kinds]


def test_it_is_the_same_on_every_call() -> None:
    again = builtin_home()
    assert again.id == HOME.id
    a, b = geometry_from_house(HOME), geometry_from_house(again)
    assert a.positions.tobytes() == b.positions.tobytes()
    assert a.face_material.tobytes() == b.face_material.tobytes()


def test_walls_and_cutters_are_closed_solids_with_outward_faces() -> None:
    solids = [i.surfaces for i in of(ItemKind.WALL)] + [(o.cutter,) for o in HOME.openings]
    assert len(solids) == 9
    for surfaces in solids:
        mesh = mesh_of(surfaces)
        assert mesh.is_watertight
        assert mesh.volume > 0


def test_wall_texture_coordinates_are_in_metres() -> None:
    for wall in of(ItemKind.WALL):
        for s in wall.surfaces:
            assert s.uvs is not None
            a, b, c = (s.positions[s.faces[:, k]] for k in range(3))
            u, v, w = (s.uvs[s.faces[:, k]] for k in range(3))
            area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
            turn = (v - u)[:, 0] * (w - u)[:, 1] - (v - u)[:, 1] * (w - u)[:, 0]
            assert turn == pytest.approx(area, rel=1e-4)  # metres, and not mirrored


def test_no_part_of_a_solid_piece_faces_inwards() -> None:
    for thing in of(ItemKind.OBJECT, ItemKind.DOOR, ItemKind.WINDOW):
        for s in thing.surfaces:
            for part in trimesh.Trimesh(s.positions, s.faces).split(only_watertight=True):
                assert part.volume > 0


def test_every_room_has_objects_enough_for_cameras_and_light() -> None:
    for room in HOME.rooms:
        inside = [i for i in HOME.items if i.room_id == room.id and not i.kind.is_structure]
        assert len([i for i in inside if i.kind is ItemKind.OBJECT]) >= 4
        assert any(i.kind is ItemKind.LAMP and i.lights for i in inside)
        assert any(i.kind is ItemKind.WINDOW for i in inside)


def test_every_piece_is_in_the_room_it_names_and_above_its_floor() -> None:
    for thing in of(ItemKind.OBJECT, ItemKind.LAMP, ItemKind.PLANT):
        room = HOME.room(thing.room_id or "")
        outline = shapely.Polygon(room.polygon).buffer(1e-6)
        for surface in thing.surfaces:
            assert outline.contains(shapely.MultiPoint(surface.positions[:, [0, 2]]))
        assert thing.bounds[0, 1] >= 0


def test_it_has_a_pane_a_mirror_a_glass_a_plant_and_a_lamp_without_a_bulb() -> None:
    kinds = {HOME.materials[s.material].kind for i in HOME.items for s in i.surfaces}
    assert {MaterialKind.PANE, MaterialKind.MIRROR, MaterialKind.GLASS, MaterialKind.BULB} <= kinds
    assert of(ItemKind.PLANT)
    assert sorted(len(i.lights[0].emitting) for i in of(ItemKind.LAMP)) == [0, 1]


def test_a_bulb_encloses_its_light() -> None:
    (lamp,) = [i for i in of(ItemKind.LAMP) if i.lights[0].emitting]
    light = lamp.lights[0]
    bulb = lamp.surfaces[light.emitting[0]]
    gap = np.linalg.norm(bulb.positions - np.float32(light.position), axis=1)
    assert gap == pytest.approx(light.radius_m, abs=1e-5)
