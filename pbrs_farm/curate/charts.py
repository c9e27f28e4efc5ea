"""Charts as inline SVG, styled by the page's own CSS variables; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.svg import element, svg_picture, svg_text

Rgb = tuple[int, int, int]  # 0..255
_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 14, 14, 40  # pixels around the plot area
_TENTHS: Final = ("0", "0.2", "0.4", "0.6", "0.8", "1")
_PERCENT: Final = ("0 %", "20 %", "40 %", "60 %", "80 %", "100 %")


class SvgPicture:
    """An SVG picture of width x height pixels; the label is its text for screen readers."""

    def __init__(self, width: float, height: float, label: str) -> None:
        self.width, self.height = width, height
        self._svg = svg_picture(viewBox=f"0 0 {width} {height}", role="img", aria_label=label)

    def add(self, tag: str, content: str = "", **attributes: object) -> None:
        """Draw an element over the existing ones, as core.svg.element does."""
        element(self._svg, tag, content, **attributes)

    def svg(self) -> Markup:
        """The picture as SVG text, its labels escaped when drawn, so safe for templates."""
        return Markup(svg_text(self._svg))


class PlotArea(SvgPicture):
    """A drawing with a plot area; positions in it are shares 0..1 of both axes, y upwards."""

    def x(self, share: float) -> float:
        """Horizontal pixel of a share 0..1 of the plot area."""
        return round(_LEFT + share * (self.width - _LEFT - _RIGHT), 2)

    def y(self, share: float) -> float:
        """Vertical pixel of a share 0..1, upwards."""
        return round(self.height - _BOTTOM - share * (self.height - _TOP - _BOTTOM), 2)

    def box(self, at: tuple[float, float, float, float], css: str, style: str = "") -> None:
        """Draw a rectangle from (x0, y0) to (x1, y1), in shares."""
        x0, y0, x1, y1 = at
        width = f"{max(self.x(x1) - self.x(x0), 0):.2f}"
        height = f"{max(self.y(y0) - self.y(y1), 0):.2f}"
        self.add(
            "rect", css=css, x=self.x(x0), y=self.y(y1), width=width, height=height, style=style
        )

    def line(self, points: Sequence[tuple[float, float]], css: str) -> None:
        """Draw a polyline through points in shares."""
        self.add(
            "polyline", css=css, points=" ".join(f"{self.x(x)},{self.y(y)}" for x, y in points)
        )

    def text(self, at: tuple[float, float], text: str, anchor: str = "start", dy: int = 0) -> None:
        """Draw a label at a position in shares, moved down by dy pixels."""
        self.add("text", text, x=self.x(at[0]), y=self.y(at[1]) + dy, text_anchor=anchor)

    def axes(self, x_title: str, x_ticks: Sequence[str], y_ticks: Sequence[str]) -> None:
        """Draw equally spaced ticks along both axes and the title of the lower one.

        Each axis needs at least two ticks, the first at 0 and the last at the end. Each vertical tick
        draws a grid line, so call this before drawing data. Ticks are texts: the caller scales the data.
        """
        for k, tick in enumerate(x_ticks):
            self.text((k / (len(x_ticks) - 1), 0), tick, "middle", 16)
        for k, tick in enumerate(y_ticks):
            share = k / (len(y_ticks) - 1)
            self.line([(0, share), (1, share)], "grid")
            self.add("text", tick, x=_LEFT - 8, y=self.y(share) + 4, text_anchor="end")
        self.text((0.5, 0), x_title, "middle", 34)

    def threshold(self, value: float) -> None:
        """Draw a vertical line at value, and its number on the side with room."""
        self.line([(value, 0), (value, 1)], "limit")
        before = value > 0.85
        place = (value + (-0.01 if before else 0.01), 1)
        self.text(place, f"{value:g}", "end" if before else "start", 10)


def distribution(scores: F64, is_kept: Bools, threshold: float, title: str) -> Markup:
    """Chart of scores 0..1 in 50 bars, the kept part of each, and the threshold; maybe empty."""
    # Count all views and the kept ones with the same bin edges.
    edges = np.linspace(0, 1, 51)
    whole, _ = np.histogram(scores, edges)
    good, _ = np.histogram(scores[is_kept], edges)
    top = 4 * max(-(-int(whole.max(initial=0)) // 4), 1)  # four whole steps of the axis
    frame = PlotArea(460, 260, f"Distribution of the {title} of all scored views")
    frame.axes(title, _TENTHS, [f"{top * k // 4:,}" for k in range(5)])
    for k in range(50):
        # Stack the rejected part on the kept part, with a gap between bars.
        x0, x1 = edges[k] + 0.002, edges[k + 1] - 0.002
        frame.box((x0, 0, x1, good[k] / top), "kept")
        frame.box((x0, good[k] / top, x1, whole[k] / top), "rejected")
    frame.threshold(threshold)
    return frame.svg()


def joint(colour: F64, depth: F64, is_kept: Bools, limits: tuple[float, float]) -> Markup:
    """Chart of colour score against depth score: darker for more views (log scale), split by verdict."""
    n, bounds = 50, [[0, 1], [0, 1]]
    cells, _, _ = np.histogram2d(colour, depth, bins=n, range=bounds)
    good, _, _ = np.histogram2d(colour[is_kept], depth[is_kept], bins=n, range=bounds)
    frame = PlotArea(460, 400, "Colour score against depth score")
    frame.axes("colour score", _TENTHS, _TENTHS)
    top = np.log1p(cells.max(initial=0)) or 1.0
    frame.box((limits[0], limits[1], 1, 1), "zone")  # where views are kept
    for i, j in zip(*np.nonzero(cells), strict=True):
        # Darken by the logarithm: most cells hold few views.
        style = f"opacity:{0.15 + 0.85 * np.log1p(cells[i, j]) / top:.2f}"
        border = (i + good[i, j] / cells[i, j]) / n
        if border > i / n:
            frame.box((i / n, j / n, border, (j + 1) / n), "kept", style)
        if border < (i + 1) / n:
            frame.box((border, j / n, (i + 1) / n, (j + 1) / n), "rejected", style)
    for ends in ([(limits[0], 0), (limits[0], 1)], [(0, limits[1]), (1, limits[1])]):
        frame.line(ends, "limit")
    # Write the vertical axis's title upwards.
    y = frame.height / 2 - 20
    turned = f"rotate(-90 12 {y})"
    frame.add("text", "depth score", x=12, y=y, text_anchor="middle", transform=turned)
    return frame.svg()


def yields(
    curves: Sequence[tuple[str, str, Sequence[float]]], threshold: float, paper: tuple[float, float]
) -> Markup:
    """Chart of the share of views above each threshold 0..1; paper: a ring at its own (threshold, share)."""
    frame = PlotArea(460, 400, "Yield as a function of the threshold")
    frame.axes("threshold for both scores", _TENTHS, _PERCENT)
    for _name, css, shares in curves:
        frame.line([(k / (len(shares) - 1), v) for k, v in enumerate(shares)], f"curve {css}")
    frame.threshold(threshold)
    # Legend of the curves, lower left.
    for k, (name, css, _shares) in enumerate(curves):
        y = 0.30 - 0.07 * k
        frame.line([(0.03, y), (0.09, y)], f"curve {css}")
        frame.text((0.11, y), name, dy=4)
    frame.add("circle", css="paper", cx=frame.x(paper[0]), cy=frame.y(paper[1]), r=6)
    frame.text((0.03, 0.30 - 0.07 * len(curves)), f"ring: the paper's, {paper[1]:.1%}", dy=4)
    return frame.svg()


def mirrored(
    above: NDArray[np.floating],
    below: NDArray[np.floating],
    label: str,
    colours: Sequence[Rgb] | None = None,
) -> Markup:
    """Two histograms on one axis: the view's upwards, its reference's downwards; colours: of bins."""
    width, half = 260, 44  # pixels; the axis is at half
    # Scale both histograms alike, so that they can be compared.
    drawing = SvgPicture(width, 2 * half, label)
    top = max(float(above.max(initial=0)), float(below.max(initial=0)), 1e-9)
    step = width / max(len(above), 1)  # pixels from bar to bar
    bar = f"{max(step - 0.6, 0.6):.1f}"
    for k, (a, b) in enumerate(zip(above, below, strict=True)):
        fill = "" if colours is None else "fill:rgb({},{},{})".format(*colours[k])
        for value, css, up in ((a, "view", True), (b, "other", False)):
            # Leave out bars too small to see.
            height = float(value) / top * (half - 2)
            if height > 0.05:
                x, y = f"{k * step:.1f}", f"{half - height if up else half + 1:.1f}"
                drawing.add(
                    "rect", css=css, x=x, y=y, width=bar, height=f"{height:.1f}", style=fill
                )
    drawing.add("line", css="grid", x1=0, x2=width, y1=half + 0.5, y2=half + 0.5)
    return drawing.svg()
