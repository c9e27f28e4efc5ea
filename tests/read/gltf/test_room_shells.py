"""Rooms drawn as one mesh: floor, walls and ceiling that face inwards are no solid block."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from pbrs_farm.core.house import Enclosure, House, Item, ItemKind
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.geometry.solids import quads_surface
from pbrs_farm.read.gltf.scene import read_gltf
from pbrs_farm.repair import RepairReport, repair
from pbrs_farm.repair.structure.booleans import TagTable
from pbrs_farm.repair.structure.closed_shells import shells_from_item
from tests.read.gltf.gltf_scenes import CUBE, Quad, Scene
from tests.repair.embree import EmbreeOccluder
from tests.repair.shells import seen_from, unpaired_edges

SIZE = np.array([4.0, 2.6, 3.0])
MIDDLE = (2.0, 1.3, 1.5)


def box_quads(low: tuple[float, ...], high: tuple[float, ...], *, inward: bool) -> list[Quad]:
    a, b = np.array(low), np.array(high)
    quads = (np.array(CUBE) * (b - a) + a).tolist()
    return [q[::-1] for q in quads] if inward else quads


def _with_table(scene: Scene) -> Scene:
    scene.node("Table", mesh=scene.box([1.5, 0.0, 1.0], [2.5, 0.7, 2.0]))
    return scene


def one_mesh(name: str, *, inward: bool = True, leave_out: int | None = None) -> Scene:
    """A room of 4 x 3 x 2.6 m as one mesh; leave_out: index of the missing side."""
    scene = Scene()
    quads = box_quads((0, 0, 0), tuple(SIZE), inward=inward)
    side_quads = [q for k, q in enumerate(quads) if k != leave_out]
    scene.node(name, mesh=scene.mesh(side_quads))
    return _with_table(scene)


def three_materials(name: str) -> Scene:
    """The same room with one material each for floor, walls and ceiling, and no front wall."""
    scene = Scene()
    scene.materials = [{"name": n} for n in ("Wall_paint", "Oak floor", "Ceiling.001")]
    quads = box_quads((0, 0, 0), tuple(SIZE), inward=True)
    rows = [([quads[0], quads[1], quads[5]], 0), ([quads[3]], 1), ([quads[2]], 2)]
    meshes = [scene.mesh(q, m) for q, m in rows]
    primitives = [scene.meshes[m]["primitives"][0] for m in meshes]
    scene.meshes.append({"primitives": primitives})
    scene.node(name, mesh=len(scene.meshes) - 1)
    return _with_table(scene)


def hollow(name: str) -> Scene:
    """A block with a cavity: its outer faces look outwards, its inner ones inwards."""
    scene = Scene()
    quads = box_quads((0, 0, 0), tuple(SIZE), inward=True)
    quads += box_quads((-0.3, -0.3, -0.3), tuple(SIZE + 0.3), inward=False)
    scene.node(name, mesh=scene.mesh(quads))
    return _with_table(scene)


def _read(scene: Scene) -> House:
    return read_gltf(scene.glb(), "room.glb", fields=ReadFields())


def _repaired(house: House) -> tuple[House, RepairReport]:
    return repair(house, RepairFields(), occluder_from=EmbreeOccluder)


def _kinds(house: House) -> list[str]:
    return sorted(str(i.kind) for i in house.items if i.name != "Table")


@pytest.mark.parametrize(
    "scene",
    [
        one_mesh("Walls"), one_mesh("Room"), one_mesh("Cube.003"), one_mesh("Floor"),
        one_mesh("Walls", inward=False), one_mesh("Room", inward=False), hollow("Walls"),
        hollow("House"),
    ],
)  # fmt: skip
def test_a_shell_that_shows_a_room_is_walls_a_floor_and_a_ceiling(scene: Scene) -> None:
    house = _read(scene)
    assert _kinds(house) == ["ceiling", "floor", "wall", "wall", "wall", "wall"]
    assert {i.nyu40 for i in house.items if i.kind is ItemKind.CEILING} == {22}
    (room,) = house.rooms
    assert (room.floor_y, room.ceiling_y) == pytest.approx((0.0, 2.6))
    after, report = _repaired(house)
    assert report.structure.left_as_is == ()
    assert after.rooms[0].enclosure is Enclosure.CLOSED
    assert report.leaks is not None
    assert report.leaks.n_rays > 1000
    assert report.leaks.n_sky == 0
    assert len(unpaired_edges(after)) == 0
    # From the middle of the room all six sides are visible, at the room's dimensions.
    boxes = seen_from(after, MIDDLE)
    assert len(boxes) == 6
    down = EmbreeOccluder(after).first_hit(
        np.array([[0.5, 1.3, 0.5]], np.float32), np.array([[0, -1, 0]], np.float32)
    )
    assert down[0] == pytest.approx(1.3, abs=1e-4)


def test_a_room_without_its_front_wall_is_parted_too() -> None:
    house = _read(one_mesh("Room", leave_out=4))
    assert _kinds(house) == ["ceiling", "floor", "wall", "wall", "wall"]
    after, report = _repaired(house)
    assert after.rooms[0].enclosure is Enclosure.OPEN
    assert report.structure.n_walls_thickened == 3


@pytest.mark.parametrize("name", ["Room", "Mesh_1", "Walls"])
def test_material_names_give_the_kinds(name: str) -> None:
    house = _read(three_materials(name))
    assert _kinds(house) == ["ceiling", "floor", "wall", "wall", "wall"]
    assert len(house.rooms) == 1


def test_sheets_of_one_node_without_a_room_are_classified_by_material() -> None:
    scene = Scene()
    scene.materials = [{"name": "Parkett"}, {"name": "Wand weiss"}, {"name": "Sofa leather"}]
    floor = scene.mesh([[[0, 0, 3], [4, 0, 3], [4, 0, 0], [0, 0, 0]]], 0)
    wall = scene.mesh([[[0, 0, 0], [4, 0, 0], [4, 2.5, 0], [0, 2.5, 0]]], 1)
    primitives = scene.meshes[floor]["primitives"] + scene.meshes[wall]["primitives"]
    scene.meshes.append({"primitives": primitives})
    scene.node("Object_7", mesh=len(scene.meshes) - 1)
    scene.node("Object_8", mesh=scene.box([1, 0, 1], [3, 0.8, 2], 2))
    house = _read(scene)
    assert sorted((str(i.kind), i.nyu40) for i in house.items) == [("floor", 2), ("object", 6), ("wall", 1)]  # fmt: skip
    assert not [n for n in house.notes if n.kind == "unmapped-class"]


def test_solid_walls_furniture_and_skies_are_no_rooms() -> None:
    scene = Scene()
    scene.node("Floor", mesh=scene.mesh([[[0, 0, 3], [4, 0, 3], [4, 0, 0], [0, 0, 0]]]))
    scene.node("Wall solid", mesh=scene.box([0, 0, -0.2], [4, 2.5, 0]))
    scene.node("Wall inward", mesh=scene.mesh(box_quads((0, 0, 3), (4, 2.5, 3.2), inward=True)))
    scene.node("Thing", mesh=scene.box([1, 0, 1], [3, 2, 2]))
    scene.node("Backdrop", mesh=scene.mesh(box_quads((-900, -9, -900), (900, 900, 900), inward=True)))  # fmt: skip
    house = _read(scene)
    assert {i.name: (str(i.kind), len(i.surfaces)) for i in house.items} == {
        "Floor": ("floor", 1), "Wall solid": ("wall", 1), "Wall inward": ("wall", 1),
        "Thing": ("object", 1), "Backdrop": ("object", 1),
    }  # fmt: skip


def test_repair_makes_no_block_of_a_shell_that_looks_inward() -> None:
    # For any reader: a wall item whose faces look into a room is no solid.
    quads = np.array(box_quads((0, 0, 0), tuple(SIZE), inward=True))
    inward, outward = (
        Item("w", "w", ItemKind.WALL, "0", (quads_surface("w", q, 0),))
        for q in (quads, quads[:, ::-1])
    )
    assert shells_from_item(inward, 0, TagTable()) is None
    assert shells_from_item(outward, 0, TagTable()) is not None


def test_a_plant_of_many_loose_leaves_takes_little_memory() -> None:
    scene = one_mesh("Room")
    rng = np.random.default_rng(0)
    leaves = rng.uniform((1, 0, 1), (2, 2, 2), (10_000, 1, 3)) + rng.uniform(
        0, 0.02, (10_000, 4, 3)
    )
    scene.node("Object_7", mesh=scene.mesh(leaves.tolist()))
    data = scene.glb()
    tracemalloc.start()
    house = read_gltf(data, "plant.glb", fields=ReadFields())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100e6
    assert len(house.rooms) == 1


@pytest.mark.parametrize("name", ["Ground", "Ground floor", "Erdgeschoss"])
def test_a_room_called_ground_is_no_ground(name: str) -> None:
    house = read_gltf(one_mesh(name).glb(), "ground.glb", fields=ReadFields())
    assert len(house.rooms) == 1
    kinds = {i.kind for i in house.items}
    assert {ItemKind.WALL, ItemKind.FLOOR, ItemKind.CEILING} <= kinds
    assert ItemKind.GROUND not in kinds
