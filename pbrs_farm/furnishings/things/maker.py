"""Generated furniture and items: functions that draw numbers and add solids; no effects.

`@thing` decorates a function that draws numbers and materials from its maker and adds solids, by the
methods of shapes.py or by `add`:

    @thing(group="vase")
    def vase(m: Maker) -> None:
        \"\"\"A vase, a third of them of glass.\"\"\"
        r, tall = m.uniform(0.04, 0.08), m.uniform(0.15, 0.33)
        with m.of(glass() if m.chance(0.3) else m.china()):
            m.vessel([(0, 0), (r, 0), (r, tall)], 0.004)

A function without a decorator is a shared part; it takes the maker too. With `@family` a function
describes furniture of the generated catalogue: it also takes the size that was drawn for a
variation, and its parameters if it has some (parameters.py). Our own families have their facts in
families.csv (catalogued.py), forms that only state numbers are rows of forms.csv (forms.py).
pbrs_farm.plugin exports these names for other packages.

Metres, y up. Furniture has its back at -z and its front at +z; wall items have their back at z = 0. The
order of draws decides the result of a seed: an inserted draw changes all later ones.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import product
from types import ModuleType
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import OTHERPROP
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import LYING_ALONG_Z, affine
from pbrs_farm.core.house import Material, Surface
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.dress.models import Model, Part, hanging_piece, standing_piece, transformed
from pbrs_farm.dress.style import COLOURS, Rgb, Style
from pbrs_farm.dress.thing_materials import WHITE, any_colour, glossy, metal, plain
from pbrs_farm.furnishings.things.shapes import Shapes
from pbrs_farm.geometry.outlines import Triple

P = ParamSpec("P")
T = TypeVar("T")
S = TypeVar("S")  # what a set draws once for all its families
Size = Triple
"""Width, depth and height of a variation, metres."""

_PAINTS = ("whites", "greys", "paints", "darks", "boards")
_PAINT_SHARES = (0.42, 0.18, 0.2, 0.1, 0.1)


class Maker(Shapes):
    """Random draws, the materials of a home's style, and the parts added so far.

    rng: source of all draws. style: of the home or the room.
    """

    def __init__(self, rng: np.random.Generator, style: Style) -> None:
        self.rng, self.style = rng, style
        self.name = ""  # of the piece where a form has its own: "elephant" for an ornament
        self._parts: list[tuple[Surface, Material | None]] = []
        self._joints: list[Joint] = []
        self._counted: Counter[str] = Counter()  # parts by what they are called

    def uniform(self, low: float, high: float) -> float:
        """A number between low and high."""
        return float(self.rng.uniform(low, high))

    def normal(self, middle: float, spread: float) -> float:
        """A number of a normal distribution."""
        return float(self.rng.normal(middle, spread))

    def integers(self, low: int, high: int) -> int:
        """A whole number from low to high - 1."""
        return int(self.rng.integers(low, high))

    def chance(self, share: float) -> bool:
        """True with that probability (0..1)."""
        return bool(self.rng.random() < share)

    def pick(self, *choices: T) -> T:
        """One of the choices, each equally likely; name one twice to make it twice as likely."""
        return choices[int(self.rng.integers(len(choices)))]

    def weighted(self, *shares: float) -> int:
        """The index of one of the shares, which sum to 1."""
        return int(self.rng.choice(len(shares), p=shares))

    @property
    def wood(self) -> Rgb:
        """The colour of the home's wood from afar."""
        return self.style.wood.mean

    @property
    def dark_wood(self) -> Rgb:
        """The colour of its late wood."""
        return self.style.wood.dark

    @property
    def accent(self) -> Rgb:
        """The loud colour of the style."""
        return self.style.accent

    @property
    def timber(self) -> Material:
        """The home's wood, varnished."""
        return plain(f"{self.style.wood.name} wood", self.style.wood.mean, 0.45)

    @property
    def dark_timber(self) -> Material:
        """The same, stained."""
        return plain(f"dark {self.style.wood.name} wood", self.style.wood.dark, 0.45)

    @property
    def metal(self) -> Material:
        """The metal of the home's fittings."""
        return metal(self.style)

    def textile(self, n: int | None = None) -> Rgb:
        """A colour of the style's cloth; n: of the n calmest alone."""
        colours = self.style.textiles
        return colours[int(self.rng.integers(len(colours) if n is None else min(n, len(colours))))]

    def cloth(self) -> Material:
        """Cloth of one of those colours."""
        return plain("fabric", self.textile(), 0.95)

    def any_colour(self) -> Rgb:
        """A colour for a small item: of the style, calm or loud, or any at all."""
        return any_colour(self.rng, self.style)

    def coloured(self, name: str, roughness: float) -> Material:
        """A plain material of any colour."""
        return plain(name, self.any_colour(), roughness)

    def colour_within(self, low: float, high: float) -> Rgb:
        """A colour whose channels lie between low and high (sRGB, 0..1)."""
        r, g, b = (float(v) for v in self.rng.uniform(low, high, 3))
        return (r, g, b)

    def china(self) -> Material:
        """Glazed ceramic, white more often than coloured."""
        colour = (0.9, 0.89, 0.86) if self.rng.random() >= 0.45 else self.any_colour()
        return plain("china", colour, (0.12, 0.25)[int(self.rng.integers(2))])

    def paint(self) -> Rgb:
        """A colour that furniture is painted with: whites and greys more often than colours."""
        colours = COLOURS[_PAINTS[int(self.rng.choice(5, p=_PAINT_SHARES))]]
        return colours[int(self.rng.integers(len(colours)))]

    def finish(self, whites: int = 1) -> Material:
        """A finish for furniture: timber, white lacquer or paint; whites: weight of white."""
        paint = glossy("paint", self.paint(), 0.4)
        return self.pick(self.timber, self.timber, self.dark_timber, *[WHITE] * whites, paint)

    def add(
        self,
        solid: Surface,
        *,
        of: Material | None = None,
        at: Triple | None = None,
        turn: F64 | None = None,
        front: Triple | None = None,
        name: str = "",
        mirrored: str = "",
    ) -> None:
        """Add a solid to the item.

        of: its material; by default that of the nearest enclosing `with m.of(...)`. turn: a
        rotation (3, 3) about the origin. at: the position of its origin after that, metres. front: the
        same of a solid whose top is turned to the front, +z. name: of its surface, for later searches. mirrored: "x", "z" or "xz" adds copies at the mirrored
        positions.
        """
        if name:
            solid = replace(solid, name=name)
        if front is not None:
            at, turn = front, LYING_ALONG_Z
        if at is None and turn is None:
            self._parts.append((solid, of))
            return
        x, y, z = at or (0, 0, 0)
        for a, b in product(
            (x, -x) if "x" in mirrored else (x,), (z, -z) if "z" in mirrored else (z,)
        ):
            moved = transformed(solid, np.eye(3) if turn is None else turn, (a, y, b))
            self._parts.append((moved, of))

    @contextmanager
    def of(self, material: Material) -> Iterator[None]:
        """Material of the solids added inside, unless they name another."""
        outer, self._parts = self._parts, []
        yield
        outer += [(solid, material if inner is None else inner) for solid, inner in self._parts]
        self._parts = outer

    @contextmanager
    def moved(self, *, at: Triple | None = None, turn: F64 | None = None) -> Iterator[None]:
        """Turn and then move the solids and joints added inside, as `add` does."""
        outer, self._parts = self._parts, []
        outer_joints, self._joints = self._joints, []
        yield
        inner, self._parts = self._parts, outer
        for solid, own_material in inner:
            self.add(solid, of=own_material, at=at, turn=turn)
        matrix = affine(np.eye(3) if turn is None else turn, at or (0.0, 0.0, 0.0))
        self._joints = [*outer_joints, *(joint.placed(matrix) for joint in self._joints)]

    @contextmanager
    def hinged(self, name: str, *, at: Triple, axis: Triple, upper_rad: float) -> Iterator[None]:
        """Make the solids added inside a part that turns anticlockwise about an axis, from shut.

        name: "door" or "lid"; a number is appended. at: a point of the axis.
        """
        with self._part(name, JointKind.REVOLUTE, at, axis, upper_rad):
            yield

    @contextmanager
    def sliding(self, name: str, *, along: Triple, upper_m: float) -> Iterator[None]:
        """Make the solids added inside a part that slides along an axis, from shut."""
        with self._part(name, JointKind.PRISMATIC, (0.0, 0.0, 0.0), along, upper_m):
            yield

    @contextmanager
    def _part(
        self, name: str, kind: JointKind, at: Triple, axis: Triple, upper: float
    ) -> Iterator[None]:
        outer, self._parts = self._parts, []
        yield
        inner, self._parts = self._parts, outer
        self._counted[name] += 1
        part = f"{name} {self._counted[name]}"
        self._parts += [(replace(solid, part=part), own_material) for solid, own_material in inner]
        self._joints.append(Joint(part, kind, at, axis, upper))

    def joints(self) -> tuple[Joint, ...]:
        """The joints by the names of their parts, without masses."""
        return tuple(self._joints)

    def finished(self, file: str, name: str) -> list[Part]:
        """All parts; BadInput if there are no parts, or one has no material."""
        parts = [(solid, material) for solid, material in self._parts if material is not None]
        if not parts or len(parts) != len(self._parts):
            raise BadInput(file, name, "has nothing in it, or a part without a material")
        return parts


