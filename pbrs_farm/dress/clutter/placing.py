"""What small things stand on and come from, and how they get there; effects: on the draft."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64, I32, Bools
from pbrs_farm.core.catalogue import Catalogue, Place, Shape
from pbrs_farm.core.classes import (
    BOOKSHELF,
    CABINET,
    COUNTER,
    DESK,
    DRESSER,
    NIGHT_STAND,
    OTHERFURNITURE,
    OTHERPROP,
    REFRIGERATOR,
    SHELVES,
    SINK,
    TABLE,
    TELEVISION,
    TOILET,
)
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Item, ItemKind, Room, Surface
from pbrs_farm.core.record import Nyu40, Record, Several, read_csv
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.supports import LEAST_FREE_M, Support
from pbrs_farm.dress.things.assembly import Made
from pbrs_farm.dress.things.books import Covers, magazines, open_book, stack_of_books
from pbrs_farm.dress.things.things import THINGS
from pbrs_farm.home.names import words_of_item
from pbrs_farm.home.room_use import RoomKind

# A support while things are put on it: where a thing of a size fits; state: what is taken.


MARGIN_M = 0.02  # between things
_HEADROOM_M = 0.01  # above a thing
LIFT_M = 0.0001  # above the support, so that no faces coincide


@dataclass(frozen=True, slots=True)
class TopSpot:
    """A place for a thing: cells of a worktop."""

    row: int
    column: int
    n_rows: int
    n_columns: int


class Worktop:
    """A support and what is still free on it. Rows run from the back to the front."""

    def __init__(self, support: Support) -> None:
        self.support = support
        self.grid = support.grid
        self.clear = support.clear.copy()
        rows, columns = np.nonzero(support.mask)
        self.rows = int(rows.min()), int(rows.max()) + 1
        self.columns = int(columns.min()), int(columns.max()) + 1

    @property
    def width(self) -> float:
        """Metres from its left to its right end."""
        return (self.columns[1] - self.columns[0]) * self.grid.cell_m

    @property
    def depth(self) -> float:
        """Metres from its back to its front."""
        return (self.rows[1] - self.rows[0]) * self.grid.cell_m

    @property
    def height(self) -> float:
        """World y that things stand at."""
        return self.support.height + LIFT_M

    def free_height(self) -> float:
        """The median free height of what is left, metres; 0 where nothing is."""
        left = self.clear[self.support.mask & (self.clear > 0)]
        return float(np.median(left)) if len(left) else 0.0

    def free_share(self) -> float:
        """The share of the support that nothing was put on."""
        mask = self.support.mask
        return float((mask & (self.clear > 0)).sum() / max(mask.sum(), 1))

    def spots(
        self, size: tuple[float, float, float], *, margin_m: float = MARGIN_M, inset_m: float = 0.0
    ) -> tuple[I32, I32, tuple[int, int]]:
        """Rows and columns of the first cells of all places for a (width, height, depth), metres.

        And the rows and columns such a place has. margin_m: to what stands there; inset_m: to the
        support's edge.
        """
        cell = self.grid.cell_m
        n = (int(np.ceil(size[2] / cell)) + 1, int(np.ceil(size[0] / cell)) + 1)
        margin, inset = round(margin_m / cell), round(inset_m / cell)
        # The thing must lie on the support, and nothing lower than it stand near.
        off = _counts(~self.support.mask, n, inset)
        hit = _counts(self.clear < size[1] + _HEADROOM_M, n, margin)
        rows, columns = np.nonzero((off == 0) & (hit == 0))
        return rows.astype(np.int32), columns.astype(np.int32), n

    def take(self, spot: TopSpot) -> None:
        """Nothing else can stand there."""
        ahead = slice(spot.row, spot.row + spot.n_rows)
        self.clear[ahead, spot.column : spot.column + spot.n_columns] = 0.0

    def is_free(self, at: F64, side_m: float) -> bool:
        """Whether a square about a plan place (2,) lies on the support and is free; it is taken then."""
        column, _y, row = self.grid.local(np.array([at[0], self.support.height, at[1]]))
        n = round(side_m / self.grid.cell_m)
        i, j = int(row) - n // 2, int(column) - n // 2
        if i < 0 or j < 0 or i + n > self.clear.shape[0] or j + n > self.clear.shape[1]:
            return False
        part = self.clear[i : i + n, j : j + n]
        if not (self.support.mask[i : i + n, j : j + n] & (part > LEAST_FREE_M)).all():
            return False
        part[:] = 0.0
        return True

    def keep_free(self, zone: BaseGeometry) -> None:
        """Nothing can stand over a plan area."""
        plan = self.grid.centres()
        corners = plan[[0, 0, -1, -1], [0, -1, 0, -1]]
        if not zone.is_empty and shapely.box(*corners.min(0), *corners.max(0)).intersects(zone):
            self.clear[shapely.contains_xy(zone, plan[..., 0], plan[..., 1])] = 0.0

    def middle(self, spot: TopSpot) -> F64:
        """(3,) world place of the spot's middle, on the support."""
        x, z = self.grid.plan_of(spot.column + spot.n_columns / 2, spot.row + spot.n_rows / 2)
        return np.array([x, self.height, z])


