"""Surfaces as Wavefront OBJ with z up and their textures as PNG, for MuJoCo, PyBullet and ROS; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Material, MaterialKind, Surface
from pbrs_farm.core.mesh import triangle_corners, unit_normals
from pbrs_farm.export.home_files import digest_name, z_up_points
from pbrs_farm.images import decode_texture, png_from_array

_CLEAR: Final = 0.3  # opacity of glass whose source gives none
_GLASSY: Final = (MaterialKind.GLASS, MaterialKind.PANE)


def obj_of_surfaces(surfaces: Sequence[Surface], material: str = "", library: str = "") -> bytes:
    """Surfaces of one material as an OBJ, with texture coordinates and normals, z up.

    material, library: its name and its MTL file; "" for neither. A surface without normals is flat:
    its triangles share no corner.
    """
    points: list[F64] = []
    uvs: list[NDArray[np.floating]] = []
    normals: list[F64] = []
    faces: list[NDArray[np.integer]] = []
    first = 1
    if sum(len(s.faces) for s in surfaces) == 1:
        surfaces = [_in_three(s) for s in surfaces if len(s.faces)]
    for s in surfaces:
        uv = np.zeros((len(s.positions), 2)) if s.uvs is None else s.uvs
        if s.normals is None:
            corners = triangle_corners(s.positions, s.faces)
            points.append(corners.reshape(-1, 3))
            normals.append(np.repeat(unit_normals(corners), 3, axis=0))
            uvs.append(uv[s.faces.ravel()])
            faces.append(np.arange(s.faces.size).reshape(-1, 3) + first)
        else:
            points.append(s.positions.astype(np.float64))
            normals.append(s.normals.astype(np.float64))
            uvs.append(uv)
            faces.append(s.faces + first)
        first += len(points[-1])
    rows = [f"mtllib {library}", f"usemtl {material}"] if library else []
    for p, n in zip(points, normals, strict=True):
        rows += [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in z_up_points(p)]
        rows += [f"vn {x:.5g} {y:.5g} {z:.5g}" for x, y, z in z_up_points(n)]
    rows += [f"vt {u:.6g} {v:.6g}" for uv in uvs for u, v in uv]
    rows += [
        f"f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}" for rows_ in faces for a, b, c in rows_.tolist()
    ]
    return ("\n".join(rows) + "\n").encode()


def _in_three(surface: Surface) -> Surface:
    """Split a surface of one triangle at its middle, since MuJoCo rejects meshes of three corners."""
    corners = surface.faces[0]

    def with_middle(values: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
        return None if values is None else np.vstack([values[corners], values[corners].mean(0)])

    return replace(
        surface,
        positions=np.vstack([surface.positions[corners], surface.positions[corners].mean(0)]),
        uvs=with_middle(surface.uvs),
        normals=with_middle(surface.normals),
        faces=np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32),
    )


def rgba_of(material: Material) -> tuple[float, float, float, float]:
    """Colour as sRGB values and opacity, 0..1."""
    opacity = material.opacity
    if material.kind in _GLASSY and opacity >= 1:
        opacity = _CLEAR
    r, g, b = material.diffuse
    return (float(r), float(g), float(b), float(opacity))


def png_textures(house: House, used: Sequence[int]) -> dict[str, tuple[str, bytes]]:
    """Texture id -> file name and PNG of the colour pictures of some materials."""
    names = {house.materials[k].texture_id for k in used}
    textures = {}
    for key in sorted(name for name in names if name and name in house.textures):
        texture = house.textures[key]
        data = texture.data
        if texture.media_type != "image/png":
            data = png_from_array(decode_texture(data, texture.name, texture.media_type))
        textures[key] = (f"{digest_name(data)}.png", data)
    return textures
