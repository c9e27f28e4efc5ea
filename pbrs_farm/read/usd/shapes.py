"""Geometry of USD prims -> triangles in the prim's own frame; no effects."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from pxr import UsdGeom, UsdLux

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.geometry.solids import box, quads_surface
from pbrs_farm.read.mesh.shape import (
    ABOUT_X,
    ABOUT_Z,
    ROUND,
    Shape,
    ball,
    capsule_profile,
    cylinder_profile,
    shape_of_surface,
    turned,
)
from pbrs_farm.read.mesh.triangulate import triangulated_corners

_OFF_M: Final = 0.005  # offset of a flat light from its ceiling, metres
# Other shape types, which are not triangulated.
_OTHERS: Final = "BasisCurves NurbsCurves NurbsPatch HermiteCurves Points TetMesh Volume"
NOT_READ: Final = frozenset(_OTHERS.split())
_PAIRS: Final = frozenset(
    ["texCoord2f[]", "texCoord2d[]", "texCoord2h[]", "float2[]", "double2[]", "half2[]"]
)


def mesh_shape(prim: Any, time: Any, file: str, uv_name: str = "") -> Shape | None:
    """The triangles of a UsdGeom.Mesh with the coordinates uv_name; None without any; BadHouse for damage."""
    mesh = UsdGeom.Mesh(prim)
    points = _float_rows(mesh.GetPointsAttr().Get(time), 3)
    sizes = _ints(mesh.GetFaceVertexCountsAttr().Get(time))
    indices = _ints(mesh.GetFaceVertexIndicesAttr().Get(time))
    if not len(points) or not len(sizes):
        return None
    _check_mesh(points, sizes, indices, file, str(prim.GetPath()))
    triangles = triangulated_corners(points[indices], sizes)
    polygon = np.repeat(np.arange(len(sizes)), sizes)[triangles[:, 0]]
    holes = _ints(mesh.GetHoleIndicesAttr().Get(time))
    if len(holes):
        is_filled = ~np.isin(polygon, holes)
        triangles, polygon = triangles[is_filled], polygon[is_filled]
    if not len(triangles):
        return None
    pairs = [_texture_coordinates(prim, time, uv_name), _normals(mesh, time)]
    of_points = [_of_points(*pair, len(points)) for pair in pairs]
    of_corners = [_of_corners(*pair, indices, sizes) for pair in pairs]
    # If corners have separate values, every corner becomes a vertex.
    if any(p is None and c is not None for p, c in zip(of_points, of_corners, strict=True)):
        points, faces = points[indices], triangles
        spread = [None if p is None else p[indices] for p in of_points]
        uvs, normals = (c if c is not None else p for c, p in zip(of_corners, spread, strict=True))
    else:
        faces, (uvs, normals) = indices[triangles], of_points
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        faces = faces[:, ::-1]
    return Shape(points, np.ascontiguousarray(faces), uvs, normals, polygon)


def _check_mesh(points: F64, sizes: I64, indices: I64, file: str, place: str) -> None:
    if not (np.abs(points) < 1e9).all():
        raise BadHouse(file, place, "has a number that is not finite")
    if sizes.min() < 0 or int(sizes.sum()) != len(indices):
        text = (
            f"faceVertexCounts add up to {int(sizes.sum())}, faceVertexIndices are {len(indices)}"
        )
        raise BadHouse(file, place, text)
    if len(indices) and not 0 <= indices.min() <= indices.max() < len(points):
        raise BadHouse(file, place, "a face names a point that does not exist")


def _float_rows(value: Any, width: int) -> F64:
    if value is None:
        return np.zeros((0, width))
    return np.asarray(value, np.float64).reshape(-1, width)


def _ints(value: Any) -> I64:
    return np.zeros(0, np.int64) if value is None else np.asarray(value, np.int64).reshape(-1)


def _texture_coordinates(prim: Any, time: Any, uv_name: str) -> tuple[F64 | None, str]:
    """(values, interpolation) of the texture coordinates of that name, else those called st before others."""
    primvars = UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithValues()
    pairs = [p for p in primvars if str(p.GetTypeName()) in _PAIRS]
    names = (uv_name, "st", "UVMap", "st0", "st_0", "uv", "map1", "Texture_uv")
    order = {name: k for k, name in reversed(list(enumerate(names)))}
    pairs.sort(key=lambda p: order.get(p.GetPrimvarName(), len(names)))
    if not pairs:
        return None, ""
    values = pairs[0].ComputeFlattened(time)
    return (None, "") if values is None else (_float_rows(values, 2), pairs[0].GetInterpolation())


def _normals(mesh: Any, time: Any) -> tuple[F64 | None, str]:
    """(values, interpolation) of the normals of a mesh that is not subdivided."""
    if mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none:
        return None, ""
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    if primvar and primvar.HasValue():
        values = primvar.ComputeFlattened(time)
        interpolation = primvar.GetInterpolation()
    else:
        values, interpolation = mesh.GetNormalsAttr().Get(time), mesh.GetNormalsInterpolation()
    return (None, "") if values is None else (_float_rows(values, 3), interpolation)


def _of_points(values: F64 | None, interpolation: str, n_points: int) -> F64 | None:
    """(V, k) values per point; None for another interpolation or without values."""
    if values is None or not np.isfinite(values).all():
        return None
    if interpolation == "constant" and len(values) == 1:
        return np.repeat(values, n_points, axis=0)
    return values if interpolation in ("vertex", "varying") and len(values) == n_points else None


def _of_corners(values: F64 | None, interpolation: str, indices: I64, sizes: I64) -> F64 | None:
    """(C, k) values of the corners of faces, or None."""
    if values is None or not np.isfinite(values).all():
        return None
    if interpolation == "uniform" and len(values) == len(sizes):
        return np.repeat(values, sizes, axis=0)
    return values if interpolation == "faceVarying" and len(values) == len(indices) else None


def solid_shape(prim: Any, time: Any) -> Shape | None:
    """Triangulate a UsdGeom primitive (cube, sphere, cylinder, cone, capsule, plane); None for any other prim."""

    def value(name: str, default: float) -> float:
        number = prim.GetAttribute(name).Get(time)
        number = default if number is None else float(number)
        return number if np.isfinite(number) and abs(number) < 1e9 else default

    kind = prim.GetTypeName()
    r, half = value("radius", 1.0), value("height", 2.0) / 2
    # A lathe turns about y, planes of USD lie across their axis.
    axis = str(prim.GetAttribute("axis").Get() or "Z")
    order = {"Z": ABOUT_Z, "X": ABOUT_X}.get(axis, (0, 1, 2))
    if kind == "Cube":
        return shape_of_surface(box("", np.zeros(3), np.full(3, value("size", 2.0) / 2), 0))
    if kind == "Sphere":
        return ball(r)
    if kind == "Plane":
        w, d = value("width", 2.0) / 2, value("length", 2.0) / 2
        quad = [[-w, 0, d], [w, 0, d], [w, 0, -d], [-w, 0, -d]]
        return shape_of_surface(quads_surface("", np.array([quad]), 0), order)
    profiles: dict[str, Any] = {
        "Cylinder": cylinder_profile(r, half),
        "Cone": np.array([[0, -half], [r, -half], [0, half]], np.float64),
        "Capsule": capsule_profile(value("radius", 0.5), value("height", 1.0) / 2),
    }
    return turned(profiles[kind], order) if kind in profiles else None


def light_shape(prim: Any, time: Any) -> Shape | None:
    """The surface of a UsdLux light: rectangles and discs shine along -z, cylinders lie along x; or None."""
    if prim.IsA(UsdLux.RectLight):
        w, h = (
            float(prim.GetAttribute(f"inputs:{n}").Get(time) or 1) / 2 for n in ("width", "height")
        )
        ring = np.array([[-w, -h], [-w, h], [w, h], [w, -h]])
    elif prim.IsA(UsdLux.DiskLight):
        angles = -2 * np.pi * np.arange(ROUND) / ROUND
        radius = float(prim.GetAttribute("inputs:radius").Get(time) or 0.5)
        ring = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    elif prim.IsA(UsdLux.CylinderLight):
        r = float(prim.GetAttribute("inputs:radius").Get(time) or 0.5)
        h = float(prim.GetAttribute("inputs:length").Get(time) or 1.0) / 2
        shape = turned(cylinder_profile(r, h), ABOUT_X)
        return Shape(shape.positions, shape.faces)
    else:
        return None
    points = np.column_stack([ring, np.full(len(ring), -_OFF_M)])
    k = np.arange(1, len(ring) - 1)
    return Shape(points, np.column_stack([np.zeros_like(k), k, k + 1]))
