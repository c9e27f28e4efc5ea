"""Furniture for items that a source gives by class and box alone: scans, plans, scenes without their models.

No effects but the catalogue's. A box-only item (tagged BOX_ONLY, without surfaces) gets the best fitting
piece of the catalogue, scaled, on the floor or at the box's height, with its front chosen from its
surroundings; else a plain box, or nothing.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Final, Literal, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import EMPTY, Catalogue, Piece, Place, Shape
from pbrs_farm.core.classes import NYU40_NAMES, SINK
from pbrs_farm.core.house import BOX_ONLY, FRONT_GIVEN, Box, House, Item, Material, Note, Room
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import Style, style_for
from pbrs_farm.dress.walls.hung_things import frame_material, framed, mirror
from pbrs_farm.dress.walls.pictures import Gallery
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.solids import box
from pbrs_farm.geometry.surface_points import item_triangles
from pbrs_farm.home.room_use import RoomKind, is_cooked_in, room_kind
from pbrs_farm.prepare.kitchen_runs import Unit, kitchen_units
from pbrs_farm.read.catalogue.piece_groups import group_rule

STAND_IN: Final = "stand-in"
"""Tag of an item that replaces a box-only item."""

How = Literal["pieces", "boxes", "none"]

_SCALES: Final = (0.6, 1.6)  # range of a model's scale along each axis
_STRETCH: Final = 1.6  # maximum ratio of the scales of two axes
_STRETCH_OF_BOARDS: Final = 2.2
# fmt: off
_BOARDS: Final = frozenset({
    "desk", "nightstand", "tv_stand", "bookcase", "shelves", "wardrobe", "dresser", "cabinet",
    "dining_table", "coffee_table", "fridge", "washer", "base_cabinet", "upper_cabinet", "rug",
    "curtain", "blinds", "picture_frame", "mirror",
})
# fmt: on
# fmt: off
_FIXTURES: Final = frozenset({
    "toilet", "washbasin", "sink", "bathtub", "shower", "bidet", "cooker", "oven", "dishwasher",
    "washer", "fridge",
})
# fmt: on
_OWN_SCALES: Final = (0.8, 1.25)  # range of scale of a fixture if no piece fits its box
_FAR_SCALES: Final = (0.35, 2.6)  # range of the ratio of such a box to the piece
_ON_WALLS: Final = frozenset({"picture_frame", "mirror"})
"""Groups of flat things that are generated in any size where no piece fits."""
_BASINS: Final = frozenset({"sink", "washbasin"})
_TALLEST_BASIN_M: Final = 1.3  # taller ones have a mirror
_RIMS_M: Final = (0.6, 1.1)  # heights of basins' rims above the floor
_ON_TOP_M: Final = 0.12  # maximum gap between an item and its support, metres
_OVER_EDGE_M: Final = 0.05
_MOST_DROP_M: Final = (
    0.6  # maximum drop to a support; an item higher up hangs from something the source omits
)
_NEAR_WALL_M: Final = 0.25  # maximum gap between a back and its wall
_THIN_M: Final = 0.12
_AT_TABLE_M: Final = 1.5  # maximum distance from a chair to the centre of its table
_ON_FLOOR_M: Final = 0.35  # maximum bottom height of a box on the floor
_MOST_IN_WALL_M: Final = 0.15  # boxes of scans reach into walls
_IN_WALL_SHARE: Final = 0.06  # maximum share of a footprint outside its room
_SEATS: Final = frozenset({"chair", "stool", "office_chair"})
_TABLES: Final = frozenset({"table", "desk"})
# fmt: off
_COLOURS: Final = {
    "bed": (0.85, 0.83, 0.8), "sofa": (0.45, 0.47, 0.5), "chair": (0.5, 0.38, 0.27), "table": (0.6, 0.45, 0.3),
    "cabinet": (0.85, 0.84, 0.82), "counter": (0.8, 0.8, 0.78), "refrigerator": (0.9, 0.9, 0.9),
    "television": (0.05, 0.05, 0.05), "toilet": (0.95, 0.95, 0.95), "sink": (0.95, 0.95, 0.95),
    "bathtub": (0.95, 0.95, 0.95), "mirror": (0.7, 0.75, 0.78),
}
# fmt: on
_PLAIN: Final = (0.62, 0.58, 0.52)


class _Fit(NamedTuple):
    piece: Piece
    scale: F64  # (3,) along the piece's width, height, depth
    misfit: float  # 0 = the modelled size


def has_box_only_items(house: House) -> bool:
    """True if the source gives some items by class and box alone."""
    return any(BOX_ONLY in item.tags for item in house.items)


def with_stand_ins(house: House, catalogue: Catalogue, how: How) -> House:
    """Replace box-only items by pieces (credited), boxes or nothing (noted), as `how` says."""
    box_only = [item for item in house.items if BOX_ONLY in item.tags]
    if not box_only:
        return house
    other_items = replace(house, items=tuple(i for i in house.items if BOX_ONLY not in i.tags))
    if how == "none":
        text = f"{len(box_only)} items given only as boxes are left out"
        return replace(
            other_items, notes=(*house.notes, Note("box-only-left-out", house.source.file, text))
        )
    with closing(MutableHouse(other_items, 0)) as mutable:
        scene = _Scene(house, catalogue if how == "pieces" else None)
        units = _units_of_kitchens(box_only, scene)
        # Supports come before their contents.
        for item in sorted(box_only, key=scene.stands_on_another):
            if item.id in units:
                _add_units(mutable, item, units[item.id], scene)
            else:
                _stand_in(mutable, item, scene)
        mutable.notes += scene.notes()
        finished = mutable.frozen()
    owed = sorted(
        {(p.creator or p.library, p.licence) for p in mutable.used.values() if "BY" in p.licence}
    )
    if not owed:
        return finished
    credit = "; ".join(f"{creator}, {licence}" for creator, licence in owed)
    line = "; ".join(t for t in (house.source.attribution, f"furniture: {credit}, modified") if t)
    return replace(finished, source=replace(finished.source, attribution=line))


class _Place(NamedTuple):
    """A room with the geometry that places box-only items."""

    room: Room
    outline: Polygon
    area: Polygon  # slightly enlarged, prepared


def _place(room: Room) -> _Place:
    outline = Polygon(room.polygon)
    area = outline.buffer(0.01)
    shapely.prepare(outline)
    shapely.prepare(area)
    return _Place(room, outline, area)


class _Scene:
    """Inputs and obstacles for choosing and placing stand-ins; counts the items without a piece."""

    def __init__(self, house: House, catalogue: Catalogue | None) -> None:
        self.house = house
        self.catalogue = catalogue
        self._gallery: Gallery | None = None
        self._places = [_place(room) for room in house.rooms]
        self._tables = [
            i.box.centre
            for i in house.items
            if i.box is not None and BOX_ONLY in i.tags and NYU40_NAMES[i.nyu40] in _TABLES
        ]
        self._box_only = [i for i in house.items if BOX_ONLY in i.tags]
        boxes = [i.box for i in self._box_only if i.box is not None]
        self._centres = np.array([b.centre for b in boxes]).reshape(-1, 3)
        self._halves = np.array([b.half for b in boxes]).reshape(-1, 3)
        self._grounds: dict[str, Polygon] = {}
        self._place_by_item: dict[str, _Place | None] = {}
        self._kitchens: dict[str, bool] = {}
        self._placed: list[tuple[float, float, float, float, Item]] = []  # with bounds in plan
        self.boxes: Counter[str] = Counter()
        self.in_walls: Counter[str] = Counter()

    def notes(self) -> list[Note]:
        """One note per kind of item without a piece."""
        notes = []
        for kind, text, names in (
            ("stand-in-box", "have no piece that fits and are plain boxes", self.boxes),
            ("box-only-left-out", "reach into walls and are left out", self.in_walls),
        ):
            if names:
                most = ", ".join(f"{n} {name}" for name, n in names.most_common(5))
                text = f"{names.total()} items {text}: {most}"
                notes.append(Note(kind, self.house.source.file, text))
        return notes

    def place_of(self, item: Item) -> _Place | None:
        """The room that a box-only item names, else the nearest on its storey; None = outside all rooms."""
        if item.id not in self._place_by_item:
            self._place_by_item[item.id] = self._find_place(item)
        return self._place_by_item[item.id]

    def _find_place(self, item: Item) -> _Place | None:
        assert item.box is not None
        x, y, z = (float(v) for v in item.box.centre)
        middle, best = Point(x, z), None
        nearest = _MOST_IN_WALL_M
        for place in self._places:
            room = place.room
            if room.id == item.room_id:
                return place
            # With many rooms, test only those with bounds nearby.
            x0, z0, x1, z1 = place.outline.bounds
            if not room.floor_y - 0.3 <= y <= room.ceiling_y + 0.3:
                continue
            if not (x0 - nearest <= x <= x1 + nearest and z0 - nearest <= z <= z1 + nearest):
                continue
            away = place.outline.distance(middle)
            if away < nearest:
                best, nearest = place, away
        return best

    def is_kitchen(self, place: _Place | None) -> bool:
        """True if the room is a kitchen, by its name or else by its furniture."""
        if place is None:
            return False
        if place.room.id not in self._kitchens:
            items = [i for i in self._box_only if self.place_of(i) is place]
            kind = room_kind(place.room, items, place.outline.area)
            is_cooked = kind is not RoomKind.BATHROOM and is_cooked_in(items)
            self._kitchens[place.room.id] = kind is RoomKind.KITCHEN or is_cooked
        return self._kitchens[place.room.id]

    def stands_on_another(self, item: Item) -> bool:
        """True if the bottom of an item's box is on or inside another box."""
        assert item.box is not None
        low = float(item.box.centre[1] - item.box.half[1])
        middle = Point(*item.box.centre[[0, 2]])
        feet, tops = (self._centres[:, 1] + s * self._halves[:, 1] for s in (-1, 1))
        away = np.hypot(*(self._centres - item.box.centre)[:, [0, 2]].T)
        reach = np.hypot(self._halves[:, 0], self._halves[:, 2]) + _OVER_EDGE_M
        near = (feet + _ON_FLOOR_M < low) & (low < tops + _ON_TOP_M) & (away <= reach)
        for support in (self._box_only[n] for n in np.flatnonzero(near)):
            assert support.box is not None
            if support.id == item.id:
                continue
            if support.id not in self._grounds:
                self._grounds[support.id] = _ground(support.box).buffer(_OVER_EDGE_M)
            if self._grounds[support.id].contains(middle):
                return True
        return False

    def surface_below(self, item: Item, target: Box) -> float | None:
        """Height of the support below an item that the source puts on another; None = nothing near."""
        if not self.stands_on_another(item):
            return None
        low = float(target.centre[1] - target.half[1])
        wide, _, deep = (float(v) for v in np.abs(target.axes) @ target.half)
        x, _, z = (float(v) for v in target.centre)
        near = [
            item_triangles(below)
            for x0, z0, x1, z1, below in self._placed
            if x0 < x + wide and x1 > x - wide and z0 < z + deep and z1 > z - deep
        ]
        if not near:
            return None
        # Sample heights under the footprint, away from its corners (it may be round).
        spread = np.linspace(-0.4, 0.4, 5)
        across, along = target.axes[[0, 2], 0], target.axes[[0, 2], 2]
        places = [
            target.centre[[0, 2]] + 2 * a * target.half[0] * across + 2 * b * target.half[2] * along
            for a in spread
            for b in spread
        ]
        y = float(highest_below(np.array(places), np.concatenate(near), low + _ON_TOP_M).max())
        return y if low - y < _MOST_DROP_M else None

    def gallery(self, mutable: MutableHouse, style: Style) -> Gallery:
        """The prints of the home, made on demand."""
        if self._gallery is None:
            self._gallery = Gallery(mutable, self.catalogue or EMPTY, style)
        return self._gallery

    def remember(self, placed: Item) -> None:
        """Record a stand-in as a possible support."""
        (x0, _, z0), (x1, _, z1) = placed.bounds.tolist()
        self._placed.append((x0, z0, x1, z1, placed))

    def table_near(self, middle: F64, height: float) -> F64 | None:
        """The (x, z) of the nearest table on the same storey, within reach of a chair."""
        tables = [t[[0, 2]] for t in self._tables if abs(t[1] - height) < 1.5]
        far = [float(np.linalg.norm(t - middle)) for t in tables]
        nearest = int(np.argmin(far)) if far else -1
        return tables[nearest] if nearest >= 0 and far[nearest] < _AT_TABLE_M else None


