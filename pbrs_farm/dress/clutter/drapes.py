"""Simulate falling cloth as a net of inextensible threads; no effects.

Position-based relaxation (Mueller et al., Position Based Dynamics, 2007): each step applies gravity,
restores thread lengths and resolves collisions. The cloth falls as a coarse net and gets its folds
as a fine one, whose threads are then tightened (Provot, Deformation Constraints in a Mass-Spring
Model, 1995). Deterministic to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.clutter.cloth_ground import TOUCH_M, Ground
from pbrs_farm.dress.textiles.hanging_cloth import solid_sheet

MOST_STRETCH: Final = 1.3  # of the 99th percentile of edges, over their lengths at rest
_STEPS: Final = 50  # time steps until the cloth is at rest
_PULLS: Final = 2  # constraint iterations a step
_FALL_M: Final = 0.004  # downward velocity that gravity adds in a step, metres a step
_FASTEST_M: Final = 0.02  # a step: less than the thinnest board that holds cloth, grown
_AIR: Final = 0.12  # share of velocity lost to drag in a step
_GRIP: Final = 0.5  # share of a step along the support lost to friction
_SHEAR: Final = 0.6  # stiffness of diagonals; 1 in threads
_PUSH: Final = 0.2  # stiffness of a thread in compression; 1 in tension
_BEND: Final = 0.25  # stiffness between vertices two threads apart: resists bending
_SHARPEST: Final = 0.75  # vertices two threads apart come no nearer than this share of them
_TIGHT: Final = 1.1  # stretch at which tightening ends
_TIGHTENED: Final = 32  # iterations of tightening at most
_STEEPEST: Final = 0.75  # rise of a fold over a thread
_SMALLER: Final = (1.0, 0.8, 0.6, 0.4)  # scales of a cloth to try when laid flat
_LEVEL_M: Final = 0.005  # heights under flat cloth differ by less


@dataclass(frozen=True, slots=True)
class Folds:
    """How rumpled cloth is."""

    n: int
    height_m: float  # at most
    width_m: float  # about
    length_m: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Net:
    """Cloth as vertices (R, C, 3) in the frame of its ground, and its threads' lengths at rest."""

    points: F64
    thread_m: tuple[float, float]  # between rows, between columns

    def stretches(self) -> F64:
        """(E,) the length of each thread and diagonal over that at rest."""
        points = np.moveaxis(self.points, -1, 0)
        down, across = self.thread_m
        slant = float(np.hypot(down, across))
        pairs = (
            (points[:, :-1], points[:, 1:], down),
            (points[:, :, :-1], points[:, :, 1:], across),
            (points[:, :-1, :-1], points[:, 1:, 1:], slant),
            (points[:, 1:, :-1], points[:, :-1, 1:], slant),
        )
        return np.concatenate(
            [(np.sqrt(((b - a) ** 2).sum(0)) / length).ravel() for a, b, length in pairs]
        )

    def deepest_m(self, ground: Ground) -> float:
        """Maximum penetration of vertices and thread centres into the ground; metres."""
        xyz = np.moveaxis(self.points, -1, 0)
        places = (xyz, (xyz[:, :-1] + xyz[:, 1:]) / 2, (xyz[:, :, :-1] + xyz[:, :, 1:]) / 2)
        return max(float(ground.depths(p).max()) for p in places)


def flat_net(
    size: tuple[float, float], thread_m: float, middle: tuple[float, float, float], turn_rad: float
) -> Net:
    """A level net, 3 x 3 vertices at least, rows along z before the turn about +y; metres of the ground."""
    n = [max(3, round(s / thread_m) + 1) for s in size]
    x, z = np.meshgrid(*(np.linspace(-s / 2, s / 2, k) for s, k in zip(size, n, strict=True)))
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    points = np.stack(
        [c * x + s * z + middle[0], np.full(x.shape, middle[1]), c * z - s * x + middle[2]], -1
    )
    return Net(points, (size[1] / (n[1] - 1), size[0] / (n[0] - 1)))


def drape(
    net: Net, ground: Ground, thick_m: float, folds: Folds, rng: np.random.Generator
) -> Net | None:
    """The net after it fell, with folds and twice the resolution (2 R - 1, 2 C - 1, 3).

    Folds are drawn from rng. None where cloth of these threads found no way to lie: where more than
    one edge of a hundred is stretched by more than MOST_STRETCH, or it is in something by more than
    thick_m.
    """
    gap_m = thick_m / 2 + TOUCH_M
    points = np.ascontiguousarray(np.moveaxis(net.points, -1, 0))
    _fall(points, net.thread_m, ground, gap_m)
    thread_m = net.thread_m[0] / 2, net.thread_m[1] / 2
    fine = _folded(points, thread_m, folds, rng)
    cloth = Net(np.moveaxis(fine, 0, -1), thread_m)
    for k in range(_TIGHTENED):
        _pull(fine, thread_m, push=0.0)
        _pull_across(fine, thread_m, _SHARPEST, pull=0.0)
        if k % 2:
            _lift_threads(fine, ground, gap_m)
        fine += ground.ways_out(fine, gap_m)
        if k % 4 == 3 and _usual_most(cloth) < _TIGHT:
            break
    is_sound = _usual_most(cloth) <= MOST_STRETCH and cloth.deepest_m(ground) <= thick_m
    return cloth if is_sound else None


def lie_flat(net: Net, ground: Ground, thick_m: float) -> Net | None:
    """The largest scaled part of a net that can be laid flat in place; None if it is too small."""
    middle = net.points.mean((0, 1))
    for share in _SMALLER:
        points = middle + share * (net.points - middle)
        under = ground.at(points[..., 0], points[..., 2])
        if np.ptp(under) < _LEVEL_M:
            points[..., 1] = under.max() + thick_m / 2 + TOUCH_M
            return Net(points, (share * net.thread_m[0], share * net.thread_m[1]))
    return None


