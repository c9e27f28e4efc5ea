"""Furniture for what a source tells by class and box alone: scans, plans, scenes without their models.

No effects but the catalogue's. A told thing (an item tagged TOLD, without surfaces) gets the piece of
the catalogue that fits its box best, scaled, on the floor or where it is told, its front by what is
near; else a plain box, or nothing.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import product
from typing import Final, Literal, NamedTuple

import numpy as np
from shapely.geometry import Point, Polygon

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Piece, Place
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import FRONT_TOLD, TOLD, Box, House, Item, Material, Note, Room
from pbrs_farm.dress.draft import Draft
from pbrs_farm.geometry.solids import box
from pbrs_farm.read.catalogue.piece_groups import group_rule

STAND_IN: Final = "stand-in"
"""Tag of an item that stands where the source told a box."""

How = Literal["pieces", "boxes", "none"]

_SCALES: Final = (0.6, 1.6)  # of a model along each of its axes
_STRETCH: Final = 1.6  # of one axis against another
_STRETCH_OF_BOARDS: Final = 2.2
_BOARDS: Final = frozenset({
    "desk", "nightstand", "tv_stand", "bookcase", "shelves", "wardrobe", "dresser", "cabinet",
    "dining_table", "coffee_table", "fridge", "washer", "base_cabinet", "upper_cabinet", "rug",
    "curtain", "blinds", "picture_frame", "mirror",
})  # fmt: skip
_NEAR_WALL_M: Final = 0.25  # a back that stands nearer to a wall than this stands at it
_ON_FLOOR_M: Final = 0.35  # what stands on floors and is told to begin lower stands on the floor
_MOST_IN_WALL_M: Final = 0.15  # boxes of scans reach into walls
_IN_WALL_SHARE: Final = 0.06  # of a footprint that may stay outside its room
_SEATS: Final = frozenset({"chair", "stool", "office_chair"})
_TABLES: Final = frozenset({"table", "desk"})
_COLOURS: Final = {
    "bed": (0.85, 0.83, 0.8), "sofa": (0.45, 0.47, 0.5), "chair": (0.5, 0.38, 0.27), "table": (0.6, 0.45, 0.3),
    "cabinet": (0.85, 0.84, 0.82), "counter": (0.8, 0.8, 0.78), "refrigerator": (0.9, 0.9, 0.9),
    "television": (0.05, 0.05, 0.05), "toilet": (0.95, 0.95, 0.95), "sink": (0.95, 0.95, 0.95),
    "bathtub": (0.95, 0.95, 0.95), "mirror": (0.7, 0.75, 0.78),
}  # fmt: skip
_PLAIN: Final = (0.62, 0.58, 0.52)


class _Fit(NamedTuple):
    piece: Piece
    scale: F64  # (3,) along the piece's width, height, depth
    misfit: float  # 0 = as it is modelled


def has_told(house: House) -> bool:
    """Whether the source tells things by class and box alone."""
    return any(TOLD in item.tags for item in house.items)


def with_stand_ins(house: House, catalogue: Catalogue, how: How) -> House:
    """The house with a piece, a box or nothing for each told thing; notes say what was left out."""
    if not has_told(house):
        return house
    left = replace(house, items=tuple(i for i in house.items if TOLD not in i.tags))
    told = [item for item in house.items if TOLD in item.tags]
    if how == "none":
        text = f"{len(told)} things that are told by their boxes alone are left out"
        return replace(left, notes=(*house.notes, Note("told-left-out", house.source.file, text)))
    with closing(Draft(left, 0)) as draft:
        for item in told:
            _stand_in(draft, item, house, catalogue if how == "pieces" else None)
        _note(draft, house)
        made = draft.house()
    owed = sorted(
        {(p.creator or p.library, p.licence) for p in draft.used.values() if "BY" in p.licence}
    )
    if not owed:
        return made
    credit = "; ".join(f"{creator}, {licence}" for creator, licence in owed)
    line = "; ".join(t for t in (house.source.attribution, f"furniture: {credit}, modified") if t)
    return replace(made, source=replace(made.source, attribution=line))


def _note(draft: Draft, house: House) -> None:
    """One note a kind of what became no piece."""
    for text, names in (
        ("have no piece that fits and are plain boxes", "box"), ("reach into walls and are left out", "wall"),
    ):  # fmt: skip
        found = Counter(
            {k.partition(": ")[2]: n for k, n in draft.refused.items() if k.startswith(names)}
        )
        if found:
            most = ", ".join(f"{n} {name}" for name, n in found.most_common(5))
            kind = "stand-in-box" if names == "box" else "told-left-out"
            draft.notes.append(
                Note(kind, house.source.file, f"{sum(found.values())} things {text}: {most}")
            )


def _stand_in(draft: Draft, item: Item, house: House, catalogue: Catalogue | None) -> None:
    assert item.box is not None
    room = _room_of(house, item)
    told = _inside(item.box, room)
    if told is None:
        draft.refused[f"wall: {item.name}"] += 1
        return
    group = _group_of(item)
    best: tuple[float, Box, _Fit] | None = None
    for turned in _turned(told, is_front_told=FRONT_TOLD in item.tags):
        fit = _best(catalogue, group, item, turned) if catalogue else None
        if fit is not None:
            cost = fit.misfit + _front_cost(turned, group, room, house)
            if best is None or cost < best[0] - 1e-9:
                best = cost, turned, fit
    if best is None or catalogue is None:
        draft.refused[f"box: {item.name}"] += 1
        draft.add(_plain_box(draft, item, told, room), "stand_ins")
        return
    _, turned, fit = best
    draft.add(_placed(draft, item, turned, fit, catalogue, room), "stand_ins", fit.piece)


def _group_of(item: Item) -> str:
    """The catalogue's group of a told thing, by its name, then by its class; "" = none."""
    assert item.box is not None
    width, height, depth = (float(2 * h) for h in item.box.half)
    names = (item.name, item.source_class, NYU40_NAMES[item.nyu40] if 0 < item.nyu40 < 38 else "")
    for name in names:
        rule = group_rule(name, "", (width, depth, height)) or group_rule(
            name, "", (depth, width, height)
        )
        if name and rule is not None:
            return rule.group
    return ""


