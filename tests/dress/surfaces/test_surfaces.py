"""Rooms get floors, walls, ceilings and skirting boards; walls stay closed."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.house import House, Item, ItemKind, Material, MaterialKind
from pbrs_farm.core.mesh import edges_are_paired, face_areas, triangle_corners
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.surfaces import dress_surfaces
from pbrs_farm.dress.surfaces.cut_triangles import cut_triangles
from pbrs_farm.dress.surfaces.dress_surfaces import room_frame
from pbrs_farm.dress.surfaces.sided_walls import RoomFinder, sided_wall
from pbrs_farm.geometry.solids import wall_prism
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.repair import repair


def dressed(seed: int, house: House | None = None, share: float = 1.0) -> House:
    mutable = MutableHouse(builtin_home() if house is None else house, seed)
    dress_surfaces(mutable, EMPTY, style_for(mutable.rng("style")), share)
    return mutable.frozen()


def long_wall() -> Item:
    """A wall of 8 m along x, 20 cm thick, with two rooms on its +z side."""
    left, right = np.array([[0, 0.1], [8, 0.1]]), np.array([[0, -0.1], [8, -0.1]])
    tops = np.full(2, 2.5)
    sides = wall_prism(left[::-1], right[::-1], -0.1, tops, tops, (0, 0, 0))
    return Item("w", "wall", ItemKind.WALL, "0", sides, nyu40=1)


def is_closed(item: Item) -> bool:
    corners = np.concatenate([triangle_corners(s.positions, s.faces) for s in item.surfaces])
    _, places = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return edges_are_paired(np.ravel(places).reshape(-1, 3))


def area_of(item: Item) -> float:
    return sum(float(face_areas(triangle_corners(s.positions, s.faces)).sum()) for s in item.surfaces)  # fmt: skip


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", range(1, 6))
def test_every_wall_stays_a_closed_solid_of_its_area(seed: int) -> None:
    source, house = builtin_home(), dressed(seed)
    for was, now in zip(source.items, house.items, strict=False):
        if was.kind is ItemKind.WALL and is_closed(was):
            assert is_closed(now)
            assert abs(area_of(was) - area_of(now)) < 1e-3


def test_repair_loses_no_wall_and_keeps_the_materials_of_the_rooms() -> None:
    house = dressed(2)
    repaired, report = repair(house, RepairFields())
    assert report.structure.walls_lost == ()
    assert report.structure.left_as_is == ()
    # The faces visible from the rooms are the same before and after repair.
    for kind in (ItemKind.WALL, ItemKind.FLOOR):
        before, after = (
            {h.materials[s.material].name for i in h.items if i.kind is kind for s in i.surfaces}
            for h in (house, repaired)
        )
        assert before - after <= {"concrete"}


def test_a_long_wall_is_cut_between_two_rooms_and_its_other_side_is_outdoors() -> None:
    room = builtin_home().rooms[0]
    boxes = [shapely.box(0, 0.1, 3, 4), shapely.box(3.1, 0.1, 8, 4)]
    rooms = [
        replace(room, id=f"0_{k}", polygon=shapely.get_coordinates(b.exterior)[:-1], floor_y=0.0)
        for k, b in enumerate(boxes)
    ]
    wall = sided_wall(long_wall(), RoomFinder(rooms, boxes))
    faces = {(round(s.normal[0]), round(s.normal[2])): s for s in wall.sides}
    inner, outer = faces[0, 1], faces[0, -1]
    assert [r.room for r in inner.runs] == [0, 1]
    # u runs to the right when facing the wall from the rooms: along +x.
    assert abs(inner.runs[0].end - inner.runs[0].start - 3.05) < 0.05
    assert [r.room for r in outer.runs] == [None]


def test_a_cut_mesh_stays_closed_and_no_triangle_crosses_the_plane() -> None:
    wall = long_wall()
    rows = np.concatenate([triangle_corners(s.positions, s.faces) for s in wall.surfaces])
    normal = np.array([1.0, 0.0, 0.0])
    cut, parents = cut_triangles(rows, normal, 2.345)
    assert len(parents) == len(cut) > len(rows)
    side = np.sign(np.where(np.abs(cut @ normal - 2.345) < 2e-4, 0, cut @ normal - 2.345))
    assert not ((side.min(1) < 0) & (side.max(1) > 0)).any()
    _, places = np.unique(cut.reshape(-1, 3), axis=0, return_inverse=True)
    assert edges_are_paired(np.ravel(places).reshape(-1, 3))


def test_planks_run_along_the_longer_side_of_the_room() -> None:
    corner, axes = room_frame(shapely.box(1, 2, 4, 9))
    assert np.allclose(np.abs(axes[0]), [0, 1])
    assert tuple(np.round(corner, 6)) in {(1, 2), (4, 2), (1, 9), (4, 9)}


def test_texture_coordinates_of_floors_and_walls_are_in_metres() -> None:
    house = dressed(3)
    sizes = (0.5, 0.53, 0.64, 1.0, 1.2, 1.6, 1.8, 1.92, 2.0, 2.4, 2.6)
    for item in house.items:
        if item.kind is not ItemKind.FLOOR or "changed:surfaces" not in item.tags:
            continue
        for s in item.surfaces:
            assert s.uvs is not None
            metres = face_areas(triangle_corners(s.positions, s.faces)).sum()
            flat = np.pad(s.uvs.astype(float), ((0, 0), (0, 1)))
            repeats = face_areas(flat[s.faces]).sum()
            ratio = metres / repeats
            assert min(abs(ratio - a * b) for a in sizes for b in sizes) < 1e-3 * ratio


def test_equal_seeds_give_equal_houses_and_other_seeds_other_surfaces() -> None:
    a, b, c = dressed(4), dressed(4), dressed(5)
    assert sorted(a.textures) == sorted(b.textures)
    assert [m.name for m in a.materials] == [m.name for m in b.materials]
    assert set(a.textures) != set(c.textures)


def test_a_share_of_nothing_changes_nothing() -> None:
    house = dressed(1, share=0.0)
    assert not any("changed:surfaces" in i.tags for i in house.items)
    assert len(house.items) == len(builtin_home().items)


def test_boards_are_closed_lie_before_walls_and_leave_doors_free() -> None:
    source = builtin_home()
    bare = source.with_items(i for i in source.items if "baseboard" not in i.tags)
    house = dressed(2, bare)
    boards = [i for i in house.items if i.id.startswith("dress-skirting-")]
    assert boards
    assert all(is_closed(b) for b in boards)
    doors = [o for o in bare.openings if float(o.cutter.positions[:, 1].min()) < 0.05]
    assert doors
    for door in doors:
        low, high = door.cutter.positions.min(0)[[0, 2]], door.cutter.positions.max(0)[[0, 2]]
        for board in boards:
            points = np.concatenate([s.positions[:, [0, 2]] for s in board.surfaces])
            assert not ((points > low + 1e-3) & (points < high - 1e-3)).all(1).any()


def test_repair_takes_added_boards_as_boards() -> None:
    source = builtin_home()
    bare = source.with_items(i for i in source.items if "baseboard" not in i.tags)
    _, report = repair(dressed(2, bare), RepairFields())
    assert report.structure.walls_lost == ()
    assert report.structure.left_as_is == ()


def test_added_boards_have_their_coat_if_the_first_material_is_glass() -> None:
    source = builtin_home()
    bare = source.with_items(i for i in source.items if "baseboard" not in i.tags)
    # Insert glass first; every surface keeps its material, whose number is one higher.
    items = [
        replace(i, surfaces=tuple(replace(s, material=s.material + 1) for s in i.surfaces))
        for i in bare.items
    ]
    glass = Material("glass", kind=MaterialKind.GLASS)
    house = dressed(2, replace(bare, materials=(glass, *bare.materials), items=tuple(items)))
    boards = [i for i in house.items if i.id.startswith("dress-skirting-")]
    assert boards
    assert all(house.materials[s.material].name != "glass" for b in boards for s in b.surfaces)