def _units_of_kitchens(box_only: list[Item], scene: _Scene) -> dict[str, list[Unit]]:
    """Units that replace counters and kitchens, by item id."""
    if scene.catalogue is None:
        return {}
    by_room: dict[str, tuple[_Place, list[Item]]] = {}
    for item in box_only:
        place = scene.place_of(item)
        target = _target_of(item, place)
        if place is not None and target is not None:
            row = by_room.setdefault(place.room.id, (place, []))
            row[1].append(replace(item, box=target))
    units: dict[str, list[Unit]] = {}
    for place, items in by_room.values():
        units |= kitchen_units(
            items,
            place.room.floor_y,
            scene.catalogue,
            scene.house.id,
            is_kitchen=scene.is_kitchen(place),
            distance_to_wall=place.outline.exterior.distance,
            choose_front=partial(_likeliest_front, place=place, scene=scene),
        )
    return units


def _likeliest_front(boxes: Sequence[Box], place: _Place, scene: _Scene) -> int:
    costs = [_front_cost(box, "base_cabinet", place, scene) for box in boxes]
    return costs.index(min(costs))


def _add_units(mutable: MutableHouse, item: Item, units: list[Unit], scene: _Scene) -> None:
    """Add the units of a run; the first one has the replaced item's id."""
    assert scene.catalogue is not None
    place = scene.place_of(item)
    for number, unit in enumerate(units):
        shape = scene.catalogue.shape(unit.piece)
        if shape is None:
            continue
        fit = _Fit(unit.piece, unit.scale, 0.0)
        placed = _placed(mutable, item, unit.box, fit, shape, place)
        if number:
            placed = replace(placed, id=f"{item.id}_{number}")
        if unit.is_invented:
            placed = replace(placed, name=unit.piece.name, nyu40=unit.piece.nyu40)
        scene.remember(placed)
        mutable.add(placed, "stand_ins", unit.piece)