def _usual_most(net: Net) -> float:
    """The stretch that 99 of 100 edges stay below."""
    return float(np.percentile(net.stretches(), 99))


def _fall(at: F64, thread_m: tuple[float, float], ground: Ground, gap_m: float) -> None:
    """Let vertices (3, R, C) fall until they lie: Verlet steps with drag and grip; in place."""
    before = at.copy()
    for k in range(_STEPS):
        start = at.copy()
        at += np.clip((at - before) * (1 - _AIR), -_FASTEST_M, _FASTEST_M)
        # Weight fades, so that threads end at their lengths.
        at[1] -= _FALL_M * (1 - k / _STEPS)
        for _pulled in range(_PULLS):
            _pull(at, thread_m, _PUSH)
            _pull_across(at, thread_m, 1.0, _BEND)
        _lift_threads(at, ground, 0.0)
        move = ground.ways_out(at, gap_m)
        gripped = move.any(0)
        at += move
        at[:, gripped] -= _GRIP * (at - start)[:, gripped] * [[1.0], [0.0], [1.0]]
        before = np.where(gripped, at, start)


def _lift_threads(at: F64, ground: Ground, gap_m: float) -> None:
    """Move threads, not only their ends, off obstacles by gap_m, in place."""
    for view in (at, at.swapaxes(1, 2)):
        a, b = view[:, :-1], view[:, 1:]
        # Half of it: a vertex has a thread to either side.
        move = ground.ways_out((a + b) / 2, gap_m) / 2
        a += move
        b += move


def _pull(at: F64, thread_m: tuple[float, float], push: float) -> None:
    """Restore thread and diagonal lengths in place, pairs without common vertices together."""
    for view, length in zip((at, at.swapaxes(1, 2)), thread_m, strict=True):
        for start in (0, 1):
            a, b = view[:, start:-1:2], view[:, start + 1 :: 2]
            _correct(a, b, length, 1.0, push)
    slant = float(np.hypot(*thread_m))
    for start in (0, 1):
        a, b = at[:, start:-1:2], at[:, start + 1 :: 2]
        _correct(a[:, :, :-1], b[:, :, 1:], slant, _SHEAR, _SHEAR * push)
        _correct(a[:, :, 1:], b[:, :, :-1], slant, _SHEAR, _SHEAR * push)


def _pull_across(at: F64, thread_m: tuple[float, float], share: float, pull: float) -> None:
    """Bring vertices two threads apart to a share of two threads, in place; pull: where they are farther."""
    for view, length in zip((at, at.swapaxes(1, 2)), thread_m, strict=True):
        for start in range(4):
            b = view[:, start + 2 :: 4]
            _correct(view[:, start:-2:4], b, 2 * share * length, pull, _BEND)


def _correct(a: F64, b: F64, length: float, pull: float, push: float) -> None:
    along = b - a
    now = np.maximum(np.sqrt((along**2).sum(0)), 1e-9)
    share = 1 - length / now
    along *= 0.5 * share * np.where(share > 0, pull, push)
    a += along
    b -= along


def _folded(at: F64, thread_m: tuple[float, float], folds: Folds, rng: np.random.Generator) -> F64:
    """Vertices (3, 2 R - 1, 2 C - 1) of a net (3, R, C) with ridges, for which cloth is drawn in."""
    shape = 2 * at.shape[1] - 1, 2 * at.shape[2] - 1
    rise = _ridges(shape, thread_m, folds, rng)
    where = [_drawn_in(rise, axis, thread_m[axis]) / 2 for axis in (0, 1)]
    fine = np.stack([ndimage.map_coordinates(c, where, order=3, mode="nearest") for c in at])
    normal = np.cross(np.gradient(fine, axis=1), np.gradient(fine, axis=2), axis=0)
    normal /= np.maximum(np.sqrt((normal**2).sum(0)), 1e-12)
    return np.asarray(fine + rise * normal)


def _ridges(
    shape: tuple[int, int], thread_m: tuple[float, float], folds: Folds, rng: np.random.Generator
) -> F64:
    """Heights (R, C) of random bent ridges over a net, metres."""
    size = np.array([thread * (n - 1) for thread, n in zip(thread_m, shape, strict=True)])
    v, u = np.meshgrid(
        *(np.linspace(0, x, n) for x, n in zip(size, shape, strict=True)), indexing="ij"
    )
    rise = np.zeros(shape)
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
    return rise


def _drawn_in(rise: F64, axis: int, thread_m: float) -> F64:
    """(R, C) coordinate of each vertex along an axis, in threads, after folds have consumed their length."""
    steep = np.clip(np.diff(rise, axis=axis) / thread_m, -_STEEPEST, _STEEPEST)
    run = np.sqrt(1 - steep**2).cumsum(axis)
    run = np.concatenate([np.zeros_like(run.take([0], axis)), run], axis)
    return np.asarray(run + (rise.shape[axis] - 1 - run.take([-1], axis)) / 2)


def sheet_of(name: str, net: Net, ground: Ground, thick_m: float) -> Surface:
    """A net as a closed body of the world, uv in metres of the cloth at rest."""
    rows, columns = net.points.shape[:2]
    v, u = np.meshgrid(
        np.arange(rows) * net.thread_m[0], np.arange(columns) * net.thread_m[1], indexing="ij"
    )
    return solid_sheet(name, ground.world(net.points), np.stack([u, v], -1), thick_m)
