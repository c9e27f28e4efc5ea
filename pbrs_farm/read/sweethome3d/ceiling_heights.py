"""How high a room's ceiling is: its level's height, or the tops of the walls around. No effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrs_farm.core.arrays import F64, Points2
from pbrs_farm.core.house import Surface
from pbrs_farm.geometry.roofs import level_or_sloped
from pbrs_farm.read.sweethome3d.home_file.home_xml import HomePlan, PlanLevel, level_of
from pbrs_farm.read.sweethome3d.wall_outlines import Outline
from pbrs_farm.read.sweethome3d.wall_solids import top_heights

KINK_M = 0.01  # smaller bends of a ceiling are left out
TIE_M = 1e-3  # walls are equally near within this
CORNER_REACH_M = 0.10  # A wall's corner this near to a room's edge can bend the ceiling there


class CeilingHeights:
    """Ceiling heights above the level, in metres; on the top level they follow the walls."""

    def __init__(self, plan: HomePlan, outlines: dict[str, Outline]) -> None:
        self._top = max((x.index for x in plan.levels), default=0)
        self._wall_height = plan.wall_height
        by_level: dict[str, list[tuple[F64, F64]]] = {}
        # Collect the top edges of all walls of a level: plan segments and heights at their ends.
        for wall in plan.walls:
            if wall.id not in outlines:
                continue
            outline, around = outlines[wall.id], outlines[wall.id].polygon
            along = np.concatenate([outline.along, outline.along[::-1]])
            tops = top_heights(wall, around, along)
            a, b = np.arange(len(around)), np.roll(np.arange(len(around)), -1)
            segments = np.concatenate([around[a], around[b]], 1)
            edges = (segments, np.stack([tops[a], tops[b]], 1))
            by_level.setdefault(level_of(plan, wall.level).id, []).append(edges)
        self._edges = {
            level_id: (np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts]))
            for level_id, parts in by_level.items()
        }

    def heights(self, level: PlanLevel, points: Points2, is_flat: bool) -> F64:
        """(N,) heights over plan points (N, 2)."""
        edges = self._edges.get(level.id)
        # Below the top level the ceiling is flat, at the level's height.
        if level.index != self._top or edges is None:
            height = level.height if level.id else self._wall_height
            return np.full(len(points), height)
        heights = np.array([_nearest_wall_top(p, *edges) for p in points])
        return np.full(len(points), heights.max()) if is_flat else heights

    def highest(self, level: PlanLevel, ring: Points2, *, is_flat: bool) -> float:
        """The height of the ceiling's highest place over an outline (N, 2), a gable's ridge too."""
        bent = self._with_kinks(level, ring, is_flat)
        return float(self.heights(level, bent, is_flat).max())

    def surface(
        self, level: PlanLevel, parts: Sequence[Sequence[Points2]], material: int, *, is_flat: bool
    ) -> Surface:
        """The ceiling over polygons (each an outline and its holes), facing down."""
        bent = [[self._with_kinks(level, ring, is_flat) for ring in rings] for rings in parts]
        heights = [self.heights(level, np.concatenate(rings), is_flat) for rings in bent]
        return level_or_sloped("ceiling", bent, [level.elevation + h for h in heights], material)

    def _with_kinks(self, level: PlanLevel, ring: Points2, is_flat: bool) -> Points2:
        # The ring with the points where the walls' tops beside one of its edges bend.
        edges = self._edges.get(level.id)
        if level.index != self._top or edges is None or is_flat:
            return ring
        corners = np.unique(edges[0][:, :2], axis=0)
        points: list[F64] = []
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            points.append(a)
            d = b - a
            length = float(np.linalg.norm(d))
            # Take the walls' corners that lie along this edge of the room.
            t = (corners - a) @ d / max(length**2, 1e-18)
            gap = np.linalg.norm(a + t[:, None] * d - corners, axis=1)
            inside = (gap < CORNER_REACH_M) & (t * length > KINK_M) & ((1 - t) * length > KINK_M)
            # Keep a corner where the ceiling leaves the straight line between the edge's ends.
            ends = self.heights(level, np.stack([a, b]), False)
            last = 0.0
            for where in np.sort(t[inside]):
                if (where - last) * length < KINK_M:
                    continue
                spot = a + where * d
                straight = ends[0] + where * (ends[1] - ends[0])
                if abs(self.heights(level, spot[None], False)[0] - straight) > KINK_M:
                    points.append(spot)
                    last = float(where)
        return np.array(points)


def _nearest_wall_top(point: Points2, segments: F64, tops: F64) -> float:
    # Height of the top of the wall edge nearest to a plan point, at the nearest spot; the lowest
    # of those equally near, so that no wall ends below the ceiling.
    a, d = segments[:, :2], segments[:, 2:] - segments[:, :2]
    t = ((point - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-18)
    # The nearest spot on each edge, and the height of the wall there.
    t = np.clip(t, 0, 1)
    gap = np.linalg.norm(a + t[:, None] * d - point, axis=1)
    heights = tops[:, 0] + t * (tops[:, 1] - tops[:, 0])
    return float(heights[gap <= gap.min() + TIE_M].min())
