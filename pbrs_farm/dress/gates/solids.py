"""How deep two closed shells enter each other, by the solid they share; the one file here with manifold3d."""

from __future__ import annotations

from typing import Any, Final

import manifold3d
import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.mesh import area_vectors
from pbrs_farm.dress.gates.bodies import Shell

_LEAST_M3: Final = 1e-8  # of what two shells share: less is rounding
_MANY: Final = 48  # directions that a solid's width is measured in


class Solids:
    """Closed shells as solids, each made once."""

    def __init__(self) -> None:
        self._made: dict[int, tuple[Shell, Any]] = {}

    def shared(self, a: Shell, b: Shell) -> list[F64]:
        """The connected parts of what two closed shells share, as triangles (F, 3, 3)."""
        solid_a, solid_b = self._solid(a), self._solid(b)
        if solid_a is None or solid_b is None:
            return []
        # Intersect the solids (manifold's ^); specks below the least volume are rounding.
        common = solid_a ^ solid_b
        if common.is_empty() or common.volume() < _LEAST_M3:
            return []
        parts = []
        for part in common.decompose():
            mesh = part.to_mesh()
            points = np.asarray(mesh.vert_properties, np.float64)[:, :3]
            parts.append(np.asarray(points[np.asarray(mesh.tri_verts)]))
        return parts

    def _solid(self, shell: Shell) -> Any:
        # manifold3d ends the process on open meshes: closed shells alone are given to it.
        assert shell.is_closed
        held = self._made.get(id(shell))
        if held is None or held[0] is not shell:
            mesh = manifold3d.Mesh(shell.vertices.astype(np.float32), shell.faces.astype(np.uint32))
            made = manifold3d.Manifold(mesh)
            good = made.status() == manifold3d.Error.NoError
            held = (shell, made if good else None)
            self._made[id(shell)] = held
        return held[1]


def thickness(corners: F64) -> float:
    """How thick a closed solid of triangles (F, 3, 3) is, metres: its least width across its faces.

    Of a bent skin it is three times the volume over half the surface, as for a plate or less.
    """
    vectors = area_vectors(corners)
    areas = np.linalg.norm(vectors, axis=1)
    surface = float(areas.sum()) / 2
    if surface <= 0:
        return 0.0
    # The divergence theorem: a sixth of the sum of corner times (twice the area) vectors.
    points = corners.reshape(-1, 3) - corners[0, 0]
    volume = abs(float(np.einsum("ij,ij->i", points[0::3], vectors).sum())) / 6
    # The least width across the solid, along the normals of its largest faces.
    largest = np.argsort(-areas, kind="stable")[:_MANY]
    normals = vectors[largest] / np.maximum(areas[largest, None], 1e-30)
    width = float(np.ptp(points @ normals.T, axis=0).min())
    return min(width, 6 * volume / surface)
