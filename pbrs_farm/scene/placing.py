"""Where models stand in a finished home: free places on furniture and floors, drawn by seed; no effects.

What is free comes from `dress.supports`, as for things that dressing lays about: level tops and
shelves found in the meshes, in cells of a centimetre with the free height above each. A model takes
the box around it, turned with it; nothing of it may reach over an edge or into what stands there.
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
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import House, Item, Room
from pbrs_farm.dress.supports import Support, floor_support, supports_of_item
from pbrs_farm.dress.worktop import LIFT_M, TopSpot, Worktop
from pbrs_farm.geometry.free_air import FreeAir
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.home.room_use import is_outdoors
from pbrs_farm.scene.models import Model

Target = Item | Room
"""What a caller names to put things on: furniture, or a room for its floor."""

# fmt: off
_FURNITURE: Final = frozenset(
    NYU40_NAMES.index(name)
    for name in ("table", "desk", "counter", "cabinet", "shelves", "bookshelf", "dresser",
                 "night stand", "chair")
)
# fmt: on
_EYE_LEVEL_M: Final = 1.4  # above the floor: higher tops are used only where there is no lower one
_GIVEN_UP: Final = 40  # things in a row that find no place in the air
_HEIGHT_M: Final = 3.0  # of the space over furniture that is in no room
_NAMED: Final = 3  # targets in a message
_NO_LEVEL: Final = "name furniture with a level top, or a room for its floor"


@dataclass(frozen=True, slots=True, eq=False)
class TargetTops:
    """The free surfaces of what a caller named; state: what was put there is taken."""

    target: Target
    tops: tuple[Worktop, ...]  # empty: nothing of it is level, or all of it is taken

    @property
    def area_m2(self) -> float:
        """What was free of its tops at first, square metres."""
        return sum(top.support.area for top in self.tops)


def free_pose(house: House, model: Model, targets: Sequence[Target], seed: int) -> F64:
    """A pose (4, 4) world_from_model of a model that stands upright on one of the targets.

    The targets are tried in an order drawn by the seed; equal seeds give equal poses. Raises BadInput
    where it fits on none, or where none has a level top.
    """
    rng = np.random.default_rng([seed, 1])
    surfaces = tops_of(house, targets)
    for k in rng.permutation(len(surfaces)):
        pose = _stand_on_tops(model, surfaces[int(k)].tops, rng)
        if pose is not None:
            return pose
    text, hint = f"has no free place for {model.id}", "a smaller thing, or another place"
    if not any(surface.tops for surface in surfaces):
        text, hint = f"has no level top, so no free place for {model.id}", _NO_LEVEL
    raise BadInput(house.id, _names_of(targets), text, hint=hint)


def scattered_poses(
    house: House, models: Sequence[Model], n: int, targets: Sequence[Target], seed: int
) -> list[tuple[Model, F64]]:
    """n models, (model, world_from_model (4, 4)) each, upright on the targets, none in another's way.

    Models are drawn alike, targets by their free area. A target that has no room for one model still
    takes smaller ones; a model that fits nowhere any more is left out. Equal seeds give equal poses.

    Raises BadInput where fewer than n fit, or where no target has a level top.
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
        text = f"takes {len(placed)} of {n} things"
        raise BadInput(house.id, "scatter", text, hint="fewer or smaller things, more supports")
    return placed