def apart(made: Made, rng: np.random.Generator, mess: float) -> Made:
    """A pair of things that stand side by side, each turned and moved by itself."""
    piece, shape = made
    turns, ahead = rng.normal(0, 0.6 * mess, 2), rng.normal(0, 0.06 * mess, 2)
    quarter = piece.size[0] / 4
    surfaces = []
    for surface in shape.surfaces:
        points = surface.positions.astype(np.float64)
        # Each connected part goes with the side that its middle is on.
        of = _parts(surface)
        middle = np.array([points[of == k, 0].mean() for k in range(int(of.max()) + 1)])[of]
        for side, sign in enumerate((-1, 1)):
            own = middle * sign > 0
            pivot, turn = np.array([sign * quarter, 0.0, 0.0]), rotation_y(float(turns[side]))
            step = [sign * abs(float(turns[side])) * quarter, 0.0, float(ahead[side])]
            points[own] = (points[own] - pivot) @ turn.T + pivot + step
        surfaces.append(replace(surface, positions=points.astype(np.float32), normals=None))
    moved = Shape(tuple(surfaces), shape.materials, shape.textures)
    low, high = moved.bounds
    width, height, depth = (float(v) for v in high - low)
    return replace(piece, size=(width, depth, height)), moved


def _parts(surface: Surface) -> NDArray[np.int64]:
    """(N,) the number of the connected part of each vertex; vertices of one place are one."""
    _, place = np.unique(np.round(surface.positions, 5), axis=0, return_inverse=True)
    place = place.reshape(-1)
    start = place[surface.faces]
    ends = np.roll(start, -1, 1)
    n = int(place.max()) + 1
    links = coo_array((np.ones(start.size, np.int8), (start.ravel(), ends.ravel())), (n, n))
    return np.asarray(connected_components(links, directed=False)[1][place], np.int64)


def turned_size(size: F64, turn_rad: float) -> tuple[float, float, float]:
    """Width, height and depth of the box around a turned box (3,) of width, height, depth."""
    c, s = abs(np.cos(turn_rad)), abs(np.sin(turn_rad))
    return (
        float(size[0] * c + size[2] * s), float(size[1]), float(size[0] * s + size[2] * c),
    )  # fmt: skip


def _counts(bad: Bools, n: tuple[int, int], grown: int) -> I32:
    # How many bad cells are in each window of n cells, grown by so many on each side.
    tall, wide = n[0] + 2 * grown, n[1] + 2 * grown
    total = np.zeros((bad.shape[0] + 2 * grown + 1, bad.shape[1] + 2 * grown + 1), np.int32)
    total[1:, 1:] = np.pad(bad, grown).astype(np.int32).cumsum(0).cumsum(1)
    if tall >= total.shape[0] or wide >= total.shape[1]:
        return np.ones((0, 0), np.int32)
    return np.asarray(
        total[tall:, wide:] - total[:-tall, wide:] - total[tall:, :-wide] + total[:-tall, :-wide]
    )


# Kinds of small things and where they come from: the catalogue's groups, or generated.


_MOST_FACES: Final = 1500  # of a small thing from a catalogue, and of most kinds
_MOST_OF_MODEL: Final = 12_000  # faces of all things of one model in a home
_GENERATED_SHARE: Final = 0.5  # where there are both
_DESIGNS: Final = 1  # of a kind in one home
_MOST_TRIES: Final = 2  # models that are loaded to find them


class ThingKind(Record):
    """Where a kind's pieces come from: a row of kinds.csv."""

    kind: str
    groups: Several[str] = ()  # of the catalogue
    made: str = ""  # generator's name
    most_m: float = 0.6  # the longest side
    is_round: bool = False  # it may face anywhere
    place: Place = Place.SURFACE  # of the catalogue's pieces
    most_faces: int = _MOST_FACES


# Of the generated things, those that a catalogue has, too, or that may face anywhere.
_KINDS: Final = {
    row.kind: row for row in read_csv(Path(__file__).with_name("kinds.csv"), ThingKind)
}