def _target_of(item: Item, place: _Place | None) -> Box | None:
    """The box clipped to its room, off the walls; None if most of it is inside them."""
    assert item.box is not None
    return _inside(_between(item.box, place.room), place.area) if place else item.box


def _stand_in(mutable: MutableHouse, item: Item, scene: _Scene) -> None:
    place = scene.place_of(item)
    target = _target_of(item, place)
    if target is None:
        scene.in_walls[item.name] += 1
        return
    if item.nyu40 == SINK and place is not None:
        target = _down_to_floor(target, place.room)
    surface_y = scene.surface_below(item, target)
    if surface_y is not None:
        # The support may be lower or higher than in the source.
        target = _from(target, surface_y, surface_y + 2 * float(target.half[1]))
    fit_and_shape = _chosen(item, target, place, scene) if scene.catalogue else None
    if fit_and_shape is not None and scene.catalogue is not None:
        turned, fit = fit_and_shape
        shape = scene.catalogue.shape(fit.piece)
        if shape is not None:
            placed = _placed(mutable, item, turned, fit, shape, place)
            scene.remember(placed)
            mutable.add(placed, "stand_ins", fit.piece)
            return
    made = _made_for_wall(mutable, item, target, place, scene) if scene.catalogue else None
    if made is not None:
        scene.remember(made)
        mutable.add(made, "stand_ins")
        return
    if scene.catalogue is not None:
        scene.boxes[item.name] += 1
    plain = _plain_box(mutable, item, target, place)
    scene.remember(plain)
    mutable.add(plain, "stand_ins")


