"""Loss and error over the steps as one SVG picture; no effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pbrs_farm.core.svg import Element, element, svg_file, svg_text

_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 720, 360, 56, 16, 40, 44
_INK, _FAINT, _LINE, _COLOURS = "#1b1e25", "#6b7280", "#e2e0da", ("#0f7c74", "#d08c4f", "#6657b5")
Points = Sequence[tuple[float, float]]  # (step, value)


def curves_svg(panels: Mapping[str, Mapping[str, Points]]) -> str:
    """Panels one below the other, title -> named curves over steps from 0, without empty curves."""
    height = _HEIGHT * len(panels)
    svg = svg_file(
        viewBox=f"0 0 {_WIDTH} {height}",
        width=_WIDTH,
        height=height,
        font_family="system-ui, sans-serif",
        font_size=12,
    )
    element(svg, "rect", width=_WIDTH, height=height, fill="#ffffff")
    for k, (title, curves) in enumerate(panels.items()):
        _panel(element(svg, "g", transform=f"translate(0 {k * _HEIGHT})"), title, curves)
    return svg_text(svg)


def _panel(svg: Element, title: str, curves: Mapping[str, Points]) -> None:
    element(svg, "text", title, x=_LEFT, y=22, fill=_INK, font_size=14)
    shown = {name: points for name, points in curves.items() if points}
    if not shown:
        return
    last = max(step for points in shown.values() for step, _ in points)
    top = _round_up(max(value for points in shown.values() for _, value in points))
    _axes(svg, last, top)
    for k, (name, points) in enumerate(shown.items()):
        colour = _COLOURS[k % len(_COLOURS)]
        line = " ".join(f"{_x(s, last):.1f},{_y(v, top):.1f}" for s, v in points)
        element(svg, "polyline", points=line, fill="none", stroke=colour, stroke_width=1.8)
        x = _WIDTH - _RIGHT - 110 * (len(shown) - k)
        element(svg, "text", name, x=x, y=22, fill=colour)


def smooth_curve(points: Points, share: float = 0.05) -> list[tuple[float, float]]:
    """Each value averaged with those before it, over a share of all: losses of single steps jump."""
    n = max(1, math.ceil(len(points) * share))
    values = [value for _, value in points]
    return [
        (step, sum(values[max(0, k - n + 1) : k + 1]) / min(n, k + 1))
        for k, (step, _) in enumerate(points)
    ]


def _axes(svg: Element, last: float, top: float) -> None:
    for k in range(5):
        value, step = top * k / 4, last * k / 4
        y, x = _y(value, top), _x(step, last)
        element(svg, "line", x1=_LEFT, x2=_WIDTH - _RIGHT, y1=y, y2=y, stroke=_LINE)
        element(svg, "text", f"{value:g}", x=_LEFT - 8, y=y + 4, fill=_FAINT, text_anchor="end")
        element(
            svg,
            "text",
            f"{step:,.0f}",
            x=x,
            y=_HEIGHT - _BOTTOM + 18,
            fill=_FAINT,
            text_anchor="middle",
        )
    element(
        svg,
        "text",
        "steps",
        x=(_LEFT + _WIDTH - _RIGHT) / 2,
        y=_HEIGHT - 8,
        fill=_FAINT,
        text_anchor="middle",
    )


def _x(step: float, last: float) -> float:
    return _LEFT + step / max(last, 1e-9) * (_WIDTH - _LEFT - _RIGHT)


def _y(value: float, top: float) -> float:
    return _HEIGHT - _BOTTOM - value / top * (_HEIGHT - _TOP - _BOTTOM)


def _round_up(value: float) -> float:
    """The next of 1, 2, 4 and 8 times a power of ten, so that quarters are round."""
    value = max(value, 1e-9)
    power = 10.0 ** math.floor(math.log10(value))
    return next((m * power for m in (1, 2, 4, 8, 10) if m * power >= value), 10 * power)
