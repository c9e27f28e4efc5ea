"""Gaze of a walker: at items on the way, turning no faster than a person does; no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F64, Bools, FirstHit
from pbrs_farm.core.house import Geometry, House
from pbrs_farm.sample.walks.walk_space import is_door_item

_FIXATION_S: Final = (1.2, 2.8)  # duration of a fixation
_DISTANCE_M: Final = (0.9, 5.5)  # distances of fixated items
_ASIDE_RAD: Final = math.radians(80)  # largest angle between gaze and way
_SMOOTH_S: Final = 0.35  # standard deviation of the filter over the gaze
_TILT_SHARE: Final = 0.5  # weight of the angle down to an item; the usual tilt has the rest
_TILT_DEG: Final = (-4.0, 22.0)  # range of tilts, positive downwards
_USUAL_TILT_DEG: Final = 8.0  # NYUv2's median (docs/cameras.md)
_SIZE_M: Final = (0.15, 3.0)  # diagonals of fixated items
_SEEN_SHARE: Final = 0.9  # minimum unobstructed share of the line of sight to an item
_OPEN_M: Final = 3.0  # free sight beyond this counts no more
_FAN_AZIMUTH: Final = np.radians([-24.0, -12.0, 0.0, 12.0, 24.0])
_FAN_TILT: Final = np.radians([-8.0, 8.0, 24.0])
_N_REMEMBERED: Final = 4  # recently fixated items, which attract the gaze less
_REMEMBERED_WEIGHT: Final = 0.05  # factor of their weight
_LEAST_OPEN: Final = 0.05  # least openness; its cube is the weight of a direction
_YAW_PART, _TILT_PART = 0.95, 0.3  # of the allowed turn: together below 1


@dataclass(frozen=True, slots=True, eq=False)
class WalkThings:
    """Fixation targets: N items other than structure, doors and windows."""

    ids: NDArray[np.int64]  # (N,) instance ids
    middles: F64  # (N, 3)
    weights: F64  # (N,) how much each draws the eye


def things_of(house: House) -> WalkThings:
    """The house's furniture and items neither tiny nor as large as a room, by the root of their size."""
    ids, middles, weights = [], [], []
    for number, item in enumerate(house.items, start=1):
        if item.kind.is_structure or is_door_item(item) or not item.n_faces:
            continue
        low, high = item.bounds
        size = float(np.linalg.norm(high - low))
        if _SIZE_M[0] <= size <= _SIZE_M[1]:
            ids.append(number)
            middles.append((low + high) / 2)
            weights.append(math.sqrt(size))
    return WalkThings(
        np.array(ids, np.int64), np.array(middles, np.float64).reshape(-1, 3), np.array(weights)
    )


@dataclass(frozen=True, slots=True, eq=False)
class Walker:
    """A walker's eyes and way at N times."""

    eyes: F64  # (N, 3)
    heading: F64  # (N, 2) unit, plan
    times: F64  # (N,) s, evenly spaced


def gaze(
    walker: Walker,
    things: WalkThings,
    geometry: Geometry,
    first_hit: FirstHit,
    turn_rps: float,
    rng: np.random.Generator,
) -> tuple[F64, F64]:
    """(N,) azimuth (+x to +z) and (N,) tilt down, radians, at most turn_rps, to an item every 1 to 3 s."""
    n = len(walker.times)
    step_s = float(walker.times[1] - walker.times[0]) if n > 1 else 1.0
    azimuth, tilt = np.zeros(n), np.zeros(n)
    looked_at: list[int] = []
    start = 0
    while start < n:
        stop = min(n, start + max(int(rng.uniform(*_FIXATION_S) / step_s), 1))
        part = slice(start, stop)
        chosen = _choose_thing(
            walker, (start + stop - 1) // 2, things, geometry, first_hit, looked_at, rng
        )
        azimuth[part], tilt[part] = _angles_to(walker, part, things, chosen)
        if chosen is not None:
            looked_at.append(chosen)
        start = stop
    return (
        _bounded(_unwrapped(azimuth), turn_rps * _YAW_PART * step_s, step_s),
        _bounded(tilt, turn_rps * _TILT_PART * step_s, step_s),
    )


