"""Drop models into a home until they come to rest: rigid bodies by MuJoCo, convex parts by CoACD.

Effects: a cache of convex parts below cache_folder(). The home is static. Supports collide triangle
by triangle (a thin prism each), other furniture nearby as its convex hull. Models start a few centimetres above free places of
`dress.supports`, tumble, and stay where they stop; those that fall off are dropped again.
"""

from __future__ import annotations

import contextlib
import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.assets.debian import cache_folder, write_whole
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.frames import affine
from pbrs_farm.core.house import House, Item, ItemKind, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors
from pbrs_farm.crash_notes import note_step
from pbrs_farm.dress.supports import Support
from pbrs_farm.dress.worktop import Worktop
from pbrs_farm.geometry.convex_parts import convex_parts, hull_of
from pbrs_farm.installation import install_command
from pbrs_farm.scene.models import Model
from pbrs_farm.scene.placing import Target, TargetTops, level_tops_of

STEP_S: Final = 0.002
_LONGEST_S: Final = 8.0  # maximum simulated time of a drop, seconds
_STILL: Final = 0.004  # maximum speed at rest, m/s (ten times that in rad/s), for _STILL_S
_STILL_S: Final = 0.2
_ROUNDS: Final = 4  # maximum number of drops of a model
_TRIES: Final = 60  # positions tried above a target per model
_APART_M: Final = 0.01  # minimum initial gap between models, metres
_DROP_M: Final = 0.03  # minimum initial height above the surface, metres
_REACH_M: Final = 0.6  # margin around the surfaces for static geometry, metres
_PRISM_M: Final = 0.03  # depth of a level triangle's prism, metres; stops tunnelling
_THIN_M: Final = 0.002  # depth of the other prisms, metres
_LEAST_M2: Final = 1e-6  # minimum area of a triangle, square metres
_MOST_PRISMS: Final = 6_000
_PARTS_FORMAT: Final = b"convex parts 1"  # changed when convex_parts returns others
_DENSITY: Final = 500.0  # kg/m3
_FALLEN_M: Final = 0.05  # depth below its surface at which a model has fallen off, metres


@dataclass(slots=True, eq=False)
class _Body:
    model: Model
    onto: TargetTops | None  # last target
    pose: F64  # (4, 4) world_from_model


def settled_poses(
    house: House, models: Sequence[Model], n: int, targets: Sequence[Target], seed: int
) -> list[tuple[Model, F64]]:
    """n models at rest, (model, world_from_model (4, 4)) each; equal seeds give equal poses.

    Models are drawn with equal probability, targets by their free area; a target too low for one model
    may still take others. Raises MachineFailed without mujoco and coacd. Raises BadInput if no target
    has a level top, if no target has room above it for a model, or if models do not come to rest,
    naming those that move.
    """
    mujoco = mujoco_module()
    rng = np.random.default_rng([seed, 3])
    things = [_Body(models[int(rng.integers(len(models)))], None, np.eye(4)) for _ in range(n)]
    size = max(float(np.linalg.norm(t.model.size_m)) for t in things)
    surfaces = level_tops_of(house, targets, border_m=size)
    parts = {thing.model: convex_parts_of(thing.model) for thing in things}
    statics = _static_solids(house, surfaces, size)
    waiting = list(things)
    for number in range(1, _ROUNDS + 1):
        note_step(house.id, f"fall {number} of at most {_ROUNDS}")
        _lift(house, things, waiting, surfaces, rng)
        moving = _simulate(mujoco, things, parts, statics)
        waiting = [t for k, t in enumerate(things) if k in moving or _has_fallen(t)]
        if not waiting:
            break
    if moving:
        names = ", ".join(f"{things[k].model.id} ({k + 1} of {n})" for k in moving[:5])
        raise BadInput(house.id, "scatter", f"still moving after {_LONGEST_S:g} s: {names}")
    return [(t.model, t.pose) for t in things]


