"""The paints of a made home; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Paints:
    """The colours of a home, "RRGGBB"."""

    walls: tuple[str, ...]  # of rooms to live in, one drawn for each
    wet_walls: str
    floor: str
    wet_floor: str
    ceiling: str
    joinery: tuple[float, float, float]  # sRGB


def drawn_paints(rng: np.random.Generator) -> Paints:
    """Soft walls, light ceilings, doors and windows of one paint."""
    walls = ("F4F1EA", "EFEBE0", "E8ECEA", "F3E9DC", "E6E3DA", "DDE4E6", "F6F3EE", "EDE6DD")
    chosen = [walls[i] for i in rng.permutation(len(walls))[:3]]
    white, oak, grey = (0.93, 0.92, 0.90), (0.66, 0.50, 0.33), (0.45, 0.46, 0.47)
    wood = (white, white, oak, grey)[int(rng.integers(4))]
    return Paints(tuple(chosen), "EEF1F1", "B08A62", "C9C6BF", "FAFAF8", wood)
