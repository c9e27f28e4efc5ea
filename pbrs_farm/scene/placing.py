"""Where a thing can stand in a finished home: free places on furniture and floors, by seed; no effects.

A place is free where the support is flat below the thing's foot and nothing is met above it up to
the thing's height, measured by rays a centimetre or two apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import House, Item, Room, corners_of_surfaces, geometry_from_house
from pbrs_farm.core.mesh import area_vectors
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.scene.models import Model

Support = Item | Room

_TRIES: Final = 400  # of a place on one support
_FLAT_M: Final = 0.004  # by which a support may lie below the foot
_MARGIN_M: Final = 0.004  # around a thing
_FOOT_M: Final = 0.01  # what is that low of a thing is its foot
_PROBES: Final = 12  # across a thing's longer side, at least
_LEVEL: Final = 0.995  # of the unit normal's y of a surface that holds things
_FURNITURE: Final = frozenset(
    NYU40_NAMES.index(name)
    for name in ("table", "desk", "counter", "cabinet", "shelves", "bookshelf", "dresser",
                 "night stand", "chair")
)  # fmt: skip
_HIGHEST_M: Final = 1.4  # above the floor: what stands higher nobody sees
_LEAST_M2: Final = 0.03  # of a support


@dataclass(frozen=True, slots=True, eq=False)
class Stood:
    """What a thing takes up where it stands."""

    outline: shapely.Polygon  # plan (x, z)
    low: float
    high: float


def upright_at(model: Model, foot: F64, yaw_rad: float) -> F64:
    """(4, 4) world_from_model of a thing that stands upright: the middle of its foot is at foot (3,)."""
    turn = rotation_y(yaw_rad) @ model.upright
    points = model.shape.points @ turn.T
    low, high = points.min(0), points.max(0)
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    matrix[:3, 3] = foot - np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return matrix


def free_pose(house: House, model: Model, supports: Sequence[Support], seed: int) -> F64:
    """A pose (4, 4) of a model upright on one of some supports; BadInput where it fits on none."""
    rng = np.random.default_rng([seed, 1])
    for k in rng.permutation(len(supports)):
        found = _free(house, model, supports[int(k)], rng, [])
        if found is not None:
            return found[0]
    where = supports[0].name or supports[0].id
    raise BadInput(house.id, where, f"has no free place for {model.id}")


def scattered_poses(
    house: House, models: Sequence[Model], n: int, supports: Sequence[Support], seed: int
) -> list[tuple[Model, F64]]:
    """n models upright on supports, none in the way of another; BadInput where fewer fit."""
    rng = np.random.default_rng([seed, 2])
    stood: list[Stood] = []
    placed: list[tuple[Model, F64]] = []
    left = list(supports)
    weights = np.array([level_area(house, one) for one in left])
    while len(placed) < n and left:
        model = models[int(rng.integers(len(models)))]
        at = int(rng.choice(len(left), p=weights / weights.sum()))
        found = _free(house, model, left[at], rng, stood)
        if found is None:
            # A support that takes no more of one thing is left to the others.
            del left[at]
            weights = np.delete(weights, at)
            continue
        placed.append((model, found[0]))
        stood.append(found[1])
    if len(placed) < n:
        text = f"takes {len(placed)} of {n} things"
        raise BadInput(house.id, "scatter", text, hint="fewer or smaller things, more supports")
    return placed


def furniture_of(house: House, room: Room) -> list[Item]:
    """What stands in a room and has a level top that things are put on."""
    return [
        item
        for item in house.items
        if item.room_id == room.id
        and item.nyu40 in _FURNITURE
        and level_area(house, item) > _LEAST_M2
    ]


def caster_of(house: House) -> Caster:
    """The rays of a finished home, panes included; those of the last homes are kept."""
    return _caster(_Key(house))


class _Key:
    # A house by its identity: it is frozen, and kept alive by the cache.
    def __init__(self, house: House) -> None:
        self.house = house

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and other.house is self.house

    def __hash__(self) -> int:
        return id(self.house)


@lru_cache(maxsize=2)
def _caster(key: _Key) -> Caster:
    return Caster(geometry_from_house(key.house))


def level_triangles(house: House, support: Support) -> F64:
    """(F, 3, 3) triangles of a support that face up, within reach; a room's are its floor."""
    if isinstance(support, Room):
        plan = shapely.constrained_delaunay_triangles(shapely.Polygon(support.polygon))
        corners = [shapely.get_coordinates(t)[:3] for t in plan.geoms]
        flat = np.stack(corners)
        y = np.full(flat.shape[:2], support.floor_y)
        return np.stack([flat[..., 0], y, flat[..., 1]], axis=-1)
    triangles = corners_of_surfaces(support.surfaces)
    normal = area_vectors(triangles)
    length = np.linalg.norm(normal, axis=1)
    floor = next((r.floor_y for r in house.rooms if r.id == support.room_id), -np.inf)
    is_level = np.abs(normal[:, 1]) > _LEVEL * np.maximum(length, 1e-12)
    y = triangles[:, :, 1].mean(1)
    within = (length > 1e-8) & (y > floor + 0.05) & (y < floor + _HIGHEST_M)
    found: F64 = triangles[is_level & (within if np.isfinite(floor) else length > 1e-8)]
    return found


