"""Record items of a home as they fall, slide and come to rest: rigid bodies by MuJoCo.

No effects. Only the named items move; everything else is static. Collision shapes are those of the
export: convex parts within 5 mm of the faces; walls and floors are slabs behind their faces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.edits import BodyMotion
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import House
from pbrs_farm.export.home_pieces import ExportedHome, Piece, exported_home
from pbrs_farm.scene.physics import STEP_S, mujoco_module, world_xml

KEYS_A_SECOND: Final = 60
_STILL_MPS: Final = 0.01  # maximum speed of the points of an item at rest, m/s
_STILL_S: Final = 0.2
_REACH_M: Final = 1.0  # margin around moving items for static geometry, metres; grows on retry
_TRIES: Final = 3
_FASTEST_MPS: Final = 60.0  # maximum speed before the simulation counts as exploded, m/s
_MOST_PUSH_MPS: Final = 50.0  # faster, an item passes through a floor within one step
_MOST_SPIN: Final = 300.0  # rad/s
_RESETS: Final = [3, 4, 5]  # mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC
_DEEPEST_M: Final = 0.03  # maximum initial penetration of another item, metres
_QUIET_S: Final = 0.3  # damped settling time before the push, seconds
_OUT_M: Final = 5.0  # distance outside the home's bounds at which an item is lost, metres


def recorded_falls(
    house: House,
    items: Sequence[str],
    *,
    seconds: float,
    from_s: float = 0.0,
    push: F64 | None = None,
    spin: F64 | None = None,
) -> tuple[BodyMotion, ...]:
    """Simulate items (ids), released at from_s, until they rest or the seconds are over.

    push: (3,) initial velocity, m/s; spin: (3,) initial rad/s about the item's middle; world axes. 60
    keys a second. Raises BadInput, naming the item, if it has no surface, begins inside another item,
    flies off, leaves the home, or still moves at the end; MachineFailed without MuJoCo.
    """
    mujoco = mujoco_module()
    for name, value, most, unit in (
        ("push", push, _MOST_PUSH_MPS, "m/s"),
        ("spin", spin, _MOST_SPIN, "rad/s"),
    ):
        if value is not None and np.linalg.norm(value) > most:
            raise BadInput("drop", name, f"expected at most {most:g} {unit}")
    for item in house.items:
        if item.id in items and item.kind.is_structure:
            raise BadInput(house.id, item.id, f"a {item.kind} cannot fall")
    home = exported_home(house)
    movers = [piece for name in items for piece in home.pieces if piece.item.id == name]
    for name in items:
        if not any(p.item.id == name and p.surfaces for p in movers):
            raise BadInput(house.id, name, "has no surface")
    reach = _REACH_M
    for _ in range(_TRIES):
        rows, pivots = _simulated(mujoco, home, movers, reach, (seconds, push, spin))
        far = float(np.linalg.norm(rows[:, :, :3] - rows[:1, :, :3], axis=-1).max())
        if far <= reach:
            break
        # Retry with the static geometry along the whole path.
        reach = 2 * far
    times = tuple(round(from_s + k / KEYS_A_SECOND, 6) for k in range(len(rows)))
    return tuple(
        BodyMotion(
            item=piece.item.id,
            times_s=times,
            pivot=tuple(pivots[k].tolist()),
            values=tuple(tuple(float(v) for v in row) for row in rows[:, k]),
        )
        for k, piece in enumerate(movers)
    )


def _simulated(
    mujoco: Any,
    home: ExportedHome,
    movers: Sequence[Piece],
    reach_m: float,
    how: tuple[float, F64 | None, F64 | None],
) -> tuple[F64, F64]:
    """(K, N, 7) middle and quaternion per key and moving item; (N, 3) initial middles."""
    seconds, push, spin = how
    pivots = np.array([piece.item.bounds.mean(0) for piece in movers])
    parts = [
        tuple(part - pivot for part in _world_parts(piece))
        for piece, pivot in zip(movers, pivots, strict=True)
    ]
    names, statics = _static_parts(home, movers, reach_m)
    world = mujoco.MjModel.from_xml_string(world_xml(parts, statics))
    state = mujoco.MjData(world)
    state.qpos[:] = np.concatenate([np.concatenate([p, [1, 0, 0, 0]]) for p in pivots])
    mujoco.mj_forward(world, state)
    _check_begin(home.house, world, state, movers, names)
    if state.ncon:
        # Convex parts of touching items may overlap slightly: separate them slowly.
        for _ in range(int(_QUIET_S / STEP_S)):
            mujoco.mj_step(world, state)
            state.qvel *= 0.9
        state.time = 0.0
    velocity = state.qvel.reshape(-1, 6)
    velocity[:, :3] += 0.0 if push is None else push
    for k in range(len(movers)):
        if spin is not None:
            # The angular velocity of a free joint is in the body's frame.
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, state.qpos[7 * k + 3 : 7 * k + 7])
            velocity[k, 3:] += turn.reshape(3, 3).T @ spin

    sizes = np.array([np.linalg.norm(np.ptp(p.item.bounds, axis=0)) / 2 for p in movers])
    box = _box_of(home.house)
    rows, still_for = [state.qpos.reshape(-1, 7).copy()], 0.0
    steps_a_key = 1 / (KEYS_A_SECOND * STEP_S)
    for k in range(1, int(seconds * KEYS_A_SECOND) + 1):
        for _ in range(round(k * steps_a_key) - round((k - 1) * steps_a_key)):
            mujoco.mj_step(world, state)
        velocity = state.qvel.reshape(-1, 6)
        speed = np.linalg.norm(velocity[:, :3], axis=1) + sizes * np.linalg.norm(
            velocity[:, 3:], axis=1
        )
        rows.append(state.qpos.reshape(-1, 7).copy())
        if state.warning.number[_RESETS].any():
            # MuJoCo has put everything back to its first state.
            speed[:] = np.inf
        _check_flight(home.house, movers, rows[-1], speed, box, k / KEYS_A_SECOND)
        still_for = still_for + 1 / KEYS_A_SECOND if speed.max() < _STILL_MPS else 0.0
        if still_for >= _STILL_S:
            break
    else:
        moving = [p.item.id for p, v in zip(movers, speed, strict=True) if v >= _STILL_MPS]
        text = f"still moves after {seconds:g} s, by {speed.max():.2f} m/s"
        raise BadInput(
            home.house.id, ", ".join(moving[:5]) or movers[0].item.id, text, hint="longer: seconds="
        )
    return np.array(rows), pivots


def _world_parts(piece: Piece) -> Iterator[F64]:
    """Convex parts (V, 3) of an item, in world coordinates."""
    for body in piece.bodies:
        for part in body.colliders:
            yield transform_points(piece.world_from_local, part)


def _static_parts(
    home: ExportedHome, movers: Sequence[Piece], reach_m: float
) -> tuple[list[str], list[F64]]:
    """Names with ids, and convex parts, of the static geometry around the moving items."""
    bounds = np.array([piece.item.bounds for piece in movers])
    low, high = bounds[:, 0].min(0) - reach_m, bounds[:, 1].max(0) + reach_m
    low[1] = -np.inf  # no lower limit: items fall
    names, parts = [], []
    moving = {piece.instance for piece in movers}
    for piece in home.pieces:
        a, b = piece.item.bounds
        if piece.instance in moving or not piece.surfaces or not ((a <= high) & (b >= low)).all():
            continue
        solids = (part for body in piece.bodies for part in body.solids)
        in_world = [transform_points(piece.world_from_local, part) for part in solids]
        near = [p for p in in_world if ((p.min(0) <= high) & (p.max(0) >= low)).all()]
        names += [f"{piece.item.name} ({piece.item.id})"] * len(near)
        parts += near
    return names, parts


def _check_begin(
    house: House, world: Any, state: Any, movers: Sequence[Piece], names: Sequence[str]
) -> None:
    """Raise BadInput if a moving item begins deep inside another item."""
    for contact in state.contact[: state.ncon]:
        if contact.dist >= -_DEEPEST_M:
            continue
        bodies = [int(world.geom_bodyid[g]) for g in (contact.geom1, contact.geom2)]
        who = [movers[b - 1].item.id for b in bodies if b > 0]
        # Static parts come first, in order.
        other_name = who[1] if len(who) > 1 else names[min(int(contact.geom1), int(contact.geom2))]
        text = f"starts {-1000 * contact.dist:.0f} mm inside {other_name}"
        raise BadInput(house.id, who[0], text, hint="move it to a free place")


def _check_flight(
    house: House, movers: Sequence[Piece], rows: F64, speed: F64, box: F64, time_s: float
) -> None:
    """Raise BadInput if an item exploded or left the home."""
    for piece, row, v in zip(movers, rows, speed, strict=True):
        if not np.isfinite(row).all() or v > _FASTEST_MPS:
            text = f"flies off after {time_s:.2f} s: too fast to simulate"
            raise BadInput(house.id, piece.item.id, text, hint="smaller push or spin")
        if (row[:3] < box[0] - _OUT_M).any() or (row[:3] > box[1] + _OUT_M).any():
            text = f"leaves the home after {time_s:.2f} s"
            raise BadInput(house.id, piece.item.id, text, hint="smaller push; a floor below it")


def _box_of(house: House) -> F64:
    bounds = np.array([i.bounds for i in house.items if i.surfaces and not i.is_outside])
    return np.array([np.nanmin(bounds[:, 0], 0), np.nanmax(bounds[:, 1], 0)])