def penetration_m(
    house: House, placed: Sequence[tuple[Model, F64]], targets: Sequence[Target]
) -> float:
    """Maximum contact depth of models (model, world_from_model) at rest, metres.

    0 without penetration. Poses are float64 (4, 4), world_from_model, of at least one model. Only
    solids of the home around the targets' tops collide. Raises BadInput if no target has a level top,
    MachineFailed without MuJoCo.
    """
    mujoco = mujoco_module()
    things = [_Body(model, None, pose) for model, pose in placed]
    parts = {thing.model: convex_parts_of(thing.model) for thing in things}
    size = max(float(np.linalg.norm(model.size_m)) for model, _pose in placed)
    statics = _static_solids(house, level_tops_of(house, targets), size)
    world = mujoco.MjModel.from_xml_string(world_xml([parts[t.model] for t in things], statics))
    state = mujoco.MjData(world)
    _set_poses(state, things)
    mujoco.mj_forward(world, state)
    return float(max(0.0, -min((c.dist for c in state.contact[: state.ncon]), default=0.0)))


def _version_of(package: str) -> str:
    """The installed version; "" if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


@lru_cache(maxsize=256)
def convex_parts_of(model: Model) -> tuple[F64, ...]:
    """Convex parts of a model, (V, 3) vertices each in its frame; cached in memory and on disk.

    CoACD may take a minute for a hollow model.
    """
    triangles = np.ascontiguousarray(model.shape.triangles, np.float64)
    made_by = _PARTS_FORMAT + _version_of("coacd").encode()
    name = keys.sha256(triangles.tobytes() + made_by)[:32]
    path = cache_folder() / "convex" / f"{name}.npz"
    try:
        with np.load(path) as arrays:
            return tuple(arrays[key] for key in sorted(arrays.files))
    except (OSError, EOFError, ValueError, zipfile.BadZipFile):
        pass  # not cached, or damaged
    note_step(model.id, f"convex parts of {len(triangles):,} faces")
    parts = convex_parts(triangles)
    data = io.BytesIO()
    named: dict[str, Any] = {f"{k:03}": part for k, part in enumerate(parts)}
    np.savez(data, **named)
    with contextlib.suppress(OSError):  # without a cache the next process computes them again
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data.getvalue())
    return parts


def _static_solids(house: House, surfaces: Sequence[TargetTops], size_m: float) -> list[F64]:
    """Convex solids of the home around the surfaces, (V, 3) each."""
    points = np.concatenate([_points_of(top.support) for s in surfaces for top in s.tops])
    reach = np.array([_REACH_M + size_m, 0.0, _REACH_M + size_m])
    low, high = points.min(0) - reach - [0, 2, 0], points.max(0) + reach + [0, 1, 0]
    exact: list[F64] = []
    solids: list[F64] = []
    bearing = {id(s.target) for s in surfaces}
    for item in house.items:
        a, b = item.bounds
        if not ((a <= high) & (b >= low)).all():
            continue
        triangles = corners_of_surfaces(item.surfaces)
        if id(item) in bearing or _is_hollow(item, triangles):
            near = triangles[((triangles.min(1) <= high) & (triangles.max(1) >= low)).all(1)]
            exact.append(near)
        elif (hull := hull_of(triangles.reshape(-1, 3))) is not None:
            solids.append(hull)
    return solids + _prisms(np.concatenate([np.zeros((0, 3, 3)), *exact]))


def _points_of(support: Support) -> F64:
    """(4, 3) corners of the bounding rectangle of a support's free cells."""
    rows, columns = np.nonzero(support.mask)
    ends = (
        np.array([columns.min(), columns.max() + 1] * 2),
        np.array([rows.min()] * 2 + [rows.max() + 1] * 2),
    )
    return np.insert(support.grid.plan_of(*ends), 1, support.height, axis=1)


