"""An Occluder on embreex, for tests: independent of the caster that the pipeline gives to repair."""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from pbrs_farm.core.house import House, geometry_from_house


class EmbreeOccluder:
    """First hits with a house's triangles."""

    def __init__(self, house: House) -> None:
        geometry = geometry_from_house(house)
        self._scene = EmbreeScene(robust=True)
        TriangleMesh(scene=self._scene, vertices=geometry.positions, indices=geometry.faces)

    def first_hit(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        max_distance: float = np.inf,
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Distance, inf for a miss, and face, -1 for a miss, of each ray's first hit."""
        hits = self._scene.run(
            np.ascontiguousarray(origins, np.float32),
            np.ascontiguousarray(directions, np.float32),
            output=True,
            dists=np.full(len(origins), min(max_distance, 1e30), np.float32),
        )
        face = hits["primID"].astype(np.int32)
        return np.where(face < 0, np.float32(np.inf), hits["tfar"]), face
