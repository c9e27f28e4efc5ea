"""Cloth that falls on what lies below it: a net of springs over heights; no effects.

The net is relaxed by positions (Mueller et al., Position Based Dynamics, 2007): each step lets it
fall, pulls its threads to their lengths and lifts it off what it met. Equal arguments give equal bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.textiles.hanging_cloth import solid_sheet
from pbrs_farm.geometry.plan_grid import PlanGrid, cells_over

CELL_M: Final = 0.0125  # cell size of the height map that cloth falls on
TOUCH_M: Final = 0.0004  # gap between the cloth's lower side and what it lies on
_STEPS: Final = 45  # time steps until the cloth lies
_PULLS: Final = 3  # constraint iterations a step
_FALL_M: Final = 0.006  # downward velocity that gravity adds in a step, metres a step
_AIR: Final = 0.12  # share of velocity lost to drag in a step
_CLEARED: Final = 3  # passes that lift edges of the net out of obstacles
_MOST_LIFT_M: Final = 0.06
_WALL_M: Final = 0.05  # a vertex deeper than this below the height map went through a wall
_SLACK: Final = 0.2  # stiffness of a thread in compression; 1 in tension
_BEND: Final = 0.25  # stiffness between vertices two threads apart: resists bending


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What cloth falls on: a height map in cells of CELL_M, in a frame of its own (x, y up, z)."""

    grid: PlanGrid  # its axes are the frame's
    heights: F64  # (rows, columns) metres, obstacles grown by half a thickness and a cell
    tight: F64  # the same, grown by half a thickness alone
    corners: F64  # (F, 3, 3) of the world: what it falls on

    @staticmethod
    def of(grid: PlanGrid, corners: F64, floor_y: float, below_y: float, thick_m: float) -> Ground:
        """The heights of triangles (F, 3, 3) of the world in the grid's cells, the floor's elsewhere.

        below_y: what begins higher hangs over the cloth and holds nothing. thick_m: of the cloth.
        """
        hits = cells_over(grid, corners, touched=True)
        heights = np.full(grid.shape, floor_y)
        there = hits.low < below_y
        cell = hits.row[there] * grid.shape[1] + hits.column[there]
        np.maximum.at(heights.reshape(-1), cell, hits.high[there])
        # The net runs in the cloth's middle: it keeps half a thickness from edges, and a cell, so
        # that threads between two corners of the net do not cut them.
        n = int(np.ceil(thick_m / 2 / CELL_M))
        tight = np.asarray(ndimage.maximum_filter(heights, size=2 * n + 1))
        return Ground(grid, np.asarray(ndimage.maximum_filter(tight, size=3)), tight, corners)

    def at(self, x: F64, z: F64, *, is_tight: bool = False) -> F64:
        """(...) heights under places of the frame.

        x and z are metres in the frame, of any one shape; places beyond the grid take its border's
        height. is_tight takes the heights grown by half a thickness alone.
        """
        heights = self.tight if is_tight else self.heights
        row = np.clip((z / self.grid.cell_m).astype(np.int64), 0, heights.shape[0] - 1)
        column = np.clip((x / self.grid.cell_m).astype(np.int64), 0, heights.shape[1] - 1)
        return np.asarray(heights[row, column])

    def world(self, points: F64) -> F64:
        """(..., 3) points of the frame in the world."""
        plan = self.grid.plan_of(
            points[..., 0] / self.grid.cell_m, points[..., 2] / self.grid.cell_m
        )
        return np.stack([plan[..., 0], points[..., 1], plan[..., 1]], -1)


@dataclass(frozen=True, slots=True)
class Folds:
    """How rumpled cloth is."""

    n: int
    height_m: float  # at most
    width_m: float  # about
    length_m: tuple[float, float]