def level_area(house: House, support: Support) -> float:
    """Square metres of level_triangles."""
    triangles = level_triangles(house, support)
    return float(np.linalg.norm(area_vectors(triangles), axis=1).sum() / 2)


def _free(
    house: House, model: Model, support: Support, rng: np.random.Generator, stood: Sequence[Stood]
) -> tuple[F64, Stood] | None:
    triangles = level_triangles(house, support)
    if not len(triangles):
        return None
    areas = np.linalg.norm(area_vectors(triangles), axis=1)
    caster = caster_of(house)
    for _ in range(_TRIES):
        # A point of the support by area, and a turn.
        a, b, c = triangles[int(rng.choice(len(areas), p=areas / areas.sum()))]
        u, v = rng.random(2)
        u, v = (1 - u, 1 - v) if u + v > 1 else (u, v)
        foot = a + u * (b - a) + v * (c - a)
        matrix = upright_at(model, foot, float(rng.uniform(0, 2 * np.pi)))
        taken = _stood(model, matrix)
        if any(_meet(taken, other) for other in stood):
            continue
        if _is_free(caster, model, matrix, taken):
            return matrix, taken
    return None


def _stood(model: Model, matrix: F64) -> Stood:
    points = model.shape.points @ matrix[:3, :3].T + matrix[:3, 3]
    hull = shapely.MultiPoint(points[:, [0, 2]]).convex_hull.buffer(_MARGIN_M)
    return Stood(hull, float(points[:, 1].min()), float(points[:, 1].max()))


def _meet(one: Stood, other: Stood) -> bool:
    apart = one.low >= other.high or other.low >= one.high
    return not apart and bool(one.outline.intersects(other.outline))


def _is_free(caster: Caster, model: Model, matrix: F64, taken: Stood) -> bool:
    points = model.shape.points @ matrix[:3, :3].T + matrix[:3, 3]
    foot = points[points[:, 1] < taken.low + _FOOT_M][:, [0, 2]]
    base = shapely.MultiPoint(foot).convex_hull.buffer(1e-3)
    probes = _probes(taken.outline)
    # Down from the thing's height: the support first, level below the foot, nothing above it.
    down = np.broadcast_to([0.0, -1.0, 0.0], (len(probes), 3))
    top = np.column_stack([probes[:, 0], np.full(len(probes), taken.high + 0.002), probes[:, 1]])
    t, _face = caster.first_hit(top, down)
    y = top[:, 1] - t
    is_foot: Bools = np.asarray(shapely.contains_xy(base, probes[:, 0], probes[:, 1]))
    if not (y <= taken.low + 1e-3).all() or not (y[is_foot] >= taken.low - _FLAT_M).all():
        return False
    # Up from just above the support: nothing until the thing's height.
    start = np.column_stack([probes[:, 0], np.full(len(probes), taken.low + 0.003), probes[:, 1]])
    t, _face = caster.first_hit(start, -down)
    return bool((t >= taken.high - taken.low).all())


def _probes(outline: shapely.Polygon) -> NDArray[np.float64]:
    """(N, 2) plan points within an outline and on its edge."""
    x0, z0, x1, z1 = outline.bounds
    step = min(0.02, max(x1 - x0, z1 - z0) / _PROBES)
    grid = np.stack(np.meshgrid(np.arange(x0, x1, step), np.arange(z0, z1, step)), -1)
    inside = grid.reshape(-1, 2)
    inside = inside[shapely.contains_xy(outline, inside[:, 0], inside[:, 1])]
    edge = np.array(outline.exterior.segmentize(step).coords)[:-1]
    middle = np.array(outline.centroid.coords)
    return np.concatenate([inside, edge, middle])
