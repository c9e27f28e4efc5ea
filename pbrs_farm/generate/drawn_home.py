"""A furnished home by seed: plan and furniture, drawn again until no gate is broken; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.generate.drawing import drawn_plan
from pbrs_farm.generate.floor_plan import Plan
from pbrs_farm.generate.furnish.furnished import furnished
from pbrs_farm.generate.furnish.gates import FurnishReport, furnish_report
from pbrs_farm.generate.furniture import PlacedPiece
from pbrs_farm.generate.programme import Programme, Wishes

_TRIES: Final = 4
_FURNISHINGS: Final = 2  # of one plan


@dataclass(frozen=True, slots=True)
class DrawnHome:
    """A plan, what stands in it, and what of it breaks a gate."""

    plan: Plan
    pieces: tuple[PlacedPiece, ...]
    report: FurnishReport


def drawn_home(
    rng: np.random.Generator, catalogue: Catalogue, *, wishes: Wishes | None = None,
    programme: Programme | None = None, style: str = "",
) -> DrawnHome:  # fmt: skip
    """A home by seed, or for a programme. Raises BadInput if no plan fits, or for a style.

    A plan whose rooms cannot hold what they must is drawn anew; after a number of tries the home
    that breaks fewest gates is given, its report saying which.
    """
    best: DrawnHome | None = None
    for _ in range(_TRIES):
        plan = drawn_plan(rng, wishes, programme)
        for _ in range(_FURNISHINGS):
            pieces = furnished(plan, catalogue, rng, style)
            home = DrawnHome(plan, pieces, furnish_report(plan, pieces, catalogue))
            if best is None or len(home.report.broken) < len(best.report.broken):
                best = home
            if not best.report.broken:
                return best
    assert best is not None
    return best
