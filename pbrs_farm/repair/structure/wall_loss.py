"""Area of every wall, floor and ceiling before and after repair; no effects.

A wall is measured from the side, along its thickness, with its openings already cut out: the
difference is the area that repair cut away. Floors and ceilings are measured from above.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import shapely
from manifold3d import Manifold

from pbrs_farm.core.house import House, Item, ItemKind, Opening, Surface
from pbrs_farm.repair.repair_report import SideArea, WallLoss
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import TagTable
from pbrs_farm.repair.structure.cut_openings import WallPart, cut_openings
from pbrs_farm.repair.structure.own_sides import along_and_across
from pbrs_farm.repair.structure.walls import Wall

MAX_LOST_SHARE = 0.1
"""A wall that loses more of its side is a fault of the repair."""

_LEAST_M2 = 0.01  # less is lost to rounding


def side_areas(
    house: House,
    walls: Sequence[Wall],
    cut: Sequence[Wall],
    left: Sequence[Manifold],
    surfaces: Mapping[int, Sequence[Surface]],
    table: TagTable,
) -> tuple[SideArea, ...]:
    """Square metres of every structure item before and after.

    walls: before any cut. cut: trimmed by other rooms; left: with their openings cut too, in the same
    order. surfaces: item index -> new surfaces; other items are unchanged.
    """
    before, after = [0.0] * len(house.items), [0.0] * len(house.items)
    for wall, cut_wall, rest in zip(walls, cut, left, strict=True):
        area = _seen_from_the_side(rest, wall.footprint)
        after[wall.item] += area
        # Cut the openings out of the wall as it was; where nothing else was cut, that is the rest.
        if cut_wall.solid is not wall.solid:
            area = _seen_from_the_side(
                _cut_openings_of_wall(house.openings, wall, table), wall.footprint
            )
        before[wall.item] += area
    uprights = {w.item for w in walls}
    rows = []
    for index, item in enumerate(house.items):
        if not item.kind.is_structure:
            continue
        if index not in uprights:
            before[index] = _seen_from_above(item.surfaces)
            after[index] = _seen_from_above(surfaces.get(index, item.surfaces))
        rows.append(_side_area_of(item, before[index], after[index]))
    return tuple(rows)


def lost_walls(areas: Iterable[SideArea]) -> tuple[WallLoss, ...]:
    """The walls whose side lost more than MAX_LOST_SHARE and _LEAST_M2."""
    return tuple(
        WallLoss(item_id=a.item_id, before_m2=a.before_m2, after_m2=a.after_m2)
        for a in areas
        if a.kind == ItemKind.WALL
        and a.before_m2 - a.after_m2 > max(MAX_LOST_SHARE * a.before_m2, _LEAST_M2)
    )


def _cut_openings_of_wall(openings: Sequence[Opening], wall: Wall, table: TagTable) -> Manifold:
    # Where the source has cut the walls already, nothing is cut: their solids have the holes.
    return cut_openings(openings, [WallPart(wall, wall.solid, is_joint=False)], table)[0][0]


def _seen_from_the_side(solid: Manifold, footprint: plan.Shape) -> float:
    if solid.is_empty() or footprint.is_empty:
        return 0.0
    # Turn the wall so that its thickness is along z, and project along z.
    along, across = along_and_across(footprint)
    turned = np.zeros((3, 4))
    turned[0, [0, 2]], turned[1, 1], turned[2, [0, 2]] = along, 1.0, across
    return float(solid.transform(turned).project().area())


def _seen_from_above(surfaces: Iterable[Surface]) -> float:
    shapes = [plan.polygon_of_triangles(s.positions.astype(float), s.faces) for s in surfaces]
    return float(shapely.area(plan.union(shapes)))


def _side_area_of(item: Item, before: float, after: float) -> SideArea:
    return SideArea(
        item_id=item.id, kind=str(item.kind), before_m2=round(before, 3), after_m2=round(after, 3)
    )
