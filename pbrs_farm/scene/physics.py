"""Things dropped into a home and come to rest: rigid bodies by MuJoCo, convex parts by CoACD.

No effects. The home stands still: its surfaces near the supports are prisms a triangle, what else
stands there its convex hull. Things fall a hand's breadth, tumble, and lie where they stop; what
falls off its support is dropped again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.house import House, Item, ItemKind, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors
from pbrs_farm.geometry.convex_parts import convex_parts, hull_of
from pbrs_farm.installation import install_command
from pbrs_farm.scene.models import Model
from pbrs_farm.scene.placing import Support, caster_of, level_area, level_triangles

_STEP_S: Final = 0.002
_LONGEST_S: Final = 8.0  # of simulated time until all lie still
_STILL: Final = 0.004  # m/s and rad/s a tenth: slower than that for _STILL_S is at rest
_STILL_S: Final = 0.2
_ROUNDS: Final = 4  # of dropping again what fell off
_TRIES: Final = 60  # of a place above a support
_APART_M: Final = 0.01  # of what falls at the same time
_DROP_M: Final = 0.03  # above the support, or what lies there
_REACH_M: Final = 0.6  # around supports: what stands farther away is not met
_DEEP_M: Final = 0.03  # of a level triangle's prism, so that nothing falls through
_THIN_M: Final = 0.002  # of the others'
_LEAST_M2: Final = 1e-6  # of a triangle that is met
_MOST_PRISMS: Final = 6_000
_DENSITY: Final = 500.0  # kg/m3
_FALLEN_M: Final = 0.05  # below its support


@dataclass(slots=True, eq=False)
class _Body:
    model: Model
    support: Support
    pose: F64  # (4, 4) world_from_model


def settled_poses(
    house: House, models: Sequence[Model], n: int, supports: Sequence[Support], seed: int
) -> list[tuple[Model, F64]]:
    """n models at rest, (model, world_from_model (4, 4)) each; equal seeds give equal poses.

    Raises MachineFailed without mujoco and coacd, BadInput where no support has a level surface or
    the things do not come to rest, naming those that move.
    """
    mujoco = _mujoco()
    rng = np.random.default_rng([seed, 3])
    weights = np.array([level_area(house, one) for one in supports])
    if not len(weights) or not weights.sum() > 0:
        raise BadInput(house.id, "scatter", "no support has a level surface")
    things = []
    for _ in range(n):
        model = models[int(rng.integers(len(models)))]
        support = supports[int(rng.choice(len(supports), p=weights / weights.sum()))]
        things.append(_Body(model, support, np.eye(4)))
    parts = {thing.model: _parts_of(thing.model) for thing in things}
    statics = _static_solids(
        house, supports, max(float(np.linalg.norm(t.model.size_m)) for t in things)
    )
    waiting = list(things)
    for _ in range(_ROUNDS):
        _lift(house, things, waiting, rng)
        moving = _simulate(mujoco, things, parts, statics)
        waiting = [t for k, t in enumerate(things) if k in moving or _has_fallen(house, t)]
        if not waiting:
            break
    if moving:
        names = ", ".join(f"{things[k].model.id} ({k + 1} of {n})" for k in moving[:5])
        raise BadInput(house.id, "scatter", f"after {_LONGEST_S:g} s these still move: {names}")
    return [(t.model, t.pose) for t in things]


def penetration_m(
    house: House, placed: Sequence[tuple[Model, F64]], supports: Sequence[Support]
) -> float:
    """How deep the deepest contact is of models (model, world_from_model) at rest, metres."""
    mujoco = _mujoco()
    things = [_Body(model, supports[0], pose) for model, pose in placed]
    parts = {thing.model: _parts_of(thing.model) for thing in things}
    size = max(float(np.linalg.norm(model.size_m)) for model, _pose in placed)
    world = mujoco.MjModel.from_xml_string(
        _mjcf(things, parts, _static_solids(house, supports, size))
    )
    state = mujoco.MjData(world)
    _set_poses(state, things)
    mujoco.mj_forward(world, state)
    return float(max(0.0, -min((c.dist for c in state.contact[: state.ncon]), default=0.0)))


@lru_cache(maxsize=256)
def _parts_of(model: Model) -> tuple[F64, ...]:
    """Convex parts of a model, (V, 3) vertices each in its frame; decomposed once a process."""
    return convex_parts(model.shape.triangles)


def _static_solids(house: House, supports: Sequence[Support], size_m: float) -> list[F64]:
    """Convex solids of the home around the supports, (V, 3) each."""
    points = np.concatenate([level_triangles(house, one).reshape(-1, 3) for one in supports])
    reach = np.array([_REACH_M + size_m, 0.0, _REACH_M + size_m])
    low, high = points.min(0) - reach - [0, 2, 0], points.max(0) + reach + [0, 1, 0]
    exact: list[F64] = []
    solids: list[F64] = []
    held = {id(s) for s in supports}
    for item in house.items:
        a, b = item.bounds
        if not ((a <= high) & (b >= low)).all():
            continue
        triangles = corners_of_surfaces(item.surfaces)
        if id(item) in held or _is_hollow(item, triangles):
            near = triangles[((triangles.min(1) <= high) & (triangles.max(1) >= low)).all(1)]
            exact.append(near)
        elif (hull := hull_of(triangles.reshape(-1, 3))) is not None:
            solids.append(hull)
    return solids + _prisms(np.concatenate([np.zeros((0, 3, 3)), *exact]))


def _is_hollow(item: Item, triangles: F64) -> bool:
    """Whether its convex hull would fill what is empty: rooms' shells, furniture one reaches into."""
    if item.kind.is_structure or item.kind in (ItemKind.DOOR, ItemKind.WINDOW, ItemKind.STAIRS):
        return True
    low, high = item.bounds
    return float((high - low).max()) > 0.3 and len(triangles) < 4_000


