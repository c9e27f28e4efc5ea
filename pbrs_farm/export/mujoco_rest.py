"""Rest poses of the loose bodies of a MuJoCo model: overlapping bodies are moved apart, then all fall; no effects.

Furniture of a home may overlap by centimetres (a chair's leg and a table's), and a simulation would throw
such bodies about. They are moved apart first, by the smallest distance that frees them. Two that cannot be
parted, like a bed and its duvet, are to be joined.
"""

from __future__ import annotations

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools

_DEEP_M: Final = 2e-3  # maximum penetration of bodies that are not moved apart
_FREE_M: Final = 5e-4  # maximum penetration of a moved body
_WAYS_M: Final = (0.005, 0.01, *np.arange(0.02, 0.16, 0.02))  # distances by which a body is moved
_MOST_PARTED: Final = 200  # moves of bodies, and failed tries
_FALL_S: Final = 4.0  # time for coming to rest
_SLOW_S: Final = 0.6  # time of slow sinking at first, so that hovering bodies do not jump
_SLOW: Final = (0.2, 0.7)  # m/s, rad/s
_LOOK_S: Final = 2.0
_STILL_M: Final = 5e-4  # maximum motion of a body at rest in _LOOK_S
_LOST_M: Final = 0.25  # maximum way of a body with a support
_TIPPED_RAD: Final = 0.35


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """Poses of bodies, and which of them found no rest. With joined pairs no body has fallen yet."""

    poses: F64  # (N, 7) place and quaternion (w, x, y, z) of each body
    restless: Bools  # (N,)
    joined: tuple[tuple[int, int], ...] = ()  # pairs of bodies that overlap for good


def rest_of(world: Any, names: Sequence[str], areas_m2: Sequence[float]) -> Rest:
    """The rest poses of the free bodies of a model (an mjModel).

    names: of their free joints. areas_m2: in plan; of two overlapping bodies the smaller moves. A body is
    restless if it stays in another one, still moves after 4 s, tips over or goes 25 cm.
    """
    from pbrs_farm.quiet_mujoco import mujoco

    state = mujoco.MjData(world)
    mujoco.mj_forward(world, state)
    start = _poses(world, state, names)
    restless, joined = _move_apart(mujoco, world, state, names, areas_m2)
    if not restless.any() and not joined:
        _fall(mujoco, world, state)
        before = _poses(world, state, names)
        for _ in range(int(_LOOK_S / world.opt.timestep)):
            mujoco.mj_step(world, state)
        after = _poses(world, state, names)
        restless = np.linalg.norm(after[:, :3] - before[:, :3], axis=1) > _STILL_M
        restless |= np.linalg.norm(after[:, :3] - start[:, :3], axis=1) > _LOST_M
        cosine = np.abs((after[:, 3:] * start[:, 3:]).sum(1))
        restless |= 2 * np.arccos(np.clip(cosine, 0, 1)) > _TIPPED_RAD
        restless |= ~np.isfinite(after).all(1)
    return Rest(_poses(world, state, names), restless, joined)


def _poses(world: Any, state: Any, names: Sequence[str]) -> F64:
    starts = [int(world.joint(name).qposadr[0]) for name in names]
    return np.array([state.qpos[k : k + 7] for k in starts], np.float64).reshape(-1, 7)


def _move_apart(
    mujoco: Any, world: Any, state: Any, names: Sequence[str], areas_m2: Sequence[float]
) -> tuple[Bools, tuple[tuple[int, int], ...]]:
    """Move bodies until none overlap; returns those that nothing frees from the home, and pairs of them."""
    body_of = {int(world.body(name).id): k for k, name in enumerate(names)}
    stuck = np.zeros(len(names), bool)
    joined: dict[tuple[int, int], tuple[int, int]] = {}
    for _ in range(_MOST_PARTED):
        pairs = {
            pair: depth
            for pair, depth in _depths(world, state).items()
            if depth > _DEEP_M and pair not in joined
        }
        loose_of = {pair: [body_of[body] for body in pair if body in body_of] for pair in pairs}
        pairs = {p: d for p, d in pairs.items() if loose_of[p] and not stuck[loose_of[p]].any()}
        if not pairs:
            break
        pair = max(pairs, key=lambda p: (pairs[p], p))
        loose = sorted(loose_of[pair], key=lambda k: areas_m2[k])
        for k in loose:
            # Smaller bodies make way afterwards, like the contents of a lifted table.
            smaller = {b for b, n in body_of.items() if areas_m2[n] < areas_m2[k]} - set(pair)
            if _freed(mujoco, world, state, names[k], smaller):
                break
        else:
            if len(loose) == 2:
                joined[pair] = (loose[0], loose[1])
            else:
                stuck[loose[0]] = True
    return stuck, tuple(joined.values())


def _depths(world: Any, state: Any) -> dict[tuple[int, int], float]:
    """Penetration of the bodies of each touching pair, metres."""
    depths: dict[tuple[int, int], float] = {}
    contact = state.contact
    for geoms, distance in zip(contact.geom, contact.dist, strict=True):
        low, high = sorted(int(world.geom_bodyid[g]) for g in geoms)
        depths[(low, high)] = max(depths.get((low, high), 0.0), -float(distance))
    return depths


def _freed(mujoco: Any, world: Any, state: Any, name: str, ignored: AbstractSet[int]) -> bool:
    """Move a body by the shortest way, level or up, to a place free of all but ignored bodies; True if there is one."""
    start, body = int(world.joint(name).qposadr[0]), int(world.body(name).id)
    home = state.qpos[start : start + 3].copy()
    angles = np.arange(8) * np.pi / 4
    ways = [np.array([np.cos(a), np.sin(a), 0.0]) for a in angles] + [np.array([0.0, 0.0, 1.0])]
    for length in _WAYS_M:
        for way in ways:
            state.qpos[start : start + 3] = home + length * way
            mujoco.mj_kinematics(world, state)
            mujoco.mj_collision(world, state)
            depths = _depths(world, state)
            met = (d for pair, d in depths.items() if body in pair and not ignored & set(pair))
            if max(met, default=0.0) < _FREE_M:
                return True
    state.qpos[start : start + 3] = home
    mujoco.mj_kinematics(world, state)
    mujoco.mj_collision(world, state)
    return False


def _fall(mujoco: Any, world: Any, state: Any) -> None:
    """Step until all bodies are at rest."""
    sleep = getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", None)
    if sleep is not None:
        world.opt.enableflags |= int(sleep)  # resting bodies cost nothing
    is_free = world.jnt_type == mujoco.mjtJoint.mjJNT_FREE
    first = world.jnt_dofadr[is_free]
    steps, slow = (int(s / world.opt.timestep) for s in (_FALL_S, _SLOW_S))
    for k in range(steps):
        mujoco.mj_step(world, state)
        if k < slow:
            for begin, most in zip((0, 3), _SLOW, strict=True):
                dofs = first[:, None] + np.arange(begin, begin + 3)
                speed = np.linalg.norm(state.qvel[dofs], axis=1, keepdims=True)
                state.qvel[dofs] *= np.minimum(1.0, most / np.maximum(speed, 1e-9))
        elif k % 50 == 0 and np.abs(state.qvel).max(initial=0.0) < 1e-3:
            break
    if sleep is not None:
        world.opt.enableflags &= ~int(sleep)
