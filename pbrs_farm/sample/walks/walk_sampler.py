"""A person's walk through a home as views in the order of time; no effects of its own.

The same house, fields and seed give the same walk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, I64, Bools, FirstHit
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.house import Geometry, House
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.core.walkable import CELL_M, WALK_M
from pbrs_farm.sample.camera_report import CameraReport
from pbrs_farm.sample.house_sampler import Sampling
from pbrs_farm.sample.stored_cameras import OUTSIDE, sector_of
from pbrs_farm.sample.walks.walk_space import (
    WalkSpace,
    is_door_item,
    shut_doors,
    walk_spaces,
    way_through_rooms,
)

# A way of cells as a smooth path, and how fast it is walked.


_ROUNDS: Final = 150  # of relaxation: corners are rounded over half a metre
_CONTROL_M: Final = 0.2  # between the control points of the spline
_DENSE_M: Final = 0.005  # between the points that speed is measured at
_ACROSS_MPS2: Final = 0.8  # acceleration in a turn, at most
_ALONG_MPS2: Final = 0.6  # of setting off and slowing down, at most
_LEAST_MPS: Final = 0.05  # also at rest, so that the way ends
_CURVE_M: Final = 0.05  # of way before and after a place that tell its curvature
_HEADING_M: Final = 0.2  # and its heading


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Where a walker is at times that are given."""

    places: F64  # (N, 2) plan x, z
    heading: F64  # (N, 2) unit direction of the path
    length_m: float  # of the path that is walked


def relaxed(way: F64, space: WalkSpace) -> F64:
    """The way (M, 2) with its corners rounded; no point comes nearer to anything than half a way."""
    places = _resampled(way, CELL_M)
    # Move each point towards its neighbours' middle, where that stays clear; the ends stay.
    for _round in range(_ROUNDS if len(places) > 2 else 0):
        moved = places.copy()
        moved[1:-1] += 0.5 * ((places[:-2] + places[2:]) / 2 - places[1:-1])
        clear = _is_clear(moved, space)
        places = np.where(clear[:, None], moved, places)
    return places


def _is_clear(places: F64, space: WalkSpace) -> Bools:
    cells = space.grid.cells(places)
    inside = space.grid.holds(cells)
    clear = np.zeros(len(places), bool)
    clear[inside] = space.clearance[tuple(cells[inside].T)] >= WALK_M / 2
    return clear


