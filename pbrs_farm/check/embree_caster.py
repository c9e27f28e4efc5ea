"""An independent ray caster: embreex through trimesh over the triangles of house.glb.

Effects: holds an Embree scene. Embree says which triangle; distance and normal are then worked
out here in double precision.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from pbrs_farm.check.stored_mesh import Triangles

Floats = NDArray[np.float64]
Faces = NDArray[np.int64]


class Rays:
    """First hits among triangles (all of them, or those chosen by keep (F,) bool)."""

    def __init__(self, triangles: Triangles, keep: NDArray[np.bool_] | None = None) -> None:
        # Leave out triangles without an area: they have no normal.
        corners = triangles.vertices.astype(np.float64)[triangles.faces]
        with np.errstate(invalid="ignore"):
            cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            length = np.linalg.norm(cross, axis=1)
            solid = np.isfinite(length) & (length > 0)
        if keep is not None:
            solid &= keep
        self._face = np.nonzero(solid)[0]  # Embree's number -> number of the triangle
        self._corner = corners[:, 0]  # a point of each triangle's plane
        self._normal = cross / np.where(length > 0, length, 1)[:, None]
        self._caster: Any = None
        if len(self._face):
            # process=False: merging vertices would renumber faces.
            mesh = trimesh.Trimesh(triangles.vertices, triangles.faces[self._face], process=False)
            self._caster = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh, scale_to_box=False)

    def first(self, origin: Floats, directions: Floats) -> Faces:
        """(N,) number of the triangle each ray hits first, -1 = nothing; origin (3,) or (N, 3).

        directions (N, 3) of any length; a direction (0, 0, 0) is a pixel without a ray and meets
        nothing. Faces are hit from both sides.
        """
        if self._caster is None or not len(directions):
            return np.full(len(directions), -1, np.int64)
        origins = np.broadcast_to(origin, directions.shape)
        local = np.asarray(self._caster.intersects_first(origins, directions), np.int64)
        # A pixel outside a fisheye's circle has no ray: its direction is 0.
        return np.where((local >= 0) & directions.any(1), self._face[local], -1)

    def distance(self, face: Faces, origin: Floats, directions: Floats) -> Floats:
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

    def normal(self, face: Faces, directions: Floats) -> Floats:
        """(N, 3) unit normals turned against directions; 0 where face is -1.

        Of the triangle, not of the shading: float64 in the world.
        """
        normal = self._normal[face]
        turned = np.where(np.einsum("ni,ni->n", normal, directions)[:, None] > 0, -normal, normal)
        return np.where(face[:, None] >= 0, turned, 0.0)
