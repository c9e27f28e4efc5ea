"""Charts as inline SVG, styled by the page's own CSS variables; pure functions, no effects."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[int, int, int]

_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 14, 14, 40


class Frame:
    """A plot area of width x height with both axes from 0 to 1 of their ranges; collects SVG."""

    def __init__(self, width: int, height: int, label: str) -> None:
        self.width, self.height, self.label = width, height, label
        self._parts: list[str] = []

    def x(self, share: float) -> float:
        """Horizontal pixel of a share 0..1 of the plot area."""
        return round(_LEFT + share * (self.width - _LEFT - _RIGHT), 2)

    def y(self, share: float) -> float:
        """Vertical pixel of a share 0..1, upwards."""
        return round(self.height - _BOTTOM - share * (self.height - _TOP - _BOTTOM), 2)

    def add(self, svg: str) -> None:
        """Draw svg above what is there."""
        self._parts.append(svg)

    def box(self, at: tuple[float, float, float, float], css: str, style: str = "") -> None:
        """A rectangle from (x0, y0) to (x1, y1), shares."""
        x0, y0, x1, y1 = at
        width, height = self.x(x1) - self.x(x0), self.y(y0) - self.y(y1)
        extra = f' style="{style}"' if style else ""
        self.add(
            f'<rect class="{css}" x="{self.x(x0)}" y="{self.y(y1)}" width="{max(width, 0):.2f}" '
            f'height="{max(height, 0):.2f}"{extra}/>'
        )

    def line(self, points: Sequence[tuple[float, float]], css: str) -> None:
        """A polyline through shares."""
        path = " ".join(f"{self.x(px)},{self.y(py)}" for px, py in points)
        self.add(f'<polyline class="{css}" points="{path}"/>')

    def text(self, at: tuple[float, float], text: str, anchor: str = "start", dy: int = 0) -> None:
        """A label at a share, moved by dy pixels downwards."""
        self.add(
            f'<text x="{self.x(at[0])}" y="{self.y(at[1]) + dy}" text-anchor="{anchor}">'
            f"{escape(text)}</text>"
        )

    def axes(self, x_title: str, x_ticks: Sequence[str], y_ticks: Sequence[str]) -> None:
        """Ticks at equal steps along both axes and the title of the lower one."""
        for k, tick in enumerate(x_ticks):
            self.text((k / (len(x_ticks) - 1), 0), tick, "middle", 16)
        for k, tick in enumerate(y_ticks):
            share = k / (len(y_ticks) - 1)
            self.line([(0, share), (1, share)], "grid")
            self.add(
                f'<text x="{_LEFT - 8}" y="{self.y(share) + 4}" text-anchor="end">'
                f"{escape(tick)}</text>"
            )
        self.text((0.5, 0), x_title, "middle", 34)

    def svg(self) -> str:
        """The chart."""
        return (
            f'<svg viewBox="0 0 {self.width} {self.height}" role="img" '
            f'aria-label="{escape(self.label)}">{"".join(self._parts)}</svg>'
        )


_TENTHS: Final = ("0", "0.2", "0.4", "0.6", "0.8", "1")


def distribution(
    scores: NDArray[np.float64], kept: NDArray[np.bool_], threshold: float, title: str
) -> str:
    """Scores 0..1 in 50 bars, the kept part of each apart, and the threshold."""
    edges = np.linspace(0, 1, 51)
    whole, _ = np.histogram(scores, edges)
    good, _ = np.histogram(scores[kept], edges)
    top = 4 * max(-(-int(whole.max(initial=0)) // 4), 1)  # four whole steps of the axis
    frame = Frame(460, 260, f"Distribution of the {title} of all scored views")
    frame.axes(title, _TENTHS, [f"{top * k // 4:,}" for k in range(5)])
    for k in range(50):
        x0, x1 = edges[k] + 0.002, edges[k + 1] - 0.002
        frame.box((x0, 0, x1, good[k] / top), "kept")
        frame.box((x0, good[k] / top, x1, whole[k] / top), "refused")
    _mark_threshold(frame, threshold)
    return frame.svg()


def joint(
    colour: NDArray[np.float64], depth: NDArray[np.float64], limits: tuple[float, float]
) -> str:
    """Colour score against depth score: a cell is darker the more views it holds (log scale)."""
    n = 50
    cells, _, _ = np.histogram2d(colour, depth, bins=n, range=[[0, 1], [0, 1]])
    frame = Frame(460, 400, "Colour score against depth score")
    frame.axes("colour score", _TENTHS, _TENTHS)
    top = np.log1p(cells.max(initial=0)) or 1.0
    frame.box((limits[0], limits[1], 1, 1), "zone")
    for i, j in zip(*np.nonzero(cells), strict=True):
        inside = (i + 0.5) / n > limits[0] and (j + 0.5) / n > limits[1]
        opacity = 0.15 + 0.85 * np.log1p(cells[i, j]) / top
        at = (i / n, j / n, (i + 1) / n, (j + 1) / n)
        frame.box(at, "kept" if inside else "refused", f"opacity:{opacity:.2f}")
    frame.line([(limits[0], 0), (limits[0], 1)], "limit")
    frame.line([(0, limits[1]), (1, limits[1])], "limit")
    frame.add(
        f'<text x="12" y="{frame.height / 2 - 20}" text-anchor="middle" '
        f'transform="rotate(-90 12 {frame.height / 2 - 20})">depth score</text>'
    )
    return frame.svg()


def yields(
    curves: Sequence[tuple[str, str, Sequence[float]]], threshold: float, paper: tuple[float, float]
) -> str:
    """Share of views above each threshold 0..1: (name, css class, shares at equal steps).

    paper: (threshold, share) of the paper's own pictures, drawn as a ring.
    """
    frame = Frame(460, 400, "Yield as a function of the threshold")
    frame.axes(
        "threshold for both scores", _TENTHS, ("0 %", "20 %", "40 %", "60 %", "80 %", "100 %")
    )
    for _name, css, shares in curves:
        frame.line([(k / (len(shares) - 1), v) for k, v in enumerate(shares)], f"curve {css}")
    _mark_threshold(frame, threshold)
    for k, (name, css, _shares) in enumerate(curves):
        y = 0.30 - 0.07 * k
        frame.line([(0.03, y), (0.09, y)], f"curve {css}")
        frame.text((0.11, y), name, dy=4)
    x, y = frame.x(paper[0]), frame.y(paper[1])
    frame.add(f'<circle class="paper" cx="{x}" cy="{y}" r="6"/>')
    frame.text((0.03, 0.30 - 0.07 * len(curves)), f"ring: the paper's own, {paper[1]:.1%}", dy=4)
    return frame.svg()


def _mark_threshold(frame: Frame, threshold: float) -> None:
    frame.line([(threshold, 0), (threshold, 1)], "limit")
    before = threshold > 0.85
    frame.text(
        (threshold + (-0.01 if before else 0.01), 1),
        f"{threshold:g}",
        "end" if before else "start",
        10,
    )


def mirrored(
    above: NDArray[np.floating],
    below: NDArray[np.floating],
    label: str,
    colours: Sequence[Rgb] | None = None,
) -> str:
    """Two histograms on one axis: the view's upwards, its reference's downwards.

    colours: of each bin; the page's own where None.
    """
    width, half = 260, 44
    top = max(float(above.max(initial=0)), float(below.max(initial=0)), 1e-9)
    step = width / max(len(above), 1)
    parts = []
    for k, (a, b) in enumerate(zip(above, below, strict=True)):
        fill = ""
        if colours is not None:
            red, green, blue = colours[k]
            fill = f' style="fill:rgb({red},{green},{blue})"'
        for value, css, up in ((a, "view", True), (b, "other", False)):
            height = float(value) / top * (half - 2)
            if height > 0.05:
                y = half - height if up else half + 1
                parts.append(
                    f'<rect class="{css}" x="{k * step:.1f}" y="{y:.1f}" '
                    f'width="{max(step - 0.6, 0.6):.1f}" height="{height:.1f}"{fill}/>'
                )
    parts.append(f'<line class="grid" x1="0" x2="{width}" y1="{half + 0.5}" y2="{half + 0.5}"/>')
    return (
        f'<svg viewBox="0 0 {width} {2 * half}" role="img" aria-label="{escape(label)}">'
        f"{''.join(parts)}</svg>"
    )
