"""What repair asks of a ray caster; the caster itself comes as an argument. No effects."""

from __future__ import annotations

from typing import Protocol

from pbrs_farm.core.arrays import F32, I32


class Occluder(Protocol):
    """First hits of rays with the triangles of one house (faces as in geometry_from_house)."""

    def first_hit(
        self, origins: F32, directions: F32, max_distance: float = ...
    ) -> tuple[F32, I32]:
        """Distance (N,) in metres, inf = a miss, and face index (N,), -1 = a miss.

        origins, directions: (N, 3) float32, directions unit.
        """
        ...
