"""Staircases -> what they cut out of floors and ceilings. No effects."""

from __future__ import annotations

import numpy as np
import shapely

from pbrs_farm.read.sweethome3d.home_file.home_xml import HomePlan, PlanPiece, level_of
from pbrs_farm.read.sweethome3d.home_materials import HomeMaterials
from pbrs_farm.read.sweethome3d.placement import PieceFrame, frame_of
from pbrs_farm.read.sweethome3d.svg_outlines import polygons_from_path

TOLERANCE_M = 0.01  # heights that differ less are equal

Cuts = dict[str, shapely.Geometry]


def staircase_cuts(
    plan: HomePlan, materials: HomeMaterials, house_level: dict[str, str]
) -> tuple[Cuts, Cuts]:
    """By level id, what staircases take of its floors and of its ceilings (plan polygons).

    A floor is cut by a staircase that starts below it and reaches it, the ceiling under such a
    floor likewise. A ceiling with no visible level above stays whole, so that no sky looks in.
    """
    floors: dict[str, list[shapely.Geometry]] = {}
    ceilings: dict[str, list[shapely.Geometry]] = {}
    visible = [level for level in plan.levels if level.is_visible]
    for piece in plan.pieces:
        if not piece.staircase_cut_out or piece.staircase_cut_out.lower() == "false":
            continue
        own_level = level_of(plan, piece.level)
        if not own_level.is_visible:
            continue
        # Cut the floors that it leads up to, and the ceilings it passes.
        hole = _hole(piece, frame_of(piece, own_level), materials)
        if hole is None:
            continue
        foot = own_level.elevation + piece.elevation
        top = foot + piece.size[2]
        for level in visible:
            reach = level.elevation - level.reach_down - TOLERANCE_M
            if foot < level.elevation - TOLERANCE_M and top >= reach:
                floors.setdefault(house_level[level.id], []).append(hole)
        for level in visible:
            ceiling = level.elevation + level.height
            has_above = any(x.elevation >= ceiling - TOLERANCE_M for x in visible)
            if foot < ceiling and top >= ceiling - TOLERANCE_M and has_above:
                ceilings.setdefault(house_level[level.id], []).append(hole)
    return _join_cuts(floors), _join_cuts(ceilings)


def _join_cuts(cuts: dict[str, list[shapely.Geometry]]) -> Cuts:
    return {level: shapely.union_all(holes) for level, holes in cuts.items()}


def _hole(piece: PlanPiece, frame: PieceFrame, materials: HomeMaterials) -> shapely.Geometry | None:
    # The cut-out shape is drawn in the unit square, x to the right, y to the front.
    try:
        outlines = polygons_from_path(piece.staircase_cut_out)
    except ValueError as error:
        materials.notes.add(
            "bad-cut-out", piece.place, f"staircaseCutOutShape: {error}; nothing is cut"
        )
        return None
    shapes = []
    for outline in outlines:
        x = (outline[:, 0] - 0.5) * 2 * frame.half[0] * frame.mirror
        z = (outline[:, 1] - 0.5) * 2 * frame.half[2]
        world = frame.world(np.stack([x, np.zeros(len(x)), z], -1))
        polygon = shapely.Polygon(world[:, [0, 2]])
        shapes.append(polygon if polygon.is_valid else shapely.make_valid(polygon))
    return shapely.union_all(shapes) if shapes else None
