"""Geoms of a compiled model of MuJoCo -> triangles and materials. Effects: reads the files of meshes."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.geometry.solids import box, quads_surface
from pbrs_farm.images import png_from_array
from pbrs_farm.quiet_mujoco import mujoco
from pbrs_farm.read.mesh.shape import (
    Shape,
    ball,
    capsule_profile,
    cylinder_profile,
    shape_of_surface,
    turned,
)
from pbrs_farm.regular_files import read_regular

_GREY: Final = (0.5, 0.5, 0.5, 1.0)  # of geoms that say no colour
_SHOWN_GROUPS: Final = 3  # geoms of higher groups are not shown by MuJoCo's own viewer either
_TYPE: Final = mujoco.mjtGeom
UNREAD: Final = {_TYPE.mjGEOM_HFIELD: "height field", _TYPE.mjGEOM_SDF: "signed distance field"}


def rgba_of(model: Any, geom: int) -> tuple[float, ...]:
    """Colour of a geom in the file: its own, else its material's."""
    rgba = tuple(float(c) for c in model.geom_rgba[geom])
    material = int(model.geom_matid[geom])
    if material < 0 or not np.allclose(rgba, _GREY):
        return rgba
    return tuple(float(c) for c in model.mat_rgba[material])


def is_shown(model: Any, geom: int) -> bool:
    """Whether MuJoCo's viewer shows a geom at first, and anything of it is seen."""
    return bool(model.geom_group[geom] < _SHOWN_GROUPS and rgba_of(model, geom)[3] > 0)


def is_endless(model: Any, geom: int) -> bool:
    """Whether a geom is a plane without an end on a side."""
    is_plane = model.geom_type[geom] == _TYPE.mjGEOM_PLANE
    return bool(is_plane and min(model.geom_size[geom, :2]) <= 0)


def shape_of(model: Any, geom: int, half_m: F64) -> Shape | None:
    """The triangles of a geom, an infinite plane with half_m (2,) sides; None for unsupported types."""
    kind, size = _TYPE(int(model.geom_type[geom])), model.geom_size[geom]
    if kind == _TYPE.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[geom]))
    if kind == _TYPE.mjGEOM_BOX:
        shape = shape_of_surface(box("", np.zeros(3), np.asarray(size, np.float64), 0))
    elif kind == _TYPE.mjGEOM_PLANE:
        w, d = (float(s) if s > 0 else float(h) for s, h in zip(size[:2], half_m, strict=True))
        quad = np.array([[[-w, -d, 0], [w, -d, 0], [w, d, 0], [-w, d, 0]]])
        shape = shape_of_surface(quads_surface("", quad, 0))
    elif kind in (_TYPE.mjGEOM_SPHERE, _TYPE.mjGEOM_ELLIPSOID):
        shape = ball(1.0)
        axes = np.asarray(size if kind == _TYPE.mjGEOM_ELLIPSOID else [size[0]] * 3, np.float64)
        leaning = None if shape.normals is None else shape.normals / axes
        shape = replace(shape, positions=shape.positions * axes, normals=leaning)
    elif kind in (_TYPE.mjGEOM_CYLINDER, _TYPE.mjGEOM_CAPSULE):
        profile = cylinder_profile if kind == _TYPE.mjGEOM_CYLINDER else capsule_profile
        shape = turned(profile(float(size[0]), float(size[1])))
    else:
        return None
    uvs = None if shape.uvs is None else _laid(shape.uvs, model, int(model.geom_matid[geom]))
    return replace(shape, uvs=uvs)


def _laid(uvs_m: F64, model: Any, material: int) -> F64:
    """Texture coordinates of a solid: repeats a metre where its material says so, else a side."""
    repeat = model.mat_texrepeat[material] if material >= 0 else np.ones(2)
    if material < 0 or not model.mat_texuniform[material]:
        # Each side of a solid has separate corners: stretch its texture to one tile.
        quads = uvs_m.reshape(-1, 4, 2) if len(uvs_m) % 4 == 0 else uvs_m[None]
        low = quads.min(1, keepdims=True)
        span = np.maximum(quads.max(1, keepdims=True) - low, 1e-9)
        uvs_m = ((quads - low) / span).reshape(-1, 2)
    return np.asarray(uvs_m * repeat * [1, -1])


