"""Furniture, clutter and surface pictures to dress a home with: Catalogue > Piece, Shape, Picture; no effects.

The frame of a shape: metres, origin at the middle of its base, x to its right, y up, its front towards
+z. Shapes for walls have their back at z = 0 and extend to +z.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import ItemKind, LightPart, Material, Note, Surface, Texture
from pbrs_farm.core.joints import Joint
from pbrs_farm.core.mesh import points_bounds
from pbrs_farm.core.shown_text import hint_of_choice

FAMILIES_VERSION: Final = 14
"""Version of the shapes of our families of furniture, part of the catalogue's digest and of repair's.

tests/furnishings/things/test_recorded_things.py records what they make and fails until it is raised.
"""


class Place(StrEnum):
    """Where a piece belongs."""

    FLOOR = "floor"
    SURFACE = "surface"  # on furniture
    WALL = "wall"
    CEILING = "ceiling"
    OPENING = "opening"  # doors and windows
    KITCHEN = "kitchen"  # part of a kitchen run


@dataclass(frozen=True, slots=True)
class Piece:
    """An entry of a catalogue; its shape is loaded at its first use."""

    id: str  # unique in the catalogue: `<library>#<its id there>`, `generated#<family>`
    name: str
    group: str  # its kind: "chair", "table_lamp", "book"; docs/dress/catalogue.md lists all
    place: Place
    nyu40: int
    size: tuple[float, float, float]  # width, depth, height in metres
    kind: ItemKind = ItemKind.OBJECT
    library: str = ""
    creator: str = ""
    licence: str = ""  # "CC0", "CC-BY 3.0"
    of_set: str = ""  # pieces of one set are sold together; "" = it goes with any
    low_m: float = 0.0  # height of its base on a wall, by its library; 0 = not hung

    @property
    def held_by(self) -> Place:
        """Its support: the place of its group, or a wall if its library hangs it there."""
        hangs = self.low_m > 0 and self.place in (Place.FLOOR, Place.SURFACE)
        return Place.WALL if hangs else self.place


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """The mesh of a piece in its own frame; Surface.material is an index into materials."""

    surfaces: tuple[Surface, ...]
    materials: tuple[Material, ...]
    textures: Mapping[str, Texture] = field(default_factory=dict)  # by Material.texture_id
    lights: tuple[LightPart, ...] = ()  # positions in the piece's frame
    joints: tuple[Joint, ...] = ()  # in the piece's frame

    @property
    def bounds(self) -> F64:
        """(2, 3) minimum and maximum in the piece's frame, metres; ValueError without surfaces. Not cached."""
        return np.array(points_bounds(np.concatenate([s.positions for s in self.surfaces])))


PRINTS = "prints"
"""The group of pictures that hang on walls; those of others repeat over surfaces."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A photographed surface that repeats, wood, cloth or tiles, or a picture for a wall."""

    texture: Texture
    group: str  # "wood", "cloth", "leather", "marble", "tiles", ..., PRINTS
    size: tuple[float, float]  # width and height of one repeat in metres
    creator: str = ""
    licence: str = ""


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Every piece and picture there is to dress with."""

    pieces: tuple[Piece, ...]
    load: Callable[[Piece], Shape | None]  # None where a model cannot be used
    digest: str  # of everything that shapes come from
    pictures: tuple[Picture, ...] = ()
    notes: tuple[Note, ...] = ()
    own: frozenset[str] = frozenset()  # ids of the pieces of the user's own libraries
    stored: Mapping[str, tuple[str | int, ...]] = field(default_factory=dict)
    """Piece id -> key of its shape in the store of shapes, of those that are kept there."""
    painted_folder: Path | None = None  # where painted materials are kept for other homes
    _shapes: dict[str, Shape | None] = field(default_factory=dict, init=False, repr=False)

    def with_licences(self, licences: Sequence[str]) -> Catalogue:
        """Only generated pieces and library pieces and pictures of these licences; () for all.

        "CC-BY" means each version of it, but not CC-BY-SA; a piece without a named licence never matches.
        Raises BadInput for a licence that none of the libraries' pieces and pictures has.
        """
        if not licences:
            return self
        of_all = {e.licence for e in self.pieces} | {e.licence for e in self.pictures}
        of_entries = sorted(of_all - {""})
        known = {word for name in of_entries for word in (name, name.partition(" ")[0])}
        for name in licences:
            if known and name not in known:
                hint = hint_of_choice(name, of_entries)
                raise BadInput("dress.licences", name, "no library has it", hint=hint)

        def is_allowed(entry: Piece | Picture) -> bool:
            first_word = entry.licence.partition(" ")[0]
            return entry.licence in licences or first_word in licences

        return replace(
            self,
            pieces=tuple(p for p in self.pieces if not p.library or is_allowed(p)),
            pictures=tuple(filter(is_allowed, self.pictures)),
            digest=keys.digest({"catalogue": self.digest, "licences": sorted(licences)}),
        )

    def of(self, *groups: str) -> tuple[Piece, ...]:
        """The pieces of these groups, in the catalogue's order."""
        return tuple(p for p in self.pieces if p.group in groups)

    def shape(self, piece: Piece) -> Shape | None:
        """The piece's shape, loaded once and shared (do not write into it); None if its model is unusable."""
        if piece.id not in self._shapes:
            self._shapes[piece.id] = self.load(piece)
        return self._shapes[piece.id]


EMPTY = Catalogue((), lambda _piece: None, "empty")
"""A catalogue of generated pieces alone."""
