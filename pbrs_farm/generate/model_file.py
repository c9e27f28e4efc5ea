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

_DECIMALS: Final = 5  # of coordinates in metres
_ENDINGS: Final = {"image/png": "png", "image/jpeg": "jpg"}
# What Sweet Home 3D makes of a group by its name.
_GROUPS: Final = {
    MaterialKind.PANE: "sweethome3d_window_pane",
    MaterialKind.MIRROR: "sweethome3d_window_mirror",
}


def model_files(shape: Shape) -> dict[str, bytes]:
    """model.obj, model.mtl and the textures of a shape, by file name; equal shapes, equal bytes.

    The textures are as the shape has them, not encoded anew. The caller writes the files side by
    side: the OBJ names its MTL, and that its pictures.
    """
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
        surface = _visible_surface(given)
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


def _visible_surface(surface: Surface) -> Surface:
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
