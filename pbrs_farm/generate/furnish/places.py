"""Candidate places of a template in a room, with their scores; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.generate.floor_plan import Point, Rect
from pbrs_farm.generate.furnish.room_space import FurnishSpace, RoomWall
from pbrs_farm.generate.furnish.template import (
    Liking,
    PieceGroup,
    Stand,
    Standing,
    Template,
    WallFrame,
)

Ints = NDArray[np.int64]

_STEP_M: Final = 0.10
_FREE_STEP_M: Final = 0.15
_TOUCH_M: Final = 0.002
_DEAD_GAP_M: Final = 0.35  # a gap that nobody can use
BESIDE_M: Final = 0.01  # between furniture and the wall at its end
_APART_M: Final = 0.4  # minimum distance between two candidate places of one template, metres
_NOISE: Final = 0.25
_BEST: Final = 20


@dataclass(slots=True, eq=False)
class Places:
    """Candidate places of a group, one per row; unused rectangles are nan."""

    templates: list[Template]
    template_of: Ints  # (N,) index into templates
    frames: F64  # (N, 4) as Frame has them
    bodies: F64  # (N, B, 4)
    clear: F64  # (N, C, 4)
    scores: F64  # (N,)

    @property
    def n(self) -> int:
        """Number of places."""
        return len(self.scores)

    def standing(self, k: int) -> Standing:
        """The template at place k."""
        x, z, dx, dz = self.frames[k].tolist()
        template = self.templates[int(self.template_of[k])]
        return Standing(template, WallFrame(x, z, dx, dz), float(self.scores[k]))

    def free_of(self, alive: Bools, standing: Standing) -> Bools:
        """Mask (N,) of alive places that remain after a template: bodies overlap neither bodies nor free areas."""
        bodies, clear = _rect_array(standing.bodies), _rect_array(standing.clear)
        taken = np.concatenate([bodies, clear])
        # Test only places still possible.
        remaining = alive.copy()
        rows = np.flatnonzero(alive)
        hit = overlap(self.bodies[rows], taken).any(1) | overlap(self.clear[rows], bodies).any(1)
        remaining[rows[hit]] = False
        return remaining

    def best(self, alive: Bools, n: int = _BEST) -> list[Standing]:
        """The best places first, those of a wall 0.4 m apart as long as there are others."""
        order = np.argsort(-self.scores, kind="stable")
        rows = order[alive[order]]
        names = [template.name for template in self.templates]
        name = np.array([names.index(x) for x in names], np.int64)[self.template_of[rows]]
        x, z, dx, dz = self.frames[rows].T
        chosen: list[int] = []
        remaining = np.ones(len(rows), bool)
        while len(chosen) < n and remaining.any():
            k = int(remaining.argmax())
            chosen.append(k)
            near = (name == name[k]) & (np.abs(x - x[k]) + np.abs(z - z[k]) < _APART_M)
            remaining &= ~(near & (dx == dx[k]) & (dz == dz[k]))
        # Where these are not enough, take those beside them.
        more = np.setdiff1d(np.arange(len(rows)), chosen)[: n - len(chosen)].tolist()
        return [self.standing(int(rows[k])) for k in (*chosen, *more)]


def overlap(rects: F64, others: F64) -> Bools:
    """(N, B) whether rectangles (N, B, 4) x0, z0, x1, z1 overlap others (M, 4) by more than 2 mm."""
    if not len(others) or not rects.size:
        return np.zeros(rects.shape[:2], bool)
    a, b, e = rects[:, :, None, :], others[None, None], _TOUCH_M
    hit = (
        (a[..., 0] < b[..., 2] - e)
        & (a[..., 2] > b[..., 0] + e)
        & (a[..., 1] < b[..., 3] - e)
        & (a[..., 3] > b[..., 1] + e)
    )
    return np.asarray(hit.any(2))


def places_of(group: PieceGroup, space: FurnishSpace, rng: np.random.Generator) -> Places:
    """Places of a group's templates that walls and openings allow, best first by `Liking` plus noise of rng."""
    versions = [v for template in group.templates for v in _versions(template)]
    frames, scores, template_of = [], [], []
    for number, template in enumerate(versions):
        template_frames, walls = _frames(template, space)
        ok = allowed(template, template_frames, space)
        noise = rng.random(len(template_frames)) * _NOISE
        frames.append(template_frames[ok])
        scores.append(_scores(template, template_frames[ok], walls[ok], space) + noise[ok])
        template_of.append(np.full(int(ok.sum()), number))
    return _sorted_places(
        versions,
        np.concatenate([np.zeros(0, int), *template_of]),
        np.concatenate([np.zeros((0, 4)), *frames]),
        np.concatenate([np.zeros(0), *scores]),
    )