class Stock:
    """What a home's small things are taken from: one model of each kind, as people own sets."""

    def __init__(self, catalogue: Catalogue, covers: Covers, seed: int) -> None:
        self.covers = covers
        self._catalogue = catalogue
        self._seed = seed
        self._designs: dict[str, list[Made]] = {}
        self._faces: Counter[str] = Counter()  # of the things taken so far, by piece

    def take(self, rng: np.random.Generator, kind: str, style: Style) -> Made | None:
        """A thing of that kind; None where there is none that can be used."""
        if kind == "book":
            # One or a pile; now and then one lies open.
            n = int(rng.choice([0, 1, 1, 2, 3, 4, 5]))
            return stack_of_books(rng, self.covers, n) if n else open_book(rng, self.covers)
        if kind == "magazines":
            return magazines(rng, self.covers, int(rng.integers(1, 6)))
        # Draw for all alike, so that what the catalogue holds moves no later draw.
        found = _kind(kind)
        is_made, number = rng.random() < _GENERATED_SHARE, int(rng.integers(1 << 30))
        designs = [] if found.made and is_made else self._owned(kind)
        # Of one detailed model there are few in a home.
        designs = [d for d in designs if self._faces[d[0].id] + _n_faces(d[1]) <= _MOST_OF_MODEL]
        if designs:
            piece, shape = designs[number % len(designs)]
            self._faces[piece.id] += _n_faces(shape)
            return piece, shape
        own = np.random.default_rng(number)
        return THINGS.make(found.made, own, style) if found.made else None

    def _owned(self, kind: str) -> list[Made]:
        """The designs of the catalogue that this home has; at most _DESIGNS of a kind."""
        if kind not in self._designs:
            found = _kind(kind)
            fitting = [
                p
                for p in self._catalogue.of(*found.groups)
                if p.place is found.place
                and max(p.size) <= found.most_m
                and p.kind in (ItemKind.OBJECT, ItemKind.LAMP)
            ]
            order = np.random.default_rng([self._seed, *kind.encode()]).permutation(len(fitting))
            owned: list[Made] = []
            for k in order[:_MOST_TRIES]:
                if len(owned) == _DESIGNS:
                    break
                shape = self._catalogue.shape(fitting[k])
                if shape is not None and _is_usable(shape, found):
                    owned.append((fitting[k], shape))
            self._designs[kind] = owned
        return self._designs[kind]


def is_round(kind: str) -> bool:
    """Whether things of that kind may face anywhere."""
    return kind in _KINDS and _KINDS[kind].is_round


def is_known(kind: str) -> bool:
    """Whether there is such a kind."""
    return kind in (*_KINDS, *THINGS.names, "book", "magazines")


def _kind(name: str) -> ThingKind:
    return _KINDS.get(name) or ThingKind(kind=name, made=name)


def _n_faces(shape: Shape) -> int:
    return sum(len(s.faces) for s in shape.surfaces)


def _is_usable(shape: Shape, kind: ThingKind) -> bool:
    if not 0 < _n_faces(shape) <= kind.most_faces:
        return False
    low, high = shape.bounds
    return bool(np.isfinite([low, high]).all() and (high - low).max() <= kind.most_m + 0.05)


# Puts things on worktops.


PART = "clutter"
_NEAR_M = 0.06


