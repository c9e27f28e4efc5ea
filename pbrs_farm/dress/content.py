"""Tables of the content that dressing draws from, filled by the module PROVIDER at first use."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.catalogue import Catalogue, Piece, Shape
from pbrs_farm.core.house import House, Surface
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.style import Rgb, Style
from pbrs_farm.dress.surface_maps import SurfaceMaps

if TYPE_CHECKING:
    from pbrs_farm.dress.patterns import Pattern

PROVIDER: Final = "pbrs_farm.furnishings.content"

Rng = np.random.Generator


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """Generated items, furniture, paints, prints and surroundings.

    things: name of an item -> its maker, called with a generator, a style and the item's own
    arguments. small_things: those that lie about, in the order from which seeds draw.
    with_families: a catalogue with the generated furniture behind its own. family_pieces: that
    furniture; family_shape: the shape of a piece; families_digest: changes with their code.
    boards: materials of a case: body, front, top, colour of the cloth.

    book_covers: a home's library, the first argument after the generator of the functions of books.
    run_of_books: also returns the height of the last book.

    maps_of: the painted pixels of a pattern; pattern_size: one repeat, metres; paint_files: the
    code that paints, for the digest of stored paintings. panels_m: width of a panel and height of the
    panelling, by variant. wallpapers: names of patterns, plain_wallpapers: of
    those in one colour; wallpaper_inks: colours on a ground.
    print_pixels: a picture for a wall, and its family. rugs, bath_mats, door_mats: names of
    patterns for rug_pixels. moulding: along a rectangle, of a profile; facing_disc: a profile turned about +z.
    """

    things: Mapping[str, Callable[..., Model]]
    small_things: Sequence[str]
    with_families: Callable[[Catalogue], Catalogue]
    family_pieces: Callable[[], tuple[Piece, ...]]
    family_shape: Callable[[Piece], Shape]
    families_digest: Callable[[], str]
    boards: Callable[..., Any]
    book_covers: Callable[[Rng, Style], Any]
    run_of_books: Callable[..., tuple[Model, float]]
    leaning_book: Callable[..., Model]
    stack_of_books: Callable[..., Model]
    open_book: Callable[..., Model]
    magazines: Callable[..., Model]
    maps_of: Callable[[Pattern], SurfaceMaps]
    pattern_size: Callable[[Pattern], tuple[float, float]]
    paint_files: Sequence[Path]
    panels_m: Mapping[str, tuple[float, float]]
    wallpapers: Sequence[str]
    plain_wallpapers: Sequence[str]
    wallpaper_inks: Callable[[Rng, Rgb, Rgb], tuple[Rgb, Rgb]]
    print_pixels: Callable[..., tuple[Srgb8Image, str]]
    rug_pixels: Callable[..., Srgb8Image]
    rugs: Sequence[str]
    bath_mats: Sequence[str]
    door_mats: Sequence[str]
    moulding: Callable[..., Surface]
    facing_disc: Callable[..., Surface]
    with_surroundings: Callable[[House, str, int], House]


@cache
def content() -> Content:
    """The tables of the content package."""
    tables: Content = import_module(PROVIDER).CONTENT
    return tables