def _is_hollow(item: Item, triangles: F64) -> bool:
    """True if a convex hull would fill empty space: rooms' shells, furniture with an open interior."""
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
            low = corners - [0.0, _PRISM_M, 0.0]
            solids.append(np.concatenate([corners, low]))
        else:
            solids.append(np.concatenate([corners - _THIN_M / 2 * n, corners + _THIN_M / 2 * n]))
    return solids


def _lift(
    house: House,
    things: Sequence[_Body],
    waiting: Sequence[_Body],
    surfaces: Sequence[TargetTops],
    rng: np.random.Generator,
) -> None:
    """Put the waiting models above their targets, at random rotations, without overlap."""
    balls = [_ball(t.model, t.pose) for t in things if t not in waiting]
    for thing in waiting:
        radius, turn = _radius(thing.model), Rotation.random(random_state=rng).as_matrix()
        spot = _spot_above_any(thing.onto, surfaces, radius, balls, rng)
        if spot is None:
            names = ", ".join(surface.target.name or surface.target.id for surface in surfaces[:3])
            text = f"has no space above it for {thing.model.id}"
            raise BadInput(house.id, names, text, hint="fewer or smaller objects, more supports")
        thing.onto, centre = spot
        thing.pose = affine(turn, centre - turn @ _middle(thing.model))
        balls.append((centre, radius))


def _spot_above_any(
    onto: TargetTops | None,
    surfaces: Sequence[TargetTops],
    radius: float,
    balls: Sequence[tuple[F64, float]],
    rng: np.random.Generator,
) -> tuple[TargetTops, F64] | None:
    """A target and a position (3,) above it for a ball: the last target, else one drawn by free area."""
    areas = np.array([surface.area_m2 for surface in surfaces])
    remaining = list(range(len(surfaces)))
    while remaining:
        index = int(rng.choice(remaining, p=areas[remaining] / areas[remaining].sum()))
        surface = onto or surfaces[index]
        centre = _spot_above(surface.tops, radius, balls, rng)
        if centre is not None:
            return surface, centre
        # Skip this target for this ball only.
        if onto is None:
            remaining.remove(index)
        onto = None
    return None


def _spot_above(
    tops: Sequence[Worktop],
    radius: float,
    balls: Sequence[tuple[F64, float]],
    rng: np.random.Generator,
) -> F64 | None:
    """The lowest of several free positions (3,) of a ball above a target's tops and above other balls."""
    areas = np.array([top.support.area for top in tops])
    best: F64 | None = None
    for _ in range(_TRIES):
        top = tops[int(rng.choice(len(tops), p=areas / areas.sum()))]
        # Draw a point of the top, uniform in area.
        cells = np.argwhere(top.support.mask)
        row, column = cells[int(rng.integers(len(cells)))] + rng.random(2)
        x, z = top.grid.plan_of(column, row)
        spot = np.array([x, top.support.height, z])
        below = [(place, r) for place, r in balls if np.hypot(*(place - spot)[[0, 2]]) < r + radius]
        height = max(
            place[1] + r + radius + _APART_M for place, r in [*below, (spot, _DROP_M - _APART_M)]
        )
        centre = np.array([x, height, z])
        is_lower = best is None or height < best[1]
        if is_lower and top.free_height_around(centre[[0, 2]], radius) > height + radius - spot[1]:
            best = centre
        if best is not None and not below:
            break
    return best


def _ball(model: Model, pose: F64) -> tuple[F64, float]:
    return pose[:3, :3] @ _middle(model) + pose[:3, 3], _radius(model)


