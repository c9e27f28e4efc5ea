"""The learning curve as a page and a plot, of what is judged; no effects."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from pbrs_farm.core.svg import Element, element, svg_file, svg_text

_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 720, 400, 56, 150, 24, 48
_INK, _FAINT, _LINE = "#1b1e25", "#6b7280", "#e2e0da"
_COLOURS: Final = ("#0f7c74", "#d08c4f", "#6657b5", "#b53d5b", "#3a6ea5")
_SEEN: Final = "training"  # views that trained: told in the table, not drawn


@dataclass(frozen=True, slots=True)
class Point:
    """Homes, views, and by judge the mean angle in degrees of each seed."""

    homes: int
    views: int
    errors: Mapping[str, tuple[float, ...]]


def curve_page(points: Sequence[Point], facts: Sequence[str]) -> str:
    """A Markdown page: the plot, a row a point, and what must be said with them."""
    judges = _judges(points)
    rows = [
        "| homes | views | seeds | " + " | ".join(judges) + " |",
        "|" + "---|" * (3 + len(judges)),
    ]
    for point in points:
        cells = [_cell(point.errors.get(name, ())) for name in judges]
        n_seeds = max(len(values) for values in point.errors.values())
        rows.append(f"| {point.homes} | {point.views} | {n_seeds} | " + " | ".join(cells) + " |")
    title = "# Lab book: the learning curve"
    made = "Written by `python -m benchmarks.study.curve --draw --docs`; mean angle in degrees, ± the standard deviation of the seeds."
    plot = "![Mean angle by views and homes](curve.svg)"
    return "\n\n".join([title, made, plot, "\n".join(rows), *facts, *gains(points)]) + "\n"


def gains(points: Sequence[Point]) -> list[str]:
    """What twice the homes bring at equal views, where there are points for it, in sentences."""
    said = []
    for views in dict.fromkeys(point.views for point in points):
        same = [point for point in points if point.views == views]
        if len(same) < 2:
            continue
        few, many = same[0], same[-1]
        parts = [
            f"{name} {statistics.fmean(few.errors[name]):.1f} to {statistics.fmean(many.errors[name]):.1f}"
            for name in _judges(same)
            if name != _SEEN and name in few.errors and name in many.errors
        ]
        said.append(
            f"Equal views, {views}: of {few.homes} homes against {many.homes}: {', '.join(parts)}."
        )
    return said


def _judges(points: Sequence[Point]) -> list[str]:
    names = list(dict.fromkeys(name for point in points for name in point.errors))
    return sorted(names, key=lambda name: (name == _SEEN, names.index(name)))


def _cell(values: Sequence[float]) -> str:
    if not values:
        return "-"
    spread = f" ± {statistics.stdev(values):.1f}" if len(values) > 1 else ""
    return f"{statistics.fmean(values):.1f}{spread}"


def curve_picture(points: Sequence[Point]) -> str:
    """An SVG: error over views, a line a judge through the points of fewest homes; rings: more homes."""
    svg = svg_file(viewBox=f"0 0 {_WIDTH} {_HEIGHT}", width=_WIDTH, height=_HEIGHT,
                   font_family="system-ui, sans-serif", font_size=12)  # fmt: skip
    element(svg, "rect", width=_WIDTH, height=_HEIGHT, fill="#ffffff")
    judges = [name for name in _judges(points) if name != _SEEN]
    means = [
        (point, name, statistics.fmean(point.errors[name]))
        for point in points
        for name in judges
        if name in point.errors
    ]
    low = math.floor(min(mean for _, _, mean in means) - 1)
    high = math.ceil(max(mean for _, _, mean in means) + 1)
    views = sorted({point.views for point in points})
    _axes(svg, views, low, high)
    least = {count: min(p.homes for p in points if p.views == count) for count in views}
    for k, name in enumerate(judges):
        colour = _COLOURS[k % len(_COLOURS)]
        own = [(p, mean) for p, judge, mean in means if judge == name]
        line = [(p, mean) for p, mean in own if p.homes == least[p.views]]
        corners = " ".join(f"{_x(p.views, views):.1f},{_y(m, low, high):.1f}" for p, m in line)
        element(svg, "polyline", points=corners, fill="none", stroke=colour, stroke_width=1.8)
        for p, mean in own:
            on_line = p.homes == least[p.views]
            x, y = _x(p.views, views), _y(mean, low, high)
            element(svg, "circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=4, stroke=colour,
                    stroke_width=1.8, fill=colour if on_line else "#ffffff")  # fmt: skip
            element(svg, "text", f"{p.homes}", x=f"{x + 7:.1f}", y=f"{y - 5:.1f}", fill=_FAINT)
        element(svg, "text", name, x=_WIDTH - _RIGHT + 24, y=_TOP + 16 + 20 * k, fill=colour)
    element(svg, "text", "numbers: homes", x=_WIDTH - _RIGHT + 24,
            y=_TOP + 16 + 20 * len(judges), fill=_FAINT)  # fmt: skip
    return svg_text(svg)


def _axes(svg: Element, views: Sequence[int], low: float, high: float) -> None:
    for k in range(5):
        value = low + (high - low) * k / 4
        y = _y(value, low, high)
        element(svg, "line", x1=_LEFT, x2=_WIDTH - _RIGHT, y1=y, y2=y, stroke=_LINE)
        element(svg, "text", f"{value:g}", x=_LEFT - 8, y=y + 4, fill=_FAINT, text_anchor="end")
    for count in views:
        element(svg, "text", f"{count:,}", x=_x(count, views), y=_HEIGHT - _BOTTOM + 18,
                fill=_FAINT, text_anchor="middle")  # fmt: skip
    middle = (_LEFT + _WIDTH - _RIGHT) / 2
    element(svg, "text", "views that train", x=middle, y=_HEIGHT - 10, fill=_INK,
            text_anchor="middle")  # fmt: skip
    element(svg, "text", "mean angle, degrees", x=_LEFT, y=_TOP - 8, fill=_INK)


def _x(views: float, all_views: Sequence[int]) -> float:
    """Twice the views are as far apart everywhere."""
    first, last = math.log2(all_views[0]), math.log2(max(all_views[-1], 2 * all_views[0]))
    share = (math.log2(views) - first) / (last - first)
    return _LEFT + 20 + share * (_WIDTH - _LEFT - _RIGHT - 40)


def _y(value: float, low: float, high: float) -> float:
    return _HEIGHT - _BOTTOM - (value - low) / (high - low) * (_HEIGHT - _TOP - _BOTTOM)