@dataclass(frozen=True, slots=True)
class Thing(Generic[P]):
    """An item that a function describes; `make` takes the function's arguments after the maker."""

    name: str
    called: str  # name of its pieces
    group: str  # as Piece.group
    nyu40: int
    place: Place
    build: Callable[Concatenate[Maker, P], None]

    def make(
        self, rng: np.random.Generator, style: Style, *args: P.args, **kwargs: P.kwargs
    ) -> Model:
        """A piece of the catalogue and its shape; BadInput if it has no solids."""
        m = Maker(rng, style)
        self.build(m, *args, **kwargs)
        return put_together(m, self)


@dataclass(frozen=True, slots=True)
class Family:
    """Furniture of the generated catalogue, in a number of variations.

    A set (a kitchen) shares values between its families. They follow the size in the arguments of
    `draw_size`, `draw` and `build`; the drawn parameters are the last argument of `build`.
    """

    name: str
    called: str  # name of its pieces
    group: str
    nyu40: int
    place: Place
    variants: int
    draw_size: Callable[..., Size]
    build: Callable[..., None]
    of_set: Callable[[Maker], Any] | None = None
    draw: Callable[..., Any] | None = None  # draws the parameters, a dataclass

    def shared(self, rng: np.random.Generator, style: Style) -> tuple[Any, ...]:
        """The values that all families of its set share, as arguments; () without a set."""
        return () if self.of_set is None else (self.of_set(Maker(rng, style)),)

    def size(self, rng: np.random.Generator, style: Style, *shared: Any) -> Size:
        """Width, depth and height of a variation without making it, metres to 0.1 mm."""
        width, depth, height = (
            round(float(v), 4) for v in self.draw_size(Maker(rng, style), *shared)
        )
        return width, depth, height

    def make(
        self,
        rng: np.random.Generator,
        style: Style,
        size: Size,
        *shared: Any,
        change: Callable[[Any], Any] | None = None,
    ) -> Model:
        """A variation of that size; BadInput where it has no solids.

        change: maps the drawn parameters to those to build from.
        """
        m = Maker(rng, style)
        if self.draw is None:
            self.build(m, size, *shared)
        else:
            drawn = self.draw(m, size, *shared)
            self.build(m, size, *shared, change(drawn) if change else drawn)
        return put_together(m, self)


