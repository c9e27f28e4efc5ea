"""Lays pillows, cushions and a folded blanket on beds; they take the shape of what they lie on. Effects: changes the house."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from shapely import Polygon, contains_xy

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Room
from pbrs_farm.dress.clutter.cloths import drop_clothes, lay_duvet
from pbrs_farm.dress.clutter.cushions import (
    CELL_M,
    LEAST_AIR_M,
    TOUCH_M,
    around_thing,
    put_as_it_is,
)
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.supports import plan_turn
from pbrs_farm.geometry.bodies import smooth
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.plan_grid import PlanGrid, top_heights
from pbrs_farm.geometry.scene_triangles import SceneTriangles

_DOUBLE_M = 1.08  # a mattress at least this wide gets two pillows
_PILLOW_SUNK = 0.45  # height of a pillow's centre above its support, in half thicknesses


@dataclass(frozen=True, slots=True, eq=False)
class Lying:
    """The flat part of a bed, seen from above, its head at the grid's back."""

    grid: PlanGrid
    tops: F64  # (rows, columns) heights; -inf = nothing
    level: float  # world y of the mattress
    rows: tuple[int, int]  # from the head to the foot, on the mattress
    columns: tuple[int, int]

    @property
    def width(self) -> float:
        """Across, metres."""
        return (self.columns[1] - self.columns[0]) * self.grid.cell_m

    @property
    def length(self) -> float:
        """From head to foot, metres."""
        return (self.rows[1] - self.rows[0]) * self.grid.cell_m


def dress_bed(placing: Placing, scene: SceneTriangles, index: int) -> int:
    """Put pillows and maybe a cushion and a blanket on items[index]; how many, 0 (counted) if too small."""
    bed = lying_place(scene, index, placing.room)
    if bed is None or bed.width < 0.6 or bed.length < 1.2:
        placing.refuse("no place to lie found")
        return 0
    rng, n = placing.rng, 0
    if not _has_pillows(bed) and rng.random() < 0.95 * placing.share:
        # Both pillows of a bed are alike.
        pillow_seed = int(rng.integers(1 << 30))
        pillow = content().things["bed_pillow"](np.random.default_rng(pillow_seed), placing.style)
        is_double = bed.width > _DOUBLE_M
        most = (bed.width + 0.04) / 2 - 0.02 if is_double else bed.width
        if pillow[0].size[0] > most:
            pillow = _narrowed(pillow, most / pillow[0].size[0])
        spacing = max(0.46, (pillow[0].size[0] + 0.02) / bed.width)
        for x in (0.5 - spacing / 2, 0.5 + spacing / 2) if is_double else (0.5,):
            n += lay_down(
                placing, scene, index, pillow, *_place_on_bed(bed, x, 0.06, pillow), bed.level
            )
        # Who sleeps there has a duvet, below the pillows.
        first = bed.rows[0] * bed.grid.cell_m + 0.06 + pillow[0].size[1] + 0.08
        sides = bed.columns[0] * bed.grid.cell_m, bed.columns[1] * bed.grid.cell_m
        rows = first, bed.rows[1] * bed.grid.cell_m
        duvet = lay_duvet(placing, scene, index, bed.grid, sides, rows, bed.level)
        if rng.random() < placing.house.mess and duvet is not None:
            _drop_on(placing, scene, duvet)
        return n + (duvet is not None)
    if rng.random() < 0.45 * placing.share:
        # A cushion leans where the pillows end, not across the bed's middle.
        pillow = content().things["cushion"](rng, placing.style)
        x = float(rng.uniform(0.35, 0.65))
        n += lay_down(
            placing, scene, index, pillow, *_place_on_bed(bed, x, 0.56, pillow), bed.level
        )
    if rng.random() < 0.65 * placing.share:
        # A folded blanket across the foot.
        pillow = content().things["folded_blanket"](rng, placing.style)
        x = float(rng.uniform(0.35, 0.65))
        from_head = bed.length - pillow[0].size[1] - float(rng.uniform(0.08, 0.25))
        n += lay_down(
            placing, scene, index, pillow, *_place_on_bed(bed, x, from_head, pillow), bed.level
        )
    return n


def _narrowed(model: Model, factor: float) -> Model:
    """The item with its width scaled."""
    piece, shape = model
    scale = np.array([factor, 1.0, 1.0])
    surfaces = tuple(
        smooth(s.name, s.positions.astype(np.float64) * scale, s.faces) for s in shape.surfaces
    )
    surfaces = tuple(
        replace(s, material=old.material) for s, old in zip(surfaces, shape.surfaces, strict=True)
    )
    size = (piece.size[0] * factor, *piece.size[1:])
    return replace(piece, size=size), Shape(surfaces, shape.materials, shape.textures)


def _drop_on(placing: Placing, scene: SceneTriangles, corners: F64) -> None:
    """Drop a garment somewhere on laid cloth, given by its triangles."""
    low, high = corners.min((0, 1)), corners.max((0, 1))
    position = low + (high - low) * placing.rng.uniform(0.3, 0.7, 3)
    drop_clothes(placing, scene, position[[0, 2]], float(high[1]))


