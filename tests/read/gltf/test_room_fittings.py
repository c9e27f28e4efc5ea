"""Fittings of a one-mesh room (windows, slats, skirting) are not walls, floor or ceiling."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.classes import NYU40_NAMES, WALL, WINDOW
from pbrs_farm.core.house import House, Item, ItemKind, MaterialKind
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.read.gltf.scene import read_gltf
from pbrs_farm.repair import repair
from tests.read.gltf.gltf_scenes import CUBE, Quad, Scene

MATERIALS = ("Wall_paint", "Parquet", "White", "Window frame", "Glass", "Skirting", "Steel")
WALL_PAINT, PARQUET, WHITE, FRAME, GLASS, SKIRTING, STEEL = range(len(MATERIALS))


def _box(low: tuple[float, ...], high: tuple[float, ...]) -> list[Quad]:
    a, b = np.array(low), np.array(high)
    return (np.array(CUBE) * (b - a) + a).tolist()


def _room() -> Scene:
    """A room of 4 x 2.6 x 3 m of separate sheets, with a window and slats, all in one mesh."""
    scene = Scene()
    scene.materials = [{"name": name} for name in MATERIALS]
    e = 0.01
    sides = [
        [[e, e, 0], [4 - e, e, 0], [4 - e, 2.6 - e, 0], [e, 2.6 - e, 0]],
        [[4 - e, e, 3], [e, e, 3], [e, 2.6 - e, 3], [4 - e, 2.6 - e, 3]],
        [[0, e, 3 - e], [0, e, e], [0, 2.6 - e, e], [0, 2.6 - e, 3 - e]],
        [[4, e, e], [4, e, 3 - e], [4, 2.6 - e, 3 - e], [4, 2.6 - e, e]],
    ]
    floor = [[[e, 0, 3 - e], [4 - e, 0, 3 - e], [4 - e, 0, e], [e, 0, e]]]
    ceiling = [[[e, 2.6, e], [4 - e, 2.6, e], [4 - e, 2.6, 3 - e], [e, 2.6, 3 - e]]]
    frame = _box((1.0, 0.9, 0.0), (1.05, 2.1, 0.05)) + _box((1.95, 0.9, 0.0), (2.0, 2.1, 0.05))
    slats = [q for k in range(8) for q in _box((1.05, 1 + 0.12 * k, 0.06), (1.95, 1.03 + 0.12 * k, 0.1))]  # fmt: skip
    glass = [[[1.05, 0.9, 0.02], [1.95, 0.9, 0.02], [1.95, 2.1, 0.02], [1.05, 2.1, 0.02]]]
    skirting = _box((2.2, 0.0, 0.0), (3.9, 0.08, 0.02))
    rows = [(sides, WALL_PAINT), (floor, PARQUET), (ceiling, WHITE), (frame, FRAME), (glass, GLASS), (skirting, SKIRTING), (slats, STEEL)]  # fmt: skip
    meshes = [scene.mesh(quads, material) for quads, material in rows]
    scene.meshes.append({"primitives": [scene.meshes[m]["primitives"][0] for m in meshes]})
    scene.node("Mesh_0", mesh=len(scene.meshes) - 1)
    scene.node("Table", mesh=scene.box([1.5, 0.0, 1.0], [2.5, 0.7, 2.0]))
    return scene


def _read() -> House:
    return read_gltf(_room().glb(), "room.glb", fields=ReadFields())


def _of(house: House, *names: str) -> list[Item]:
    return [i for i in house.items if {s.name for s in i.surfaces} & set(names)]


def test_slats_frame_glass_and_skirting_are_no_striped_walls_floors_and_ceilings() -> None:
    house = _read()
    kinds = sorted(str(i.kind) for i in house.items if i.kind.is_structure)
    assert kinds == ["ceiling", "floor", "wall", "wall", "wall", "wall"]
    (window,) = _of(house, "Window frame", "Glass", "Steel")
    assert (window.kind, window.nyu40) == (ItemKind.WINDOW, WINDOW)
    assert window.n_faces == 12 * 10 + 2
    panes = [house.materials[s.material].kind for s in window.surfaces if s.name == "Glass"]
    assert panes == [MaterialKind.PANE]
    (skirting,) = _of(house, "Skirting")
    assert skirting.nyu40 == WALL
    assert not skirting.kind.is_structure
    assert [o.item_id for o in house.openings] == [window.id]


def test_the_parted_room_is_closed_and_its_window_cut() -> None:
    after, report = repair(_read(), RepairFields())
    assert after.rooms[0].enclosure == "closed"
    assert report.structure.n_openings_cut == 1
    assert {NYU40_NAMES[i.nyu40] for i in after.items} == {"wall", "floor", "ceiling", "window", "table"}  # fmt: skip
