"""Walls and baseboards -> items: closed, uncut, mitred solids; no effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import WALL
from pbrs_farm.core.house import Item, ItemKind, Surface
from pbrs_farm.geometry.solids import wall_prism
from pbrs_farm.read.sweethome3d.home_file.home_xml import (
    Baseboard,
    HomePlan,
    HomeWall,
    Paint,
    PlanLevel,
    PlanPicture,
    level_of,
)
from pbrs_farm.read.sweethome3d.home_materials import HomeMaterials
from pbrs_farm.read.sweethome3d.wall_outlines import Outline, outlines_of

SUNK_M = 0.002  # Depth of a baseboard's back inside its wall, to avoid coplanar faces


def wall_items(
    plan: HomePlan,
    outlines: dict[str, Outline],
    materials: HomeMaterials,
    house_level: dict[str, str],
) -> list[Item]:
    """An item for each visible wall, closed, mitred, without holes, each followed by its baseboards."""
    items: list[Item] = []
    widened = outlines_of(tuple(_with_baseboards(w) for w in plan.walls))
    for wall in plan.walls:
        level = level_of(plan, wall.level)
        if not level.is_visible:
            continue
        outline = outlines.get(wall.id)
        place = f"wall {wall.id}"
        if outline is None:
            materials.notes.add("degenerate-wall", place, "no length or no thickness: left out")
            continue
        if max(wall.height, wall.height_end or 0.0) <= 1e-3:
            materials.notes.add("degenerate-wall", place, "no height: left out")
            continue
        level_id = house_level[level.id]
        items.append(_wall_item(wall, outline, level, materials, level_id))
        for board in wall.baseboards:
            sides = (outline, widened[wall.id])
            item = _baseboard_item(wall, board, sides, level, materials, level_id)
            if item is not None:
                items.append(item)
    return items


def top_heights(wall: HomeWall, points: F64, along: F64) -> F64:
    """(N,) heights above the level of a wall's top, planar or, of an arc, along it, over plan points."""
    low, high = wall.height, wall.height if wall.height_end is None else wall.height_end
    if wall.height_end is None or abs(wall.arc) > 1e-3:
        return np.asarray(low + (high - low) * along)
    start, end = np.array(wall.start), np.array(wall.end)
    direction = end - start
    t = (points - start) @ direction / float(direction @ direction)
    return np.asarray(np.maximum(low + (high - low) * t, 0.0))


def _wall_item(
    wall: HomeWall, outline: Outline, level: PlanLevel, materials: HomeMaterials, level_id: str
) -> Item:
    place = f"wall {wall.id}"
    sides = (
        materials.painted(wall.left, "wall", f"{place} left"),
        materials.painted(wall.right, "wall", f"{place} right"),
        materials.painted(wall.right if wall.left.is_empty else wall.left, "wall", place),
    )
    # Extend the wall down through the floor slab.
    foot = level.elevation - level.reach_down
    left_top = level.elevation + top_heights(wall, outline.left, outline.along)
    right_top = level.elevation + top_heights(wall, outline.right, outline.along)
    surfaces = wall_prism(
        outline.left,
        outline.right,
        foot,
        np.maximum(left_top, foot + 1e-3),
        np.maximum(right_top, foot + 1e-3),
        sides,
        top=materials.painted(wall.top, "wall top", f"{place} top"),
    )
    painted = tuple(
        _textured(s, paint, level.elevation)
        for s, paint in zip(surfaces, (wall.left, wall.right, *[Paint()] * 4), strict=True)
    )
    return Item(
        id=f"wall_{wall.id}",
        name=f"Wall {wall.id}",
        kind=ItemKind.WALL,
        level_id=level_id,
        surfaces=painted,
        nyu40=WALL,
        source_class="wall",
        tags=("arc",) if abs(wall.arc) > 1e-3 else (),
    )


def _baseboard_item(
    wall: HomeWall,
    board: Baseboard,
    outlines: tuple[Outline, Outline],
    level: PlanLevel,
    materials: HomeMaterials,
    level_id: str,
) -> Item | None:
    side = "left" if board.is_left else "right"
    line, front = (o.left if board.is_left else o.right for o in outlines)
    back = line - SUNK_M * (_outward(line) if board.is_left else -_outward(line))
    # End the board below the lowest top of the wall.
    height = min(board.height, float(top_heights(wall, line, outlines[0].along).min()))
    if height <= 1e-3:
        return None
    # A board without paint takes its side's.
    paint = board.paint
    if paint.is_empty:
        paint = wall.left if board.is_left else wall.right
    material = materials.painted(paint, "baseboard", f"wall {wall.id} {side} baseboard")
    top = np.full(len(line), level.elevation + height)
    near, far = (front, back) if board.is_left else (back, front)
    surfaces = wall_prism(near, far, level.elevation, top, top, (material,) * 3)
    return Item(
        id=f"wall_{wall.id}_{side}_baseboard",
        name=f"Baseboard of wall {wall.id}, {side}",
        kind=ItemKind.WALL,
        level_id=level_id,
        surfaces=tuple(_textured(s, paint, level.elevation) for s in surfaces),
        nyu40=WALL,
        source_class="baseboard",
        tags=("baseboard", f"baseboard_of:wall_{wall.id}"),
    )


def _with_baseboards(wall: HomeWall) -> HomeWall:
    # The wall thickened by its baseboards, whose mitred outline is the boards' front.
    most = max((b.thickness for b in wall.baseboards), default=0.0)
    return replace(wall, thickness=wall.thickness + 2 * most)


def _outward(line: F64) -> F64:
    # Unit vectors to the left of a polyline (plan with y down), mitred at its inner points.
    step = np.diff(line, axis=0)
    step = step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    normal = np.stack([step[:, 1], -step[:, 0]], -1)
    mean = np.concatenate([normal[:1], normal[:-1] + normal[1:], normal[-1:]])
    # Lengthen the mitre, so that the offset lines keep their distance.
    mean[1:-1] /= np.maximum((mean[1:-1] * normal[1:]).sum(1, keepdims=True), 1e-6)
    return np.asarray(mean)


def _textured(surface: Surface, paint: Paint, floor_y: float) -> Surface:
    picture = paint.picture
    if picture is None or surface.uvs is None:
        return surface
    metres = surface.uvs.astype(np.float64)
    # Measure v from the level's floor: textures of neighbouring walls meet.
    metres[:, 1] = surface.positions[:, 1] - floor_y
    return replace(surface, uvs=picture_uvs(metres, picture).astype(np.float32))


def picture_uvs(metres: F64, picture: PlanPicture) -> F64:
    """(N, 2) texture coordinates of points given in metres along a surface (right, up)."""
    c, s = np.cos(picture.angle), np.sin(picture.angle)
    # Turn, scale to the picture's size, then move by its offset.
    turned = metres @ np.array([[c, -s], [s, c]])
    size = np.array([picture.width, picture.height]) * picture.scale
    return np.asarray(turned / size - np.array(picture.offset))