def fixed_places(standings: Sequence[Standing]) -> Places:
    """Places determined elsewhere."""
    frames = frames_array([p.frame for p in standings])
    scores = np.array([p.score for p in standings], np.float64)
    return _sorted_places(
        [p.template for p in standings], np.arange(len(standings)), frames, scores
    )


def _sorted_places(
    templates: list[Template], template_of: Ints, frames: F64, scores: F64
) -> Places:
    # Pad with NaN, which no comparison is true for: templates differ in their number of bodies.
    n_bodies = max((len(t.bodies) for t in templates), default=0)
    n_clear = max((len(t.clear) for t in templates), default=0)
    bodies = np.full((len(frames), n_bodies, 4), np.nan)
    clear = np.full((len(frames), n_clear, 4), np.nan)
    for number, template in enumerate(templates):
        rows = np.flatnonzero(template_of == number)
        if len(rows):
            grounds = np.array([s.rect for s in template.bodies])
            bodies[rows, : len(template.bodies)] = _rects_in_frames(grounds, frames[rows])
        if len(rows) and template.clear:
            clear[rows, : len(template.clear)] = _rects_in_frames(
                np.array(template.clear), frames[rows]
            )
    return Places(templates, template_of, frames, bodies, clear, scores)


def frames_array(frames: Sequence[WallFrame]) -> F64:
    """(N, 4) frames as arrays have them."""
    rows = [(f.x, f.z, f.dx, f.dz) for f in frames]
    return np.array(rows, np.float64).reshape(-1, 4)


def allowed(template: Template, frames: F64, space: FurnishSpace) -> Bools:
    """(N,) which frames (x, z, unit vector along the wall) keep a template inside, off doors and below sills."""
    bodies = _rects_in_frames(np.array([s.rect for s in template.bodies]), frames)
    bad = overlap(bodies, np.concatenate([space.outside, space.doors])).any(1)
    if template.clear:
        bad |= overlap(_rects_in_frames(np.array(template.clear), frames), space.outside).any(1)
    for zone, low in (strip for window in space.windows for strip in window.clear_above):
        tall = [s.rect for s in template.slots if s.screen_top > low]
        if tall:
            bad |= overlap(_rects_in_frames(np.array(tall), frames), np.array([zone])).any(1)
    return np.asarray(~bad)


def _versions(template: Template) -> list[Template]:
    if template.stand is Stand.CORNER:
        return [template, template.mirrored()]
    turned = template.mirrored()
    same = {(s.piece.id, s.rect) for s in template.slots} == {
        (s.piece.id, s.rect) for s in turned.slots
    }
    return [template] if same and set(template.clear) == set(turned.clear) else [template, turned]


def _frames(template: Template, space: FurnishSpace) -> tuple[F64, Ints]:
    """(N, 4) candidate frames of a template, and the wall index of each, -1 for none."""
    if template.stand is Stand.FREE:
        frames = _free_frames(space)
        return frames, np.full(len(frames), -1)
    u0, _, u1, _ = template.extent
    candidates, walls = [np.zeros((0, 4))], [np.zeros(0, int)]
    for number, wall in enumerate(space.walls):
        along = _positions_along_wall(template, wall, BESIDE_M - u0, wall.length - u1 - BESIDE_M)
        f = wall.frame
        rows = np.empty((len(along), 4))
        rows[:] = f.x, f.z, f.dx, f.dz
        rows[:, 0] += along * f.dx
        rows[:, 1] += along * f.dz
        candidates.append(rows)
        walls.append(np.full(len(along), number))
    return np.concatenate(candidates), np.concatenate(walls)


def _positions_along_wall(template: Template, wall: RoomWall, low: float, high: float) -> F64:
    """Where along a wall a template's origin can be, metres."""
    positions: list[float] = []
    if high < low - 1e-9:
        return np.zeros(0)
    if template.stand is Stand.CORNER:
        if template.end < 0 and wall.is_left_corner:
            positions = [low]
        if template.end > 0 and wall.is_right_corner:
            positions = [high]
    else:
        n = int((high - low) / _STEP_M + 1e-9)
        positions = [low + k * _STEP_M for k in range(n + 1)]
        if high - positions[-1] > 1e-6:
            positions.append(high)
    return np.array(positions)