def lying_place(scene: SceneTriangles, index: int, room: Room) -> Lying | None:
    """The mattress of a bed, rows from its higher (or wall) end, its head; None without a level, free part."""
    corners = scene.of_item(index)
    points = corners.reshape(-1, 3)
    if not len(points):
        return None
    turn = plan_turn(scene.items[index], points)
    grid = PlanGrid.around(points[:, [0, 2]], turn, CELL_M, 0.0)
    # Turn it so that rows run along it, from the head.
    quarter = 0 if grid.shape[0] >= grid.shape[1] else 1
    if _foot_first(
        PlanGrid.around(points[:, [0, 2]], turn + quarter * np.pi / 2, CELL_M, 0.0), corners, room
    ):
        quarter += 2
    grid = PlanGrid.around(points[:, [0, 2]], turn + quarter * np.pi / 2, CELL_M, 0.0)
    tops = top_heights(grid, corners)
    level = _usual(tops[np.isfinite(tops)])
    flat = np.abs(tops - level) < 0.05
    rows = np.flatnonzero(flat.mean(1) > 0.4)
    columns = np.flatnonzero(flat.mean(0) > 0.4)
    if not len(rows) or not len(columns) or room.ceiling_y - level < LEAST_AIR_M:
        return None
    return Lying(
        grid,
        tops,
        level,
        (int(rows[0]), int(rows[-1]) + 1),
        (int(columns[0]), int(columns[-1]) + 1),
    )


def _usual(heights: F64) -> float:
    # The middle of the two centimetres that hold most of the heights.
    if not len(heights):
        return 0.0
    bins = np.round(heights / 0.02).astype(np.int64)
    values, counts = np.unique(bins, return_counts=True)
    best = values[int(np.argmax(counts))]
    return float(np.median(heights[bins == best]))


def _foot_first(grid: PlanGrid, corners: F64, room: Room) -> bool:
    # The head is the higher end; else the one at the wall.
    tops = top_heights(grid, corners)
    tops = np.where(np.isfinite(tops), tops, tops[np.isfinite(tops)].min(initial=0.0))
    end = max(2, round(0.25 / grid.cell_m))
    back, front = float(tops[:end].max()), float(tops[-end:].max())
    if abs(back - front) > 0.05:
        return front > back
    middle = grid.shape[1] / 2
    behind = grid.plan_of(middle, -0.3 / grid.cell_m)
    ahead = grid.plan_of(middle, grid.shape[0] + 0.3 / grid.cell_m)
    area = Polygon(room.polygon)
    return bool(contains_xy(area, *behind) and not contains_xy(area, *ahead))


def _has_pillows(bed: Lying) -> bool:
    # Something on the mattress near the head is higher than it.
    first = bed.rows[0] + round(0.1 / bed.grid.cell_m)
    part = bed.tops[first : first + round(0.3 / bed.grid.cell_m), bed.columns[0] : bed.columns[1]]
    return bool((part > bed.level + 0.03).mean() > 0.15)


def _place_on_bed(bed: Lying, across: float, from_head_m: float, model: Model) -> tuple[F64, float]:
    # World (x, z) of an item at a distance from the head, and its rotation.
    depth = model[0].size[1]
    row = bed.rows[0] + (from_head_m + depth / 2) / bed.grid.cell_m
    column = bed.columns[0] + across * (bed.columns[1] - bed.columns[0])
    return bed.grid.plan_of(column, row), bed.grid.turn_rad


def lay_down(
    placing: Placing,
    scene: SceneTriangles,
    index: int,
    model: Model,
    plan: F64,
    turn_rad: float,
    level: float,
) -> bool:
    """Lay a soft item at a plan position (2,) on items[index], flat below; False if occupied."""
    piece, shape = model
    turn = rotation_y(turn_rad + float(placing.rng.normal(0, 0.05)))
    half = piece.size[2] / 2
    corners, overlaps = around_thing(scene, index, plan, turn, np.asarray(piece.size), level)
    if overlaps:
        placing.refuse("something lies on the bed or seat")
        return False
    # Folded items are flat already; a cushion's centre sinks in, and lower points are pressed up to
    # the
    # surface.
    sunk = 1.0 if piece.group == "blanket" else _PILLOW_SUNK
    pressed, gap = [], np.inf
    for surface in shape.surfaces:
        points = (surface.positions - [0, half, 0]) @ turn.T + [plan[0], 0, plan[1]]
        ground = highest_below(points[:, [0, 2]], corners, level + 0.12)
        points[:, 1] = np.maximum(points[:, 1] + level + sunk * half, ground + TOUCH_M)
        gap = min(gap, float((points[:, 1] - ground).min()))
        pressed.append(points)
    if not np.isfinite(gap):
        placing.refuse("nothing to lie on")
        return False
    # Lower it to contact where the bed is not flat.
    fall = np.array([0.0, gap - TOUCH_M, 0.0])
    surfaces = [
        smooth(s.name, points - fall, s.faces)
        for s, points in zip(shape.surfaces, pressed, strict=True)
    ]
    put_as_it_is(placing, model, surfaces)
    return True
