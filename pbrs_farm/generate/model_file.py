"""A shape as the files of an OBJ model; no effects."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import Material, MaterialKind, Surface
from pbrs_farm.core.mesh import face_areas
from pbrs_farm.generate.floor_plan import OpeningKind, PlanOpening
from pbrs_farm.geometry.solids import Triple, boxes_surface

_DECIMALS: Final = 5  # of metres
_ENDINGS: Final = {"image/png": "png", "image/jpeg": "jpg"}
# What Sweet Home 3D makes of a group by its name.
_GROUPS: Final = {
    MaterialKind.PANE: "sweethome3d_window_pane",
    MaterialKind.MIRROR: "sweethome3d_window_mirror",
}


def model_files(shape: Shape) -> dict[str, bytes]:
    """model.obj, model.mtl and the textures of a shape, by file name; equal shapes, equal bytes."""
    pictures = {
        texture_id: f"texture{k}.{_ENDINGS.get(texture.media_type, 'png')}"
        for k, (texture_id, texture) in enumerate(sorted(shape.textures.items()))
    }
    obj = "\n".join(("mtllib model.mtl", *_obj_lines(shape), ""))
    mtl = "\n".join((*_mtl_lines(shape, pictures), ""))
    files = {"model.obj": obj.encode(), "model.mtl": mtl.encode()}
    return files | {name: shape.textures[i].data for i, name in pictures.items()}


def _obj_lines(shape: Shape) -> Iterator[str]:
    n_points = n_uvs = n_normals = 1
    for number, given in enumerate(shape.surfaces):
        surface = _seen(given)
        kind = shape.materials[surface.material].kind
        yield f"g {_GROUPS.get(kind, 'part')}_{number}"
        yield f"usemtl {material_name(shape, surface.material)}"
        yield from (
            f"v {x:.{_DECIMALS}f} {y:.{_DECIMALS}f} {z:.{_DECIMALS}f}"
            for x, y, z in surface.positions.tolist()
        )
        if surface.uvs is not None:
            yield from (f"vt {u:.5g} {v:.5g}" for u, v in surface.uvs.tolist())
        if surface.normals is not None:
            yield from (f"vn {x:.4f} {y:.4f} {z:.4f}" for x, y, z in surface.normals.tolist())
        yield from _face_lines(surface, n_points, n_uvs, n_normals)
        n_points += len(surface.positions)
        n_uvs += 0 if surface.uvs is None else len(surface.uvs)
        n_normals += 0 if surface.normals is None else len(surface.normals)


def _seen(surface: Surface) -> Surface:
    """The surface without faces that have no area once written, and without vertices of those alone.

    The program, and every reader, fits the box of all vertices to the piece's size.
    """
    written = np.asarray(surface.positions, np.float64).round(_DECIMALS)
    seen = surface.faces[face_areas(written[surface.faces]) > 0]
    used, faces = np.unique(seen, return_inverse=True)
    return replace(
        surface, positions=surface.positions[used],
        faces=faces.reshape(-1, 3).astype(np.int32),
        uvs=None if surface.uvs is None else surface.uvs[used],
        normals=None if surface.normals is None else surface.normals[used],
    )  # fmt: skip


def material_name(shape: Shape, number: int) -> str:
    """What its readers know a material by: its number, and what it says of itself."""
    words = re.findall(r"[A-Za-z]+", shape.materials[number].name)
    return "_".join((f"m{number}", *words))[:60]


def _face_lines(surface: Surface, point: int, uv: int, normal: int) -> Iterator[str]:
    has_uvs, has_normals = surface.uvs is not None, surface.normals is not None

    def corner(i: int) -> str:
        if not has_uvs and not has_normals:
            return str(point + i)
        texture = str(uv + i) if has_uvs else ""
        return f"{point + i}/{texture}" + (f"/{normal + i}" if has_normals else "")

    for face in surface.faces.tolist():
        yield "f " + " ".join(corner(i) for i in face)


def _mtl_lines(shape: Shape, pictures: dict[str, str]) -> Iterator[str]:
    for number, material in enumerate(shape.materials):
        yield f"newmtl {material_name(shape, number)}"
        yield from _material_lines(material)
        if material.texture_id in pictures:
            yield f"map_Kd {pictures[material.texture_id or '']}"


def _material_lines(material: Material) -> Iterator[str]:
    yield "illum 2"
    yield "Kd " + " ".join(f"{c:.4g}" for c in material.diffuse)
    yield "Ks " + " ".join(f"{c:.4g}" for c in material.specular)
    shininess = material.shininess
    if material.roughness is not None and shininess <= 0:
        # The Phong exponent of the same GGX lobe: alpha squared is 2 / (Ns + 2).
        shininess = max(2.0 / max(material.roughness, 0.05) ** 4 - 2.0, 0.0)
    yield f"Ns {min(shininess, 128.0):.4g}"
    opacity = material.opacity
    if material.kind is MaterialKind.GLASS and opacity >= 1:
        opacity = 0.3
    yield f"d {opacity:.4g}"


# Generated doors and windows, for homes whose catalogue has none of the right size.
# A shape fills the opening: metres, the middle of its base at the origin, x along the wall, its
# front (the room a door swings into) towards +z.


_FRAME_M: Final = 0.06  # breadth of a frame's posts
_LEAF_M: Final = 0.04  # thickness of a door's leaf
_SASH_M: Final = 0.05  # breadth of a sash's bars
_PANE_M: Final = 0.006
_WIDEST_SASH_M: Final = 0.95

_Box = tuple[Triple, Triple]  # low and high corner


def joinery(opening: PlanOpening, wall_m: float, colour: Triple) -> Shape:
    """The door or window of an opening in a wall of that thickness; colour: sRGB of its wood."""
    paint = Material("joinery", diffuse=colour, specular=(0.3, 0.3, 0.3), shininess=40.0)
    metal = Material("handle", diffuse=(0.2, 0.2, 0.2), specular=(0.7, 0.7, 0.7), shininess=60.0)
    glass = Material("pane", kind=MaterialKind.PANE, diffuse=(0.9, 0.95, 0.95), opacity=0.2)
    # The frame is 2 cm deeper than the wall, so that it shows on both sides.
    w, h, d = opening.width, opening.height, wall_m + 0.02
    frame = _frame(w, h, d, has_sill=opening.sill > 0)
    if opening.kind is OpeningKind.PASSAGE:
        return Shape((boxes_surface("frame", frame, 0),), (paint,))
    if opening.kind in (OpeningKind.DOOR, OpeningKind.ENTRANCE):
        leaf = _leaf(w, h, d)
        handles = _handles(w, d, opening.hinge_at_start)
        surfaces = (boxes_surface("frame", [*frame, *leaf], 0), boxes_surface("handle", handles, 1))
        return Shape(surfaces, (paint, metal))
    bars, panes = _sashes(w, h)
    surfaces = (boxes_surface("frame", [*frame, *bars], 0), boxes_surface("pane", panes, 1))
    return Shape(surfaces, (paint, glass))


def _frame(w: float, h: float, d: float, *, has_sill: bool) -> list[_Box]:
    # Two posts, the head between them, a sill below a window.
    x, z, t = w / 2, d / 2, _FRAME_M
    boxes: list[_Box] = [
        ((-x, 0.0, -z), (-x + t, h, z)),
        ((x - t, 0.0, -z), (x, h, z)),
        ((-x + t, h - t, -z), (x - t, h, z)),
    ]
    if has_sill:
        boxes.append(((-x + t, 0.0, -z), (x - t, t * 0.7, z)))
    return boxes


def _leaf(w: float, h: float, d: float) -> list[_Box]:
    """A door's leaf with four raised panels on either side, flush with the room it swings into."""
    x, front = w / 2 - _FRAME_M - 0.003, d / 2 - 0.005
    back, top = front - _LEAF_M, h - _FRAME_M - 0.003
    boxes: list[_Box] = [((-x, 0.006, back), (x, top, front))]
    inset, gap, middle = 0.11, 0.012, 0.95
    for low, high in ((0.14, middle - 0.06), (middle + 0.06, top - inset)):
        for left, right in ((-x + inset, -gap * 3), (gap * 3, x - inset)):
            boxes.append(((left, low, front), (right, high, front + 0.006)))
            boxes.append(((left, low, back - 0.006), (right, high, back)))
    return boxes


