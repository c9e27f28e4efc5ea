"""Errors of normals by kind of surface, depth and luma: a mean hides that only floors were learned; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import Mask
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.study.metrics.angular import angles_deg

_LEVEL_DEG: Final = 45.0  # of elevation, from which on a surface faces up or down
_UPRIGHT_DEG: Final = 25.0  # of elevation, up to which it is upright
_FRONTAL_DEG: Final = (
    30.0  # of azimuth from the camera's axis, up to which an upright one is frontal
)
_NEAR_M, _FAR_M = 2.0, 4.0
_DARK, _BRIGHT = 0.25, 0.6  # of luma 0..1 as the picture is stored
_LUMA: Final = (0.2126, 0.7152, 0.0722)  # Rec. 709

PARTS: Final = (
    "up", "frontal", "oblique", "slanted", "down",
    f"nearer than {_NEAR_M:g} m", f"{_NEAR_M:g} to {_FAR_M:g} m", f"farther than {_FAR_M:g} m",
    f"luma below {_DARK:g}", f"luma {_DARK:g} to {_BRIGHT:g}", f"luma above {_BRIGHT:g}",
)  # fmt: skip
"""Kinds of surface, then depths, then lumas: each pixel is in one of each, of depth where it is known."""


def surface_kinds(normal: NDArray[Any]) -> dict[str, Mask]:
    """Which pixels of normals (..., 3), x right, y down and z forward, are of which kind.

    By elevation above the camera's horizon: from 45 degrees "up" (floors, table tops) or "down"
    (ceilings), within 25 an upright surface, "frontal" where it faces the camera within 30 degrees
    to the side, else "oblique"; the rest is "slanted". A camera that looks down sees walls tilted by
    as much. The masks part the pixels; a normal of no length is oblique.
    """
    n = np.asarray(normal, np.float64)
    length = np.maximum(np.linalg.norm(n, axis=-1), 1e-12)
    elevation = np.degrees(np.arcsin(np.clip(-n[..., 1] / length, -1, 1)))
    azimuth = np.degrees(np.arctan2(np.abs(n[..., 0]), -n[..., 2]))
    upright = np.abs(elevation) <= _UPRIGHT_DEG
    frontal = upright & (azimuth <= _FRONTAL_DEG) & (length > 1e-6)
    up, down = elevation >= _LEVEL_DEG, elevation <= -_LEVEL_DEG
    return {
        "up": up, "frontal": frontal, "oblique": upright & ~frontal,
        "slanted": ~(upright | up | down), "down": down,
    }  # fmt: skip


class ErrorParts:
    """Sums of views that come one by one: the mean angle of each part of PARTS."""

    def __init__(self) -> None:
        self._sum = dict.fromkeys(PARTS, 0.0)
        self._n = dict.fromkeys(PARTS, 0)

    def add(
        self, predicted: NDArray[Any], truth: Mapping[str, NDArray[Any]], colour: NDArray[np.uint8]
    ) -> None:
        """Count a view's valid pixels.

        predicted: (H, W, 3). truth: normal (H, W, 3), valid (H, W) and, where it is known, depth
        (H, W) metres, 0 = unknown. colour: sRGB of any size; each pixel takes the nearest.
        """
        valid = truth["valid"]
        height, width = valid.shape
        errors = angles_deg(predicted[valid], truth["normal"][valid])
        luma = (resized_nearest(colour, width, height)[valid] @ np.array(_LUMA)) / 255
        masks = list(surface_kinds(truth["normal"][valid]).values())
        if "depth" in truth:
            depth = truth["depth"][valid]
            masks += [(depth > 0) & (depth < _NEAR_M), (depth >= _NEAR_M) & (depth <= _FAR_M), depth > _FAR_M]  # fmt: skip
        else:
            masks += [np.zeros(len(errors), bool)] * 3
        masks += [luma < _DARK, (luma >= _DARK) & (luma <= _BRIGHT), luma > _BRIGHT]
        for part, mask in zip(PARTS, masks, strict=True):
            self._sum[part] += float(errors[mask].sum())
            self._n[part] += int(mask.sum())

    def means_deg(self) -> dict[str, float]:
        """The mean angle of each part that has pixels."""
        return {part: self._sum[part] / n for part, n in self._n.items() if n}

    def shares(self) -> dict[str, float]:
        """The share of all pixels that each part has."""
        total = max(sum(self._n[part] for part in PARTS[:5]), 1)
        return {part: n / total for part, n in self._n.items()}
