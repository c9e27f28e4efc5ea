"""A made home by its seed: plan, furniture, file; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.made_home import VERSION, MadeHome
from pbrs_farm.generate.drawing import drawn_plan
from pbrs_farm.generate.furnish.furnished import furnished
from pbrs_farm.generate.furniture import PlacedPiece
from pbrs_farm.generate.home_file import home_file
from pbrs_farm.generate.plan import Plan
from pbrs_farm.generate.programme import Wishes


@dataclass(frozen=True, slots=True)
class Made:
    """A home that was made."""

    plan: Plan
    pieces: tuple[PlacedPiece, ...]
    data: bytes  # of its .sh3d


def made(home: MadeHome, catalogue: Catalogue) -> Made:
    """The home of a seed; equal homes and catalogues give equal bytes.

    Raises BadInput for wishes that no home meets.
    """
    wishes = Wishes(home.bedrooms, (float(home.area[0]), float(home.area[1])))
    rng = np.random.default_rng(keys.seed("made", VERSION, home.word))
    plan = drawn_plan(rng, wishes)
    shelf = catalogue if home.furniture else EMPTY
    pieces = furnished(plan, shelf, rng, home.style)
    return Made(plan, pieces, home_file(plan, pieces, shelf, rng, name=home.name))
