"""Pillows, cushions and a folded blanket on beds; they take the shape of what they lie on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from shapely import Polygon, contains_xy

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Room, Surface
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.generated.assembly import Made
from pbrs_farm.dress.generated.things import THINGS
from pbrs_farm.dress.generated.turned import smooth
from pbrs_farm.dress.supports.exact_heights import heights_under
from pbrs_farm.dress.supports.find_supports import plan_turn
from pbrs_farm.dress.supports.plan_grid import PlanGrid, cells_over, top_heights
from pbrs_farm.dress.supports.scene_triangles import SceneTriangles

_CELL_M = 0.02
_LEAST_AIR_M = 0.6  # above a mattress
TOUCH_M = 0.0003  # soft things keep this from what they lie on
_PILLOW_UP_M = 0.06  # what rises so far above the mattress is a pillow, or a board
_SUNK = 0.45  # of its half thickness that a pillow's middle stands above what it lies on


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
    """Put pillows, and now and then a cushion and a blanket, on items[index]; how many."""
    bed = lying_place(scene, index, placing.room)
    if bed is None or bed.width < 0.6 or bed.length < 1.2:
        placing.refuse("no place to lie found")
        return 0
    rng, n = placing.rng, 0
    if not _has_pillows(bed) and rng.random() < 0.95 * placing.share:
        # Both pillows of a bed are alike.
        own = int(rng.integers(1 << 30))
        made = THINGS.make("bed_pillow", np.random.default_rng(own), placing.style)
        apart = max(0.46, (made[0].size[0] + 0.02) / bed.width)
        fits = bed.width > 1.15 and apart * bed.width + made[0].size[0] < bed.width + 0.06
        for at in (0.5 - apart / 2, 0.5 + apart / 2) if fits else (0.5,):
            n += lay_down(placing, scene, index, made, *_place(bed, at, 0.06, made), bed.level)
    if rng.random() < 0.45 * placing.share:
        made = THINGS.make("cushion", rng, placing.style)
        at = float(rng.uniform(0.4, 0.6))
        n += lay_down(placing, scene, index, made, *_place(bed, at, 0.75, made), bed.level)
    if rng.random() < 0.65 * placing.share:
        # A folded blanket across the foot.
        made = THINGS.make("folded_blanket", rng, placing.style)
        at = float(rng.uniform(0.35, 0.65))
        from_head = bed.length - made[0].size[1] - float(rng.uniform(0.08, 0.25))
        n += lay_down(placing, scene, index, made, *_place(bed, at, from_head, made), bed.level)
    return n


def lying_place(scene: SceneTriangles, index: int, room: Room) -> Lying | None:
    """The mattress of a bed: the height that most of it has, between head and foot boards."""
    corners = scene.of_item(index)
    points = corners.reshape(-1, 3)
    if not len(points):
        return None
    turn = plan_turn(scene.items[index], points)
    grid = PlanGrid.around(points[:, [0, 2]], turn, _CELL_M, 0.0)
    # Turn it so that rows run along it, from the head.
    quarter = 0 if grid.shape[0] >= grid.shape[1] else 1
    if _foot_first(
        PlanGrid.around(points[:, [0, 2]], turn + quarter * np.pi / 2, _CELL_M, 0.0), corners, room
    ):
        quarter += 2
    grid = PlanGrid.around(points[:, [0, 2]], turn + quarter * np.pi / 2, _CELL_M, 0.0)
    tops = top_heights(grid, corners)
    level = _usual(tops[np.isfinite(tops)])
    flat = np.abs(tops - level) < 0.05
    rows = np.flatnonzero(flat.mean(1) > 0.4)
    columns = np.flatnonzero(flat.mean(0) > 0.4)
    if not len(rows) or not len(columns) or room.ceiling_y - level < _LEAST_AIR_M:
        return None
    return Lying(
        grid, tops, level, (int(rows[0]), int(rows[-1]) + 1), (int(columns[0]), int(columns[-1]) + 1)
    )  # fmt: skip


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


def _place(bed: Lying, across: float, from_head_m: float, made: Made) -> tuple[F64, float]:
    # World (x, z) of a thing that lies so far from the head, and its turn.
    depth = made[0].size[1]
    row = bed.rows[0] + (from_head_m + depth / 2) / bed.grid.cell_m
    column = bed.columns[0] + across * (bed.columns[1] - bed.columns[0])
    return bed.grid.plan_of(column, row), bed.grid.turn_rad


def lay_down(
    placing: Placing, scene: SceneTriangles, index: int, made: Made, plan: F64, turn_rad: float,
    level: float,
) -> bool:  # fmt: skip
    """Lay a soft thing down at a plan place (2,) on items[index]; False where something is there.

    It is pressed flat below: no point of it is lower than what it lies on.
    """
    piece, shape = made
    turn = rotation_y(turn_rad + float(placing.rng.normal(0, 0.05)))
    half = piece.size[2] / 2
    corners, others = around_thing(scene, index, plan, turn, np.asarray(piece.size), level)
    if others:
        placing.refuse("something lies on the bed or seat")
        return False
    # What is folded lies flat already; a cushion's middle sinks in, and what would be lower than
    # the surface is pressed up to it.
    sunk = 1.0 if piece.group == "blanket" else _SUNK
    pressed, gap = [], np.inf
    for surface in shape.surfaces:
        points = (surface.positions - [0, half, 0]) @ turn.T + [plan[0], 0, plan[1]]
        ground = heights_under(points[:, [0, 2]], corners, level + 0.12)
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
    put_as_it_is(placing, made, surfaces)
    return True


def around_thing(
    scene: SceneTriangles, index: int, plan: F64, turn: F64, size: F64, level: float
) -> tuple[F64, bool]:
    """Faces of items[index] under a thing (width, depth, height) at plan, and whether others meet it."""
    outline = np.array([[x, 0, z] for x in (-0.5, 0.5) for z in (-0.5, 0.5)]) * [
        size[0],
        1,
        size[1],
    ]
    outline = (outline @ turn.T)[:, [0, 2]] + plan
    low = np.array([outline[:, 0].min(), level - 0.3, outline[:, 1].min()])
    high = np.array([outline[:, 0].max(), level + _LEAST_AIR_M - 0.1, outline[:, 1].max()])
    corners, owner = scene.in_box(low, high)
    angle = float(np.arctan2(turn[0, 2], turn[0, 0]))
    grid = PlanGrid.around(outline, angle, _CELL_M, 0.0)
    hits = cells_over(grid, corners[owner != index], touched=True)
    # A closed body is known by its bottom or its top.
    meets = (hits.high > level - 0.01) & (hits.low < high[1])
    return corners[owner == index], bool(meets.any())


def put_as_it_is(placing: Placing, made: Made, surfaces: list[Surface]) -> None:
    """Add a thing whose surfaces (in the order of its shape's) stand in the world already."""
    piece, shape = made
    kept = tuple(
        replace(surface, material=old.material)
        for surface, old in zip(surfaces, shape.surfaces, strict=True)
    )
    points = np.concatenate([s.positions for s in kept]).astype(np.float64)
    low, high = points.min(0), points.max(0)
    base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    moved = tuple(replace(s, positions=(s.positions - base).astype(np.float32)) for s in kept)
    placing.put((piece, Shape(moved, shape.materials, shape.textures)), base, 0.0)
