"""Statistics of one picture for a comparison: histograms and a few numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.recipe import HistogramFields
from pbrs_farm.selection.histograms import coarser_colour, coarser_depth, histogram, normalised
from pbrs_farm.selection.quality import picture_quality
from pbrs_farm.study.metrics.error_parts import surface_kinds
from pbrs_farm.study.plane_normals import normals_of_depth

FIELDS: Final = HistogramFields()
COLOUR_BINS: Final = (4, 4, 4)  # of red, green and blue
DEPTH_BINS: Final = 32  # over 0 to 10 m
_DIRECTION_BINS: Final = 8  # number of bands of elevation and of sectors of azimuth, of equal area
_LEAST_PIXELS: Final = 50  # minimum number of normals for their histogram

# Name of each number, title, and adjectives for a lower and a higher value.
# fmt: off
NUMBERS: Final = (
    ("luma", "median luma, 0 to 1", "darker", "brighter"),
    ("contrast", "spread of luma", "of less contrast", "of more contrast"),
    ("colourful", "mean distance of channels from grey", "greyer", "more colourful"),
    ("warmth", "red minus blue", "bluer", "redder"),
    ("detail", "mean step of luma from pixel to pixel", "smoother", "with more fine detail"),
    ("burnt", "share of pixels with a full channel", "with fewer overexposed pixels", "with more overexposed pixels"),
    ("depth_m", "median depth, m", "nearer", "farther"),
    ("up", "share of surfaces that face up", "with less floor and table top", "with more floor and table top"),
    ("frontal", "share of walls seen straight", "with less wall seen straight", "with more wall seen straight"),
    ("oblique", "share of walls seen from the side", "with less wall seen from the side", "with more wall seen from the side"),
    ("slanted", "share of slanted surfaces", "with fewer slanted surfaces", "with more slanted surfaces"),
    ("down", "share of surfaces that face down", "with less ceiling", "with more ceiling"),
)
# fmt: on
KINDS: Final = ("up", "frontal", "oblique", "slanted", "down")


@dataclass(frozen=True, slots=True, eq=False)
class PictureFacts:
    """Statistics of one picture at the common size."""

    id: str
    group: str  # home or folder: its pictures are alike
    colour: Srgb8Image  # (H, W, 3)
    histograms: dict[str, F64] = field(default_factory=dict)  # name -> shares that sum to 1
    numbers: dict[str, float] = field(default_factory=dict)  # by the names of NUMBERS


def facts_of(
    id: str,
    group: str,
    colour: Srgb8Image,
    depth_m: NDArray[Any] | None = None,
    K: F64 | None = None,
    class40: NDArray[np.uint8] | None = None,
) -> PictureFacts:
    """Statistics of a picture (H, W, 3) uint8 and its layers, all of one size.

    depth_m: (H, W) metres, 0 = unknown. K: (3, 3) pixels, needed for normals. class40: (H, W) NYU40
    ids, 0 = none.

    Histograms: colour (joint bins), luma, depth (0 to 10 m), normals (of planes fitted to depth, by
    direction) and classes, as far as the layers exist.
    """
    depth_mm = np.zeros((1, 1), np.uint16) if depth_m is None else _millimetres(depth_m)
    counts = histogram(colour, depth_mm, FIELDS)
    luma = colour @ LUMINANCE / 255
    shares = {
        "colour": _shares(coarser_colour(counts.colour, COLOUR_BINS)),
        "luma": _shares(np.histogram(luma, 32, (0, 1))[0]),
    }
    numbers = _numbers(colour, luma)
    if depth_m is not None and counts.depth.any():
        shares["depth"] = _shares(coarser_depth(counts.depth, DEPTH_BINS))
        numbers["depth_m"] = float(np.median(depth_m[depth_m > 0]))
    if depth_m is not None and K is not None:
        normal, valid = normals_of_depth(depth_m, K)
        if int(valid.sum()) >= _LEAST_PIXELS:
            shares["normals"] = _shares(_directions(normal[valid]))
            numbers |= {kind: float(m.mean()) for kind, m in surface_kinds(normal[valid]).items()}
    if class40 is not None and class40.any():
        shares["classes"] = _shares(np.bincount(class40[class40 > 0], minlength=41)[:41])
    return PictureFacts(id, group, colour, shares, numbers)


def _millimetres(depth_m: NDArray[Any]) -> NDArray[np.uint16]:
    return np.clip(np.rint(np.asarray(depth_m, np.float64) * 1000), 0, 65535).astype(np.uint16)


def _shares(counts: NDArray[Any]) -> F64:
    return np.asarray(normalised(counts), np.float64)


def _numbers(colour: Srgb8Image, luma: F64) -> dict[str, float]:
    channels = colour.astype(np.float64) / 255
    steps = np.abs(np.diff(luma, axis=0)).mean() + np.abs(np.diff(luma, axis=1)).mean()
    quality = picture_quality(colour)
    return {
        "luma": quality.brightness,
        "contrast": float(luma.std()),
        "colourful": float(np.abs(channels - channels.mean(-1, keepdims=True)).mean()),
        "warmth": float((channels[..., 0] - channels[..., 2]).mean()),
        "detail": float(steps / 2),
        "burnt": quality.blown,
    }


def _directions(normal: NDArray[Any]) -> NDArray[np.intp]:
    """(64,) counts of normals (n, 3): eight bands from down to up, with eight sectors from left to right."""
    up = np.clip((1 - normal[:, 1]) / 2 * _DIRECTION_BINS, 0, _DIRECTION_BINS - 1)
    azimuth = np.arctan2(normal[:, 0], np.maximum(-normal[:, 2], 0))
    side = np.clip((azimuth / np.pi + 0.5) * _DIRECTION_BINS, 0, _DIRECTION_BINS - 1)
    bins = up.astype(np.intp) * _DIRECTION_BINS + side.astype(np.intp)
    return np.bincount(bins, minlength=_DIRECTION_BINS**2)


def bands_of_height(normals: F64) -> F64:
    """(8,) shares by elevation, from downward to upward surfaces."""
    return np.asarray(normals.reshape(_DIRECTION_BINS, _DIRECTION_BINS).sum(1))
