"""Errors of normals by kind of surface, depth and luma, since a mean may hide that only floors are right."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import Mask
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.study.metrics.angular import angles_deg

_LEVEL_DEG: Final = 45.0  # minimum elevation of upward and downward surfaces
_UPRIGHT_DEG: Final = 25.0  # maximum elevation of upright surfaces
_FRONTAL_DEG: Final = 30.0  # maximum azimuth of frontal surfaces from the camera's axis
_NEAR_M, _FAR_M = 2.0, 4.0
_DARK, _BRIGHT = 0.25, 0.6  # bounds of luma 0..1 of the encoded picture

# fmt: off
PARTS: Final = (
    "up", "frontal", "oblique", "slanted", "down",
    f"nearer than {_NEAR_M:g} m", f"{_NEAR_M:g} to {_FAR_M:g} m", f"farther than {_FAR_M:g} m",
    f"luma below {_DARK:g}", f"luma {_DARK:g} to {_BRIGHT:g}", f"luma above {_BRIGHT:g}",
)
# fmt: on
"""Kinds of surface, ranges of depth and ranges of luma; each pixel has one of each, unless its depth is unknown."""


def surface_kinds(normal: NDArray[Any]) -> dict[str, Mask]:
    """Masks of normals (..., 3), x right, y down and z forward, by kind of surface.

    By elevation above the camera's horizon: from 45 degrees "up" (floors, table tops) or "down"
    (ceilings); up to 25 degrees "frontal" within an azimuth of 30 degrees from the camera, else
    "oblique"; others "slanted". A pitched camera tilts the walls by its pitch. Each pixel is in one
    mask; zero vectors are oblique.
    """
    n = np.asarray(normal, np.float64)
    length = np.maximum(np.linalg.norm(n, axis=-1), 1e-12)
    elevation = np.degrees(np.arcsin(np.clip(-n[..., 1] / length, -1, 1)))
    azimuth = np.degrees(np.arctan2(np.abs(n[..., 0]), -n[..., 2]))
    upright = np.abs(elevation) <= _UPRIGHT_DEG
    frontal = upright & (azimuth <= _FRONTAL_DEG) & (length > 1e-6)
    up, down = elevation >= _LEVEL_DEG, elevation <= -_LEVEL_DEG
    return {
        "up": up,
        "frontal": frontal,
        "oblique": upright & ~frontal,
        "slanted": ~(upright | up | down),
        "down": down,
    }


class ErrorParts:
    """Accumulated errors of each part of PARTS."""

    def __init__(self) -> None:
        self._sum = dict.fromkeys(PARTS, 0.0)
        self._n = dict.fromkeys(PARTS, 0)

    def add(
        self, predicted: NDArray[Any], truth: Mapping[str, NDArray[Any]], colour: NDArray[np.uint8]
    ) -> None:
        """Add the valid pixels of a view.

        predicted: (H, W, 3). truth: normal (H, W, 3), valid (H, W) and optionally depth (H, W)
        metres, 0 = unknown. colour: sRGB of any size, resized by the nearest pixel.
        """
        valid = truth["valid"]
        height, width = valid.shape
        errors = angles_deg(predicted[valid], truth["normal"][valid])
        luma = (resized_nearest(colour, width, height)[valid] @ LUMINANCE) / 255
        masks = list(surface_kinds(truth["normal"][valid]).values())
        if "depth" in truth:
            depth = truth["depth"][valid]
            masks += [
                (depth > 0) & (depth < _NEAR_M),
                (depth >= _NEAR_M) & (depth <= _FAR_M),
                depth > _FAR_M,
            ]
        else:
            masks += [np.zeros(len(errors), bool)] * 3
        masks += [luma < _DARK, (luma >= _DARK) & (luma <= _BRIGHT), luma > _BRIGHT]
        for part, mask in zip(PARTS, masks, strict=True):
            self._sum[part] += float(errors[mask].sum())
            self._n[part] += int(mask.sum())

    def means_deg(self) -> dict[str, float]:
        """The mean angle of each part with pixels."""
        return {part: self._sum[part] / n for part, n in self._n.items() if n}

    def shares(self) -> dict[str, float]:
        """The share of all pixels in each part."""
        total = max(sum(self._n[part] for part in PARTS[:5]), 1)
        return {part: n / total for part, n in self._n.items()}