def _resampled(path: F64, step_m: float) -> F64:
    """Points step_m apart along a polyline (M, 2), its ends among them."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    n = max(round(float(along[-1]) / step_m), 1)
    at = np.linspace(0, along[-1], n + 1)
    return np.stack([np.interp(at, along, path[:, k]) for k in range(2)], axis=1)


def spline_through(places: F64) -> F64:
    """(M, 2) points 5 mm apart on the cubic B-spline that has the places as control points.

    It lies within the hull of every four neighbours: twice continuous and as clear as they are.
    """
    from scipy.interpolate import BSpline  # here: 0.1 s that only walks need

    control = _resampled(places, _CONTROL_M)
    # Repeat the ends, so that the curve begins and ends at them.
    control = np.concatenate([control[:1], control[:1], control, control[-1:], control[-1:]])
    knots = np.arange(len(control) + 4, dtype=np.float64)
    curve = BSpline(knots, control, 3)
    at = np.linspace(knots[3], knots[-4], max(int(len(places) * CELL_M / _DENSE_M), 8))
    return _resampled(np.asarray(curve(at)), _DENSE_M)


def walked(path: F64, times: F64, speed_mps: float) -> Motion:
    """The walker on a path (M, 2) at ascending times (N,) s from 0; no faster than speed_mps.

    It slows in turns and sets off and stops gently; at the path's end it stays.
    """
    step = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(step)])
    # Bound the speed by the curvature, then by what can be gained or lost on the way.
    speed = np.minimum(speed_mps, np.sqrt(_ACROSS_MPS2 / np.maximum(_curvature(path), 1e-6)))
    speed = np.maximum(speed, _LEAST_MPS)
    gain = 2 * _ALONG_MPS2 * np.append(step, 0)
    squared = speed**2
    for k in range(1, len(squared)):
        squared[k] = min(squared[k], squared[k - 1] + gain[k - 1])
    for k in range(len(squared) - 2, -1, -1):
        squared[k] = min(squared[k], squared[k + 1] + gain[k])
    speed = np.sqrt(squared)
    # Add up the time from point to point and find the place of each time that is asked for.
    when = np.concatenate([[0.0], np.cumsum(step / ((speed[:-1] + speed[1:]) / 2))])
    at = np.interp(times, when, along)
    places = np.stack([np.interp(at, along, path[:, k]) for k in range(2)], axis=1)
    return Motion(places, _heading(path, along, at), float(at[-1]))


def _curvature(path: F64) -> F64:
    """(M,) 1/m, over 10 cm: a point of the polyline has none."""
    n = max(int(_CURVE_M / _DENSE_M), 1)
    if len(path) <= 2 * n:
        return np.zeros(len(path))
    back, ahead = path[n:-n] - path[: -2 * n], path[2 * n :] - path[n:-n]
    cross = back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0]
    turn = np.abs(np.arctan2(cross, (back * ahead).sum(1)))
    return np.pad(turn / (n * _DENSE_M), n, mode="edge")


def _heading(path: F64, along: F64, at: F64) -> F64:
    """(N, 2) unit direction at lengths at, over 20 cm ahead and behind."""
    ends = [
        np.stack([np.interp(at + d, along, path[:, k]) for k in range(2)], axis=1)
        for d in (-_HEADING_M, _HEADING_M)
    ]
    direction = ends[1] - ends[0]
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    return np.where(length > 1e-6, direction / np.maximum(length, 1e-9), [1.0, 0.0])


# Where a walker looks: at things on the way, turning no faster than a person does of its own.


_FIXATION_S: Final = (1.2, 2.8)  # how long one thing is looked at
_DISTANCE_M: Final = (0.9, 5.5)  # of a thing that is looked at
_ASIDE_RAD: Final = math.radians(80)  # from the way, at most
_SMOOTH_S: Final = 0.35  # standard deviation of the filter over the gaze
_TILT_SHARE: Final = 0.5  # of a thing's own angle; the rest is the usual tilt
_TILT_DEG: Final = (-4.0, 22.0)  # downwards, least and most
_USUAL_TILT_DEG: Final = 8.0  # NYUv2's median (docs/cameras.md)
_SIZE_M: Final = (0.15, 3.0)  # diagonal of a thing that is looked at
_SEEN_SHARE: Final = 0.9  # of the way to a thing's middle that nothing may stand in
_OPEN_M: Final = 3.0  # as far as anything need be
_FAN_AZIMUTH: Final = np.radians([-24.0, -12.0, 0.0, 12.0, 24.0])
_FAN_TILT: Final = np.radians([-8.0, 8.0, 24.0])
_N_REMEMBERED: Final = 4  # things looked at last, which draw the eye less
_REMEMBERED_WEIGHT: Final = 0.05  # of theirs
_LEAST_OPEN: Final = 0.05  # of the share of _OPEN_M; its cube prefers far sights
_YAW_PART, _TILT_PART = 0.95, 0.3  # of the turn that is allowed: together below 1


@dataclass(frozen=True, slots=True, eq=False)
class WalkThings:
    """What can be looked at: N items that are no structure, door or window."""

    ids: NDArray[np.int64]  # (N,) instance ids
    middles: F64  # (N, 3)
    weights: F64  # (N,) how much each draws the eye


def things_of(house: House) -> WalkThings:
    """The house's furniture and things, by the size of their boxes."""
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
    """(N,) azimuth from +x towards +z and (N,) tilt downwards, radians; turning at most turn_rps.

    Every one to three seconds another thing that is in sight is looked at, or the way ahead.
    """
    n = len(walker.times)
    step_s = float(walker.times[1] - walker.times[0]) if n > 1 else 1.0
    azimuth, tilt = np.zeros(n), np.zeros(n)
    looked_at: list[int] = []
    start = 0
    while start < n:
        stop = min(n, start + max(int(rng.uniform(*_FIXATION_S) / step_s), 1))
        part = slice(start, stop)
        chosen = _chosen(
            walker, (start + stop - 1) // 2, things, geometry, first_hit, looked_at, rng
        )
        azimuth[part], tilt[part] = _towards(walker, part, things, chosen)
        if chosen is not None:
            looked_at.append(chosen)
        start = stop
    return (
        _bounded(_unwrapped(azimuth), turn_rps * _YAW_PART * step_s, step_s),
        _bounded(tilt, turn_rps * _TILT_PART * step_s, step_s),
    )


def _towards(
    walker: Walker, part: slice, things: WalkThings, chosen: int | None
) -> tuple[F64, F64]:
    """Azimuth and tilt of one fixation: to the middle of a thing, or along the way."""
    usual = math.radians(_USUAL_TILT_DEG)
    heading = walker.heading[part]
    if chosen is None:
        return np.arctan2(heading[:, 1], heading[:, 0]), np.full(len(heading), usual)
    to = things.middles[chosen] - walker.eyes[part]
    level = np.linalg.norm(to[:, [0, 2]], axis=1)
    tilt = _TILT_SHARE * np.arctan2(-to[:, 1], level) + (1 - _TILT_SHARE) * usual
    return np.arctan2(to[:, 2], to[:, 0]), np.clip(tilt, *np.radians(_TILT_DEG))