def _angles_to(
    walker: Walker, part: slice, things: WalkThings, chosen: int | None
) -> tuple[F64, F64]:
    """Azimuth and tilt of one fixation: to the centre of an item, or along the way."""
    usual = math.radians(_USUAL_TILT_DEG)
    heading = walker.heading[part]
    if chosen is None:
        return np.arctan2(heading[:, 1], heading[:, 0]), np.full(len(heading), usual)
    to = things.middles[chosen] - walker.eyes[part]
    level = np.linalg.norm(to[:, [0, 2]], axis=1)
    tilt = _TILT_SHARE * np.arctan2(-to[:, 1], level) + (1 - _TILT_SHARE) * usual
    return np.arctan2(to[:, 2], to[:, 0]), np.clip(tilt, *np.radians(_TILT_DEG))


def _choose_thing(
    walker: Walker,
    at: int,
    things: WalkThings,
    geometry: Geometry,
    first_hit: FirstHit,
    looked_at: list[int],
    rng: np.random.Generator,
) -> int | None:
    """The item fixated from the place at, among visible ones ahead; None without any."""
    eye, heading = walker.eyes[at], walker.heading[at]
    to = things.middles - eye
    level = np.linalg.norm(to[:, [0, 2]], axis=1)
    ahead = (to[:, [0, 2]] @ heading) >= math.cos(_ASIDE_RAD) * level
    near = (level >= _DISTANCE_M[0]) & (level <= _DISTANCE_M[1])
    candidates = np.flatnonzero(ahead & near)
    candidates = candidates[_in_sight(eye, candidates, things, geometry, first_hit)]
    # Recently fixated items attract the gaze less, and a close wall least of all.
    seen_lately = np.isin(candidates, looked_at[-_N_REMEMBERED:])
    weights = things.weights[candidates] * np.where(seen_lately, _REMEMBERED_WEIGHT, 1.0)
    towards = np.concatenate([to[candidates][:, [0, 2]], heading[None]])
    weights = np.append(weights, 1.0) * _openness(eye, towards, first_hit)
    # The last of them is the way ahead.
    chosen = int(rng.choice(len(weights), p=weights / weights.sum()))
    return None if chosen == len(candidates) else int(candidates[chosen])


def _openness(eye: F64, towards: F64, first_hit: FirstHit) -> F64:
    """(N,) openness, near 0 to 1: median visible distance of a fan of rays about directions (N, 2)."""
    azimuth = np.arctan2(towards[:, 1], towards[:, 0])[:, None, None] + _FAN_AZIMUTH[:, None]
    tilt = np.broadcast_to(_FAN_TILT, azimuth.shape[:2] + _FAN_TILT.shape)
    azimuth = np.broadcast_to(azimuth, tilt.shape)
    rays = np.stack(
        [np.cos(tilt) * np.cos(azimuth), -np.sin(tilt), np.cos(tilt) * np.sin(azimuth)], axis=-1
    ).reshape(-1, 3)
    t, _face = first_hit(np.broadcast_to(eye, rays.shape), rays)
    distance = np.minimum(t, _OPEN_M).reshape(len(towards), -1)
    return np.asarray(np.maximum(np.median(distance, axis=1) / _OPEN_M, _LEAST_OPEN) ** 3)


def _in_sight(
    eye: F64,
    candidates: NDArray[np.intp],
    things: WalkThings,
    geometry: Geometry,
    first_hit: FirstHit,
) -> Bools:
    if not len(candidates):
        return np.zeros(0, bool)
    to = things.middles[candidates] - eye
    t, face = first_hit(np.broadcast_to(eye, to.shape), to)
    itself = np.zeros(len(candidates), bool)
    itself[face >= 0] = geometry.face_item[face[face >= 0]] == things.ids[candidates][face >= 0]
    return np.asarray(itself | (t >= _SEEN_SHARE))


def _unwrapped(azimuth: F64) -> F64:
    """The same directions without jumps by whole turns: each change is the shorter way round."""
    return np.asarray(np.unwrap(azimuth))


def _bounded(angle: F64, most: float, step_s: float) -> F64:
    """The angle (N,) following as fast as it may, smoothed; no step is larger than most."""
    followed = angle.copy()
    for k in range(1, len(followed)):
        followed[k] = followed[k - 1] + np.clip(angle[k] - followed[k - 1], -most, most)
    # A mean of neighbours changes no faster than they do.
    return np.asarray(ndimage.gaussian_filter1d(followed, _SMOOTH_S / step_s, mode="nearest"))
