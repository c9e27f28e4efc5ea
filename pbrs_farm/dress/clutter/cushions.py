"""Pillows, cushions and blankets: on beds, sofas and armchairs, in the shape of what they lie on; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from shapely import Polygon, contains_xy

from pbrs_farm.core.arrays import F64, I32, Bools
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Room, Surface
from pbrs_farm.dress.clutter.cloths import drop_clothes, lay_duvet
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.supports import plan_turn
from pbrs_farm.dress.things import soft
from pbrs_farm.dress.things.assembly import Made
from pbrs_farm.dress.things.bodies import smooth
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.plan_grid import PlanGrid, cells_over, top_heights
from pbrs_farm.geometry.scene_triangles import SceneTriangles

# Pillows, cushions and a folded blanket on beds; they take the shape of what they lie on.


_CELL_M = 0.02
_DOUBLE_M = 1.08  # from which a mattress is wide enough for two pillows
_LEAST_AIR_M = 0.6  # above a mattress
TOUCH_M = 0.0003  # soft things keep this from what they lie on
_PILLOW_UP_M = 0.06  # what rises so far above the mattress is a pillow, or a board
_PILLOW_SUNK = 0.45  # of its half thickness that a pillow's middle stands above what it lies on


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
        made = soft.bed_pillow.make(np.random.default_rng(own), placing.style)
        is_double = bed.width > _DOUBLE_M
        most = (bed.width + 0.04) / 2 - 0.02 if is_double else bed.width
        if made[0].size[0] > most:
            made = _narrowed(made, most / made[0].size[0])
        apart = max(0.46, (made[0].size[0] + 0.02) / bed.width)
        for at in (0.5 - apart / 2, 0.5 + apart / 2) if is_double else (0.5,):
            n += lay_down(placing, scene, index, made, *_place(bed, at, 0.06, made), bed.level)
        # Who sleeps there has a duvet, below the pillows.
        first = bed.rows[0] * bed.grid.cell_m + 0.06 + made[0].size[1] + 0.08
        sides = bed.columns[0] * bed.grid.cell_m, bed.columns[1] * bed.grid.cell_m
        rows = first, bed.rows[1] * bed.grid.cell_m
        duvet = lay_duvet(placing, scene, index, bed.grid, sides, rows, bed.level)
        if rng.random() < placing.draft.mess:
            _drop_on(placing, scene, duvet)
        return n + 1
    if rng.random() < 0.45 * placing.share:
        # A cushion leans where the pillows end, not across the bed's middle.
        made = soft.cushion.make(rng, placing.style)
        at = float(rng.uniform(0.35, 0.65))
        n += lay_down(placing, scene, index, made, *_place(bed, at, 0.56, made), bed.level)
    if rng.random() < 0.65 * placing.share:
        # A folded blanket across the foot.
        made = soft.folded_blanket.make(rng, placing.style)
        at = float(rng.uniform(0.35, 0.65))
        from_head = bed.length - made[0].size[1] - float(rng.uniform(0.08, 0.25))
        n += lay_down(placing, scene, index, made, *_place(bed, at, from_head, made), bed.level)
    return n


def _narrowed(made: Made, factor: float) -> Made:
    """The thing with its width scaled."""
    piece, shape = made
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
    """Drop a garment somewhere on cloth that was laid, given by its triangles."""
    low, high = corners.min((0, 1)), corners.max((0, 1))
    at = low + (high - low) * placing.rng.uniform(0.3, 0.7, 3)
    drop_clothes(placing, scene, at[[0, 2]], float(high[1]))


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


# Cushions on sofas and armchairs.


_SEAT_M = (0.22, 0.62)  # heights of seats above the floor
_BACK_M = 0.15  # a back is at least so much higher than the seat
_LEAST_DEPTH_M = 0.3  # of a seat
_SUNK = 0.55  # of its half thickness that a cushion's middle keeps from the back
_MOST_PRESSED_M = 0.03  # that a cushion gives way
_SINKS_M = 0.0015  # of a cushion into the seat, so that its lowest edge touches, too
_SIDE_M = 0.04  # kept from arms


@dataclass(frozen=True, slots=True, eq=False)
class Seat:
    """A seat with a back, seen from above; the grid's back rows are at the back."""

    grid: PlanGrid
    level: float  # world y of the seat
    back_row: F64  # (columns,) first row before the back, in cells; NaN = no seat there


