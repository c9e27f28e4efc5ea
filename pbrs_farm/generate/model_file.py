"""A shape as the files of an OBJ model; no effects."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I32
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import Material, MaterialKind, Surface, part_of
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.mesh import face_areas

MTL: Final = "model.mtl"
_DECIMALS: Final = 5  # of coordinates in metres
_NORMAL_DECIMALS: Final = 4
_UV_DIGITS: Final = 5
_MOST_DECIMALS: Final = 12  # a float32 times 10^12 is still exact in double precision
_POWERS: Final = np.array([float(f"1e{n}") for n in range(-_MOST_DECIMALS, 16)])
_ENDINGS: Final = {"image/png": "png", "image/jpeg": "jpg"}
# Sweet Home 3D's interpretation of group names: transparent, mirror, or moving.
_GROUPS: Final = {
    MaterialKind.PANE: "sweethome3d_window_pane",
    MaterialKind.MIRROR: "sweethome3d_window_mirror",
}
_OPENING: Final = "sweethome3d_opening"
_HANGERS: Final = {JointKind.REVOLUTE: "hinge", JointKind.PRISMATIC: "rail"}


@dataclass(frozen=True, slots=True, eq=False)
class WrittenSurface:
    """A surface as a reader of the OBJ finds it: numbers in double precision, rounded as written."""

    group: str
    material: str
    positions: F64  # (V, 3)
    faces: I32  # (F, 3)
    uvs: F64 | None  # (V, 2)
    normals: F64 | None  # (V, 3)


def written_surfaces(shape: Shape) -> Iterator[WrittenSurface]:
    """The surfaces that obj_file writes, without writing them; equal to what parsing gives, bit by bit."""
    for number, given_surface in enumerate(shape.surfaces):
        surface = _visible_surface(given_surface)
        if len(surface.faces):
            yield WrittenSurface(
                _group_name(shape, surface, number),
                material_name(shape, surface.material),
                _rounded(surface.positions, _DECIMALS),
                surface.faces,
                None if surface.uvs is None else _to_digits(surface.uvs, _UV_DIGITS),
                None if surface.normals is None else _rounded(surface.normals, _NORMAL_DECIMALS),
            )


def _rounded(values: NDArray[np.floating], decimals: int) -> F64:
    """Round as float(f"{value:.{decimals}f}") does.

    A float32 times a power of ten up to 10^12 is exact in double precision, so that rounding it and
    dividing gives the nearest double of the decimal number, as parsing does.
    """
    if values.dtype != np.float32:
        return _as_text(values, f".{decimals}f")
    return np.asarray(np.round(values.astype(np.float64), decimals))


def _to_digits(values: NDArray[np.floating], digits: int) -> F64:
    """Round as float(f"{value:.{digits}g}") does, by the same method digit by digit."""
    size = np.abs(values.astype(np.float64))
    # Count decimals from the first digit that is not 0; compare, since a logarithm is not exact.
    exponent = np.searchsorted(_POWERS, size, side="right") - 1 - _MOST_DECIMALS
    decimals = digits - 1 - exponent
    is_exact = (size == 0) | ((decimals >= 0) & (decimals <= _MOST_DECIMALS))
    if values.dtype != np.float32 or not is_exact.all():
        return _as_text(values, f".{digits}g")
    scale = _POWERS[_MOST_DECIMALS + np.clip(decimals, 0, _MOST_DECIMALS)]
    return np.asarray(np.rint(values.astype(np.float64) * scale) / scale)


def _as_text(values: NDArray[np.floating], form: str) -> F64:
    numbers = [float(format(value, form)) for value in values.ravel().tolist()]
    return np.array(numbers, np.float64).reshape(values.shape)


def obj_file(shape: Shape) -> bytes:
    """model.obj of a shape; equal shapes, equal bytes. It names the MTL of side_files."""
    return "\n".join((f"mtllib {MTL}", *_obj_lines(shape), "")).encode()


def side_files(shape: Shape) -> dict[str, bytes]:
    """model.mtl and the textures of a shape, as it has them, by file name."""
    pictures = {
        texture_id: f"texture{k}.{_ENDINGS.get(texture.media_type, 'png')}"
        for k, (texture_id, texture) in enumerate(sorted(shape.textures.items()))
    }
    mtl = "\n".join((*_mtl_lines(shape, pictures), ""))
    pixels = {name: shape.textures[i].data for i, name in pictures.items()}
    return {MTL: mtl.encode()} | pixels


def _group_name(shape: Shape, surface: Surface, number: int) -> str:
    made_of = _GROUPS.get(shape.materials[surface.material].kind)
    for k, joint in enumerate(shape.joints, 1):
        if joint.part == surface.part:
            return f"{made_of or _OPENING}_on_{hanger(joint, k)}_{number}"
    return f"{made_of or 'part'}_{number}"


def hanger(joint: Joint, number: int) -> str:
    """Group name of a shape's k-th joint: "hinge_1", "rail_2"."""
    return f"{_HANGERS[joint.kind]}_{number}"


def _obj_lines(shape: Shape) -> Iterator[str]:
    n_points = n_uvs = n_normals = 1
    for number, given_surface in enumerate(shape.surfaces):
        surface = _visible_surface(given_surface)
        yield f"g {_group_name(shape, surface, number)}"
        yield f"usemtl {material_name(shape, surface.material)}"
        yield from (
            f"v {x:.{_DECIMALS}f} {y:.{_DECIMALS}f} {z:.{_DECIMALS}f}"
            for x, y, z in surface.positions.tolist()
        )
        if surface.uvs is not None:
            yield from (
                f"vt {u:.{_UV_DIGITS}g} {v:.{_UV_DIGITS}g}" for u, v in surface.uvs.tolist()
            )
        if surface.normals is not None:
            yield from (
                f"vn {x:.{_NORMAL_DECIMALS}f} {y:.{_NORMAL_DECIMALS}f} {z:.{_NORMAL_DECIMALS}f}"
                for x, y, z in surface.normals.tolist()
            )
        yield from _face_lines(surface, n_points, n_uvs, n_normals)
        n_points += len(surface.positions)
        n_uvs += 0 if surface.uvs is None else len(surface.uvs)
        n_normals += 0 if surface.normals is None else len(surface.normals)


def _visible_surface(surface: Surface) -> Surface:
    """The surface without faces that have no area once written, and without their vertices."""
    written = np.asarray(surface.positions, np.float64).round(_DECIMALS)
    return part_of(surface, surface.faces[face_areas(written[surface.faces]) > 0], surface.name)


def material_name(shape: Shape, number: int) -> str:
    """Name of a material in the file: its number and its own name."""
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