def _best(catalogue: Catalogue, group: str, item: Item, told: Box) -> _Fit | None:
    """The piece of the group, else of the class, that needs the least stretching."""
    pieces = catalogue.of(group) if group else ()
    if not pieces and 0 < item.nyu40 < 38:
        pieces = tuple(p for p in catalogue.pieces if p.nyu40 == item.nyu40)
    fits = [
        fit for piece in pieces if (fit := _fit(piece, told)) and piece.place is not Place.OPENING
    ]
    return min(fits, key=lambda fit: (round(fit.misfit, 6), fit.piece.id), default=None)


def _fit(piece: Piece, told: Box) -> _Fit | None:
    width, depth, height = piece.size
    if min(piece.size) <= 0:
        return None
    # A picture or a rug may be as thin as it likes.
    wanted = np.maximum(2 * told.half, 0.02)
    scale = wanted / np.array([width, height, depth])
    if min(width, height, depth) < 0.12:
        scale = np.where(np.array([width, height, depth]) < 0.12, 1.0, scale)
    most = _STRETCH_OF_BOARDS if piece.group in _BOARDS else _STRETCH
    if scale.min() < _SCALES[0] or scale.max() > _SCALES[1] or scale.max() / scale.min() > most:
        return None
    logs = np.log(scale)
    return _Fit(piece, scale, float(np.ptp(logs) + 0.3 * np.abs(logs.mean())))


# Where it stands and which way it looks.


def _room_of(house: House, item: Item) -> Room | None:
    assert item.box is not None
    x, y, z = (float(v) for v in item.box.centre)
    own = [r for r in house.rooms if r.id == item.room_id]
    here = [
        r for r in house.rooms
        if r.floor_y - 0.3 <= y <= r.ceiling_y + 0.3 and Polygon(r.polygon).distance(Point(x, z)) < _MOST_IN_WALL_M
    ]  # fmt: skip
    return next(iter((*own, *here)), None)


