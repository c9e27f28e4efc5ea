"""A room of 4 x 3 m as RoomPlan exports it to USD: meshes one-sided, floor and walls 16 cm larger outside."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

THICK_M: Final = 0.16
HIGH_M: Final = 2.4
_SIDES: Final = ((0.0, -1.5, 0), (2.0, 0.0, 90), (0.0, 1.5, 180), (-2.0, 0.0, 270))
_UNIT: Final = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
_QUADS: Final = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


class Shape(NamedTuple):
    """Boxes (low, high) in a frame at a place, turned about y."""

    name: str
    boxes: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]
    place: tuple[float, float, float]
    turn_deg: float = 0.0


def write_scanned_stage(
    folder: Path, *, opening: str = "hole", objects: tuple[Shape, ...] = (), label: str = "kitchen"
) -> Path:
    """room.usda; opening: of the first wall, a `hole` in its mesh, an `Opening0` before it, or `none`."""
    lines = ['#usda 1.0', '(', '    defaultPrim = "Room"', '    metersPerUnit = 1', '    upAxis = "Y"', ')',
             'def Xform "Room" (kind = "assembly") {', 'def Xform "Section_grp" (kind = "group") {',
             f'def Xform "{label}0" (kind = "assembly") {{', *_placed((0.0, 1.2, 0.0), 0.0), "}", "}",
             'def Xform "Mesh_grp" (kind = "group") {', 'def Xform "Arch_grp" (kind = "group") {']  # fmt: skip
    for k, (x, z, turn) in enumerate(_SIDES):
        half = 2.0 if k % 2 == 0 else 1.5
        low, high = (-half, -HIGH_M / 2, -THICK_M), (half + THICK_M, HIGH_M / 2, 0.0)
        boxes = [(low, high)]
        if k == 0 and opening == "hole":
            # 0.9 m wide, 2 m high, from 0.3 m right of the middle.
            top = -HIGH_M / 2 + 2.0
            boxes = [
                (low, (0.3, high[1], 0.0)),
                ((1.2, low[1], low[2]), high),
                ((0.3, top, low[2]), (1.2, high[1], 0.0)),
            ]
        lines.append(f'def Xform "Wall_{k}_grp" (kind = "group") {{')
        lines += _mesh(Shape(f"Wall{k}", tuple(boxes), (x, HIGH_M / 2, z), -turn))
        if k == 0 and opening == "Opening0":
            sheet = ((-0.45, -1.0, -0.0002), (0.45, 1.0, 0.0))
            lines += _mesh(Shape("Opening0", (sheet,), (0.75, 1.0, z), -turn))
        if k == 2:
            window = ((-0.6, -0.5, -0.08), (0.6, 0.5, 0.0))
            lines += _mesh(Shape("Window0", (window,), (x, 1.5, z), -turn))
        if k == 3:
            door = ((-0.4, -1.0, -0.08), (0.4, 1.0, 0.0))
            lines += _mesh(Shape("Door0", (door,), (x, 1.0, z), -turn))
        lines.append("}")
    out = THICK_M
    floor = ((-2.0 - out, -out, -1.5 - out), (2.0 + out, 0.0, 1.5 + out))
    lines += ["}", 'def Xform "Floor_grp" (kind = "group") {', *_mesh(Shape("Floor0", (floor,), (0, 0, 0))), "}"]  # fmt: skip
    lines.append('def Xform "Object_grp" (kind = "group") {')
    for group in dict.fromkeys(s.name.rstrip("0123456789") for s in objects):
        lines.append(f'def Xform "{group}_grp" (kind = "group") {{')
        for shape in objects:
            lines += _mesh(shape) if shape.name.rstrip("0123456789") == group else []
        lines.append("}")
    path = folder / "room.usda"
    path.write_text("\n".join([*lines, "}", "}", "}"]) + "\n")
    return path


def thing(name: str, size: tuple[float, float, float], x: float, z: float) -> Shape:
    """An object of RoomPlan on the floor: a box around its own middle."""
    half = np.array(size) / 2
    return Shape(name, ((tuple(-half), tuple(half)),), (x, float(half[1]), z))


def dining_group() -> tuple[Shape, ...]:
    """Three chairs, a table and a cupboard."""
    chairs = [thing(f"Chair{k}", (0.44, 0.9, 0.44), x, 0.9) for k, x in enumerate((-1.2, 0.0, 1.2))]
    table = thing("Table0", (1.2, 0.74, 0.8), 0.0, -0.2)
    return (*chairs, table, thing("Storage0", (0.6, 1.0, 0.4), -1.6, -1.2))


def _mesh(shape: Shape) -> list[str]:
    points = np.concatenate(
        [np.array(a) + _UNIT * (np.array(b) - np.array(a)) for a, b in shape.boxes]
    )
    faces = [8 * k + i for k in range(len(shape.boxes)) for quad in _QUADS for i in quad]
    name = shape.name
    rows = ", ".join(f"({x:.4f}, {y:.4f}, {z:.4f})" for x, y, z in points)
    return [
        f'def Mesh "{name}" {{', f"point3f[] points = [{rows}]",
        f"int[] faceVertexCounts = [{', '.join(['4'] * (len(faces) // 4))}]", f"int[] faceVertexIndices = {faces}",
        # Bound as RoomPlan does, without the schema that USD asks for.
        f"rel material:binding = <../{name}_color>", 'uniform token subdivisionScheme = "none"',
        *_placed(shape.place, shape.turn_deg), "}", f'def Material "{name}_color" {{', "}",
    ]  # fmt: skip


def _placed(place: tuple[float, ...], turn_deg: float) -> list[str]:
    x, y, z = place
    return [
        f"double3 xformOp:translate = ({x}, {y}, {z})", f"double xformOp:rotateY = {turn_deg}",
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]',
    ]  # fmt: skip