def _free_frames(space: FurnishSpace) -> F64:
    """A grid over the room, at each of its points along x and along z."""
    x0, z0, x1, z1 = space.bounds
    xs = x0 + np.arange(1, int((x1 - x0) / _FREE_STEP_M)) * _FREE_STEP_M
    zs = z0 + np.arange(1, int((z1 - z0) / _FREE_STEP_M)) * _FREE_STEP_M
    frames = np.empty((len(xs), len(zs), 2, 4))
    frames[..., 0], frames[..., 1] = xs[:, None, None], zs[:, None]
    frames[:, :, 0, 2:], frames[:, :, 1, 2:] = (1, 0), (0, 1)
    return frames.reshape(-1, 4)


def _rects_in_frames(rects: F64, frames: F64) -> F64:
    """(N, B, 4) rectangles of the template (B, 4) in each frame."""
    x, z, dx, dz = (frames[:, k, None, None] for k in range(4))
    u, v = rects[None, :, 0::2], rects[None, :, 1::2]
    xs, zs = x + u * dx - v * dz, z + u * dz + v * dx
    # Of two values numpy's least costs ten times as much along an axis.
    ends = [(side[..., 0], side[..., 1]) for side in (xs, zs)]
    return np.stack(
        [least_or_most(*end) for least_or_most in (np.minimum, np.maximum) for end in ends], -1
    )


def _rect_array(rects: Sequence[Rect]) -> F64:
    return np.array(rects, np.float64).reshape(-1, 4)


def _scores(template: Template, frames: F64, walls: Ints, space: FurnishSpace) -> F64:
    """(N,) how good each place is, by what the template likes."""
    like, scores = template.liking, np.full(len(frames), template.rank)
    u0, v0, u1, v1 = template.extent
    x, z, dx, dz = frames.T
    u, v = (u0 + u1) / 2, (v0 + v1) / 2
    middles = np.stack([x + u * dx - v * dz, z + u * dz + v * dx], -1)
    if template.stand is not Stand.FREE and len(frames):
        scores += _wall_scores(like, (u0, u1), frames, walls, space)
    if like.daylight and space.windows:
        scores -= like.daylight * _distances_to_nearest(middles, [w.middle for w in space.windows])
    if like.door and len(space.doors):
        doors = (space.doors[:, :2] + space.doors[:, 2:]) / 2
        scores += like.door * np.minimum(_distances_to_nearest(middles, doors.tolist()), 4.0)
    if like.middle:
        x0, z0, x1, z1 = space.bounds
        scores -= like.middle * _distances_to_nearest(middles, [((x0 + x1) / 2, (z0 + z1) / 2)])
    if like.back:
        scores += like.back * _back_scores(template, frames, space)
    return scores


def _distances_to_nearest(points: F64, targets: Sequence[Point]) -> F64:
    """(N,) distance of each point to the nearest of others."""
    offsets = points[:, None] - np.array(targets)[None]
    return np.asarray(np.hypot(offsets[..., 0], offsets[..., 1]).min(1))


def _wall_scores(
    like: Liking, span: tuple[float, float], frames: F64, walls: Ints, space: FurnishSpace
) -> F64:
    """(N,) score: favours ends at corners, penalises unusable gaps and blocked windows."""
    start = frames_array([w.frame for w in space.walls])[walls]
    length = np.array([w.length for w in space.walls])[walls]
    along = ((frames[:, :2] - start[:, :2]) * start[:, 2:]).sum(1)
    low, high = along + span[0], along + span[1]
    scores = np.zeros(len(frames))
    corners = [w.is_left_corner for w in space.walls], [w.is_right_corner for w in space.walls]
    for gap, is_corner in zip((low, length - high), corners, strict=True):
        at_corner = np.array(is_corner)[walls]
        scores += at_corner * like.corner * (gap < 0.02)
        scores -= at_corner * 0.25 * ((gap > 0.03) & (gap < _DEAD_GAP_M))
    if like.window_wall:
        covered = np.zeros(len(frames))
        for window in space.windows:
            shared = np.minimum(high, window.high) - np.maximum(low, window.low)
            covered += (walls == window.wall) * np.maximum(shared, 0.0)
        scores += like.window_wall * covered / max(span[1] - span[0], 1e-6)
    return scores


def _back_scores(template: Template, frames: F64, space: FurnishSpace) -> F64:
    """(N,) of a seat whose back is its far end: 1 at a wall, .6 with a way behind it, else -1."""
    u0, _, u1, v1 = template.extent
    scores = np.full(len(frames), 0.6)
    # From far to near: the first hit decides.
    for far, score in ((0.75, -1.0), (0.3, 0.8), (0.06, 1.0)):
        behind = _rects_in_frames(np.array([(u0 + 0.3, v1, u1 - 0.3, v1 + far)]), frames)
        scores[overlap(behind, space.outside).any(1)] = score
    return scores
