"""Views without light: black pictures, and dark rooms. Effects: reads files."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import LM_PER_W, has_channels, luminance_of
from pbrs_farm.core.arrays import F64

_BLACK_CD_M2 = 0.05
_DARK_LX = 1.0
_TILES = 8  # of a picture, across and down


def check_darkness(case: ViewCase) -> None:
    """A picture fails if all light together leaves it black; a room below 1 lx is noted."""
    hit = case.arrays["valid"] > 0
    if has_channels(case.light, hit.shape, "outdoor indoor") and hit.any():
        planes = [np.nan_to_num(luminance_of(case.light, g)) for g in ("outdoor", "indoor")]
        fault = f"all light together leaves nine tenths of it below {_BLACK_CD_M2:g} cd/m2"
        level = _ninth_tenth(LM_PER_W * (planes[0] + planes[1]), hit)
        case.expect("black pictures")(level >= _BLACK_CD_M2, fault)
    room = str(case.view.table.get("room", ""))
    lux = _lux_of_rooms(case.house.illuminance).get(room)
    if lux is not None and lux < _DARK_LX:
        note = f"is in room {room}, which has {lux:.2g} lx by all light"
        case.tally.note(f"{case.place} {note}")


def _ninth_tenth(level: F64, hit: NDArray[Any]) -> float:
    """90th percentile of the mean levels of the tiles that hit something."""
    rows, columns = (np.arange(n) * _TILES // n for n in level.shape)
    tile = (rows[:, None] * _TILES + columns)[hit]
    n = np.bincount(tile)
    means = np.bincount(tile, level[hit])[n > 0] / n[n > 0]
    return float(np.quantile(means, 0.9))


def _lux_of_rooms(document: dict[str, Any]) -> dict[str, float]:
    """Room id -> lx on its floor by all light; {} where illuminance.json is missing or damaged."""
    try:
        rows = document["rooms"]
        return {str(r["room"]): float(r["outdoor_lx"]) + float(r["indoor_lx"]) for r in rows}
    except (ValueError, KeyError, TypeError):
        return {}


CHECKS = (Check("darkness", "view", check_darkness, 22, ("radiance",)),)
