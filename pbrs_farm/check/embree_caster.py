"""An independent ray caster: embreex through trimesh over the triangles of house.glb.

Effects: holds an Embree scene. Embree says which triangle; distance and normal are then worked
out here in double precision.
"""

from __future__ import annotations

from typing import Any, Final, Protocol

import numpy as np
import trimesh

from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.arrays import F64, I64, Bools

_MOST_SHEETS: Final = 64  # with holes, that a ray passes: behind them it meets what is solid
_STEP: Final = 1e-5  # behind a hole, of the largest coordinate plus 1 m: above float32's rounding


class Hits(Protocol):
    """What rays meet: see Rays."""

    def first(self, origin: F64, directions: F64) -> I64: ...
    def distance(self, face: I64, origin: F64, directions: F64) -> F64: ...
    def normal(self, face: I64, directions: F64) -> F64: ...
    def without_holes(self, face: I64, origin: F64, directions: F64) -> I64: ...
    def last_leg(self, origin: F64, directions: F64) -> tuple[F64, F64, F64]: ...


class Rays:
    """First hits among triangles (all of them, or those chosen by keep (F,) bool).

    Where alpha leaves a hole in a triangle the ray goes on: the solid triangles are asked from its
    own origin, those with holes one behind the other.
    """

    def __init__(self, triangles: Triangles, keep: Bools | None = None) -> None:
        # Leave out triangles without an area: they have no normal.
        corners = triangles.vertices.astype(np.float64)[triangles.faces]
        with np.errstate(invalid="ignore"):
            cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            length = np.linalg.norm(cross, axis=1)
            solid = np.isfinite(length) & (length > 0)
        if keep is not None:
            solid &= keep
        self._triangles = triangles
        self._corner = corners[:, 0]  # a point of each triangle's plane
        self._normal = cross / np.where(length > 0, length, 1)[:, None]
        self._has_holes = triangles.has_holes
        self._all = _Embree(triangles, solid)
        self._solid = self._sheets = self._all
        if (solid & self._has_holes).any():
            self._solid = _Embree(triangles, solid & ~self._has_holes)
            self._sheets = _Embree(triangles, solid & self._has_holes)

    def first(self, origin: F64, directions: F64) -> I64:
        """(N,) number of the triangle each ray hits first, -1 = nothing; origin (3,) or (N, 3).

        directions (N, 3) of any length; a direction (0, 0, 0) is a pixel without a ray and meets
        nothing. I64 are hit from both sides.
        """
        origins = np.broadcast_to(origin, directions.shape)
        found = self._all.first(origins, directions)
        if self._solid is self._all:
            return found
        rays = np.nonzero((found >= 0) & self._has_holes[found])[0]
        rays = rays[self._is_hole(found[rays], origins[rays], directions[rays])]
        if not len(rays):
            return found
        return self._behind_holes(found, rays, origins, directions)

    def _behind_holes(self, found: I64, rays: I64, origins: F64, directions: F64) -> I64:
        """found, of whose rays some are known to meet a hole first."""
        here = self.distance(found[rays], origins[rays], directions[rays])
        found[rays] = self._solid.first(origins[rays], directions[rays])
        end = self.distance(found[rays], origins[rays], directions[rays])
        end[found[rays] < 0] = np.inf
        for _ in range(_MOST_SHEETS):
            o, d = origins[rays], directions[rays]
            point = o + here[:, None] * d
            here = here + _STEP * (1 + np.abs(point).max(1)) / np.linalg.norm(d, axis=1)
            sheet = self._sheets.first(o + here[:, None] * d, d)
            t = np.maximum(self.distance(sheet, o, d), here)
            before = (sheet >= 0) & (t < end)
            hole = before.copy()
            hole[before] = self._is_hole(sheet[before], o[before], d[before])
            found[rays[before & ~hole]] = sheet[before & ~hole]
            rays, here, end = rays[hole], t[hole], end[hole]
            if not len(rays):
                break
        return found

    def without_holes(self, face: I64, origin: F64, directions: F64) -> I64:
        """(N,) face, -1 where the ray passes a hole of it."""
        kept = face.copy()
        some = np.nonzero((face >= 0) & self._has_holes[face])[0]
        origins = np.broadcast_to(origin, directions.shape)
        kept[some[self._is_hole(face[some], origins[some], directions[some])]] = -1
        return kept

    def last_leg(self, origin: F64, directions: F64) -> tuple[F64, F64, F64]:
        """Where the rays come from that meet something, (N, 3), their directions, and the way until there, (N,)."""
        return np.broadcast_to(origin, directions.shape), directions, np.zeros(len(directions))

    def _is_hole(self, face: I64, origins: F64, directions: F64) -> Bools:
        t = self.distance(face, origins, directions)
        points = origins + np.where(np.isfinite(t), t, 0)[:, None] * directions
        return self._triangles.is_hole(face, points)

    def distance(self, face: I64, origin: F64, directions: F64) -> F64:
        """(N,) distance in lengths of directions to each face's plane; 0 where face is -1.

        In double precision from the plane itself, more exact than the caster's own. Where a ray
        runs along the plane the result is inf or NaN; whether the point lies in the triangle is not
        asked.
        """
        normal, corner = self._normal[face], self._corner[face]
        # Intersect the ray with the plane through the corner.
        with np.errstate(divide="ignore", invalid="ignore"):
            height = np.einsum("ni,ni->n", normal, corner - origin)
            t = height / np.einsum("ni,ni->n", normal, directions)
        return np.where(face >= 0, t, 0.0)

    def normal(self, face: I64, directions: F64) -> F64:
        """(N, 3) unit normals turned against directions; 0 where face is -1.

        Of the triangle, not of the shading: float64 in the world.
        """
        normal = self._normal[face]
        turned = np.where(np.einsum("ni,ni->n", normal, directions)[:, None] > 0, -normal, normal)
        return np.where(face[:, None] >= 0, turned, 0.0)


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
        """(N,) number of the triangle that each ray (N, 3) hits first, -1 = nothing."""
        if self._caster is None or not len(directions):
            return np.full(len(directions), -1, np.int64)
        local = np.asarray(self._caster.intersects_first(origins, directions), np.int64)
        # A pixel outside a fisheye's circle has no ray: its direction is 0.
        return np.where((local >= 0) & directions.any(1), self._face[local], -1)
