"""A made home by its seed: plan, furniture, file; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.made_home import VERSION, MadeHome
from pbrs_farm.generate.drawn_home import drawn_home
from pbrs_farm.generate.furniture import PlacedPiece
from pbrs_farm.generate.home_file import home_file
from pbrs_farm.generate.plan import Plan
from pbrs_farm.generate.programme import Programme, Wishes


@dataclass(frozen=True, slots=True)
class Made:
    """A home that was made."""

    plan: Plan
    pieces: tuple[PlacedPiece, ...]
    data: bytes  # of its .sh3d
    origin: str


def made(home: MadeHome, catalogue: Catalogue, programme: Programme | None = None) -> Made:
    """The home of a seed, or of a seed and a programme; equal arguments give equal bytes.

    Raises BadInput for wishes that no home meets.
    """
    wishes = Wishes(home.bedrooms, (float(home.area[0]), float(home.area[1])))
    words = (home.word,) if programme is None else (home.word, repr(programme))
    rng = np.random.default_rng(keys.seed("made", VERSION, *words))
    shelf = catalogue if home.furniture else EMPTY
    drawn = drawn_home(rng, shelf, wishes=wishes, programme=programme, style=home.style)
    plan, pieces = drawn.plan, drawn.pieces
    said = origin(home, shelf, programme)
    data = home_file(plan, pieces, shelf, rng, name=home.name, origin=said)
    return Made(plan, pieces, data, said)


def origin(home: MadeHome, catalogue: Catalogue, programme: Programme | None = None) -> str:
    """What tells a made home from every other, in its file: its word and a digest of the rest."""
    shelf = catalogue if home.furniture else EMPTY
    return f"{home.word} {keys.digest('made', VERSION, home.word, repr(programme), shelf.digest)}"
