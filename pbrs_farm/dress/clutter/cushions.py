"""Pillows, cushions and blankets: on beds, sofas and armchairs, in the shape of what they lie on; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F64, I32, Bools
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.supports import plan_turn
from pbrs_farm.geometry.bodies import smooth
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.plan_grid import PlanGrid, cells_over, top_heights
from pbrs_farm.geometry.scene_triangles import SceneTriangles

CELL_M = 0.02
LEAST_AIR_M = 0.6  # least free height above a mattress
TOUCH_M = 0.0003  # gap between soft items and their support, metres
_SEAT_M = (0.22, 0.62)  # heights of seats above the floor
_BACK_M = 0.15  # least height of a seat's back above the seat
_LEAST_DEPTH_M = 0.3  # least depth of a seat
_SUNK = 0.55  # distance of a cushion's middle from the back, in half thicknesses
_MOST_PRESSED_M = 0.03  # greatest depth by which a cushion is pressed in
_SINKS_M = 0.0015  # depth by which a cushion sinks into the seat, so that its lowest edge touches
_SIDE_M = 0.04  # kept from arms


def around_thing(
    scene: SceneTriangles, index: int, plan: F64, turn: F64, size: F64, level: float
) -> tuple[F64, bool]:
    """Faces of items[index] below an item (width, depth, height) at plan, and whether it hits others."""
    outline = np.array([[x, 0, z] for x in (-0.5, 0.5) for z in (-0.5, 0.5)]) * [
        size[0],
        1,
        size[1],
    ]
    outline = (outline @ turn.T)[:, [0, 2]] + plan
    low = np.array([outline[:, 0].min(), level - 0.3, outline[:, 1].min()])
    high = np.array([outline[:, 0].max(), level + LEAST_AIR_M - 0.1, outline[:, 1].max()])
    corners, owner = scene.in_box(low, high)
    angle = float(np.arctan2(turn[0, 2], turn[0, 0]))
    grid = PlanGrid.around(outline, angle, CELL_M, 0.0)
    hits = cells_over(grid, corners[owner != index], touched=True)
    # A closed body is known by its bottom or its top.
    meets = (hits.high > level - 0.01) & (hits.low < high[1])
    return corners[owner == index], bool(meets.any())


def put_as_it_is(placing: Placing, model: Model, surfaces: list[Surface]) -> None:
    """Add an item shaped to its support: surfaces in the world, in its shape's order; nothing is checked."""
    piece, shape = model
    nonempty = tuple(
        replace(surface, material=old.material)
        for surface, old in zip(surfaces, shape.surfaces, strict=True)
    )
    points = np.concatenate([s.positions for s in nonempty]).astype(np.float64)
    low, high = points.min(0), points.max(0)
    base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    moved = tuple(replace(s, positions=(s.positions - base).astype(np.float32)) for s in nonempty)
    placing.put((piece, Shape(moved, shape.materials, shape.textures)), base, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Seat:
    """A seat with a back, seen from above; the grid's back rows are at the back."""

    grid: PlanGrid
    level: float  # world y of the seat
    back_row: F64  # (columns,) first row before the back, in cells; NaN = no seat there


def dress_seat(placing: Placing, scene: SceneTriangles, index: int, most: int) -> int:
    """Lean up to `most` cushions on the back of items[index], corners first; how many, 0 (counted)."""
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
        cushion = content().things["cushion"](rng, placing.style)
        half = cushion[0].size[0] / 2 / CELL_M
        low, high = columns[0] + half + _SIDE_M / CELL_M, columns[-1] - half - _SIDE_M / CELL_M
        if high <= low:
            break
        middle = (low, high)[k] if k < 2 else float(rng.uniform(low, high))
        if any(middle - half < b + 1 and middle + half > a - 1 for a, b in taken):
            continue
        if _lean(placing, scene, index, seat, cushion, middle):
            taken.append((middle - half, middle + half))
            n += 1
    return n


def find_seat(scene: SceneTriangles, index: int, floor_y: float) -> Seat | None:
    """The seat of items[index] and its back, at its highest border, else its box's; None without."""
    corners = scene.of_item(index)
    points = corners.reshape(-1, 3)
    if not len(points):
        return None
    turn = plan_turn(scene.items[index], points)
    best: tuple[float, PlanGrid, F64] | None = None
    # The back is the side whose strip is highest.
    for quarter in range(4):
        grid = PlanGrid.around(points[:, [0, 2]], turn + quarter * np.pi / 2, CELL_M, 0.0)
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
        if len(rows) * CELL_M < _LEAST_DEPTH_M:
            continue
        if (tops[: rows[0], column] > level + _BACK_M).any():
            back_row[column] = rows[0]
    if np.isfinite(back_row).sum() * CELL_M < 0.4:
        return None
    return Seat(grid, level, back_row)


def _lean(
    placing: Placing, scene: SceneTriangles, index: int, seat: Seat, model: Model, at: float
) -> bool:
    piece, shape = model
    half, thick = piece.size[0] / 2, piece.size[2]
    span = seat.back_row[max(0, int(at - half / CELL_M)) : int(at + half / CELL_M) + 1]
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
    seat_corners = corners[owner == index]
    placed = _settled(points, seat_corners, turn, centre, thick)
    if placed is None or _meets_cushion(placed, turn, points, corners, owner, index):
        placing.refuse("a cushion does not fit on the seat")
        return False
    start, surfaces = 0, []
    for surface in shape.surfaces:
        end = start + len(surface.positions)
        surfaces.append(smooth(surface.name, placed[start:end], surface.faces))
        start = end
    put_as_it_is(placing, model, surfaces)
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
    local = (corners - centre) @ turn
    ground = highest_below(points[:, [0, 2]], local, _MOST_PRESSED_M)
    pressed = points.copy()
    pressed[:, 1] = np.maximum(points[:, 1], ground + TOUCH_M)
    placed = pressed @ turn.T + centre
    fall = _way_to_seat(placed, corners)
    if fall is None or abs(fall) > 0.003:
        return None
    return np.asarray(placed - np.array([0, fall + _SINKS_M, 0]))


def _way_to_back(points: F64, corners: F64, turn: F64, centre: F64, thick: float) -> float | None:
    """Distance along its thickness that the cushion moves to touch the back."""
    # In the cushion's own frame the back is a height field under its upper half.
    local = (corners - centre) @ turn
    upper = points[:, 2] < 0
    ground = highest_below(points[upper][:, [0, 2]], local, thick)
    is_backed = np.isfinite(ground)
    if is_backed.sum() < 0.4 * upper.sum():
        return None
    return float(np.quantile(ground[is_backed], 0.9)) + _SUNK * thick / 2


def _way_to_seat(placed: F64, corners: F64) -> float | None:
    """Distance that the cushion falls to touch the seat; negative if it is lifted."""
    low = placed[:, 1].min()
    lower = placed[placed[:, 1] < low + 0.06]
    ground = highest_below(lower[:, [0, 2]], corners, low + 0.06)
    gap = lower[:, 1] - ground
    if not np.isfinite(gap).any() or not -0.08 < gap.min() < 0.3:
        return None
    return float(gap.min() - TOUCH_M)


def _meets_cushion(
    placed: F64, turn: F64, points: F64, corners: F64, owner: I32, index: int
) -> bool:
    """Whether faces reach deeper than a centimetre into the cushion, or others touch it at all."""
    # Spread points over the faces near it and see them in the cushion's frame.
    centre = placed.mean(0)
    size = np.ptp((placed - centre) @ turn, axis=0) / 2
    weights = np.array([[a, b, 8 - a - b] for a in range(9) for b in range(9 - a)]) / 8
    samples = np.einsum("wk,tkd->twd", weights, corners)
    local = (samples - centre) @ turn
    deep = _depth_in_cushion(local, size - 0.012)
    near = _depth_in_cushion(local, size + 0.005)
    return bool(deep.any() or near[owner != index].any())


def _depth_in_cushion(local: F64, half: F64) -> F64:
    # Inside the cushion's lens: thick in its middle, thin at its rim.
    u = np.abs(local[..., 0] / half[0])
    v = np.abs(local[..., 2] / half[2])
    rise = (np.maximum(1 - u**2.2, 0) * np.maximum(1 - v**2.2, 0)) ** 0.5
    return np.asarray((u < 1) & (v < 1) & (np.abs(local[..., 1]) < half[1] * rise - 0.01))