def _chosen(
    item: Item, target: Box, place: _Place | None, scene: _Scene
) -> tuple[Box, _Fit] | None:
    """The best fitting piece, and the box turned to its front; None if no piece fits."""
    assert scene.catalogue is not None
    group = _group_of(item)
    if group in _BASINS:
        group = "sink" if scene.is_kitchen(place) else "washbasin"
    best: tuple[float, Box, _Fit] | None = None
    for turned in _turned(target, is_front_given=FRONT_GIVEN in item.tags):
        fit = _best(scene.catalogue, group, item, turned)
        if fit is None:
            continue
        cost = fit.misfit + _front_cost(turned, group, place, scene)
        if best is None or cost < best[0] - 1e-9:
            best = cost, turned, fit
    return best and (best[1], best[2])


def _made_for_wall(
    mutable: MutableHouse, item: Item, target: Box, place: _Place | None, scene: _Scene
) -> Item | None:
    """A generated picture or mirror of the box's size; None for any other or a thicker item."""
    assert scene.catalogue is not None
    group = _group_of(item)
    flat = [b for b in _turned(target, is_front_given=FRONT_GIVEN in item.tags) if _is_flat(b)]
    if group not in _ON_WALLS or not flat:
        return None
    turned = min(flat, key=lambda b: _front_cost(b, group, place, scene))
    width, height = (float(2 * h) for h in turned.half[:2])
    style = style_for(mutable.rng("style"))
    rng = mutable.rng("stand-in", item.id)
    frame = frame_material(rng, style)
    if group == "mirror":
        piece, shape = mirror(rng, width, height, frame)
    else:
        shown = scene.gallery(mutable, style).print_for(width / height).texture
        piece, shape = framed(rng, style, width, height, shown, frame)
    # Its back is the box's, whatever its own depth.
    deep = piece.size[1] / 2
    centre = turned.centre + (deep - turned.half[2]) * turned.axes[:, 2]
    at_back = Box(centre, np.array([*turned.half[:2], deep]), turned.axes)
    return _placed(mutable, item, at_back, _Fit(piece, np.ones(3), 0.0), shape, place)