def _chosen(
    walker: Walker,
    at: int,
    things: WalkThings,
    geometry: Geometry,
    first_hit: FirstHit,
    looked_at: list[int],
    rng: np.random.Generator,
) -> int | None:
    """The thing that is looked at from the place at, of those ahead and in sight; None without any."""
    eye, heading = walker.eyes[at], walker.heading[at]
    to = things.middles - eye
    level = np.linalg.norm(to[:, [0, 2]], axis=1)
    ahead = (to[:, [0, 2]] @ heading) >= math.cos(_ASIDE_RAD) * level
    near = (level >= _DISTANCE_M[0]) & (level <= _DISTANCE_M[1])
    candidates = np.flatnonzero(ahead & near)
    candidates = candidates[_in_sight(eye, candidates, things, geometry, first_hit)]
    # What was looked at lately draws the eye less, and a wall close before it least of all.
    seen_lately = np.isin(candidates, looked_at[-_N_REMEMBERED:])
    weights = things.weights[candidates] * np.where(seen_lately, _REMEMBERED_WEIGHT, 1.0)
    towards = np.concatenate([to[candidates][:, [0, 2]], heading[None]])
    weights = np.append(weights, 1.0) * _openness(eye, towards, first_hit)
    # The last of them is the way ahead.
    chosen = int(rng.choice(len(weights), p=weights / weights.sum()))
    return None if chosen == len(candidates) else int(candidates[chosen])


def _openness(eye: F64, towards: F64, first_hit: FirstHit) -> F64:
    """(N,) from near 0 to 1: how far one sees, by the median of a fan of rays about directions (N, 2)."""
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


# The shake of a camera held by a walking person, as sums of slow waves.


_WAVES_HZ: Final = (0.45, 0.8, 1.3, 2.1)
_PLACE_M: Final = 0.0015  # amplitude of each wave and axis
_TURN_RAD: Final = math.radians(0.12)
_STEPS_HZ: Final = 1.7
_STEP_M: Final = 0.006  # up and down with every step


@dataclass(frozen=True, slots=True, eq=False)
class Shake:
    """What is added to a steady camera at N times."""

    moved: F64  # (N, 3) metres, world
    turned: F64  # (N, 3) radians: azimuth, tilt, roll

    speed_mps: float  # at most, by the shake alone
    turn_rps: float


def shake(times: F64, strength: float, rng: np.random.Generator) -> Shake:
    """The shake at times (N,) s; strength: 1 = a steady hand's, 0 = none."""
    frequency = np.asarray(_WAVES_HZ)
    phases = rng.uniform(0, 2 * math.pi, (6, len(frequency)))
    waves = np.sin(2 * math.pi * frequency * times[:, None, None] + phases).sum(-1)  # (N, 6)
    moved = strength * _PLACE_M * waves[:, :3]
    moved[:, 1] += strength * _STEP_M * np.sin(2 * math.pi * _STEPS_HZ * times + phases[0, 0])
    # Bound the speed by the sum of what the waves can do, three axes at once.
    steepest = 2 * math.pi * float(frequency.sum())
    speed = math.sqrt(3) * _PLACE_M * steepest + 2 * math.pi * _STEPS_HZ * _STEP_M
    turn = math.sqrt(3) * _TURN_RAD * steepest
    return Shake(moved, strength * _TURN_RAD * waves[:, 3:], strength * speed, strength * turn)


# A person's walk through a home as views in the order of time.


ORIGIN: Final = "walk"
_EYE_M: Final = (1.5, 1.6)  # above the floor, as the paper's cameras
_STEP_SMOOTH_S: Final = 0.3  # over which a step between floors is spread
_SPEED_PART: Final = 0.95  # of the speed is along the floor, the rest up and down


