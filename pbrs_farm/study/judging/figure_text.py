"""Figures as text and Markdown tables."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Final

UNDERFIT: Final = (
    0.8  # training error, as a share of the baseline's, above which a network is underfit
)
_UNITS: Final = ("_deg", "_m")  # endings of names with units; other figures are shares
# fmt: off
_TITLES: Final = {
    "mean_deg": "mean, degrees", "median_deg": "median, degrees",
    "rms_deg": "RMS, degrees", "below_5": "< 5", "below_7_5": "< 7.5",
    "below_11_25": "< 11.25", "below_22_5": "< 22.5", "below_30": "< 30",
    "mean_iou": "mean IoU", "pixel_accuracy": "pixel accuracy",
    "mean_accuracy": "mean accuracy", "weighted_iou": "f.w. IoU",
    "scale_invariant": "scale-invariant", "abs_rel": "absolute relative",
    "below_1_25": "ratio < 1.25", "rms_m": "RMS, metres",
    "over_rooms": "error over rooms", "over_rooms_deg": "mean over rooms",
    "ods": "ODS", "ois": "OIS", "ap": "AP", "r50": "R50",
}
# fmt: on


PLANES: Final = "planes_"
"""Start of the names of figures by the normals of large planes."""


def title_of(figure: str) -> str:
    """Title of a figure in tables."""
    if figure.startswith(PLANES):
        return f"large planes: {title_of(figure.removeprefix(PLANES))}"
    return _TITLES[figure]


def shown_figure(figure: str, value: float | None) -> str:
    """Degrees and metres with two decimals, shares as per cent with one; "-" for None and NaN."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.2f}" if figure.endswith(_UNITS) else f"{100 * value:.1f} %"


def spread_text(figure: str, values: Sequence[float]) -> str:
    """Mean and, of two or more values, the sample standard deviation (n - 1)."""
    mean = shown_figure(figure, statistics.fmean(values))
    if len(values) < 2:
        return mean
    scale = 1 if figure.endswith(_UNITS) else 100
    return f"{mean} ± {scale * statistics.stdev(values):.2f}"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table with aligned columns."""
    cells = [list(head), *(list(row) for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |"
        for row in cells
    ]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    return "\n".join([lines[0], rule, *lines[1:]])


def is_underfit(train_error: float, baseline_error: float) -> bool:
    """True if the error on training views is near a baseline's without pictures: no result, not a bad one."""
    return train_error > UNDERFIT * baseline_error
