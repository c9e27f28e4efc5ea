"""Rooms and walls that break geometry: odd fans, overlaps, shells, dark rooms. No effects until written."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from tests.hostile.case import Case, Place, Words, by_verb, home, run
from tests.hostile.sound_inputs import CHAIRS, archive, glb, scene, suncg
from tests.read.gltf.gltf_scenes import CUBE, Scene
from tests.read.suncg.suncg_meshes import Obj
from tests.read.suncg.suncg_root import HOUSE, object_node, placement, room, write, write_room

Point = tuple[float, float]


def cases() -> Iterator[Case]:
    """Fans and seven corners, overlapping rooms, shells, black rooms."""
    for seed in range(10):
        corners = star(seed, 7)
        yield home(f"shape/seven_corners_{seed}", "crash", "seven.sh3d", seven_cornered(corners))
        yield home(f"shape/fan_{seed}", "crash", "fan.glb", partial(fan_scene, star(seed, 7)))
    for n in (5, 9):
        yield home(f"shape/fan_of_{n}", "crash", "fan.glb", partial(fan_scene, star(n, n)))
    for seed in range(3):
        yield by_verb(
            f"shape/repair_fan_{seed}", "crash", "repair", "fan.glb", fan_scene(star(seed, 7))
        )
        yield by_verb(
            f"shape/cameras_fan_{seed}", "crash", "cameras", "fan.glb", fan_scene(star(seed, 7))
        )
        yield Case(f"shape/suncg_seven_{seed}", "crash", partial(_suncg_fan, seed))
    yield Case("shape/suncg_bathroom_inside", "walls", _bathroom_inside)
    yield home("shape/rooms_overlap", "walls", "overlap.sh3d", overlapping_rooms())
    yield home("shape/same_room_twice", "walls", "twice.sh3d", same_room_twice())
    yield home("shape/glb_rooms_overlap", "walls", "overlap.glb", partial(shell, overlap=True))
    yield home("shape/one_mesh_inward", "shell", "shell.glb", partial(shell, inward=True))
    yield home("shape/one_mesh_outward", "shell", "shell.glb", partial(shell, inward=False))
    yield home("shape/one_mesh_by_material", "shell", "shell.glb", materials_shell)
    yield home("shape/opaque_glass", "dark", "glass.glb", opaque_glass)
    yield home("shape/no_ceilings", "dark", "open.sh3d", no_ceilings())
    yield home("shape/no_ceilings_glb", "dark", "open.glb", partial(without, "Ceiling"))
    yield home("shape/no_walls_glb", "dark", "open.glb", partial(without, "Wall"))
    yield home("shape/no_floor_glb", "dark", "open.glb", partial(without, "Floor"))
    yield home("shape/lamp_in_ceiling", "dark", "lamp.sh3d", archive(walls(BOX) + _lamp() + CHAIRS))


BOX: list[Point] = [(0, 0), (400, 0), (400, 300), (0, 300)]


def star(seed: int, n: int) -> list[Point]:
    """A star-shaped polygon of n corners about the origin, radius 1.5 to 3.5 m."""
    rng = np.random.default_rng(seed)
    angles = 2 * math.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    return [
        (float(r * math.cos(a)), float(r * math.sin(a)))
        for r, a in zip(rng.uniform(1.5, 3.5, n), angles)
    ]


def walls(corners: Sequence[Point], thickness: float = 10.0, first: int = 0) -> str:
    """Joined walls around a polygon, cm."""
    n = len(corners)
    text = ""
    for k, ((x0, y0), (x1, y1)) in enumerate(zip(corners, [*corners[1:], corners[0]])):
        before, after = first + (k - 1) % n, first + (k + 1) % n
        text += (
            f"<wall id='w{first + k}' wallAtStart='w{before}' wallAtEnd='w{after}' xStart='{x0}'"
            f" yStart='{y0}' xEnd='{x1}' yEnd='{y1}' thickness='{thickness}'/>"
        )
    return text


def room_xml(corners: Sequence[Point], name: str = "Room", more: str = "") -> str:
    """A <room> element with corners in cm."""
    points = "".join(f"<point x='{x}' y='{y}'/>" for x, y in corners)
    return f"<room name='{name}' {more}>{points}</room>"


def seven_cornered(corners: list[Point]) -> bytes:
    """A home with one room of odd corners and walls along its edges."""
    cm = [(100 * x + 400, 100 * y + 400) for x, y in corners]
    return archive(walls(cm), room=room_xml(cm))


def fan_scene(corners: list[Point]) -> bytes:
    """A room whose floor, ceiling and walls are open sheets; floor and ceiling are fans of faces."""
    s = Scene()
    for name, y in (("Floor", 0.0), ("Ceiling", 2.6)):
        ring = [[x, y, z] for x, z in corners]
        ring = ring if name == "Ceiling" else ring[::-1]
        s.node(name, mesh=_fan(s, ring))
    sides = [
        [[a[0], 0, a[1]], [b[0], 0, b[1]], [b[0], 2.6, b[1]], [a[0], 2.6, a[1]]]
        for a, b in zip(corners, [*corners[1:], corners[0]])
    ]
    s.node("Walls", mesh=s.mesh(sides))
    s.node("chair", mesh=s.box([-0.3, 0, -0.3], [0.3, 0.8, 0.3]))
    return s.glb()


def _fan(s: Scene, ring: list[list[float]]) -> int:
    """A mesh of one polygon, a fan of triangles about its first corner: two fewer than corners."""
    n = len(ring)
    positions = s.writer.add_vertices(np.array(ring, np.float32), with_bounds=True)
    faces = np.array([[0, k, k + 1] for k in range(1, n - 1)], np.int32)
    attributes = {"POSITION": positions}
    s.meshes.append(
        {"primitives": [{"attributes": attributes, "indices": s.writer.add_faces(faces)}]}
    )
    return len(s.meshes) - 1


def _suncg_fan(seed: int, place: Place) -> list[Words]:
    """A SUNCG room whose floor and ceiling are fans of an odd number of faces, open sheets."""
    house = suncg(place.folder)
    corners = [(x + 2, z + 1.5) for x, z in star(seed, 7)]
    folder = house.parent.parent / "room" / HOUSE
    for part, group, y in (("f", "Floor", 0.05), ("c", "Ceiling", 2.7)):
        obj = Obj(f"fr_0rm_0{part}.mtl")
        obj.begin(group=f"{group}#0_0", material="surface")
        obj.lines += [f"v {x} {y} {z}\nvt 0 0\nvn 0 1 0" for x, z in [(2.0, 1.5), *corners]]
        for k in range(7):
            a, b = k + 2, (k + 1) % 7 + 2
            first, second = (b, a) if part == "f" else (a, b)
            obj.lines.append(f"f 1/1/1 {first}/{first}/{first} {second}/{second}/{second}")
        write(folder / f"fr_0rm_0{part}.obj", obj.text())
    return [run(place, house)]


def _bathroom_inside(place: Place) -> list[Words]:
    """A second room whose outline is inside the first one's."""

    def edit(plain: dict[str, Any]) -> None:
        nodes = plain["levels"][0]["nodes"]
        nodes.append(room("0_17", "fr_0rm_17", [], ["Bathroom"]))
        nodes.append(object_node("0_18", "chair", placement(2, 0.05, 2)))

    house = suncg(place.folder, edit)
    write_room(house.parent.parent, "fr_0rm_17", "0_17", 1.5, 2.7, {})
    return [run(place, house)]


