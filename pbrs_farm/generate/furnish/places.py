"""All places where a template can stand in a room, with what makes each good; no effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.generate.furnish.room_space import RoomSpace, Wall
from pbrs_farm.generate.furnish.template import Frame, Group, Stand, Standing, Template
from pbrs_farm.generate.plan import Rect

_STEP_M: Final = 0.10
_FREE_STEP_M: Final = 0.15
_TOUCH_M: Final = 0.002
_ABOVE_SILL_M: Final = 0.08
_DEAD_GAP_M: Final = 0.35  # a gap that nobody can use
_BESIDE_M: Final = 0.01  # between furniture and the wall at its end
_NOISE: Final = 0.25
_BEST: Final = 20


@dataclass(slots=True, eq=False)
class Places:
    """Where a group can stand: rows are places; unused rectangles are nan."""

    found: list[Standing]
    bodies: F64  # (N, B, 4)
    clear: F64  # (N, C, 4)
    scores: F64  # (N,)

    def free_of(self, alive: Bools, standing: Standing) -> Bools:
        """Which of the places stay possible when something stands."""
        bodies, clear = _array(standing.bodies), _array(standing.clear)
        taken = np.concatenate([bodies, clear])
        hit = overlap(self.bodies, taken).any(1) | overlap(self.clear, bodies).any(1)
        return np.asarray(alive & ~hit)

    def best(self, alive: Bools, n: int = _BEST) -> list[Standing]:
        """The best places, no two of a wall closer than 0.4 m while others are there."""
        order = np.argsort(-self.scores, kind="stable")
        chosen: list[Standing] = []
        later: list[Standing] = []
        for k in order[alive[order]]:
            place = self.found[k]
            near = any(
                c.template.name == place.template.name
                and abs(c.frame.x - place.frame.x) + abs(c.frame.z - place.frame.z) < 0.4
                and (c.frame.dx, c.frame.dz) == (place.frame.dx, place.frame.dz)
                for c in chosen
            )
            (later if near else chosen).append(place)
            if len(chosen) >= n:
                break
        return (chosen + later)[:n]


def overlap(rects: F64, others: F64) -> Bools:
    """(N, B) whether each of rects (N, B, 4) overlaps any of others (M, 4) by more than 2 mm."""
    if not len(others) or not rects.size:
        return np.zeros(rects.shape[:2], bool)
    a, b, e = rects[:, :, None, :], others[None, None], _TOUCH_M
    hit = (
        (a[..., 0] < b[..., 2] - e) & (a[..., 2] > b[..., 0] + e)
        & (a[..., 1] < b[..., 3] - e) & (a[..., 3] > b[..., 1] + e)
    )  # fmt: skip
    return np.asarray(hit.any(2))


def places_of(group: Group, space: RoomSpace, rng: np.random.Generator) -> Places:
    """Every place of every template of a group that walls, doors and windows allow."""
    found: list[Standing] = []
    for template in group.templates:
        for version in _versions(template):
            found += _places(version, space, rng)
    n_bodies = max((len(t.bodies) for t in group.templates), default=0)
    n_clear = max((len(t.clear) for t in group.templates), default=0)
    bodies = np.full((len(found), n_bodies, 4), np.nan)
    clear = np.full((len(found), n_clear, 4), np.nan)
    for k, place in enumerate(found):
        for i, rect in enumerate(place.bodies):
            bodies[k, i] = rect
        for i, rect in enumerate(place.clear):
            clear[k, i] = rect
    scores = np.array([place.score for place in found])
    return Places(found, bodies, clear, scores)


def fixed_places(found: Sequence[Standing]) -> Places:
    """Places that were found elsewhere."""
    n_bodies = max((len(p.bodies) for p in found), default=0)
    n_clear = max((len(p.clear) for p in found), default=0)
    bodies = np.full((len(found), n_bodies, 4), np.nan)
    clear = np.full((len(found), n_clear, 4), np.nan)
    for k, place in enumerate(found):
        bodies[k, : len(place.bodies)] = _array(place.bodies)
        clear[k, : len(place.clear)] = _array(place.clear)
    return Places(list(found), bodies, clear, np.array([p.score for p in found]))


def allowed(template: Template, frames: Sequence[Frame], space: RoomSpace) -> Bools:
    """(N,) which frames keep a template inside the room, off doors and below window sills."""
    bodies = _moved(np.array([s.rect for s in template.bodies]), frames)
    bad = overlap(bodies, np.concatenate([space.outside, space.doors])).any(1)
    if template.clear:
        bad |= overlap(_moved(np.array(template.clear), frames), space.outside).any(1)
    for window in space.windows:
        tall = [s.rect for s in template.slots if s.screen_top > window.sill + _ABOVE_SILL_M]
        if tall:
            bad |= overlap(_moved(np.array(tall), frames), np.array([window.zone])).any(1)
    return np.asarray(~bad)


def _versions(template: Template) -> list[Template]:
    if template.stand is Stand.CORNER:
        return [template, template.mirrored()]
    turned = template.mirrored()
    same = {(s.piece.id, s.rect) for s in template.slots} == {
        (s.piece.id, s.rect) for s in turned.slots
    }
    return [template] if same and set(template.clear) == set(turned.clear) else [template, turned]


def _places(template: Template, space: RoomSpace, rng: np.random.Generator) -> list[Standing]:
    framed = _free_frames(space) if template.stand is Stand.FREE else _wall_frames(template, space)
    if not framed:
        return []
    ok = allowed(template, [frame for frame, _ in framed], space)
    noise = rng.random(len(framed)) * _NOISE
    return [
        Standing(template, frame, _score(template, frame, wall, space) + float(noise[k]))
        for k, (frame, wall) in enumerate(framed)
        if ok[k]
    ]


def _wall_frames(template: Template, space: RoomSpace) -> list[tuple[Frame, Wall | None]]:
    u0, _, u1, _ = template.extent
    found: list[tuple[Frame, Wall | None]] = []
    for wall in space.walls:
        low, high = _BESIDE_M - u0, wall.length - u1 - _BESIDE_M
        if high < low - 1e-9:
            continue
        at: list[float] = []
        if template.stand is Stand.CORNER:
            if template.end < 0 and wall.is_left_corner:
                at = [low]
            if template.end > 0 and wall.is_right_corner:
                at = [high]
        else:
            n = int((high - low) / _STEP_M + 1e-9)
            at = [low + k * _STEP_M for k in range(n + 1)]
            if high - at[-1] > 1e-6:
                at.append(high)
        for u in at:
            x, z = wall.frame.point(u, 0.0)
            found.append((Frame(x, z, wall.frame.dx, wall.frame.dz), wall))
    return found


def _free_frames(space: RoomSpace) -> list[tuple[Frame, Wall | None]]:
    x0, z0, x1, z1 = space.bounds
    found: list[tuple[Frame, Wall | None]] = []
    for i in range(1, int((x1 - x0) / _FREE_STEP_M)):
        for k in range(1, int((z1 - z0) / _FREE_STEP_M)):
            x, z = x0 + i * _FREE_STEP_M, z0 + k * _FREE_STEP_M
            found += [(Frame(x, z, 1, 0), None), (Frame(x, z, 0, 1), None)]
    return found


def _moved(rects: F64, frames: Sequence[Frame]) -> F64:
    """(N, B, 4) rectangles of the template (B, 4) in each frame."""
    place = np.array([(f.x, f.z, f.dx, f.dz) for f in frames])
    x, z, dx, dz = (place[:, k, None, None] for k in range(4))
    u, v = rects[None, :, 0::2], rects[None, :, 1::2]
    xs, zs = x + u * dx - v * dz, z + u * dz + v * dx
    return np.stack([xs.min(2), zs.min(2), xs.max(2), zs.max(2)], -1)


def _array(rects: Sequence[Rect]) -> F64:
    return np.array(rects, np.float64).reshape(-1, 4)


def _score(template: Template, frame: Frame, wall: Wall | None, space: RoomSpace) -> float:
    like, score = template.liking, template.rank
    u0, v0, u1, v1 = template.extent
    x, z = frame.point((u0 + u1) / 2, (v0 + v1) / 2)
    if wall is not None:
        along = (frame.x - wall.frame.x) * wall.frame.dx + (frame.z - wall.frame.z) * wall.frame.dz
        left, right = along + u0, wall.length - along - u1
        for gap, is_corner in ((left, wall.is_left_corner), (right, wall.is_right_corner)):
            if is_corner:
                score += like.corner * (gap < 0.02) - 0.25 * (0.03 < gap < _DEAD_GAP_M)
        if like.window_wall:
            score += like.window_wall * _window_share(space, wall, along + u0, along + u1)
    if like.daylight and space.windows:
        near = min(math.dist((x, z), w.middle) for w in space.windows)
        score -= like.daylight * near
    if like.door and len(space.doors):
        near = min(math.dist((x, z), ((d[0] + d[2]) / 2, (d[1] + d[3]) / 2)) for d in space.doors)
        score += like.door * min(near, 4.0)
    if like.middle:
        x0, z0, x1, z1 = space.bounds
        score -= like.middle * math.dist((x, z), ((x0 + x1) / 2, (z0 + z1) / 2))
    if like.back:
        score += like.back * _back_score(template, frame, space)
    return score


def _window_share(space: RoomSpace, wall: Wall, low: float, high: float) -> float:
    """Share of a stretch of wall that lies below windows."""
    covered = 0.0
    for window in space.windows:
        if window.wall >= 0 and space.walls[window.wall] == wall:
            covered += max(min(high, window.high) - max(low, window.low), 0.0)
    return covered / max(high - low, 1e-6)


def _back_score(template: Template, frame: Frame, space: RoomSpace) -> float:
    """Of a seat whose back is its far end: 1 at a wall, .6 with a way behind it, else -1."""
    u0, _, u1, v1 = template.extent
    depth = 0.0
    for far in (0.06, 0.3, 0.75):
        behind = np.array([[frame.rect((u0 + 0.3, v1, u1 - 0.3, v1 + far))]])
        if overlap(behind, space.outside).any():
            break
        depth = far
    return {0.0: 1.0, 0.06: 0.8, 0.3: -1.0}.get(depth, 0.6)
