"""Rays that mirrors reflect, with hits at their virtual position behind the mirror. No effects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pbrs_farm.check.axes import dot
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.arrays import F64, I64

_MOST = 8  # reflections; the next mirror counts as the hit
_LEAST_COSINE = 0.02  # between a shading normal and the way back, to which it is bent
_OFF = 2e-5  # distance off a mirror, relative to the largest coordinate plus 1 m


class _Path(NamedTuple):
    """N rays behind their last mirror."""

    face: I64
    way: F64  # until the last mirror, in lengths of directions
    origin: F64  # (N, 3) on the last mirror
    directions: F64  # (N, 3)
    mirrors: list[F64]  # (N, 3) normals of each reflection's mirrors; 0 = no mirror


class MirrorRays:
    """First hits of an eye's rays, through mirrors: distances of the whole way, normals of the image."""

    def __init__(self, triangles: Triangles, rays: Rays, eye: F64) -> None:
        """rays: of all triangles."""
        self._triangles, self._rays, self._eye = triangles, rays, eye

    def first(self, origin: F64, directions: F64) -> I64:
        """As Rays, behind the mirrors."""
        return self._path(origin, directions).face

    def distance(self, face: I64, origin: F64, directions: F64) -> F64:
        """(N,) the whole way to each face's plane; 0 where face is -1."""
        path = self._path(origin, directions)
        t = self._rays.distance(face, path.origin, path.directions)
        return np.where(face >= 0, path.way + t, 0.0)

    def normal(self, face: I64, directions: F64) -> F64:
        """(N, 3) unit normals of the images; 0 where face is -1."""
        path = self._path(self._eye, directions)
        normal = self._rays.normal(face, path.directions)
        for n in reversed(path.mirrors):
            normal = normal - 2 * dot(normal, n)[:, None] * n
        return normal

    def without_holes(self, face: I64, origin: F64, directions: F64) -> I64:
        """As Rays, behind the mirrors."""
        path = self._path(origin, directions)
        return self._rays.without_holes(face, path.origin, path.directions)

    def last_leg(self, origin: F64, directions: F64) -> tuple[F64, F64, F64]:
        """As Rays: from the last mirrors."""
        path = self._path(origin, directions)
        return path.origin, path.directions, path.way

    def _path(self, eye: F64, directions: F64) -> _Path:
        origin, d = np.broadcast_to(eye, directions.shape).copy(), directions.copy()
        way = np.zeros(len(directions))
        face = self._rays.first(origin, d)
        mirrors: list[F64] = []
        for _ in range(_MOST):
            on = np.nonzero((face >= 0) & (self._triangles.kinds_of(face) == "mirror"))[0]
            if not len(on):
                break
            t = self._rays.distance(face[on], origin[on], d[on])
            point = origin[on] + t[:, None] * d[on]
            flat = self._rays.normal(face[on], d[on])
            n = self._triangles.shading_normals(face[on], point, flat)
            unit = d[on] / np.linalg.norm(d[on], axis=1, keepdims=True)
            cosine = -dot(n, unit)[:, None]
            bent = n + (cosine - _LEAST_COSINE) * unit
            bent /= np.linalg.norm(bent, axis=1, keepdims=True)
            n = np.where(cosine < _LEAST_COSINE, bent, n)
            mirror = np.zeros(directions.shape)
            mirror[on] = n
            mirrors.append(mirror)
            d[on] = d[on] - 2 * dot(n, d[on])[:, None] * n
            way[on] += t
            origin[on] = point
            away = dot(d[on], flat) > 0
            step = _OFF * (1 + np.abs(point).max(axis=1, keepdims=True))
            face[on] = np.where(away, self._rays.first(point + step * flat, d[on]), -1)
        return _Path(face, way, origin, d, mirrors)