@dataclass(slots=True)
class Placing:
    """What is needed to put things into one room."""

    draft: Draft
    stock: Stock
    room: Room
    style: Style
    rng: np.random.Generator
    share: float
    bias: float = 0.0  # of the home: how much more or less than usual lies about
    kind: RoomKind = RoomKind.OTHER  # what the room is for
    taken: Counter[str] = field(default_factory=Counter)  # in this room, by kind
    laid: list[F64] = field(
        default_factory=list
    )  # triangles of what fell here: cloth lies on cloth

    def put(self, made: Made, at: F64, turn_rad: float) -> None:
        """Add the thing with the middle of its base at (3,), turned about +y."""
        piece, shape = made
        low, high = shape.bounds
        base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        number = sum(self.draft.done.values())
        item = self.draft.placed(
            piece, shape, at - rotation_y(turn_rad) @ base, turn_rad,
            item_id=f"dress-{PART}-{len(self.draft.items)}-{number}",
            room_id=self.room.id, level_id=self.room.level_id,
        )  # fmt: skip
        self.draft.add(item, PART, piece)

    def laid_near(self, low: F64, high: F64) -> list[F64]:
        """The triangles of cloth in the room that may meet the box low..high (3,)."""
        return [
            c for c in self.laid
            if (c.min((0, 1)) <= high).all() and (c.max((0, 1)) >= low).all()
        ]  # fmt: skip

    def refuse(self, reason: str) -> None:
        """Count a thing that was not put down."""
        self.draft.refused[f"{PART}: {reason}"] += 1

    def drop(self, top: Worktop, made: Made, *, faces_anywhere: bool, depth_pull: float) -> bool:
        """Put the thing where it fits on the worktop; False where it fits nowhere.

        depth_pull: how strongly it is drawn to the back (> 0) or to the front (< 0), per metre.
        """
        size = np.asarray(made[0].size)[[0, 2, 1]]
        low, high = made[1].bounds
        size = high - low
        sd = 0.06 + 0.3 * self.draft.mess
        turn = self.rng.uniform(-np.pi, np.pi) if faces_anywhere else self.rng.normal(0, sd)
        for turn_rad, inset in ((turn, 0.02), (0.0, 0.01), (0.0, 0.0)):
            needed = turned_size(size, turn_rad)
            rows, columns, n = top.spots(needed, inset_m=inset)
            if len(rows):
                break
        else:
            self.refuse("no room on the surface")
            return False
        # Prefer the back or the front, and leave the rest to chance.
        weight = np.exp(-depth_pull * rows * top.grid.cell_m)
        k = int(self.rng.choice(len(rows), p=weight / weight.sum()))
        spot = TopSpot(int(rows[k]), int(columns[k]), *n)
        top.take(spot)
        self.put(made, top.middle(spot), top.grid.turn_rad + float(turn_rad))
        return True

    def drop_near(self, top: Worktop, made: Made, at: F64, *, turn_rad: float = 0.0) -> bool:
        """Put the thing at a plan place (2,), or within 6 cm of it; False where it does not fit."""
        low, high = made[1].bounds
        # Of the free spots take the nearest; n: the rows and columns of cells that it covers.
        rows, columns, n = top.spots(turned_size(high - low, turn_rad), margin_m=0.01)
        if not len(rows):
            return False
        places = top.grid.plan_of(columns + n[1] / 2, rows + n[0] / 2)
        away = np.linalg.norm(places - at, axis=1)
        k = int(np.argmin(away))
        if away[k] > _NEAR_M:
            return False
        spot = TopSpot(int(rows[k]), int(columns[k]), *n)
        top.take(spot)
        self.put(made, top.middle(spot), top.grid.turn_rad + turn_rad)
        return True


# What a support is to who lives there: receptacles.csv says what it is, shares.csv what lies there.


_HOLDERS = frozenset({
    CABINET, TABLE, BOOKSHELF, COUNTER, DESK, SHELVES, DRESSER, REFRIGERATOR, TELEVISION, NIGHT_STAND,
    TOILET, SINK, OTHERFURNITURE, OTHERPROP,
})  # fmt: skip


class Row(Record):
    """One row of shares.csv: a share of the receptacles holds the kind."""

    receptacle: str
    kind: str
    share: float
    source: str


class _ReceptacleRule(Record):
    # One row of receptacles.csv: what fits all that it names is that receptacle.
    room: Several[RoomKind] = ()
    classes: Several[Nyu40] = Field((), alias="class")
    inside: bool = False
    words: Several[str] = ()
    name: Several[str] = ()
    above_m: float = -inf
    below_m: float = inf
    free_m: float = -inf
    area_m2: float = inf
    holds: str = ""


@cache
def shares() -> Mapping[str, tuple[Row, ...]]:
    """Rows by receptacle, in the table's order."""
    rows: dict[str, list[Row]] = {}
    for row in read_csv(Path(__file__).with_name("shares.csv"), Row):
        rows.setdefault(row.receptacle, []).append(row)
    return MappingProxyType({name: tuple(found) for name, found in rows.items()})


@cache
def _rules() -> tuple[_ReceptacleRule, ...]:
    return read_csv(Path(__file__).with_name("receptacles.csv"), _ReceptacleRule)


def can_hold(item: Item) -> bool:
    """Whether things are put on furniture of this kind; seats and beds are for cushions."""
    if item.kind is not ItemKind.OBJECT or item.nyu40 not in _HOLDERS:
        return False
    low, high = item.bounds
    # Small things hold nothing, and neither do thin ones as rails and radiators.
    return bool(min(high[0] - low[0], high[2] - low[2]) > 0.15 and (high - low).max() > 0.3)


def receptacle_of(item: Item, support: Support, kind: RoomKind) -> str:
    """The table's name for a support of an item in a room of that kind; "" holds nothing."""
    name, words = f"{item.name} {item.source_class}".casefold(), words_of_item(item)
    low, high = item.bounds
    is_inner = float(high[1]) - support.height > 0.1
    area = float((high[0] - low[0]) * (high[2] - low[2]))
    for rule in _rules():
        if (
            (not rule.room or kind in rule.room)
            and (not rule.classes or item.nyu40 in rule.classes)
            and (is_inner or not rule.inside)
            and (not rule.words or words & {*rule.words})
            and (not rule.name or any(part in name for part in rule.name))
            and rule.above_m < support.above_floor < rule.below_m
            and (rule.free_m == -inf or float(support.clear[support.mask].max()) > rule.free_m)
            and area < rule.area_m2
        ):
            return rule.holds
    return ""
