"""The generated catalogue: families of furniture, many variations each.

A variation has a family, a number and a style (`generated#cooker-07-nordic`). Its size
is drawn at once, its shape on use. Variations of a set (a kitchen) with the same number share
the values that the set draws. Effects: imports the modules of installed plugins that add furniture.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import ModuleType
from typing import Any, Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import FAMILIES_VERSION, Catalogue, Piece, Place, Shape
from pbrs_farm.core.classes import LAMP
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import affine
from pbrs_farm.core.house import ItemKind, LightPart, MaterialKind, Surface
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.plugins import marks_in_digest, plugins
from pbrs_farm.dress.models import GENERATED
from pbrs_farm.dress.style import Style, style_for
from pbrs_farm.furnishings.things.maker import Family, described_in, modules_of

# The order decides which piece a seed draws.
# fmt: off
_MODULES: Final = ("kitchen", "bathroom", "seating", "tables", "storage", "beds", "lamps", "radiators",
    "bins", "chandeliers", "plants", "fitted")
# fmt: on

_WARM: Final = (1.0, 0.79, 0.55)  # linear, of a lamp of about 3000 K
_FLUX_LM: Final = 1000.0  # of a lamp; homes give it what their rooms need


def with_families(catalogue: Catalogue) -> Catalogue:
    """The catalogue and every variation of every family, behind its own pieces."""
    return replace(
        catalogue,
        pieces=(*catalogue.pieces, *family_pieces()),
        load=lambda piece: family_shape(piece) if is_of_family(piece) else catalogue.load(piece),
        digest=keys.digest(catalogue.digest, families_digest()),
    )


@cache
def families() -> Mapping[str, Family]:
    """Every family by name, ours first, then those of installed plugins.

    Raises BadInput where two families have one name or a plugin names no module with families,
    MachineFailed where a plugin's module cannot be imported.
    """
    modules = []
    for plugin in plugins("furniture").values():
        module = plugin.load()
        if not isinstance(module, ModuleType) or not described_in((module,), Family):
            raise BadInput(plugin.mark, plugin.entry.value, "is not a module with a family in it")
        modules.append(module)
    return described_in((*modules_of(__package__, _MODULES), *modules), Family)


def is_of_family(piece: Piece) -> bool:
    """True if a piece is a variation of a family."""
    return piece.id in family_numbers()


@cache
def family_pieces() -> tuple[Piece, ...]:
    """Every variation, in the order of the files."""
    return tuple(
        _piece(name, number)
        for name, family in families().items()
        for number in range(1, family.variants + 1)
    )


@cache
def family_numbers() -> dict[str, tuple[str, int]]:
    """Family and number of each variation, by id."""
    rows = (
        (name, number)
        for name, family in families().items()
        for number in range(1, family.variants + 1)
    )
    return {piece.id: row for piece, row in zip(family_pieces(), rows, strict=True)}


def family_shape(piece: Piece) -> Shape:
    """The shape of a variation, scaled to the size of its piece."""
    return fitted_to_size(_drawn(piece), piece)


def fitted_to_size(shape: Shape, piece: Piece) -> Shape:
    """The shape scaled to the size of its piece; a lamp has its light."""
    return _lit(_sized(shape, piece), piece)


def drawn_size(piece: Piece) -> tuple[float, float, float]:
    """Width, depth and height of a variation before scaling, metres."""
    low, high = _drawn(piece).bounds
    width, height, depth = (float(v) for v in high - low)
    return width, depth, height


def _drawn(piece: Piece) -> Shape:
    name, number = family_numbers()[piece.id]
    family = families()[name]
    style, shared = _shared(family, number)
    rng = np.random.default_rng(keys.seed("family", "shape", name, number))
    _, shape = family.make(rng, style, piece.size, *shared)
    return shape


def _shared(family: Family, number: int) -> tuple[Style, tuple[Any, ...]]:
    # The style of a variation, and the values of its set.
    of = family.of_set.__name__ if family.of_set else family.name
    rng = np.random.default_rng(keys.seed("family", of, number))
    style = style_for(rng)
    return style, family.shared(rng, style)


def _piece(name: str, number: int) -> Piece:
    family = families()[name]
    style, shared = _shared(family, number)
    rng = np.random.default_rng(keys.seed("family", "size", name, number))
    taste = style.name.replace(" ", "-")
    return Piece(
        f"{GENERATED}{name}-{number:02d}-{taste}",
        family.called.replace("_", " ").capitalize(),
        family.group,
        family.place,
        family.nyu40,
        family.size(rng, style, *shared),
        ItemKind.LAMP if family.nyu40 == LAMP else ItemKind.OBJECT,
        of_set=f"{family.of_set.__name__} {number}" if family.of_set else "",
    )


def _sized(shape: Shape, piece: Piece) -> Shape:
    """The shape scaled to the piece's size; wall pieces start at z = 0."""
    low, high = shape.bounds
    target = np.array([piece.size[0], piece.size[2], piece.size[1]])
    scale = target / np.maximum(high - low, 1e-6)
    base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    if piece.place is Place.WALL:
        base[2] = low[2]
    matrix = affine(np.diag(scale), -scale * base)
    return replace(
        shape,
        surfaces=tuple(_scaled(s, scale, base) for s in shape.surfaces),
        joints=tuple(joint.placed(matrix) for joint in shape.joints),
    )


def _scaled(surface: Surface, scale: F64, base: F64) -> Surface:
    points = (surface.positions.astype(np.float64) - base) * scale
    normals = surface.normals
    if normals is not None:
        turned = normals.astype(np.float64) / scale
        turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-12)
        normals = turned.astype(np.float32)
    return replace(surface, positions=points.astype(np.float32), normals=normals)


def _lit(shape: Shape, piece: Piece) -> Shape:
    """The shape with one light for all its surfaces of opal glass."""
    bulbs = tuple(
        k
        for k, surface in enumerate(shape.surfaces)
        if shape.materials[surface.material].kind is MaterialKind.BULB
    )
    if piece.kind is not ItemKind.LAMP or not bulbs:
        return shape
    points = shape.surfaces[bulbs[0]].positions.astype(np.float64)
    low, high = points.min(0), points.max(0)
    x, y, z = (float(v) for v in (low + high) / 2)
    light = LightPart(
        (x, y, z),
        float((high - low).min()) / 2,
        _FLUX_LM,
        PowerUnit.LUMEN,
        rgb_linear=_WARM,
        emitting=bulbs,
    )
    return replace(shape, lights=(light,))


@cache
def families_digest() -> str:
    """Digest of the version of our families, and of the plugins that add some."""
    return keys.digest(FAMILIES_VERSION, *marks_in_digest("furniture", plugins("furniture")))