def dress_seat(placing: Placing, scene: SceneTriangles, index: int, most: int) -> int:
    """Lean up to `most` cushions on the back of items[index]; how many."""
    rng = placing.rng
    seat = find_seat(scene, index, placing.room.floor_y)
    if seat is None:
        placing.refuse("no seat with a back found")
        return 0
    columns = np.flatnonzero(np.isfinite(seat.back_row))
    n_wanted = int(np.ceil(rng.random() * most * placing.share)) if placing.share > 0 else 0
    taken: list[tuple[float, float]] = []
    n = 0
    # Corners first, then anywhere.
    for k in range(2 * n_wanted):
        if n == n_wanted:
            break
        made = soft.cushion.make(rng, placing.style)
        half = made[0].size[0] / 2 / _CELL_M
        low, high = columns[0] + half + _SIDE_M / _CELL_M, columns[-1] - half - _SIDE_M / _CELL_M
        if high <= low:
            break
        at = (low, high)[k] if k < 2 else float(rng.uniform(low, high))
        if any(at - half < b + 1 and at + half > a - 1 for a, b in taken):
            continue
        if _lean(placing, scene, index, seat, made, at):
            taken.append((at - half, at + half))
            n += 1
    return n


def find_seat(scene: SceneTriangles, index: int, floor_y: float) -> Seat | None:
    """The seat of items[index] and where its back begins; None where there is none."""
    corners = scene.of_item(index)
    points = corners.reshape(-1, 3)
    if not len(points):
        return None
    turn = plan_turn(scene.items[index], points)
    best: tuple[float, PlanGrid, F64] | None = None
    # The back is the side whose strip is highest.
    for quarter in range(4):
        grid = PlanGrid.around(points[:, [0, 2]], turn + quarter * np.pi / 2, _CELL_M, 0.0)
        tops = np.maximum(top_heights(grid, corners), floor_y)
        height = float(np.median(tops[: max(3, grid.shape[0] // 8)].max(0)))
        # Front and sides may be as high: prefer what the box calls the back, and the long side.
        height += 0.02 * (quarter == 0) + 0.01 * (grid.shape[1] >= grid.shape[0])
        if best is None or height > best[0]:
            best = height, grid, tops
    assert best is not None
    _, grid, tops = best
    seat = (tops > floor_y + _SEAT_M[0]) & (tops < floor_y + _SEAT_M[1])
    if not seat.any():
        return None
    level = float(np.median(tops[seat]))
    return _seat_before_back(grid, tops, seat & (np.abs(tops - level) < 0.08), level)


def _seat_before_back(grid: PlanGrid, tops: F64, seat: Bools, level: float) -> Seat | None:
    # In each column the seat begins where the back ends.
    back_row = np.full(grid.shape[1], np.nan)
    for column in range(grid.shape[1]):
        rows = np.flatnonzero(seat[:, column])
        if len(rows) * _CELL_M < _LEAST_DEPTH_M:
            continue
        if (tops[: rows[0], column] > level + _BACK_M).any():
            back_row[column] = rows[0]
    if np.isfinite(back_row).sum() * _CELL_M < 0.4:
        return None
    return Seat(grid, level, back_row)


def _lean(
    placing: Placing, scene: SceneTriangles, index: int, seat: Seat, made: Made, at: float
) -> bool:
    piece, shape = made
    half, thick = piece.size[0] / 2, piece.size[2]
    span = seat.back_row[max(0, int(at - half / _CELL_M)) : int(at + half / _CELL_M) + 1]
    if not len(span) or not np.isfinite(span).all() or np.ptp(span) > 6:
        placing.refuse("a seat's back is too round for a cushion")
        return False
    # Stand it up: its thickness points forward and a little up, its depth down the back.
    tilt = float(placing.rng.uniform(0.3, 0.5))
    c, s = np.cos(tilt), np.sin(tilt)
    forward, up, right = np.array([0, 0, 1.0]), np.array([0, 1.0, 0]), np.array([1.0, 0, 0])
    normal, down = c * forward + s * up, s * forward - c * up
    local = np.stack([right, normal, down], -1)
    turn = rotation_y(seat.grid.turn_rad) @ local @ rotation_y(float(placing.rng.normal(0, 0.06)))
    place = seat.grid.plan_of(at, float(span.max()))
    centre = np.array([place[0], seat.level + half * c + 0.02, place[1]])
    centre += rotation_y(seat.grid.turn_rad) @ (normal * thick)
    corners, owner = scene.in_box(centre - half - 0.25, centre + half + 0.25)
    points = np.concatenate([s_.positions for s_ in shape.surfaces]).astype(np.float64)
    points = points - [0, thick / 2, 0]
    own = corners[owner == index]
    placed = _settled(points, own, turn, centre, thick)
    if placed is None or _meets(placed, turn, points, corners, owner, index):
        placing.refuse("a cushion does not fit on the seat")
        return False
    start, surfaces = 0, []
    for surface in shape.surfaces:
        end = start + len(surface.positions)
        surfaces.append(smooth(surface.name, placed[start:end], surface.faces))
        start = end
    put_as_it_is(placing, made, surfaces)
    return True


def _settled(points: F64, corners: F64, turn: F64, centre: F64, thick: float) -> F64 | None:
    """The cushion (its own frame) in the world: at the back, down on the seat, pressed; or None."""
    for _ in range(2):
        ahead = _way_to_back(points, corners, turn, centre, thick)
        if ahead is None:
            return None
        centre = centre + turn[:, 1] * ahead
        fall = _way_to_seat(points @ turn.T + centre, corners)
        if fall is None:
            return None
        centre = centre - [0, fall, 0]
    # Give way where the back, or the seat, would reach into it.
    own = (corners - centre) @ turn
    ground = highest_below(points[:, [0, 2]], own, _MOST_PRESSED_M)
    pressed = points.copy()
    pressed[:, 1] = np.maximum(points[:, 1], ground + TOUCH_M)
    placed = pressed @ turn.T + centre
    fall = _way_to_seat(placed, corners)
    if fall is None or abs(fall) > 0.003:
        return None
    return np.asarray(placed - np.array([0, fall + _SINKS_M, 0]))


def _way_to_back(points: F64, corners: F64, turn: F64, centre: F64, thick: float) -> float | None:
    """How far the cushion goes along its thickness until it rests on the back."""
    # In the cushion's own frame the back is a height field under its upper half.
    own = (corners - centre) @ turn
    upper = points[:, 2] < 0
    ground = highest_below(points[upper][:, [0, 2]], own, thick)
    found = np.isfinite(ground)
    if found.sum() < 0.4 * upper.sum():
        return None
    return float(np.quantile(ground[found], 0.9)) + _SUNK * thick / 2


def _way_to_seat(placed: F64, corners: F64) -> float | None:
    """How far the cushion falls, or is lifted where negative, to touch the seat."""
    low = placed[:, 1].min()
    lower = placed[placed[:, 1] < low + 0.06]
    ground = highest_below(lower[:, [0, 2]], corners, low + 0.06)
    gap = lower[:, 1] - ground
    if not np.isfinite(gap).any() or not -0.08 < gap.min() < 0.3:
        return None
    return float(gap.min() - TOUCH_M)


def _meets(placed: F64, turn: F64, points: F64, corners: F64, owner: I32, index: int) -> bool:
    """Whether faces reach deeper than a centimetre into the cushion, or others touch it at all."""
    # Spread points over the faces near it and see them in the cushion's frame.
    centre = placed.mean(0)
    size = np.ptp((placed - centre) @ turn, axis=0) / 2
    weights = np.array([[a, b, 8 - a - b] for a in range(9) for b in range(9 - a)]) / 8
    samples = np.einsum("wk,tkd->twd", weights, corners)
    local = (samples - centre) @ turn
    deep = _inside(local, size - 0.012)
    near = _inside(local, size + 0.005)
    return bool(deep.any() or near[owner != index].any())


def _inside(local: F64, half: F64) -> F64:
    # Inside the cushion's lens: thick in its middle, thin at its rim.
    u = np.abs(local[..., 0] / half[0])
    v = np.abs(local[..., 2] / half[2])
    rise = (np.maximum(1 - u**2.2, 0) * np.maximum(1 - v**2.2, 0)) ** 0.5
    return np.asarray((u < 1) & (v < 1) & (np.abs(local[..., 1]) < half[1] * rise - 0.01))
