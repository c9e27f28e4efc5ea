"""Rays that mirrors send on, with what they meet told where the picture shows it: behind the mirror. No effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.arrays import F64, I64

_MOST = 8  # reflections; the next mirror is what is met
_LEAST_COSINE = 0.02  # between a shading normal and the way back, to which it is bent
_OFF = 2e-5  # a mirror, of the largest coordinate plus 1 m


class MirrorRays:
    """First hits of one eye's rays among all triangles, through every mirror on the way.

    Distances are the whole way, normals those of the image in the mirror: a picture cannot tell it
    from what stands behind a window.
    """

    def __init__(self, triangles: Triangles, rays: Rays, eye: F64) -> None:
        """rays: of all triangles."""
        self._triangles, self._rays, self._eye = triangles, rays, eye

    def first(self, origin: F64, directions: F64) -> I64:
        """As Rays, behind the mirrors."""
        return self._followed(origin, directions)[0]

    def distance(self, face: I64, origin: F64, directions: F64) -> F64:
        """(N,) the whole way to each face's plane; 0 where face is -1."""
        _face, way, at, d, _mirrors = self._followed(origin, directions)
        return np.where(face >= 0, way + self._rays.distance(face, at, d), 0.0)

    def normal(self, face: I64, directions: F64) -> F64:
        """(N, 3) unit normals of the images; 0 where face is -1."""
        _face, _way, _at, d, mirrors = self._followed(self._eye, directions)
        seen = self._rays.normal(face, d)
        for n in reversed(mirrors):
            seen = seen - 2 * np.einsum("ni,ni->n", seen, n)[:, None] * n
        return seen

    def without_holes(self, face: I64, origin: F64, directions: F64) -> I64:
        """As Rays, behind the mirrors."""
        at, d, _way = self.last_leg(origin, directions)
        return self._rays.without_holes(face, at, d)

    def last_leg(self, origin: F64, directions: F64) -> tuple[F64, F64, F64]:
        """As Rays: from the last mirrors."""
        _face, way, at, d, _mirrors = self._followed(origin, directions)
        return at, d, way

    def _followed(self, origin: F64, directions: F64) -> tuple[I64, F64, F64, F64, list[F64]]:
        """(faces, way until the last mirrors, points there, directions, normals of all mirrors; 0 = none)."""
        at = np.broadcast_to(origin, directions.shape).copy()
        d, way = directions.copy(), np.zeros(len(directions))
        face = self._rays.first(at, d)
        mirrors: list[F64] = []
        for _ in range(_MOST):
            on = np.nonzero((face >= 0) & (self._triangles.kinds_of(face) == "mirror"))[0]
            if not len(on):
                break
            t = self._rays.distance(face[on], at[on], d[on])
            point = at[on] + t[:, None] * d[on]
            flat = self._rays.normal(face[on], d[on])
            n = self._triangles.shading_normals(face[on], point, flat)
            unit = d[on] / np.linalg.norm(d[on], axis=1, keepdims=True)
            cosine = -np.einsum("ni,ni->n", n, unit)[:, None]
            bent = n + (cosine - _LEAST_COSINE) * unit
            bent /= np.linalg.norm(bent, axis=1, keepdims=True)
            n = np.where(cosine < _LEAST_COSINE, bent, n)
            mirror = np.zeros(directions.shape)
            mirror[on] = n
            mirrors.append(mirror)
            d[on] = d[on] - 2 * np.einsum("ni,ni->n", n, d[on])[:, None] * n
            way[on] += t
            at[on] = point
            away = np.einsum("ni,ni->n", d[on], flat) > 0
            step = _OFF * (1 + np.abs(point).max(axis=1, keepdims=True))
            met = self._rays.first(point + step * flat, d[on])
            face[on] = np.where(away, met, -1)
        return face, way, at, d, mirrors
