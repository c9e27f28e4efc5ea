"""A drawing of polygons, lines, dots and text, as SVG text or as an RGB array; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from pbrs_farm.core.svg import Element, element, svg_file, svg_text

Shape = Literal["polygon", "line", "dot", "text"]


@dataclass(frozen=True, slots=True)
class Mark:
    """One shape of a drawing."""

    shape: Shape
    points: tuple[tuple[float, float], ...]  # px, x right, y down; one for a dot or text
    colour: str  # "#rrggbb"
    size: float = 1.0  # px: line width, dot radius or letter height
    text: str = ""
    title: str = ""  # shown by a browser over the shape


@dataclass(frozen=True, slots=True)
class Drawing:
    """Marks on a white sheet."""

    width: int  # px
    height: int
    marks: tuple[Mark, ...]  # later ones on top

    def svg(self) -> str:
        """The drawing as a whole SVG file, to be written as UTF-8, later marks on top."""
        box = f"0 0 {self.width} {self.height}"
        root = svg_file(width=self.width, height=self.height, viewBox=box, font_family="sans-serif")
        element(root, "rect", width="100%", height="100%", fill="#ffffff")
        for mark in self.marks:
            _draw_mark(root, mark)
        return svg_text(root) + "\n"

    def rgb(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 sRGB, drawn at twice the size and halved, text on top."""
        # Paint shapes at twice the size and halve it: edges become smooth.
        big = Image.new("RGB", (2 * self.width, 2 * self.height), "#ffffff")
        pen = ImageDraw.Draw(big)
        for mark in self.marks:
            if mark.shape != "text":
                _svg_paint(pen, mark)
        # Set text at the final size, where letters are sharpest.
        image = big.resize((self.width, self.height), Image.Resampling.BOX)
        pen = ImageDraw.Draw(image)
        for mark in self.marks:
            if mark.shape == "text":
                font = ImageFont.load_default(mark.size)
                pen.text(mark.points[0], mark.text, fill=mark.colour, font=font, anchor="lm")
        return np.asarray(image, np.uint8)


def _draw_mark(root: Element, mark: Mark) -> None:
    # Points are in pixels of the drawing; the first is the position of dots and text.
    x, y = (f"{value:.1f}" for value in mark.points[0])
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in mark.points)
    if mark.shape == "dot":
        shape = element(root, "circle", cx=x, cy=y, r=f"{mark.size:.1f}", fill=mark.colour)
    elif mark.shape == "text":
        where = {"x": x, "y": y, "dominant_baseline": "middle"}
        size = f"{mark.size:.0f}"
        shape = element(root, "text", mark.text, **where, font_size=size, fill=mark.colour)
    elif mark.shape == "polygon":
        shape = element(root, "polygon", points=points, fill=mark.colour)
    else:
        stroke = {"stroke": mark.colour, "stroke_width": f"{mark.size:.1f}"}
        shape = element(root, "polyline", points=points, fill="none", **stroke)
    if mark.title:
        element(shape, "title", mark.title)


def _svg_paint(pen: ImageDraw.ImageDraw, mark: Mark) -> None:
    points = [(2 * x, 2 * y) for x, y in mark.points]
    if mark.shape == "polygon" and len(points) >= 3:
        pen.polygon(points, fill=mark.colour)
    elif mark.shape == "line":
        pen.line(points, fill=mark.colour, width=max(1, round(2 * mark.size)), joint="curve")
    elif mark.shape == "dot":
        (x, y), r = points[0], 2 * mark.size
        pen.ellipse((x - r, y - r, x + r, y + r), fill=mark.colour)