def floating_poses(
    house: House, models: Sequence[Model], n: int, targets: Sequence[Target], seed: int
) -> list[tuple[Model, F64]]:
    """n models, (model, world_from_model (4, 4)) each, in the air of rooms at any turn, that touch nothing.

    Models are drawn alike, rooms among the targets by their volume, none outdoors; 5 cm are left to
    all else. Equal seeds give equal poses. Raises BadInput where fewer than n fit.
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
        text = f"the air takes {len(placed)} of {n} things"
        raise BadInput(house.id, "scatter", text, hint="fewer or smaller things, larger rooms")
    return placed


def furniture_of(house: House, room: Room) -> list[Item]:
    """What stands in a room and has a level top, no higher than eyes, that people put things on.

    Tables, desks, cabinets, shelves, chairs and the like by their NYU40 class; one whose tops all
    lie above eye level is left out. In the order of the house's items.
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
    """tops_of, without targets that have none; BadInput where none has any.

    For calls that cannot go on without a place. border_m as of tops_of. The message names the
    targets.
    """
    with_tops = [target for target in tops_of(house, targets, border_m) if target.tops]
    if not with_tops:
        text = f"no support has a level surface: {_names_of(targets)}"
        raise BadInput(house.id, "scatter", text, hint=_NO_LEVEL)
    return with_tops


def tops_of(
    house: House, targets: Sequence[Target], border_m: float | None = None
) -> list[TargetTops]:
    """The free surfaces of each target, in their order; border_m: as of supports_of_item.

    A room gives its floor, an item the level tops of its mesh; a target without any has no tops,
    and the caller decides. Items must be those of this house: the same objects, not equal ones.
    Tops above eye level are left out where a target has lower ones.
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
    """(4, 4) world_from_model of a thing that stands upright: the middle of its foot is at foot (3,).

    float64. foot is (3,) metres in the world; the yaw turns about +y. The middle is that of the
    bounding box after the turn, so a thing that leans does not stand on its centre of mass.
    """
    turn = rotation_y(yaw_rad) @ model.upright
    points = model.shape.points @ turn.T
    low, high = points.min(0), points.max(0)
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    matrix[:3, 3] = foot - np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return matrix


def _stand_on_tops(model: Model, tops: Sequence[Worktop], rng: np.random.Generator) -> F64 | None:
    """Take a free place of some tops for a model; its pose (4, 4), None where it fits on none.

    It is turned at random, and along the top's sides where it fits in no other way.
    """
    if not tops:
        return None
    points = model.shape.points @ model.upright.T
    for yaw in (float(rng.uniform(0, 2 * np.pi)), 0.0, np.pi / 2):
        local = points @ rotation_y(yaw).T  # about the axes of a top's grid
        low, high = local.min(0), local.max(0)
        width, height, depth = (float(v) for v in high - low)
        spots = [top.spots((width, height, depth), margin_m=0.0) for top in tops]
        counts = np.cumsum([len(rows) for rows, _columns, _n in spots])
        if not counts[-1]:
            continue
        # Draw one place of all that there are.
        number = int(rng.integers(counts[-1]))
        which = int(np.searchsorted(counts, number, side="right"))
        rows, columns, n = spots[which]
        k, top = number - int(counts[which]) + len(rows), tops[which]
        spot = TopSpot(int(rows[k]), int(columns[k]), *n)
        top.take(spot)
        turn = rotation_y(top.grid.turn_rad)
        foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        matrix = np.eye(4)
        matrix[:3, :3] = turn @ rotation_y(yaw) @ model.upright
        matrix[:3, 3] = top.middle(spot) - [0.0, LIFT_M, 0.0] - turn @ foot
        return matrix
    return None


def _within_sight(supports: Sequence[Support]) -> Sequence[Support]:
    low = [s for s in supports if s.above_floor < _EYE_LEVEL_M and s.mask.any()]
    return low or [s for s in supports if s.mask.any()]


def _space_around(item: Item) -> Room:
    """A room of its own for furniture that stands in none: the space over its bounds."""
    low, high = item.bounds
    outline = np.asarray(shapely.box(low[0], low[2], high[0], high[2]).exterior.coords)[:4]
    return Room(
        "", "", item.level_id, outline, floor_y=float(low[1]), ceiling_y=float(high[1]) + _HEIGHT_M
    )


def _names_of(targets: Sequence[Target]) -> str:
    names = list(dict.fromkeys(target.name or target.id for target in targets))
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
