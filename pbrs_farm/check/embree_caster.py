"""An independent ray caster: Embree finds the triangle, float64 its distance and normal, also behind mirrors; holds an Embree scene."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import trimesh

from pbrs_farm.check.axes import dot
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.arrays import F64, I64, Bools

_MOST_SHEETS = 64  # triangles with holes that a ray may pass, before it meets a solid one
_STEP = 1e-5  # behind a hole, relative to the largest coordinate plus 1 m: above float32's rounding
_MOST_REFLECTIONS = 8  # reflections; the next mirror counts as the hit
_LEAST_COSINE = 0.02  # between a shading normal and the way back, to which it is bent
_OFF = 2e-5  # distance off a mirror, relative to the largest coordinate plus 1 m


class Rays:
    """First hits among triangles (all of them, or those chosen by keep (F,) bool).

    A ray passes the holes that alpha leaves in a triangle: the solid triangles are asked from its
    origin, those with holes one behind the other.
    """

    def __init__(self, triangles: Triangles, keep: Bools | None = None) -> None:
        # Triangles without an area have no normal.
        corners = triangles.vertices.astype(np.float64)[triangles.faces]
        with np.errstate(invalid="ignore"):
            cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            length = np.linalg.norm(cross, axis=1)
            chosen = np.isfinite(length) & (length > 0)
        if keep is not None:
            chosen &= keep
        self._triangles = triangles
        self._corner = corners[:, 0]  # a point of each triangle's plane
        self._normal = cross / np.where(length > 0, length, 1)[:, None]
        self._has_holes = triangles.has_holes
        self._all = _Embree(triangles, chosen)
        self._solid = self._sheets = self._all
        if (chosen & self._has_holes).any():
            self._solid = _Embree(triangles, chosen & ~self._has_holes)
            self._sheets = _Embree(triangles, chosen & self._has_holes)

    def first(self, origin: F64, directions: F64) -> I64:
        """(N,) the triangle that each ray hits first, -1 = nothing; origin (3,) or (N, 3).

        directions (N, 3) of any length; (0, 0, 0) is a pixel without a ray and hits nothing. Faces
        are hit from both sides.
        """
        origins = np.broadcast_to(origin, directions.shape)
        face = self._all.first(origins, directions)
        if self._solid is self._all:
            return face
        rays = np.nonzero((face >= 0) & self._has_holes[face])[0]
        rays = rays[self._is_hole(face[rays], origins[rays], directions[rays])]
        return self._behind_holes(face, rays, origins, directions) if len(rays) else face

    def _behind_holes(self, face: I64, rays: I64, origins: F64, directions: F64) -> I64:
        """The first hits of all rays, of which some hit a hole in face first."""
        way = self.distance(face[rays], origins[rays], directions[rays])
        face[rays] = self._solid.first(origins[rays], directions[rays])
        end = self.distance(face[rays], origins[rays], directions[rays])
        end[face[rays] < 0] = np.inf
        for _ in range(_MOST_SHEETS):
            o, d = origins[rays], directions[rays]
            point = o + way[:, None] * d
            way = way + _STEP * (1 + np.abs(point).max(1)) / np.linalg.norm(d, axis=1)
            sheet = self._sheets.first(o + way[:, None] * d, d)
            t = np.maximum(self.distance(sheet, o, d), way)
            before = (sheet >= 0) & (t < end)
            hole = before.copy()
            hole[before] = self._is_hole(sheet[before], o[before], d[before])
            face[rays[before & ~hole]] = sheet[before & ~hole]
            rays, way, end = rays[hole], t[hole], end[hole]
            if not len(rays):
                break
        return face

    def without_holes(self, face: I64, origin: F64, directions: F64) -> I64:
        """(N,) face, -1 where the ray passes a hole of it."""
        solid = face.copy()
        some = np.nonzero((face >= 0) & self._has_holes[face])[0]
        origins = np.broadcast_to(origin, directions.shape)
        solid[some[self._is_hole(face[some], origins[some], directions[some])]] = -1
        return solid

    def last_leg(self, origin: F64, directions: F64) -> tuple[F64, F64, F64]:
        """Origins (N, 3) and directions of the rays' last legs, and the way until there, (N,)."""
        return np.broadcast_to(origin, directions.shape), directions, np.zeros(len(directions))

    def _is_hole(self, face: I64, origins: F64, directions: F64) -> Bools:
        t = self.distance(face, origins, directions)
        points = origins + np.where(np.isfinite(t), t, 0)[:, None] * directions
        return self._triangles.is_hole(face, points)

    def distance(self, face: I64, origin: F64, directions: F64) -> F64:
        """(N,) distance in lengths of directions to each face's plane; 0 where face is -1.

        In double precision from the plane itself, so more exact than Embree's own. Inf or NaN for a
        ray along the plane. The point may be outside the triangle.
        """
        normal, corner = self._normal[face], self._corner[face]
        with np.errstate(divide="ignore", invalid="ignore"):
            height = dot(normal, corner - origin)
            t = height / dot(normal, directions)
        return np.where(face >= 0, t, 0.0)

    def normal(self, face: I64, directions: F64) -> F64:
        """(N, 3) unit normals of the triangles, turned against directions; 0 where face is -1."""
        normal = self._normal[face]
        away = dot(normal, directions)[:, None] > 0
        return np.where(face[:, None] >= 0, np.where(away, -normal, normal), 0.0)


def is_visible(rays: Rays, eye: F64, points: F64, slack_m: Any) -> Bools:
    """(N,) True if rays from the eye to points (N, 3) hit nothing more than slack_m before them."""
    to = points - eye
    face = rays.first(eye, to)
    with np.errstate(invalid="ignore"):
        gap = (1 - rays.distance(face, eye, to)) * np.linalg.norm(to, axis=1)
        return np.asarray((face < 0) | (gap <= slack_m), bool)


class _Embree:
    """Embree over some of the triangles."""

    def __init__(self, triangles: Triangles, keep: Bools) -> None:
        self._face = np.nonzero(keep)[0]  # Embree's number -> number of the triangle
        self._caster: Any = None
        if len(self._face):
            # process=False: merging vertices would renumber faces.
            mesh = trimesh.Trimesh(triangles.vertices, triangles.faces[self._face], process=False)
            self._caster = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh, scale_to_box=False)

    def first(self, origins: F64, directions: F64) -> I64:
        """(N,) the triangle that each ray (N, 3) hits first, -1 = nothing."""
        if self._caster is None or not len(directions):
            return np.full(len(directions), -1, np.int64)
        local = np.asarray(self._caster.intersects_first(origins, directions), np.int64)
        # A pixel outside a fisheye's circle has no ray: its direction is 0.
        return np.where((local >= 0) & directions.any(1), self._face[local], -1)


class _Path(NamedTuple):
    """N rays behind their last mirror."""

    face: I64
    way: F64  # until the last mirror, in lengths of directions
    origin: F64  # (N, 3) on the last mirror
    directions: F64  # (N, 3)
    mirrors: list[F64]  # (N, 3) normals of each reflection's mirrors; 0 = no mirror


class MirrorRays(Rays):
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
        for _ in range(_MOST_REFLECTIONS):
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