def overlapping_rooms() -> bytes:
    """A bathroom with its four walls inside the living room's outline."""
    inner: list[Point] = [(200, 100), (395, 100), (395, 295), (200, 295)]
    rooms = room_xml(BOX, "Living") + room_xml(inner, "Bath")
    return archive(walls(BOX) + walls(inner, first=10) + CHAIRS, room=rooms)


def same_room_twice() -> bytes:
    """One outline drawn twice, and once more in reverse."""
    rooms = room_xml(BOX, "A") + room_xml(BOX, "B") + room_xml(BOX[::-1], "C")
    return archive(walls(BOX) + CHAIRS, room=rooms)


def shell(*, inward: bool = True, overlap: bool = False) -> bytes:
    """A room of one box, seen from inside; overlap: a second one that shares half of it."""
    s = Scene()
    box = np.array(CUBE, np.float64) * [4.0, 2.6, 3.0]
    quads = box[:, ::-1] if inward else box
    s.node("Room floor walls ceiling", mesh=s.mesh(quads.tolist()))
    if overlap:
        s.node("Room2 floor walls ceiling", mesh=s.mesh((quads + np.array([2.0, 0, 1.0])).tolist()))
    for k in range(3):
        s.node(f"chair_{k}", mesh=s.box([0.5 + k, 0, 1], [0.9 + k, 0.8, 1.4]))
    return s.glb()


def materials_shell() -> bytes:
    """A room of one mesh; only its materials identify floor, wall and ceiling."""
    s = Scene()
    box = (np.array(CUBE, np.float64) * [4.0, 2.6, 3.0])[:, ::-1]
    names = ("Wall", "Wall", "Ceiling", "Floor", "Wall", "Wall")
    s.materials = [{"name": name} for name in names]
    primitives = []
    for k, quad in enumerate(box):
        primitives += s.meshes[s.mesh([quad.tolist()], k)]["primitives"]
    s.meshes = [{"primitives": primitives}]
    s.node("Plane.001", mesh=0)
    s.node("chair", mesh=s.box([1, 0, 1], [1.5, 0.8, 1.5]))
    return s.glb()


def opaque_glass() -> bytes:
    """A window whose pane is named glass but opaque."""
    s = scene()
    s.materials.append({"name": "window glass", "alphaMode": "OPAQUE"})
    s.node("Window", mesh=s.box([1, 0.9, -0.05], [2.5, 2.1, 0.05], 0))
    return s.glb()


def no_ceilings() -> bytes:
    """Rooms with hidden ceilings and walls without a lamp."""
    return archive(walls(BOX) + CHAIRS, room=room_xml(BOX, "Hall", "ceilingVisible='false'"))


def without(part: str) -> bytes:
    """The sound scene without nodes whose name starts with a word."""

    def edit(document: dict[str, Any]) -> None:
        keep = [k for k, n in enumerate(document["nodes"]) if not n["name"].startswith(part)]
        document["scenes"][0]["nodes"] = keep

    return glb(edit)


def _lamp() -> str:
    return (
        "<light id='l' name='Lamp' model='1' x='150' y='100' width='30' depth='30' height='10'"
        " elevation='245' power='0.5'><lightSource x='.5' y='.5' z='.5' color='FFFFFF'/></light>"
    )
