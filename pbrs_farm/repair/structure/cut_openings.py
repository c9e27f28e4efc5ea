"""Cut openings through both faces of their walls, and make the plugs that fill them; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from manifold3d import Manifold

from pbrs_farm.core.house import House, Opening, Surface
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import (
    TagTable,
    bounds,
    common,
    overlap_of_bounds,
    patches_from_solid,
    solid_from_patches,
    subtract,
    unite,
)
from pbrs_farm.repair.structure.closed_shells import patch_from_surface, surface_from_patch
from pbrs_farm.repair.structure.slabs import GAP_M
from pbrs_farm.repair.structure.walls import REVEAL, Wall

_MIN_VOLUME_M3 = 1e-9  # of what an opening cuts; less is a touch


@dataclass(frozen=True, slots=True, eq=False)
class WallPart:
    """A solid of a wall."""

    wall: Wall
    solid: Manifold
    is_joint: bool  # added by repair, else the wall's own


def thresholds(house: House, walls: Sequence[Wall]) -> plan.Shape:
    """Plan area of the openings (doors, some windows) that reach down to the foot of their wall."""
    areas = []
    for opening in house.openings:
        cutter = opening.cutter
        area = plan.polygon_of_triangles(cutter.positions.astype(float), cutter.faces)
        low = float(cutter.positions[:, 1].min())
        # Keep the area over walls whose foot is as low as the opening.
        feet = [w.footprint for w in walls if abs(w.bottom_y - low) < GAP_M]
        areas.append(plan.common(area, plan.union(feet)))
    return plan.union(areas)


def cut_openings(
    openings: Sequence[Opening], parts: Sequence[WallPart], table: TagTable
) -> tuple[list[Manifold], dict[str, tuple[Surface, ...]], list[str]]:
    """Each part minus its openings; plugs as thick as the walls, by opening; ids that cut nothing."""
    cutters_of: list[list[Manifold]] = [[] for _ in parts]
    plugs: dict[str, tuple[Surface, ...]] = {}
    for opening in openings:
        fills = []
        # Pass over parts whose box the opening does not meet.
        reach = np.stack([opening.cutter.positions.min(0), opening.cutter.positions.max(0)])
        for k, part in enumerate(parts):
            if (overlap_of_bounds(bounds(part.solid), reach) <= 0).any():
                continue
            # Leave walls alone that the source has cut itself.
            if opening.is_cut and not part.is_joint:
                continue
            cutter = _cutter(opening, part.wall, table)
            if cutter is None:
                continue
            # Remember what the cut takes away: together it is the plug.
            fill = common(part.solid, cutter)
            if fill.volume() > _MIN_VOLUME_M3:
                cutters_of[k].append(cutter)
                fills.append(fill)
        if opening.is_cut:
            plugs[opening.id] = (opening.cutter,)
        elif fills:
            plug = patches_from_solid(unite(fills), table)
            plugs[opening.id] = tuple(s for p in plug if (s := surface_from_patch(p)) is not None)
    # Cut all openings of a part together.
    idle = [o.id for o in openings if o.id not in plugs]
    cut = [subtract(p.solid, c) for p, c in zip(parts, cutters_of, strict=True)]
    return cut, plugs, idle


def _cutter(opening: Opening, wall: Wall, table: TagTable) -> Manifold | None:
    patch = patch_from_surface(opening.cutter, wall.item)
    return solid_from_patches([replace(patch, tag=wall.tag(REVEAL))], table)
