"""SVG path data -> polygons: the outlines that doors and staircases cut. No effects."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from typing import Any, Final

import numpy as np
from svgelements import Arc, Close, CubicBezier, Line, Move, Path, QuadraticBezier

from pbrs_farm.core.arrays import Points2

MAX_TEXT: Final = 100_000  # characters
MAX_POINTS: Final = 20_000
MAX_CLOSES: Final = 1_000  # The library looks back for the start of a sub-path at every close

MAX_COORDINATE: Final = 1e6
CURVE_STEPS: Final = 16  # straight pieces of a curve
SVG_ARC_STEP_RAD: Final = math.radians(7.5)

# Kind of a curve, its control point that T or S reflects, and of which one of the curve before.
_SMOOTH: Final = ((QuadraticBezier, "control", "control"), (CubicBezier, "control1", "control2"))
# The library passes over letters it does not know: only these make a path.
_PATH: Final = re.compile(r"[\s,]*[Mm][MmLlHhVvCcSsQqTtAaZzEe0-9.,+\-\s]*")
_TRAILING_POINT: Final = re.compile(r"(?<=\d)\.(?!\d)")  # "1." is SVG, but not the library's


def polygons_from_path(text: str) -> tuple[Points2, ...]:
    """The path's closed sub-paths as polygons (N >= 3, 2); ValueError if invalid, too long or too large."""
    segments = _segments(text)
    # Bound the number of points before any is computed.
    if sum(_n_steps(s) for s in segments) > MAX_POINTS:
        raise ValueError(f"path of more than {MAX_POINTS} points")
    outlines: list[list[tuple[float, float]]] = []
    for before, segment in pairwise([None, *segments]):
        # Begin a sub-path at every move, and where drawing goes on after a close.
        if isinstance(segment, Move) or isinstance(before, Close):
            outlines.append([_xy(segment.end if isinstance(segment, Move) else segment.start)])
        n = _n_steps(segment)
        outlines[-1] += [_xy(segment.point(k / n)) for k in range(1, n)]
        outlines[-1].append(_xy(segment.end))
    polygons = [np.array(_without_repeats(outline), np.float64) for outline in outlines]
    if any(not (np.abs(polygon) <= MAX_COORDINATE).all() for polygon in polygons):
        raise ValueError(f"path with a coordinate beyond {MAX_COORDINATE:.0e}")
    return tuple(p for p in polygons if len(p) >= 3)


def _segments(text: str) -> list[Any]:
    """The path as absolute moves, lines, curves, arcs and closes."""
    if len(text) > MAX_TEXT:
        raise ValueError(f"path of {len(text)} characters, at most {MAX_TEXT} are read")
    if text.lower().count("z") > MAX_CLOSES:
        raise ValueError(f"path of more than {MAX_CLOSES} closes")
    if _PATH.fullmatch(text) is None:
        raise ValueError("no path: it starts with M and holds SVG's commands and numbers")
    try:
        segments = list(Path(_TRAILING_POINT.sub("", text)))
    except (ValueError, ArithmeticError, IndexError, TypeError):
        raise ValueError("no path: a command lacks numbers") from None
    # T reflects the control point of quadratic curves only, S that of cubic ones (SVG 1.1, 8.3.7).
    for before, segment in pairwise(segments):
        for kind, control, last in _SMOOTH:
            if isinstance(segment, kind) and segment.smooth:
                is_same = isinstance(before, kind)
                point = getattr(before, last) if is_same else segment.start
                setattr(segment, control, point.reflected_across(segment.start))
    return segments


def _n_steps(segment: Any) -> int:
    """Points that a segment adds: of arcs by their angle, of curves a fixed number."""
    if isinstance(segment, Arc):
        return max(1, math.ceil(abs(float(segment.sweep)) / SVG_ARC_STEP_RAD))
    return 1 if isinstance(segment, Move | Line | Close) else CURVE_STEPS


def _xy(point: Any) -> tuple[float, float]:
    return float(point.x), float(point.y)


def _without_repeats(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points without those that repeat the one before, the last and first too."""
    distinct: list[tuple[float, float]] = []
    for p in points:
        if not distinct or math.dist(p, distinct[-1]) > 1e-9:
            distinct.append(p)
    while len(distinct) > 1 and math.dist(distinct[0], distinct[-1]) <= 1e-9:
        distinct.pop()
    return distinct