def drop_net(net: F64, thread_m: tuple[float, float], ground: Ground, thick_m: float) -> F64:
    """The net (R, C, 3) of vertices after it fell, with twice the resolution (2 R - 1, 2 C - 1, 3).

    net: metres in the ground's frame. thread_m: rest lengths along rows and columns. Verlet steps with
    drag, each followed by constraint iterations and collision with the height map. No vertex ends
    lower than half the thickness above the ground.
    """
    at, before = net.copy(), net.copy()
    above = thick_m / 2 + TOUCH_M
    down, across = thread_m
    slant = float(np.hypot(down, across))
    for _ in range(_STEPS):
        ahead = at + (at - before) * (1 - _AIR)
        ahead[..., 1] -= _FALL_M
        before, at = at, ahead
        for _pull in range(_PULLS):
            _pull_threads(at, 0, 1, down, 1.0)
            _pull_threads(at, 1, 1, across, 1.0)
            _pull_slants(at, slant)
            _pull_threads(at, 0, 2, 2 * down, _BEND)
            _pull_threads(at, 1, 2, 2 * across, _BEND)
        _lift(at, before, ground, above)
    # Double the vertices so that folds are round, and lift those that end in the ground.
    fine = np.stack(
        [
            ndimage.zoom(
                at[..., k],
                (2 - 1 / len(at), 2 - 1 / at.shape[1]),
                order=3,
                mode="nearest",
                grid_mode=False,
            )
            for k in range(3)
        ],
        -1,
    )
    least = ground.at(fine[..., 0], fine[..., 2]) + above
    fine[..., 1] = np.maximum(fine[..., 1], least)
    return fine


def _lift(at: F64, before: F64, ground: Ground, above: float) -> None:
    low = ground.at(at[..., 0], at[..., 2]) + above - at[..., 1]
    # Move what went through a wall back before it; lift what sank into the top, and stop it there.
    through = low > _WALL_M
    for k in (0, 2):
        at[..., k] = np.where(through, before[..., k], at[..., k])
    low = ground.at(at[..., 0], at[..., 2]) + above - at[..., 1]
    held = low > 0
    at[..., 1] = np.where(held, at[..., 1] + low, at[..., 1])
    before[held] = at[held]


def _pull_threads(at: F64, axis: int, apart: int, length: float, stiff: float) -> None:
    """Enforce the rest length between vertices `apart` steps along `axis`, in place.

    Stretching is corrected fully (times `stiff`), compression by _SLACK of that.
    """
    view = at if axis == 0 else at.swapaxes(0, 1)
    for start in range(2 * apart):
        # Correct pairs that share no vertex at once.
        first = np.arange(start, view.shape[0] - apart, 2 * apart)
        if not len(first):
            continue
        _pull(view, first, first + apart, length, stiff)


def _pull(view: F64, first: F64, second: F64, length: float, stiff: float) -> None:
    a, b = view[first], view[second]
    along = b - a
    now = np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-9)
    step = 0.5 * stiff * along * (1 - length / now)
    # Correct compression partly: a slack thread folds.
    step = np.where(now < length, _SLACK * step, step)
    view[first] = a + step
    view[second] = b - step


def _pull_slants(at: F64, length: float) -> None:
    for rows in (0, 1):
        for sign in (1, -1):
            first = at[rows:-1:2, :-1] if sign > 0 else at[rows:-1:2, 1:]
            second = at[rows + 1 :: 2, 1:] if sign > 0 else at[rows + 1 :: 2, :-1]
            n = min(len(first), len(second))
            along = second[:n] - first[:n]
            now = np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-9)
            step = 0.5 * 0.3 * along * (1 - length / now)
            step = np.where(now < length, _SLACK * step, step)
            first[:n] += step
            second[:n] -= step