def _handles(w: float, d: float, hinge_at_start: bool) -> list[_Box]:
    # A lever on either side, 1.05 m high, away from the hinges.
    side = 1.0 if hinge_at_start else -1.0
    at, front = side * (w / 2 - _FRAME_M - 0.06), d / 2 - 0.005
    boxes: list[_Box] = []
    for face, out in ((front, 1.0), (front - _LEAF_M, -1.0)):
        near, far = sorted((face, face + out * 0.05))
        boxes.append(((at - 0.01, 1.04, near), (at + 0.01, 1.06, far)))
        low, high = sorted((at, at - side * 0.11))
        lever = sorted((face + out * 0.035, face + out * 0.05))
        boxes.append(((low, 1.04, lever[0]), (high, 1.06, lever[1])))
    return boxes


def _sashes(w: float, h: float) -> tuple[list[_Box], list[_Box]]:
    """(bars, panes): as many sashes side by side as keep each below a metre."""
    n = max(1, round((w - 2 * _FRAME_M) / _WIDEST_SASH_M + 0.3))
    inner, low, high = w - 2 * _FRAME_M, _FRAME_M * 0.7, h - _FRAME_M
    bars: list[_Box] = []
    panes: list[_Box] = []
    for k in range(n):
        left, right = -inner / 2 + k * inner / n + 0.002, -inner / 2 + (k + 1) * inner / n - 0.002
        z, t = 0.03, _SASH_M
        bars += [
            ((left, low, -z), (left + t, high, z)),
            ((right - t, low, -z), (right, high, z)),
            ((left + t, low, -z), (right - t, low + t, z)),
            ((left + t, high - t, -z), (right - t, high, z)),
        ]
        pane = _PANE_M / 2
        panes.append(((left + t, low + t, -pane), (right - t, high - t, pane)))
    return bars, panes