def _mesh(model: Any, mesh: int) -> Shape:
    def rows(array: Any, first: Any, n: Any) -> Any:
        return array[int(first[mesh]) : int(first[mesh]) + int(n[mesh])]

    points = rows(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum).astype(np.float64)
    faces = rows(model.mesh_face, model.mesh_faceadr, model.mesh_facenum).astype(np.int64)
    corners = faces.reshape(-1)
    normal_of = rows(model.mesh_facenormal, model.mesh_faceadr, model.mesh_facenum).reshape(-1)
    normals = None
    if _has_normals(model, mesh):
        values = rows(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum)
        normals = values[normal_of].astype(np.float64)
    uvs = None
    if int(model.mesh_texcoordadr[mesh]) >= 0:
        uv_of = rows(model.mesh_facetexcoord, model.mesh_faceadr, model.mesh_facenum).reshape(-1)
        values = rows(model.mesh_texcoord, model.mesh_texcoordadr, model.mesh_texcoordnum)
        uvs = values[uv_of].astype(np.float64)
    # Corners that share a point, its normal and its place in the picture are one vertex.
    keys = [corners, normal_of] + ([] if uvs is None else [uv_of])
    _, first_uses, index = np.unique(
        np.stack(keys, 1), axis=0, return_index=True, return_inverse=True
    )
    return Shape(
        points[corners[first_uses]],
        index.reshape(-1, 3),
        None if uvs is None else uvs[first_uses],
        None if normals is None else normals[first_uses],
    )


def _has_normals(model: Any, mesh: int) -> bool:
    """True if a mesh's file has normals; MuJoCo generates smooth ones for all others."""
    if int(model.mesh_pathadr[mesh]) < 0:
        return False  # written inline
    path = Path(model.paths[int(model.mesh_pathadr[mesh]) :].split(b"\0", 1)[0].decode())
    try:
        data = read_regular(path)
    except OSError:
        return False
    if path.suffix.lower() == ".msh":
        return int.from_bytes(data[4:8], "little") > 0  # header: vertices, normals, ...
    return path.suffix.lower() == ".obj" and re.search(rb"^\s*vn\s", data, re.MULTILINE) is not None


def material_row(model: Any, geom: int, texture: int | None) -> dict[str, Any]:
    """The glTF material of a geom. texture: its number in the document, None = none."""
    material = int(model.geom_matid[geom])
    rgba = np.array(rgba_of(model, geom))
    pbr: dict[str, Any] = {
        "baseColorFactor": [*linear_from_srgb(rgba[:3].clip(0, 1)).tolist(), float(rgba[3])],
        "metallicFactor": 0.0,
        "roughnessFactor": 0.5,
    }
    row: dict[str, Any] = {"name": "", "pbrMetallicRoughness": pbr}
    if material >= 0:
        row["name"] = name_of(model, mujoco.mjtObj.mjOBJ_MATERIAL, material)
        shine, rough = float(model.mat_shininess[material]), float(model.mat_roughness[material])
        # A material says roughness since MuJoCo 3.2, -1 = not at all.
        pbr["roughnessFactor"] = float(np.clip(rough if rough >= 0 else 1 - shine, 0.05, 1))
        pbr["metallicFactor"] = float(np.clip(model.mat_metallic[material], 0, 1))
    if texture is not None:
        pbr["baseColorTexture"] = {"index": texture}
    if rgba[3] < 1:
        row["alphaMode"] = "BLEND"
    return row


def texture_of(model: Any, geom: int) -> int | None:
    """The number of the texture whose colours a geom shows; None where it shows none."""
    material = int(model.geom_matid[geom])
    if material < 0:
        return None
    roles = np.asarray(model.mat_texid).reshape(model.nmat, -1)[material]
    colour_roles = (mujoco.mjtTextureRole.mjTEXROLE_RGB, mujoco.mjtTextureRole.mjTEXROLE_RGBA)
    numbers = [int(roles[int(role)]) for role in colour_roles if int(roles[int(role)]) >= 0]
    return numbers[0] if numbers else None


def png_of_texture(model: Any, texture: int) -> bytes:
    """The picture of a texture; of one for a cube, that of its first side."""
    width, height = int(model.tex_width[texture]), int(model.tex_height[texture])
    n, first = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    data = np.asarray(model.tex_data[first : first + width * height * n], np.uint8)
    picture = data.reshape(height, width, n)
    if model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_CUBE and height == 6 * width:
        picture = picture[:width]
    if n == 2:
        picture = picture[:, :, :1]
    return png_from_array(
        np.ascontiguousarray(picture if picture.shape[2] != 1 else np.repeat(picture, 3, 2))
    )


def name_of(model: Any, kind: Any, number: int) -> str:
    """The name of an element; "" if unnamed."""
    return str(mujoco.mj_id2name(model, kind, number) or "")