def _prisms(triangles: F64) -> list[F64]:
    normal = area_vectors(triangles)
    length = np.linalg.norm(normal, axis=1)
    large = np.argsort(-length)[:_MOST_PRISMS]
    large = np.sort(large[length[large] > 2 * _LEAST_M2])
    solids = []
    for corners, n in zip(triangles[large], normal[large] / length[large, None], strict=True):
        if abs(n[1]) > 0.9:
            low = corners - [0.0, _DEEP_M, 0.0]
            solids.append(np.concatenate([corners, low]))
        else:
            solids.append(np.concatenate([corners - _THIN_M / 2 * n, corners + _THIN_M / 2 * n]))
    return solids


def _lift(
    house: House, things: Sequence[_Body], waiting: Sequence[_Body], rng: np.random.Generator
) -> None:
    """Put those that wait above their supports, turned at random, apart from each other."""
    balls = [_ball(t.model, t.pose) for t in things if t not in waiting]
    for thing in waiting:
        radius, turn = _radius(thing.model), Rotation.random(random_state=rng).as_matrix()
        centre = _spot_above(house, thing.support, radius, balls, rng)
        if centre is None:
            where = thing.support.name or thing.support.id
            raise BadInput(house.id, where, f"has no room above it for {thing.model.id}")
        thing.pose = np.eye(4)
        thing.pose[:3, :3] = turn
        thing.pose[:3, 3] = centre - turn @ _middle(thing.model)
        balls.append((centre, radius))


def _spot_above(
    house: House, support: Support, radius: float, balls: Sequence[tuple[F64, float]],
    rng: np.random.Generator,
) -> F64 | None:  # fmt: skip
    """The lowest of some open places (3,) of a ball above a support and above other balls."""
    triangles = level_triangles(house, support)
    areas = np.linalg.norm(area_vectors(triangles), axis=1)
    best: F64 | None = None
    for _ in range(_TRIES):
        # A point of the support by area.
        a, b, c = triangles[int(rng.choice(len(areas), p=areas / areas.sum()))]
        u, v = sorted(rng.random(2))
        spot = u * a + (v - u) * b + (1 - v) * c
        below = [(at, r) for at, r in balls if np.hypot(*(at - spot)[[0, 2]]) < r + radius]
        height = max(
            at[1] + r + radius + _APART_M for at, r in [*below, (spot, _DROP_M - _APART_M)]
        )
        centre = np.array([spot[0], height, spot[2]])
        if (best is None or centre[1] < best[1]) and _is_open(house, centre, radius):
            best = centre
        if best is not None and not below:
            break
    return best


def _ball(model: Model, pose: F64) -> tuple[F64, float]:
    return pose[:3, :3] @ _middle(model) + pose[:3, 3], _radius(model)