def _is_flat(target: Box) -> bool:
    return bool(2 * target.half[2] < _THIN_M and target.half[2] < target.half[:2].min())


def _group_of(item: Item) -> str:
    """Catalogue group of a box-only item, by its name, then by its class; "" = none."""
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


def _best(catalogue: Catalogue, group: str, item: Item, target: Box) -> _Fit | None:
    """The piece of the group, else of the class, that needs the least stretching."""
    by_class = 0 < item.nyu40 < 38
    for pieces in (
        catalogue.of(group) if group else (),
        [p for p in catalogue.pieces if by_class and p.nyu40 == item.nyu40],
    ):
        fits = [fit for p in pieces if p.place is not Place.OPENING and (fit := _fit(p, target))]
        if fits:
            return min(fits, key=lambda fit: (round(fit.misfit, 6), fit.piece.id))
    # Fixtures have standard sizes, so a toilet of the wrong size is better than a box.
    fits = [
        fit for p in catalogue.of(group) if group in _FIXTURES and (fit := _own_size(p, target))
    ]
    return min(fits, key=lambda fit: (round(fit.misfit, 6), fit.piece.id), default=None)


def _own_size(piece: Piece, target: Box) -> _Fit | None:
    """A piece at about its modelled size; None if the box is far smaller or larger."""
    size = np.array([piece.size[0], piece.size[2], piece.size[1]])
    raw = 2 * target.half / np.maximum(size, 1e-6)
    if not _stands(piece) or raw.min() < _FAR_SCALES[0] or raw.max() > _FAR_SCALES[1]:
        return None
    return _Fit(piece, np.clip(raw, *_OWN_SCALES), float(np.abs(np.log(raw)).sum()))


def _fit(piece: Piece, target: Box) -> _Fit | None:
    """Scale of a piece for a box; None if the limits of scale forbid it."""
    size = np.array([piece.size[0], piece.size[2], piece.size[1]])  # width, height, depth
    if size.min() <= 0:
        return None
    scale = np.maximum(2 * target.half, 0.01) / size
    if piece.group in _BASINS:
        # A source measures a basin to its rim, below the tap.
        if not _stands(piece) or piece.size[2] > _TALLEST_BASIN_M:
            return None
        scale[1] = 1.0
    # The thickness of a thin item (picture, rug, flat screen) says little.
    is_thin = (size < _THIN_M) | (2 * target.half < _THIN_M)
    scale = np.where(is_thin, np.clip(scale, *_SCALES), scale)
    thick = scale[~is_thin] if not is_thin.all() else scale
    most = _STRETCH_OF_BOARDS if piece.group in _BOARDS else _STRETCH
    if thick.min() < _SCALES[0] or thick.max() > _SCALES[1] or thick.max() / thick.min() > most:
        return None
    logs = np.log(thick)
    return _Fit(piece, scale, float(np.ptp(logs) + 0.3 * np.abs(logs.mean())))


