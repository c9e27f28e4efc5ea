"""Surfaces visible in mirrors: the pixels' rays continue after reflection; no effects.

As for light, a mirror reflects about its shading normal, recursively. Hits are reported at their virtual position
behind the mirror, on the pixel's own ray.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I32, I64, Bools, FirstHit, HitRecord
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import Geometry, House, MaterialKind
from pbrs_farm.core.mesh import triangle_corners, unit_normals
from pbrs_farm.truth.surface_layers import bent_by_maps

MOST_REFLECTIONS: Final = 8  # the next mirror is shown as its own plane
_LEAST_COS: Final = 0.02  # of a shading normal to its ray: one that turns away more is bent
_STEP: Final = (
    2e-5  # off a mirror, of a point's largest coordinate plus 1 m: above float32's rounding
)


class _Rays(NamedTuple):
    """N rays under way, and the faces that they meet."""

    pixel: I64
    origin: F64  # (N, 3)
    direction: F64  # (N, 3), as long as those of the camera
    face: I32  # -1 = nothing
    way: F64  # until the origin, in lengths of the direction

    def some(self, k: I64) -> _Rays:
        """Those of some numbers."""
        return _Rays(self.pixel[k], self.origin[k], self.direction[k], self.face[k], self.way[k])


def mirror_faces(geometry: Geometry, house: House) -> Bools:
    """(F,) bool: the face's material is a mirror."""
    mirrors = np.array([m.kind is MaterialKind.MIRROR for m in house.materials], bool)
    if not len(mirrors):
        return np.zeros(len(geometry.faces), bool)
    return mirrors[geometry.face_material]


def mirrored_hits(
    hit: HitRecord,
    camera: Camera,
    geometry: Geometry,
    house: House,
    first_hit: FirstHit,
    textures: Mapping[str, NDArray[np.uint8]],
) -> HitRecord:
    """Replace hits on mirrors by those of their reflections; other pixels keep hit.

    Depth and normal are those of the virtual image; item and face those of the real one. Without a hit in
    the mirror there is no surface. first_hit, textures: as of LabelInputs. Its points must not be used.
    """
    is_mirror = mirror_faces(geometry, house)
    face, depth = hit.face.reshape(-1).copy(), hit.depth_z.reshape(-1).copy()
    normal = hit.geo_normal_world.reshape(-1, 3).copy()
    pixels = np.flatnonzero((face >= 0) & is_mirror[face]) if len(is_mirror) else np.zeros(0, int)
    eye, directions = camera.exact_rays()
    origin = np.broadcast_to(eye, (len(pixels), 3))
    rays = _Rays(
        pixels, origin, directions.reshape(-1, 3)[pixels], face[pixels], np.zeros(len(pixels))
    )
    turned: list[tuple[I64, F64]] = []  # pixels and normals of the mirrors met, in order
    for _ in range(MOST_REFLECTIONS):
        at_mirror = np.flatnonzero((rays.face >= 0) & is_mirror[rays.face])
        if not len(at_mirror):
            break
        rays, mirror = _reflected(rays.some(at_mirror), geometry, house, first_hit, textures)
        turned.append((rays.pixel, mirror))
        # The new hits may be on mirrors again.
        is_hit = rays.face >= 0
        points, n = _met(rays, geometry)
        face[rays.pixel], depth[rays.pixel] = rays.face, np.where(is_hit, points, 0)
        normal[rays.pixel] = np.where(is_hit[:, None], _seen_in(turned, rays.pixel, n), 0)
    shape = hit.face.shape
    item = np.where(face >= 0, geometry.face_item[face], 0) if len(geometry.faces) else face
    return HitRecord(
        face.reshape(shape),
        item.reshape(shape).astype(np.uint32),
        depth.reshape(shape).astype(np.float32),
        normal.reshape(*shape, 3).astype(np.float32),
        _no_points,
    )


def _no_points() -> NoReturn:
    raise ValueError("a mirrored hit has no points")