D = TypeVar("D", Thing[...], Family)


def put_together(m: Maker, of: Thing[...] | Family) -> Model:
    """Assemble the added parts into a piece and its shape."""
    parts, name = m.finished(of.build.__module__, of.name), m.name or of.called
    if of.place in (Place.WALL, Place.CEILING):
        return hanging_piece(name, of.group, of.nyu40, parts, (), of.place, m.joints())
    return standing_piece(
        name, parts, group=of.group, nyu40=of.nyu40, place=of.place, joints=m.joints()
    )


def thing(
    *, group: str, nyu40: int = OTHERPROP, place: Place = Place.SURFACE, called: str = ""
) -> Callable[[Callable[Concatenate[Maker, P], None]], Thing[P]]:
    """Decorator for a function that describes an item.

    group: as docs/dress/catalogue.md lists them. nyu40: its class. place: floor, surface, wall or ceiling.
    called: the name of its pieces, by default the function's name.
    """

    def described(build: Callable[Concatenate[Maker, P], None]) -> Thing[P]:
        return Thing(build.__name__, called or build.__name__, group, nyu40, place, build)

    return described


def family(
    *,
    group: str,
    variants: int,
    size: Callable[..., Size],
    nyu40: int = OTHERPROP,
    place: Place = Place.SURFACE,
    called: str = "",
    of_set: Callable[[Maker], Any] | None = None,
    draw: Callable[..., Any] | None = None,
) -> Callable[[Callable[..., None]], Family]:
    """Decorator for a function that describes a family of the generated catalogue.

    variants: how many there are. size: draws width, depth and height of one. called: the name of
    its pieces, by default the function's name. of_set: draws what families of a set (the units of
    a kitchen) share; those of one number get equal values, as the last argument of `size` and
    after the size in `draw` and the function. draw: draws the parameters, a frozen dataclass
    (parameters.py), which the function takes as its last argument; users may choose them.
    """

    def described(build: Callable[..., None]) -> Family:
        name = build.__name__
        return Family(
            name, called or name, group, nyu40, place, variants, size, build, of_set, draw
        )

    return described


def modules_of(package: str, names: Iterable[str]) -> Iterator[ModuleType]:
    """The modules of a package by name."""
    return (import_module(f"{package}.{name}") for name in names)


def described_in(modules: Iterable[ModuleType], kind: type[D]) -> dict[str, D]:
    """The items or families of some modules by name, in the order of their definitions.

    kind: Thing or Family; dictionaries of them count too. BadInput if two have the same name.
    """
    result: dict[str, D] = {}
    for module in modules:
        values = vars(module).values()
        for value in (v for x in values for v in (x.values() if type(x) is dict else (x,))):
            if not isinstance(value, kind) or value.build.__module__ != module.__name__:
                continue
            if result.get(value.name, value) is not value:
                raise BadInput(module.__name__, value.name, "is already the name of another object")
            result[value.name] = value
    return result
