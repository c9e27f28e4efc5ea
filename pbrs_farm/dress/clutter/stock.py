"""Sources of a home's small items: the catalogue's groups, or generators; state: items taken so far."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.catalogue import Catalogue, Place, Shape
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.record import Record, Several, read_csv, read_toml
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.style import Style
from pbrs_farm.home.room_use import RoomKind

# Maximum faces of one small catalogue item, unless its kind has another limit.
_MOST_FACES: Final = 1500
_MOST_OF_MODEL: Final = 12_000  # maximum faces of all items of one model in a home
_DESIGNS: Final = 1  # models of a kind in one home
_MOST_TRIES: Final = 2  # models to load before giving up


class ThingKind(Record):
    """Where a kind's pieces come from: a row of kinds.csv."""

    kind: str
    groups: Several[str] = ()  # of the catalogue
    made: str = ""  # generator's name
    most_m: float = 0.6  # the longest side
    is_round: bool = False  # it may face anywhere
    place: Place = Place.SURFACE  # of the catalogue's pieces
    most_faces: int = _MOST_FACES
    made_share: float = 0.5  # chance that one is generated, where the catalogue has it, too


# Generated items that catalogues have too, or that may face anywhere.
_KINDS: Final = {
    row.kind: row for row in read_csv(Path(__file__).with_name("kinds.csv"), ThingKind)
}


class Stock:
    """Source of a home's small items: one model of each kind, as people own sets."""

    def __init__(self, catalogue: Catalogue, covers: Any, seed: int) -> None:
        self.covers = covers
        self._catalogue = catalogue
        self._seed = seed
        self._designs: dict[str, list[Model]] = {}
        self._faces: Counter[str] = Counter()  # of the items taken so far, by piece

    def take(self, rng: np.random.Generator, kind: str, style: Style) -> Model | None:
        """An item of that kind, generated or of the catalogue, heavy ones rarely; or None."""
        if kind == "book":
            # One or a pile; occasionally one is open.
            n = int(rng.choice([0, 1, 1, 2, 3, 4, 5]))
            books = content()
            return (
                books.stack_of_books(rng, self.covers, n)
                if n
                else books.open_book(rng, self.covers)
            )
        if kind == "magazines":
            return content().magazines(rng, self.covers, int(rng.integers(1, 6)))
        # Draw for all alike, so that what the catalogue holds moves no later draw.
        thing_kind = _thing_kind(kind)
        is_made, number = rng.random() < thing_kind.made_share, int(rng.integers(1 << 30))
        designs = [] if thing_kind.made and is_made else self._owned(kind)
        # Of one detailed model there are few in a home.
        designs = [d for d in designs if self._faces[d[0].id] + _n_faces(d[1]) <= _MOST_OF_MODEL]
        if designs:
            piece, shape = designs[number % len(designs)]
            self._faces[piece.id] += _n_faces(shape)
            return piece, shape
        model_rng = np.random.default_rng(number)
        return content().things[thing_kind.made](model_rng, style) if thing_kind.made else None

    def _owned(self, kind: str) -> list[Model]:
        """The designs of the catalogue that this home has; at most _DESIGNS of a kind."""
        if kind not in self._designs:
            thing_kind = _thing_kind(kind)
            fitting = [
                p
                for p in self._catalogue.of(*thing_kind.groups)
                if p.place is thing_kind.place
                and max(p.size) <= thing_kind.most_m
                and p.kind in (ItemKind.OBJECT, ItemKind.LAMP)
            ]
            order = np.random.default_rng([self._seed, *kind.encode()]).permutation(len(fitting))
            owned: list[Model] = []
            for k in order[:_MOST_TRIES]:
                if len(owned) == _DESIGNS:
                    break
                shape = self._catalogue.shape(fitting[k])
                if shape is not None and _is_usable(shape, thing_kind):
                    owned.append((fitting[k], shape))
            self._designs[kind] = owned
        return self._designs[kind]


def is_round(kind: str) -> bool:
    """True if items of that kind may face anywhere."""
    return kind in _KINDS and _KINDS[kind].is_round


def is_known(kind: str) -> bool:
    """Whether there is such a kind."""
    return kind in (*_KINDS, *content().small_things, "book", "magazines")


def _thing_kind(name: str) -> ThingKind:
    return _KINDS.get(name) or ThingKind(kind=name, made=name)


def _n_faces(shape: Shape) -> int:
    return sum(len(s.faces) for s in shape.surfaces)


def _is_usable(shape: Shape, kind: ThingKind) -> bool:
    if not 0 < _n_faces(shape) <= kind.most_faces:
        return False
    low, high = shape.bounds
    return bool(np.isfinite([low, high]).all() and (high - low).max() <= kind.most_m + 0.05)


KindShares = tuple[tuple[str, float], ...]


class ClutterTable(Record):
    # The file clutter.toml.
    in_front: tuple[str, ...]
    at_walls: tuple[str, ...]
    most_on_one: dict[str, int]
    most_in_room: dict[str, int]
    usual_m2: dict[str, float]
    floors: dict[RoomKind, KindShares]
    shelves: dict[str, KindShares]


CLUTTER: Final = read_toml(Path(__file__).with_name("clutter.toml"), ClutterTable)