def add_folds(
    net: F64, ground: Ground, thick_m: float, folds: Folds, rng: np.random.Generator
) -> F64:
    """The net with random ridges, as of cloth that nobody smoothed; no vertex sinks into the ground.

    net is (R, C, 3) float64 metres in the ground's frame; a new one comes back. thick_m is the
    cloth's thickness. Ridges are drawn from rng, so the same generator gives the same folds.
    """
    size = np.array([_length(net, 0), _length(net, 1)])
    v, u = np.meshgrid(
        *(np.linspace(0, x, n) for x, n in zip(size, net.shape[:2], strict=True)), indexing="ij"
    )
    rise = np.zeros(net.shape[:2])
    for _ in range(folds.n):
        # Draw a bent ridge line somewhere on the cloth: s along it, d across it.
        middle, angle = rng.uniform(0, 1, 2) * size, float(rng.uniform(0, np.pi))
        long, bent = float(rng.uniform(*folds.length_m)), float(rng.normal(0, 0.8))
        wide = folds.width_m * float(rng.uniform(0.7, 1.4))
        du, dv = u - middle[1], v - middle[0]
        s = np.cos(angle) * du + np.sin(angle) * dv
        d = -np.sin(angle) * du + np.cos(angle) * dv - bent * s**2
        ridge = np.exp(-((d / wide) ** 2)) * np.clip(1 - (2 * s / long) ** 2, 0, 1) ** 1.5
        rise = np.maximum(rise, float(rng.uniform(0.4, 1.0)) * folds.height_m * ridge)
    normal = np.cross(np.gradient(net, axis=0), np.gradient(net, axis=1))
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    raised = net + rise[..., None] * normal
    least = ground.at(raised[..., 0], raised[..., 2]) + thick_m / 2 + TOUCH_M
    raised[..., 1] = np.maximum(raised[..., 1], least)
    _clear_threads(raised, ground, thick_m / 2 + TOUCH_M)
    return raised


def _clear_threads(net: F64, ground: Ground, above: float) -> None:
    """Lift both ends of edges and diagonals of the net that would cut through an obstacle."""
    for _ in range(_CLEARED):
        for a, b in (
            (net[:-1], net[1:]), (net[:, :-1], net[:, 1:]), (net[:-1, :-1], net[1:, 1:]),
            (net[:-1, 1:], net[1:, :-1]),
        ):  # fmt: skip
            for t in (0.25, 0.5, 0.75):
                at = a + t * (b - a)
                short = ground.at(at[..., 0], at[..., 2], is_tight=True) + above - at[..., 1]
                lift = np.clip(short, 0.0, _MOST_LIFT_M)
                a[..., 1] += lift
                b[..., 1] += lift


def _length(net: F64, axis: int) -> float:
    return float(np.linalg.norm(np.diff(net, axis=axis), axis=-1).sum(axis).mean())


def sheet_of(name: str, net: F64, ground: Ground, thick_m: float) -> Surface:
    """A net of the ground's frame as a closed body of the world; texture coordinates in metres."""
    points = ground.world(net)
    run = [np.linalg.norm(np.diff(points, axis=k), axis=-1) for k in (0, 1)]
    v = np.concatenate([np.zeros((1, net.shape[1])), np.cumsum(run[0], 0)])
    u = np.concatenate([np.zeros((net.shape[0], 1)), np.cumsum(run[1], 1)], axis=1)
    return solid_sheet(name, points, np.stack([u, v], -1), thick_m)


def flat_net(
    size: tuple[float, float], thread_m: float, middle: tuple[float, float, float], turn_rad: float
) -> tuple[F64, tuple[float, float]]:
    """A level net (R, C, 3) of width and depth about a middle, and its threads' lengths.

    At least 3 x 3 vertices. Rows run along z and columns along x before the turn about +y; metres,
    in the ground's frame. Threads' lengths are (between rows, between columns), as `drop_net` takes
    them.
    """
    n = [max(3, round(s / thread_m) + 1) for s in size]
    x, z = np.meshgrid(*(np.linspace(-s / 2, s / 2, k) for s, k in zip(size, n, strict=True)))
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    net = np.stack(
        [c * x + s * z + middle[0], np.full(x.shape, middle[1]), c * z - s * x + middle[2]], -1
    )
    return net, (size[1] / (n[1] - 1), size[0] / (n[0] - 1))