def _met(rays: _Rays, geometry: Geometry) -> tuple[F64, F64]:
    """(N,) the whole way to the faces' planes, in lengths of the directions; (N, 3) their normals, turned."""
    corners = triangle_corners(geometry.positions, geometry.faces[rays.face])
    normal = unit_normals(corners)
    along = np.einsum("ni,ni->n", normal, rays.direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("ni,ni->n", normal, corners[:, 0] - rays.origin) / along
    return rays.way + np.nan_to_num(t), np.where(along[:, None] > 0, -normal, normal)


def _reflected(
    rays: _Rays,
    geometry: Geometry,
    house: House,
    first_hit: FirstHit,
    textures: Mapping[str, NDArray[np.uint8]],
) -> tuple[_Rays, F64]:
    """(the rays behind the mirrors that they meet, the normals (N, 3) that they were reflected about)."""
    way, flat = _met(rays, geometry)
    point = rays.origin + (way - rays.way)[:, None] * rays.direction
    length = np.linalg.norm(rays.direction, axis=1, keepdims=True)
    d = rays.direction / length
    n = _shading_normals(rays.face, point, flat, geometry, house, textures)
    # Bend a shading normal back that turns away from the ray.
    towards = -np.einsum("ni,ni->n", n, d)[:, None]
    bent = n - (_LEAST_COS - towards) * d
    bent /= np.linalg.norm(bent, axis=1, keepdims=True)
    n = np.where(towards < _LEAST_COS, bent, n)
    d = d - 2 * np.einsum("ni,ni->n", n, d)[:, None] * n
    # Go on from just off the mirror; a ray that would go into it ends.
    step = _STEP * (1 + np.abs(point).max(axis=1, initial=0.0, keepdims=True))
    _t, face = first_hit(point + step * flat, d)
    face = np.where(np.einsum("ni,ni->n", d, flat) > 0, face, -1).astype(np.int32)
    return _Rays(rays.pixel, point, d * length, face, way), n


def _shading_normals(
    face: I32,
    point: F64,
    flat: F64,
    geometry: Geometry,
    house: House,
    textures: Mapping[str, NDArray[np.uint8]],
) -> F64:
    """(N, 3) unit normals that light reflects about, on the side of the flat ones (N, 3)."""
    corner = geometry.faces[face]
    a, b, c = np.moveaxis(triangle_corners(geometry.positions, corner), 1, 0)
    area = np.cross(b - a, c - a)
    squared = np.einsum("ni,ni->n", area, area)
    w_b = np.einsum("ni,ni->n", np.cross(point - a, c - a), area) / squared
    w_c = np.einsum("ni,ni->n", np.cross(b - a, point - a), area) / squared
    weights = np.stack([1 - w_b - w_c, w_b, w_c], axis=1)
    smooth = np.einsum("nk,nkc->nc", weights, geometry.normals[corner].astype(np.float64))
    size = np.linalg.norm(smooth, axis=1, keepdims=True)
    smooth = np.where(size > 1e-6, smooth / np.maximum(size, 1e-12), flat)
    smooth = np.where(np.einsum("nc,nc->n", smooth, flat)[:, None] < 0, -smooth, smooth)
    uv = np.einsum("nk,nkc->nc", weights, geometry.uvs[corner].astype(np.float64))
    normals = smooth.astype(np.float32)
    bent = bent_by_maps(normals, face, uv.astype(np.float32), house, geometry, textures)
    # Keep double precision where no map bends them.
    return np.where((bent == normals).all(axis=1, keepdims=True), smooth, bent)


def _seen_in(turned: list[tuple[I64, F64]], pixel: I64, normal: F64) -> F64:
    """(N, 3) normals of pixels as the mirrors show them; those of the last mirror's pixels."""
    normals = normal
    for pixels, mirror in reversed(turned):
        n = mirror[np.searchsorted(pixels, pixel)]
        normals = normals - 2 * np.einsum("ni,ni->n", normals, n)[:, None] * n
    return normals
