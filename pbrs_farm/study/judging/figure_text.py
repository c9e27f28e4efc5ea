"""Figures as text and Markdown tables: titles, units, spreads; no effects."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Final

UNDERFIT: Final = 0.8  # training error above this share of the baseline's: nothing may be ranked
_UNITS: Final = ("_deg", "_m")  # that names of figures end with; others are shares
_TITLES: Final = {
    "mean_deg": "mean, degrees", "median_deg": "median, degrees",
    "rms_deg": "RMS, degrees", "below_5": "< 5", "below_7_5": "< 7.5",
    "below_11_25": "< 11.25", "below_22_5": "< 22.5", "below_30": "< 30",
    "mean_iou": "mean IoU", "pixel_accuracy": "pixel accuracy",
    "mean_accuracy": "mean accuracy", "weighted_iou": "f.w. IoU",
    "scale_invariant": "scale-invariant", "abs_rel": "absolute relative",
    "below_1_25": "ratio < 1.25", "rms_m": "RMS, metres",
    "ods": "ODS", "ois": "OIS", "ap": "AP", "r50": "R50",
}  # fmt: skip


def title_of(figure: str) -> str:
    """A figure's name as tables have it."""
    return _TITLES[figure]


def shown_figure(figure: str, value: float | None) -> str:
    """Degrees and metres with two places, shares as per cent with one; "-" for none."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.2f}" if figure.endswith(_UNITS) else f"{100 * value:.1f} %"


def spread_text(figure: str, values: Sequence[float]) -> str:
    """Mean and, of several seeds, the standard deviation of a sample.

    The standard deviation is that of a sample (n - 1), and left out for one value, where NaN is "-".
    At least one value is needed.
    """
    mean = shown_figure(figure, statistics.fmean(values))
    if len(values) < 2:
        return mean
    scale = 1 if figure.endswith(_UNITS) else 100
    return f"{mean} ± {scale * statistics.stdev(values):.2f}"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table whose columns are as wide as their widest cell."""
    cells = [list(head), *(list(row) for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |"
        for row in cells
    ]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    return "\n".join([lines[0], rule, *lines[1:]])


def is_underfit(train_error: float, baseline_error: float) -> bool:
    """The network hardly knows its own training views: no conclusion may be drawn from it.

    Compared with a baseline that sees no picture. Report such a row as no result, not as a bad one.
    """
    return train_error > UNDERFIT * baseline_error
