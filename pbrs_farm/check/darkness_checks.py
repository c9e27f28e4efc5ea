"""Whether a stored view has light: black pictures, and rooms that were measured dark. Effects: reads files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored_files import stored_object
from pbrs_farm.check.stored_view import StoredView

_LM_PER_W = 179.0  # of white: radiance in W m-2 sr-1 to cd m-2
_LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear sRGB
_BLACK_CD_M2 = 0.05
_DARK_LX = 1.0
_TILES = 8


def check_darkness(
    view: StoredView, channels: dict[str, NDArray[Any]], valid: NDArray[Any], tally: Tally
) -> None:
    """A picture that the sum of all light leaves black fails; a dark room is noted.

    channels: of radiance.exr; valid: (H, W), 0 where nothing is hit. A black picture shows
    nothing, so nobody can want it. A room below 1 lx may be what the house is like: its labels
    and its light are right.
    """
    level = _luminance(channels, valid.shape)
    if level is not None and valid.any():
        what = f"all light together leaves nine tenths of it below {_BLACK_CD_M2:g} cd/m2"
        is_bright = _ninth_tenth(level, valid > 0) >= _BLACK_CD_M2
        tally.expect("black pictures", view.place, is_bright, what)
    # A dark room is noted, not failed.
    room = str(view.table.get("room", ""))
    lux = _lux_of_rooms(view.folder.parent.parent / "illuminance.json").get(room)
    if lux is not None and lux < _DARK_LX:
        text = f"stands in room {room}, which has {lux:.2g} lx by all light"
        tally.note(f"{view.place} {text}")


def _luminance(
    channels: dict[str, NDArray[Any]], shape: tuple[int, ...]
) -> NDArray[np.float64] | None:
    """(H, W) cd/m2 of all light together; None where a light group is not there at this size."""
    names = [f"{group}.{c}" for group in ("outdoor", "indoor") for c in "RGB"]
    planes = [channels[name] for name in names if name in channels]
    if len(planes) < len(names) or any(p.shape != shape for p in planes):
        return None
    # Both light groups add up; what is no number counts as black.
    level = np.zeros(shape)
    for plane, share in zip(planes, 2 * _LUMINANCE, strict=True):
        level += _LM_PER_W * share * np.nan_to_num(plane)
    return level


def _ninth_tenth(level: NDArray[Any], valid: NDArray[Any]) -> float:
    """The 90th percentile of the mean level of the picture's tiles that hit something."""
    # Number each pixel's tile, and average by number.
    rows, columns = (np.arange(n) * _TILES // n for n in level.shape)
    tile = (rows[:, None] * _TILES + columns)[valid]
    n = np.bincount(tile)
    means = np.bincount(tile, level[valid])[n > 0] / n[n > 0]
    return float(np.quantile(means, 0.9))


def _lux_of_rooms(file: Path) -> dict[str, float]:
    """Room id -> lx on its floor by all light; {} where illuminance.json is not there or damaged."""
    try:
        rows = stored_object(file)["rooms"]
        return {str(r["room"]): float(r["outdoor_lx"]) + float(r["indoor_lx"]) for r in rows}
    except (ValueError, KeyError, TypeError):
        return {}