def sample_walk(
    house: House, fields: CameraFields, seed: int, geometry: Geometry, first_hit: FirstHit
) -> Sampling:
    """fields.walk_frames views along one walk, where the most floor is free and most things stand.

    Rooms are passed where their doors are open. No frame is farther from the last one than
    fields.walk_speed_mps, or turned by more than fields.walk_turn_dps, allow. A home without a
    region 0.6 m wide has no view; the report says which doors are shut.
    """
    spaces = walk_spaces(house)
    space = max(spaces, key=lambda s: s.interest, default=None)
    if space is None or not space.region.any():
        return Sampling((), _report(fields, 0, (_why_none(spaces),)), ())
    # Find the way, then where the walker is and what is looked at.
    rng = np.random.default_rng(seed)
    times = np.arange(fields.walk_frames) / fields.walk_fps
    shaken = shake(times, fields.walk_shake, rng)
    speed = max(_SPEED_PART * (fields.walk_speed_mps - shaken.speed_mps), 0.05)
    way = way_through_rooms(space, speed * float(times[-1]) + 1.0, rng)
    motion = walked(spline_through(relaxed(way, space)), times, speed)
    eyes = _eyes(space, motion.places, fields, rng)
    turn_rps = math.radians(fields.walk_turn_dps) - shaken.turn_rps
    azimuth, tilt = gaze(
        Walker(eyes, motion.heading, times), things_of(house), geometry, first_hit,
        max(turn_rps, 0.02), rng,
    )  # fmt: skip
    views = _views(house, space, fields, _poses(eyes, azimuth, tilt, shaken))
    notes = _notes(house, space, views, motion.length_m)
    return Sampling(views, _report(fields, len(views), notes), ())


def _eyes(space: WalkSpace, places: F64, fields: CameraFields, rng: np.random.Generator) -> F64:
    """(N, 3) eyes above the floor of plan places (N, 2); steps between floors are spread."""
    cells = _cells(space, places)
    floor = space.floor_y[tuple(cells.T)]
    floor = ndimage.gaussian_filter1d(floor, _STEP_SMOOTH_S * fields.walk_fps, mode="nearest")
    height = rng.uniform(*_EYE_M)
    return np.stack([places[:, 0], floor + height, places[:, 1]], axis=1)


def _cells(space: WalkSpace, places: F64) -> I64:
    cells = space.grid.cells(places)
    return np.clip(cells, 0, np.array(space.grid.shape) - 1)


def _poses(eyes: F64, azimuth: F64, tilt: F64, shaken: Shake) -> F64:
    """(N, 4, 4) world from camera, OpenGL axes."""
    azimuth, tilt = azimuth + shaken.turned[:, 0], tilt + shaken.turned[:, 1]
    towards = np.stack(
        [np.cos(tilt) * np.cos(azimuth), -np.sin(tilt), np.cos(tilt) * np.sin(azimuth)], axis=1
    )
    # Roll turns the picture about the view's axis.
    right = np.stack([-np.sin(azimuth), np.zeros(len(azimuth)), np.cos(azimuth)], axis=1)
    up = np.cross(right, towards)
    c, s = np.cos(shaken.turned[:, 2:]), np.sin(shaken.turned[:, 2:])
    poses = np.zeros((len(eyes), 4, 4))
    poses[:, :3, 0], poses[:, :3, 1] = c * right + s * up, c * up - s * right
    poses[:, :3, 2], poses[:, :3, 3] = -towards, eyes + shaken.moved
    poses[:, 3, 3] = 1.0
    return poses


def _views(house: House, space: WalkSpace, fields: CameraFields, poses: F64) -> tuple[View, ...]:
    intrinsics = Intrinsics.from_hfov(
        fields.score_width_px, fields.score_height_px, fields.hfov_rad
    )
    room = space.room[tuple(_cells(space, poses[:, [0, 2], 3]).T)]
    views: list[View] = []
    for number, (pose, k) in enumerate(zip(poses, room.tolist(), strict=True)):
        # In a doorway the room is the one that was left.
        before = views[-1].room_id if views else OUTSIDE
        camera = Camera(intrinsics, pose)
        views.append(
            View(
                keys.frame_id(number),
                house.rooms[k].id if k >= 0 else before,
                sector_of(camera, fields.n_sectors),
                camera,
                ORIGIN,
                frame=number,
                time_s=number / fields.walk_fps,
            )
        )
    return tuple(views)


def _why_none(spaces: tuple[WalkSpace, ...]) -> str:
    shut = [name for space in spaces for name in shut_doors(space)]
    text = "nowhere to walk: no way 0.6 m wide between things"
    return f"{text}; doors that are shut: {', '.join(shut)}" if shut else text


def _notes(
    house: House, space: WalkSpace, views: tuple[View, ...], length_m: float
) -> tuple[str, ...]:
    rooms = list(dict.fromkeys(view.room_id for view in views))
    names = ", ".join(house.room(r).name or r for r in rooms if r != OUTSIDE)
    notes = [f"a walk of {length_m:.1f} m through {names}"]
    if shut := shut_doors(space):
        notes.append(f"doors that are shut: {', '.join(shut)}")
    return tuple(notes)


def _report(fields: CameraFields, n_views: int, notes: tuple[str, ...]) -> CameraReport:
    return CameraReport(
        preset=fields.preset, source=fields.source, n_views=n_views, n_candidates=n_views,
        refused={}, rooms=(), notes=notes,
    )  # fmt: skip