def _simulate(
    mujoco: Any,
    things: Sequence[_Body],
    parts: dict[Model, tuple[F64, ...]],
    statics: Sequence[F64],
) -> list[int]:
    """Simulate until all models rest and update their poses; returns the indices of those still moving."""
    world = mujoco.MjModel.from_xml_string(world_xml([parts[t.model] for t in things], statics))
    state = mujoco.MjData(world)
    _set_poses(state, things)
    still_for = 0.0
    for _ in range(int(_LONGEST_S / STEP_S)):
        mujoco.mj_step(world, state)
        speed = np.abs(state.qvel.reshape(-1, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
        still_for = still_for + STEP_S if speed.max() < _STILL else 0.0
        if still_for >= _STILL_S:
            break
    for k, thing in enumerate(things):
        x, y, z, qw, qx, qy, qz = state.qpos[7 * k : 7 * k + 7]
        thing.pose = affine(Rotation.from_quat([qx, qy, qz, qw]).as_matrix(), [x, y, z])
    fast = (np.abs(state.qvel.reshape(-1, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]).max(1) > 10 * _STILL
    return [int(k) for k in np.flatnonzero(fast)]


def _set_poses(state: Any, things: Sequence[_Body]) -> None:
    for k, thing in enumerate(things):
        x, y, z, w = Rotation.from_matrix(thing.pose[:3, :3]).as_quat()
        state.qpos[7 * k : 7 * k + 7] = [*thing.pose[:3, 3], w, x, y, z]


def world_xml(bodies: Sequence[tuple[F64, ...]], statics: Sequence[F64]) -> str:
    """A MuJoCo model, y up, metres: free bodies of convex parts (V, 3), and static convex solids.

    Body k is the k-th free joint. Parts shared by bodies, as one tuple, are written once.
    """
    assets = [_mjcf_mesh(f"s{k}", solid) for k, solid in enumerate(statics)]
    names: dict[int, str] = {}
    for parts in bodies:
        if id(parts) not in names:
            name = names.setdefault(id(parts), f"m{len(names)}")
            assets += [_mjcf_mesh(f"{name}_{k}", hull) for k, hull in enumerate(parts)]
    lines = [f'<geom type="mesh" mesh="s{k}"/>' for k in range(len(statics))]
    for parts in bodies:
        geoms = "".join(
            f'<geom type="mesh" mesh="{names[id(parts)]}_{k}" density="{_DENSITY}" class="thing"/>'
            for k in range(len(parts))
        )
        lines.append(f"<body><freejoint/>{geoms}</body>")
    return f"""<mujoco>
<compiler inertiafromgeom="true" balanceinertia="true" boundmass="1e-4" boundinertia="1e-9"/>
<option timestep="{STEP_S}" gravity="0 -9.81 0" integrator="implicitfast" cone="elliptic"
 iterations="60" noslip_iterations="4" impratio="5"/>
<size memory="512M"/>
<default><geom friction="0.8 0.01 0.002" solref="0.005 1" solimp="0.97 0.995 0.0005" condim="6"
 contype="1" conaffinity="0"/>
<default class="thing"><geom contype="1" conaffinity="1"/></default>
<mesh inertia="convex"/></default>
<asset>{"".join(assets)}</asset>
<worldbody>{"".join(lines)}</worldbody></mujoco>"""


def _mjcf_mesh(name: str, points: F64) -> str:
    text = " ".join(f"{v:.7g}" for v in np.asarray(points).ravel())
    return f'<mesh name="{name}" vertex="{text}"/>'


def _has_fallen(thing: _Body) -> bool:
    if thing.onto is None:
        return False
    y = float((thing.model.shape.points @ thing.pose[:3, :3].T)[:, 1].min() + thing.pose[1, 3])
    return y < min(top.support.height for top in thing.onto.tops) - _FALLEN_M


def _middle(model: Model) -> F64:
    return np.asarray(model.shape.bounds.mean(0))


def _radius(model: Model) -> float:
    return float(np.linalg.norm(model.shape.points - _middle(model), axis=1).max())


def mujoco_module() -> Any:
    """The mujoco package; raises MachineFailed, with the install command, if it is missing."""
    try:
        from pbrs_farm.quiet_mujoco import mujoco
    except ImportError:
        raise _missing("mujoco") from None
    return mujoco


def _missing(package: str) -> MachineFailed:
    return MachineFailed(f"physics needs {package}", hint=install_command("physics"))
