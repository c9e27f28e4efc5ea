"""Poses for models in a finished home: free places on furniture and floors, by seed; no effects.

Free places come from `dress.supports`, as for clutter: level tops and shelves found in the meshes,
in cells of a centimetre with the free height above each. A model occupies its box, rotated with it;
the box may not reach over an edge or into other items.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import affine, rotation_y
from pbrs_farm.core.house import House, Item, Room
from pbrs_farm.dress.supports import Support, floor_support, supports_of_item
from pbrs_farm.dress.worktop import LIFT_M, TopSpot, Worktop
from pbrs_farm.geometry.free_air import FreeAir
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.home.room_use import is_outdoors
from pbrs_farm.scene.models import Model

Target = Item | Room
"""A support named by the caller: furniture, or a room for its floor."""

# fmt: off
_FURNITURE: Final = frozenset(
    NYU40_NAMES.index(name)
    for name in ("table", "desk", "counter", "cabinet", "shelves", "bookshelf", "dresser",
                 "night stand", "chair")
)
# fmt: on
_EYE_LEVEL_M: Final = 1.4  # preferred maximum height of a top above the floor, metres
_GIVEN_UP: Final = 40  # maximum consecutive failures to place a model in the air
_HEIGHT_M: Final = 3.0  # height of the space above furniture outside all rooms, metres
_NAMED: Final = 3  # maximum number of targets in a message
_NO_LEVEL: Final = "name furniture with a level top, or a room"


@dataclass(frozen=True, slots=True, eq=False)
class TargetTops:
    """Free surfaces of a target; mutable, since placed models occupy them."""

    target: Target
    tops: tuple[Worktop, ...]  # empty: no level surface, or all of it is occupied

    @property
    def area_m2(self) -> float:
        """Initial free area of its tops, square metres."""
        return sum(top.support.area for top in self.tops)


def free_pose(house: House, model: Model, targets: Sequence[Target], seed: int) -> F64:
    """Pose (4, 4) world_from_model of a model upright on one of the targets.

    The targets are tried in an order drawn by the seed; equal seeds give equal poses. Raises BadInput
    if the model fits on no target, or no target has a level top.
    """
    rng = np.random.default_rng([seed, 1])
    surfaces = tops_of(house, targets)
    for k in rng.permutation(len(surfaces)):
        pose = _stand_on_tops(model, surfaces[int(k)].tops, rng)
        if pose is not None:
            return pose
    text, hint = f"has no free place for {model.id}", "a smaller object, or another place"
    if not any(surface.tops for surface in surfaces):
        text, hint = f"has no level top, so no free place for {model.id}", _NO_LEVEL
    raise BadInput(house.id, _names_of(targets), text, hint=hint)


def scattered_poses(
    house: House, models: Sequence[Model], n: int, targets: Sequence[Target], seed: int
) -> list[tuple[Model, F64]]:
    """n models, (model, world_from_model (4, 4)) each, upright on the targets, without overlap.

    Models are drawn with equal probability, targets by their free area. A target too small for one
    model may still take smaller ones; a model that no longer fits anywhere is left out. Equal seeds
    give equal poses.

    Raises BadInput if fewer than n fit, or if no target has a level top.
    """
    rng = np.random.default_rng([seed, 2])
    surfaces = level_tops_of(house, targets)
    areas = np.array([surface.area_m2 for surface in surfaces])
    placed: list[tuple[Model, F64]] = []
    untried = {k: list(range(len(surfaces))) for k in range(len(models))}
    while len(placed) < n and untried:
        which = list(untried)[int(rng.integers(len(untried)))]
        choices = untried[which]
        index = int(rng.choice(choices, p=areas[choices] / areas[choices].sum()))
        pose = _stand_on_tops(models[which], surfaces[index].tops, rng)
        if pose is not None:
            placed.append((models[which], pose))
            continue
        # Skip this target for this model only; smaller models may still fit.
        choices.remove(index)
        if not choices:
            del untried[which]
    if len(placed) < n:
        text = f"has space for {len(placed)} of {n} objects"
        raise BadInput(house.id, "scatter", text, hint="fewer or smaller objects, more supports")
    return placed


def floating_poses(
    house: House, models: Sequence[Model], n: int, targets: Sequence[Target], seed: int
) -> list[tuple[Model, F64]]:
    """n models, (model, world_from_model (4, 4)) each, floating in rooms at random rotations.

    Models are drawn with equal probability, rooms among the targets by volume, none outdoors; models
    touch nothing, with a gap of 5 cm. Equal seeds give equal poses. Raises BadInput if fewer than n fit.
    """
    rng = np.random.default_rng([seed, 3])
    rooms = [target for target in targets if isinstance(target, Room) and not is_outdoors(target)]
    volumes = np.array(
        [
            shapely.Polygon(room.polygon).area * max(room.ceiling_y - room.floor_y, 0)
            for room in rooms
        ]
    )
    air, placed, n_failed = FreeAir(house.items), list[tuple[Model, F64]](), 0
    while len(placed) < n and n_failed < _GIVEN_UP and volumes.any():
        model = models[int(rng.integers(len(models)))]
        room = rooms[int(rng.choice(len(rooms), p=volumes / volumes.sum()))]
        pose = air.put(room, model.shape.points, rng)
        n_failed = n_failed + 1 if pose is None else 0
        if pose is not None:
            placed.append((model, pose))
    if len(placed) < n:
        text = f"found space for {len(placed)} of {n} floating objects"
        raise BadInput(house.id, "scatter", text, hint="fewer or smaller objects, larger rooms")
    return placed


def furniture_of(house: House, room: Room) -> list[Item]:
    """Furniture of a room with a level top below eye level, in the order of the house's items.

    Tables, desks, cabinets, shelves, chairs and the like by their NYU40 class.
    """
    scene = SceneTriangles(house.items)
    return [
        item
        for k, item in enumerate(house.items)
        if item.room_id == room.id
        and item.nyu40 in _FURNITURE
        and any(s.above_floor < _EYE_LEVEL_M for s in supports_of_item(scene, k, room))
    ]


def level_tops_of(
    house: House, targets: Sequence[Target], border_m: float | None = None
) -> list[TargetTops]:
    """Targets with their free tops, as tops_of; raises BadInput, naming the targets, without any top.

    Targets without a top are left out. border_m as of tops_of.
    """
    with_tops = [target for target in tops_of(house, targets, border_m) if target.tops]
    if not with_tops:
        text = f"no level surface: {_names_of(targets)}"
        raise BadInput(house.id, "scatter", text, hint=_NO_LEVEL)
    return with_tops


def tops_of(
    house: House, targets: Sequence[Target], border_m: float | None = None
) -> list[TargetTops]:
    """The free surfaces of each target, in order; border_m: as of supports_of_item.

    A room gives its floor, an item the level tops of its mesh; a target without a level surface has
    empty tops. Items must be those of this house: the same objects, not equal ones. Tops above eye
    level are left out if a target has lower ones.
    """
    scene = SceneTriangles(house.items)
    rooms = {room.id: room for room in house.rooms}
    border = {} if border_m is None else {"border_m": border_m}
    all_tops = []
    for target in targets:
        if isinstance(target, Room):
            floor = floor_support(scene, target, **border)
            supports = [floor] if floor is not None else []
        else:
            index = next(k for k, item in enumerate(house.items) if item is target)
            room = rooms.get(target.room_id or "") or _space_around(target)
            supports = supports_of_item(scene, index, room, **border)
        all_tops.append(TargetTops(target, tuple(Worktop(s) for s in _within_sight(supports))))
    return all_tops


def upright_at(model: Model, foot: F64, yaw_rad: float) -> F64:
    """(4, 4) world_from_model of an upright model with the middle of its foot at foot (3,).

    float64. foot is (3,) metres in the world; the yaw turns about +y. The middle is that of the
    bounding box after the turn, so for a leaning model it is not below the centre of mass.
    """
    turn = rotation_y(yaw_rad) @ model.upright
    points = model.shape.points @ turn.T
    low, high = points.min(0), points.max(0)
    return affine(turn, foot - np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]))


def _stand_on_tops(model: Model, tops: Sequence[Worktop], rng: np.random.Generator) -> F64 | None:
    """Occupy a free place of some tops with a model; returns its pose (4, 4), None if it does not fit.

    The rotation is random; if no place fits, it is aligned with the sides of the top.
    """
    if not tops:
        return None
    points = model.shape.points @ model.upright.T
    for yaw in (float(rng.uniform(0, 2 * np.pi)), 0.0, np.pi / 2):
        local = points @ rotation_y(yaw).T  # in axes of the top's grid
        low, high = local.min(0), local.max(0)
        width, height, depth = (float(v) for v in high - low)
        spots = [top.spots((width, height, depth), margin_m=0.0) for top in tops]
        counts = np.cumsum([len(rows) for rows, _columns, _n in spots])
        if not counts[-1]:
            continue
        # Draw one of the free places.
        number = int(rng.integers(counts[-1]))
        which = int(np.searchsorted(counts, number, side="right"))
        rows, columns, n = spots[which]
        k, top = number - int(counts[which]) + len(rows), tops[which]
        spot = TopSpot(int(rows[k]), int(columns[k]), *n)
        top.take(spot)
        turn = rotation_y(top.grid.turn_rad)
        foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        offset = top.middle(spot) - [0.0, LIFT_M, 0.0] - turn @ foot
        return affine(turn @ rotation_y(yaw) @ model.upright, offset)
    return None


def _within_sight(supports: Sequence[Support]) -> Sequence[Support]:
    low = [s for s in supports if s.above_floor < _EYE_LEVEL_M and s.mask.any()]
    return low or [s for s in supports if s.mask.any()]


def _space_around(item: Item) -> Room:
    """A substitute room for furniture outside all rooms: its footprint, to _HEIGHT_M above its top."""
    low, high = item.bounds
    outline = np.asarray(shapely.box(low[0], low[2], high[0], high[2]).exterior.coords)[:4]
    return Room(
        "", "", item.level_id, outline, floor_y=float(low[1]), ceiling_y=float(high[1]) + _HEIGHT_M
    )


def _names_of(targets: Sequence[Target]) -> str:
    names = list(dict.fromkeys(target.name or target.id for target in targets))
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