def _between(target: Box, room: Room) -> Box:
    """The box clipped to its room's height; a box just above the floor is lowered onto it."""
    low, high = (float(target.centre[1] + side * target.half[1]) for side in (-1, 1))
    bottom = max(low, room.floor_y)
    top = min(high, room.ceiling_y - 0.005)
    if top - bottom < 0.01:
        # The box is outside: keep its height and put it on the floor.
        bottom, top = room.floor_y, room.floor_y + min(high - low, room.ceiling_y - room.floor_y)
    return _from(target, bottom, top)


def _down_to_floor(target: Box, room: Room) -> Box:
    """Extend a basin's box to the floor if its rim is as high as that of a pedestal basin."""
    rim = float(target.centre[1] + target.half[1]) - room.floor_y
    if not _RIMS_M[0] <= rim <= _RIMS_M[1]:
        return target
    return _from(target, room.floor_y, room.floor_y + rim)


def _from(target: Box, low: float, high: float) -> Box:
    """The box between two heights of the world."""
    centre, half = target.centre.copy(), target.half.copy()
    centre[1], half[1] = (low + high) / 2, (high - low) / 2
    return replace(target, centre=centre, half=half)


def _ground(target: Box) -> Polygon:
    across, front = target.axes[[0, 2], 0] * target.half[0], target.axes[[0, 2], 2] * target.half[2]
    middle = target.centre[[0, 2]]
    corners = [middle + a * across + b * front for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return Polygon([(float(x), float(z)) for x, z in corners])


def _inside(target: Box, area: Polygon) -> Box | None:
    """Move the box off the walls of its room by the smallest step; None if over 30 % of it stays outside."""
    ground = _ground(target)
    if area.contains(ground):
        return target
    steps = sorted(
        product((0.0, 0.05, -0.05, 0.1, -0.1, 0.15, -0.15), repeat=2), key=lambda s: math.hypot(*s)
    )
    x_axis, z_axis = target.axes[[0, 2], 0], target.axes[[0, 2], 2]
    for across, along in steps:
        dx, dz = across * x_axis + along * z_axis
        moved = Polygon([(x + dx, z + dz) for x, z in ground.exterior.coords])
        if moved.difference(area).area <= 1e-4 + _IN_WALL_SHARE * ground.area * (
            across == along == 0.0
        ):
            return replace(target, centre=target.centre + np.array([dx, 0.0, dz]))
    outside = ground.difference(area).area
    return target if outside <= 0.3 * ground.area else None


def _turned(target: Box, *, is_front_given: bool) -> Iterator[Box]:
    """The box with its given front, or in each possible orientation: four, two if it is flat."""
    if is_front_given:
        yield target
        return
    width, depth = (float(2 * h) for h in target.half[[0, 2]])
    quarters: Sequence[int] = range(4)
    if min(width, depth) < _THIN_M and max(width, depth) > 2 * min(width, depth):
        # A flat screen faces across its thin side.
        quarters = (0, 2) if depth < width else (1, 3)
    for quarter in quarters:
        right, up, front = target.axes.T
        for _ in range(quarter):
            right, front = front, -right
        half = target.half[[2, 1, 0]] if quarter % 2 else target.half
        yield Box(target.centre, half, np.stack([right, up, front], 1))


def _front_cost(target: Box, group: str, place: _Place | None, scene: _Scene) -> float:
    """0 if its back is at a wall or it faces its table; higher for other fronts and blocked ones."""
    if place is None:
        return 0.0
    front = target.axes[[0, 2], 2]
    middle = target.centre[[0, 2]]
    back = middle - front * target.half[2]
    before = Point(*(middle + front * (target.half[2] + _NEAR_WALL_M)))
    blocked = 0.0 if place.outline.contains(before) else 1.0
    table = scene.table_near(middle, float(target.centre[1])) if group in _SEATS else None
    if table is not None:
        way = table - middle
        return 1 - float(way @ front) / max(float(np.linalg.norm(way)), 1e-6) + blocked
    if place.outline.exterior.distance(Point(*back)) < _NEAR_WALL_M:
        return blocked
    centre = np.array(place.outline.representative_point().coords[0]) - middle
    looks = float(centre @ front) / max(float(np.linalg.norm(centre)), 1e-6)
    return 0.5 + 0.25 * (1 - looks) + blocked


def _placed(
    mutable: MutableHouse, item: Item, target: Box, fit: _Fit, shape: Shape, place: _Place | None
) -> Item:
    size = np.ptp(shape.bounds, axis=0)
    size_m = fit.scale * np.array([fit.piece.size[0], fit.piece.size[2], fit.piece.size[1]])
    scale = size_m / np.maximum(size, 1e-6)
    front = target.axes[:, 2]
    turn_rad = float(np.arctan2(front[0], front[2]))
    low, high = shape.bounds * scale
    # Align the centres of the bases; if the piece is deeper than the box, align their backs.
    # Hanging
    # items keep their top.
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    mx, mz = (low[0] + high[0]) / 2, (low[2] + high[2]) / 2
    base = float(target.centre[1] - target.half[1])
    if fit.piece.place is Place.CEILING:
        base = float(target.centre[1] + target.half[1]) - float(high[1] - low[1])
    elif place is not None and _stands(fit.piece) and base - place.room.floor_y < _ON_FLOOR_M:
        base = place.room.floor_y
    if fit.piece.group in _BASINS:
        # The tap rises above the rim that the source measures.
        target = _from(target, base, base + float(high[1] - low[1]))
    deeper = max(float(high[2] - low[2]) / 2 - float(target.half[2]), 0.0)
    position = (
        target.centre + deeper * front - np.array([mx * cos + mz * sin, 0.0, mz * cos - mx * sin])
    )
    position[1] = base - low[1]
    placed = mutable.placed(
        fit.piece,
        shape,
        position,
        turn_rad,
        item_id=item.id,
        room_id=_room_id(item, place),
        level_id=_level_id(item, place),
        scale=scale,
    )
    return replace(
        placed,
        name=item.name,
        nyu40=item.nyu40 or placed.nyu40,
        source_class=item.source_class,
        box=target,
        tags=(*_kept(item), STAND_IN, f"piece:{fit.piece.id}"),
    )


def _stands(piece: Piece) -> bool:
    return piece.place in (Place.FLOOR, Place.KITCHEN) and piece.group != "upper_cabinet"


def _room_id(item: Item, place: _Place | None) -> str | None:
    return place.room.id if place else item.room_id


def _level_id(item: Item, place: _Place | None) -> str:
    return place.room.level_id if place else item.level_id


def _kept(item: Item) -> tuple[str, ...]:
    """The tags of a box-only item, without those that mark it as one."""
    return tuple(tag for tag in item.tags if tag not in (BOX_ONLY, FRONT_GIVEN))


def _plain_box(mutable: MutableHouse, item: Item, target: Box, place: _Place | None) -> Item:
    name = NYU40_NAMES[item.nyu40] if item.nyu40 else ""
    r, g, b = _COLOURS.get(name, _PLAIN)
    material = mutable.material(Material(f"stand-in {name}".strip(), diffuse=(r, g, b)))
    half = np.maximum(target.half, 0.005)
    # Slightly off the floor, so that none of its faces coincides with the floor's.
    centre = target.centre + np.array([0.0, 0.001, 0.0])
    surface = box("box", centre, half, material, axes=_right_handed(target.axes))
    return replace(
        item,
        surfaces=(surface,),
        box=target,
        room_id=_room_id(item, place),
        level_id=_level_id(item, place),
        tags=(*_kept(item), STAND_IN, "piece:box"),
    )


def _right_handed(axes: F64) -> F64:
    return axes if np.linalg.det(axes) > 0 else axes * np.array([-1.0, 1.0, 1.0])
