"""How high a room's ceiling is: its level's height, or the tops of the walls around; no effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.arrays import Points2
from pbrs_farm.house import Surface
from pbrs_farm.read.planes import horizontal
from pbrs_farm.read.sweethome3d.outlines import Outline
from pbrs_farm.read.sweethome3d.plan import Plan, PlanLevel, level_of
from pbrs_farm.read.sweethome3d.walls import top_heights

F64 = NDArray[np.float64]


class CeilingHeights:
    """Ceiling heights above the level, in metres; on the top level they follow the walls."""

    def __init__(self, plan: Plan, outlines: dict[str, Outline]) -> None:
        self._top = max((x.index for x in plan.levels), default=0)
        self._wall_height = plan.wall_height
        self._edges: dict[str, tuple[F64, F64]] = {}
        by_level: dict[str, list[tuple[F64, F64]]] = {}
        for wall in plan.walls:
            if wall.id not in outlines:
                continue
            outline = outlines[wall.id]
            around = outline.polygon
            along = np.concatenate([outline.along, outline.along[::-1]])
            tops = top_heights(wall, around, along)
            a, b = np.arange(len(around)), np.roll(np.arange(len(around)), -1)
            segments = np.concatenate([around[a], around[b]], 1)
            by_level.setdefault(level_of(plan, wall.level).id, []).append(
                (segments, np.stack([tops[a], tops[b]], 1))
            )
        for level_id, parts in by_level.items():
            self._edges[level_id] = (
                np.concatenate([p[0] for p in parts]),
                np.concatenate([p[1] for p in parts]),
            )

    def heights(self, level: PlanLevel, points: Points2, is_flat: bool) -> F64:
        """(N,) heights over plan points (N, 2)."""
        edges = self._edges.get(level.id)
        if level.index != self._top or edges is None:
            height = level.height if level.id else self._wall_height
            return np.full(len(points), height)
        found = np.array([_nearest(p, *edges) for p in points])
        return np.full(len(points), found.max()) if is_flat else found

    def surface(
        self, level: PlanLevel, parts: Sequence[Sequence[Points2]], material: int, *, is_flat: bool
    ) -> Surface:
        """The ceiling over polygons (each an outline and its holes), facing down."""
        flat = horizontal("ceiling", parts, level.elevation, material, up=False)
        positions = flat.positions.astype(np.float64)
        heights = self.heights(level, positions[:, [0, 2]], is_flat)
        positions[:, 1] = level.elevation + heights
        return Surface(flat.name, positions.astype(np.float32), flat.faces, flat.material, flat.uvs)


def _nearest(point: Points2, segments: F64, tops: F64) -> float:
    # Height of the top of the wall edge nearest to a plan point, at the nearest spot.
    a, d = segments[:, :2], segments[:, 2:] - segments[:, :2]
    t = ((point - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-18)
    t = np.clip(t, 0, 1)
    gap = np.linalg.norm(a + t[:, None] * d - point, axis=1)
    k = int(gap.argmin())
    return float(tops[k, 0] + t[k] * (tops[k, 1] - tops[k, 0]))
