"""The tables by which dressing uses this package; no effects."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from pbrs_farm.dress.content import Content
from pbrs_farm.furnishings.prints import print_pixels
from pbrs_farm.furnishings.rug_patterns import BATH_MATS, DOOR_MATS, RUGS, rug_pixels
from pbrs_farm.furnishings.surroundings import with_surroundings
from pbrs_farm.furnishings.textures.families import maps_of, size_of
from pbrs_farm.furnishings.textures.panelling import PANELS_M
from pbrs_farm.furnishings.textures.wallpaper import PATTERNS, PLAIN, inks
from pbrs_farm.furnishings.things import books, case_goods, families, hung, radiators
from pbrs_farm.furnishings.things.book_covers import book_covers
from pbrs_farm.furnishings.things.maker import Thing, described_in
from pbrs_farm.furnishings.things.things import THINGS

_LARGE: Final = described_in((case_goods, hung, radiators), Thing)

CONTENT: Final = Content(
    things={name: thing.make for name, thing in {**_LARGE, **THINGS}.items()},
    small_things=tuple(THINGS),
    with_families=families.with_families,
    family_pieces=families.family_pieces,
    family_shape=families.family_shape,
    families_digest=families.families_digest,
    boards=case_goods.Boards,
    book_covers=book_covers,
    run_of_books=books.run_of_books,
    leaning_book=books.leaning_book,
    stack_of_books=books.stack_of_books,
    open_book=books.open_book,
    magazines=books.magazines,
    maps_of=maps_of,
    pattern_size=size_of,
    paint_files=tuple(sorted((Path(__file__).parent / "textures").glob("*.py"))),
    panels_m=PANELS_M,
    wallpapers=PATTERNS,
    plain_wallpapers=PLAIN,
    wallpaper_inks=inks,
    print_pixels=print_pixels,
    rug_pixels=rug_pixels,
    rugs=tuple(RUGS),
    bath_mats=tuple(BATH_MATS),
    door_mats=tuple(DOOR_MATS),
    moulding=hung.moulding,
    facing_disc=hung.facing_disc,
    with_surroundings=with_surroundings,
)