def _ground(told: Box) -> Polygon:
    across, front = told.axes[[0, 2], 0] * told.half[0], told.axes[[0, 2], 2] * told.half[2]
    middle = told.centre[[0, 2]]
    corners = [middle + a * across + b * front for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return Polygon([(float(x), float(z)) for x, z in corners])


def _inside(told: Box, room: Room | None) -> Box | None:
    """The box moved off the walls of its room by the least step; None where none is small enough."""
    if room is None:
        return told
    area, ground = Polygon(room.polygon).buffer(0.01), _ground(told)
    steps = sorted(
        product((0.0, 0.05, -0.05, 0.1, -0.1, 0.15, -0.15), repeat=2), key=lambda s: math.hypot(*s)
    )
    x_axis, z_axis = told.axes[[0, 2], 0], told.axes[[0, 2], 2]
    for across, along in steps:
        dx, dz = across * x_axis + along * z_axis
        moved = Polygon([(x + dx, z + dz) for x, z in ground.exterior.coords])
        if moved.difference(area).area <= 1e-4 + _IN_WALL_SHARE * ground.area * (
            across == along == 0.0
        ):
            return replace(told, centre=told.centre + np.array([dx, 0.0, dz]))
    outside = ground.difference(area).area
    return told if outside <= 0.3 * ground.area else None


def _turned(told: Box, *, is_front_told: bool) -> Iterator[Box]:
    """The box with its front as told, or in each of the four ways that it may look."""
    yield told
    if is_front_told:
        return
    for quarter in (1, 2, 3):
        right, up, front = told.axes.T
        for _ in range(quarter):
            right, front = front, -right
        half = told.half[[2, 1, 0]] if quarter % 2 else told.half
        yield Box(told.centre, half, np.stack([right, up, front], 1))


def _front_cost(told: Box, group: str, room: Room | None, house: House) -> float:
    """0 where its back is at a wall or it looks at its table, more where it looks the wrong way."""
    if room is None:
        return 0.0
    front = told.axes[[0, 2], 2]
    middle = told.centre[[0, 2]]
    back = middle - front * told.half[2]
    outline = Polygon(room.polygon).exterior
    before = Point(*(middle + front * (told.half[2] + _NEAR_WALL_M)))
    blocked = 0.0 if Polygon(room.polygon).contains(before) else 1.0
    if group in _SEATS and (table := _nearest_table(middle, house)) is not None:
        way = table - middle
        return 1 - float(way @ front) / max(float(np.linalg.norm(way)), 1e-6) + blocked
    if outline.distance(Point(*back)) < _NEAR_WALL_M:
        return blocked
    centre = np.array(Polygon(room.polygon).representative_point().coords[0]) - middle
    looks = float(centre @ front) / max(float(np.linalg.norm(centre)), 1e-6)
    return 0.5 + 0.25 * (1 - looks) + blocked


def _nearest_table(middle: F64, house: House) -> F64 | None:
    tables = [
        i.box.centre[[0, 2]] for i in house.items
        if i.box is not None and NYU40_NAMES[i.nyu40] in _TABLES
    ]  # fmt: skip
    far = [float(np.linalg.norm(t - middle)) for t in tables]
    nearest = int(np.argmin(far)) if far else -1
    return tables[nearest] if nearest >= 0 and far[nearest] < 1.5 else None


# The item that stands there.


def _placed(
    draft: Draft, item: Item, told: Box, fit: _Fit, catalogue: Catalogue, room: Room | None
) -> Item:
    shape = catalogue.shape(fit.piece)
    if shape is None:
        return _plain_box(draft, item, told, room)
    size = np.ptp(shape.bounds, axis=0)
    wanted = fit.scale * np.array([fit.piece.size[0], fit.piece.size[2], fit.piece.size[1]])
    scale = wanted / np.maximum(size, 1e-6)
    front = told.axes[:, 2]
    turn_rad = float(np.arctan2(front[0], front[2]))
    low, high = shape.bounds * scale
    # Bring the middle of its base to the middle of the box's; what hangs keeps its top.
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    mx, mz = (low[0] + high[0]) / 2, (low[2] + high[2]) / 2
    base = float(told.centre[1] - told.half[1])
    if fit.piece.place is Place.CEILING:
        base = float(told.centre[1] + told.half[1]) - float(high[1] - low[1])
    elif room is not None and _stands(fit.piece) and base - room.floor_y < _ON_FLOOR_M:
        base = room.floor_y
    at = told.centre - np.array([mx * cos + mz * sin, 0.0, mz * cos - mx * sin])
    at[1] = base - low[1]
    placed = draft.placed(
        fit.piece, shape, at, turn_rad, item_id=item.id, room_id=room.id if room else None,
        level_id=item.level_id, scale=scale,
    )  # fmt: skip
    return replace(
        placed, name=item.name, nyu40=item.nyu40 or placed.nyu40, source_class=item.source_class,
        tags=(STAND_IN, f"piece:{fit.piece.id}"),
    )  # fmt: skip


def _stands(piece: Piece) -> bool:
    return piece.place in (Place.FLOOR, Place.KITCHEN) and piece.group != "upper_cabinet"


def _plain_box(draft: Draft, item: Item, told: Box, room: Room | None) -> Item:
    name = NYU40_NAMES[item.nyu40] if item.nyu40 else ""
    r, g, b = _COLOURS.get(name, _PLAIN)
    material = draft.material(Material(f"stand-in {name}".strip(), diffuse=(r, g, b)))
    half = np.maximum(told.half, 0.005)
    # Off the floor by a hair, so that no face of it coincides with the floor's.
    centre = told.centre + np.array([0.0, 0.001, 0.0])
    surface = box("box", centre, half, material, axes=_right_handed(told.axes))
    return replace(
        item, surfaces=(surface,), box=told, room_id=room.id if room else item.room_id,
        tags=(STAND_IN, "piece:box"),
    )  # fmt: skip


def _right_handed(axes: F64) -> F64:
    return axes if np.linalg.det(axes) > 0 else axes * np.array([-1.0, 1.0, 1.0])