def _is_open(house: House, centre: F64, radius: float) -> bool:
    """Whether a ball meets nothing of the home: rays from its middle."""
    golden = np.pi * (3 - np.sqrt(5))
    k = np.arange(64)
    y = 1 - (2 * k + 1) / 64
    r = np.sqrt(1 - y * y)
    directions = np.column_stack([r * np.cos(golden * k), y, r * np.sin(golden * k)])
    t, _face = caster_of(house).first_hit(np.broadcast_to(centre, (64, 3)), directions)
    return bool((t > radius).all())


def _simulate(
    mujoco: Any,
    things: Sequence[_Body],
    parts: dict[Model, tuple[F64, ...]],
    statics: Sequence[F64],
) -> list[int]:
    """Let things fall until they lie still, and take their poses; the numbers of those that move."""
    world = mujoco.MjModel.from_xml_string(_mjcf(things, parts, statics))
    state = mujoco.MjData(world)
    _set_poses(state, things)
    still_for = 0.0
    for _ in range(int(_LONGEST_S / _STEP_S)):
        mujoco.mj_step(world, state)
        speed = np.abs(state.qvel.reshape(-1, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
        still_for = still_for + _STEP_S if speed.max() < _STILL else 0.0
        if still_for >= _STILL_S:
            break
    for k, thing in enumerate(things):
        x, y, z, qw, qx, qy, qz = state.qpos[7 * k : 7 * k + 7]
        thing.pose = np.eye(4)
        thing.pose[:3, :3] = Rotation.from_quat([qx, qy, qz, qw]).as_matrix()
        thing.pose[:3, 3] = [x, y, z]
    fast = (np.abs(state.qvel.reshape(-1, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]).max(1) > 10 * _STILL
    return [int(k) for k in np.flatnonzero(fast)]


def _set_poses(state: Any, things: Sequence[_Body]) -> None:
    for k, thing in enumerate(things):
        x, y, z, w = Rotation.from_matrix(thing.pose[:3, :3]).as_quat()
        state.qpos[7 * k : 7 * k + 7] = [*thing.pose[:3, 3], w, x, y, z]


def _mjcf(
    things: Sequence[_Body], parts: dict[Model, tuple[F64, ...]], statics: Sequence[F64]
) -> str:
    assets = [_mesh(f"s{k}", solid) for k, solid in enumerate(statics)]
    names = {model: f"m{j}" for j, model in enumerate(parts)}
    for model, hulls in parts.items():
        assets += [_mesh(f"{names[model]}_{k}", hull) for k, hull in enumerate(hulls)]
    bodies = [f'<geom type="mesh" mesh="s{k}"/>' for k in range(len(statics))]
    for thing in things:
        geoms = "".join(
            f'<geom type="mesh" mesh="{names[thing.model]}_{k}" density="{_DENSITY}" class="thing"/>'
            for k in range(len(parts[thing.model]))
        )
        bodies.append(f"<body><freejoint/>{geoms}</body>")
    return f"""<mujoco>
<compiler inertiafromgeom="true" balanceinertia="true" boundmass="1e-4" boundinertia="1e-9"/>
<option timestep="{_STEP_S}" gravity="0 -9.81 0" integrator="implicitfast" cone="elliptic"
 iterations="60" noslip_iterations="4" impratio="5"/>
<size memory="512M"/>
<default><geom friction="0.8 0.01 0.002" solref="0.005 1" solimp="0.97 0.995 0.0005" condim="6"
 contype="1" conaffinity="0"/>
<default class="thing"><geom contype="1" conaffinity="1"/></default>
<mesh inertia="convex"/></default>
<asset>{"".join(assets)}</asset>
<worldbody>{"".join(bodies)}</worldbody></mujoco>"""


def _mesh(name: str, points: F64) -> str:
    text = " ".join(f"{v:.7g}" for v in np.asarray(points).ravel())
    return f'<mesh name="{name}" vertex="{text}"/>'


def _has_fallen(house: House, thing: _Body) -> bool:
    y = float((thing.model.shape.points @ thing.pose[:3, :3].T)[:, 1].min() + thing.pose[1, 3])
    least = float(level_triangles(house, thing.support)[:, :, 1].min())
    return y < least - _FALLEN_M


def _middle(model: Model) -> F64:
    return np.asarray(model.shape.bounds.mean(0))


def _radius(model: Model) -> float:
    return float(np.linalg.norm(model.shape.points - _middle(model), axis=1).max())


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError:
        raise _missing("mujoco") from None
    return mujoco


def _missing(package: str) -> MachineFailed:
    return MachineFailed(f"physics needs {package}", hint=install_command("physics"))
