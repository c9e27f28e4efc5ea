"""A drawing of polygons, lines, dots and text, as SVG text or as an RGB array; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

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
        """The drawing as a whole SVG file."""
        lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{self.width}" '
            f'height="{self.height}" viewBox="0 0 {self.width} {self.height}" '
            'font-family="sans-serif">',
            '<rect width="100%" height="100%" fill="#ffffff"/>',
            *(_svg(mark) for mark in self.marks),
            "</svg>",
        ]
        return "\n".join(lines) + "\n"

    def rgb(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 sRGB, drawn at twice the size and halved."""
        # Paint shapes at twice the size and halve it: edges become smooth.
        big = Image.new("RGB", (2 * self.width, 2 * self.height), "#ffffff")
        pen = ImageDraw.Draw(big)
        for mark in self.marks:
            if mark.shape != "text":
                _paint(pen, mark)
        # Set text at the final size, where letters are sharpest.
        image = big.resize((self.width, self.height), Image.Resampling.BOX)
        pen = ImageDraw.Draw(image)
        for mark in self.marks:
            if mark.shape == "text":
                font = ImageFont.load_default(mark.size)
                pen.text(mark.points[0], mark.text, fill=mark.colour, font=font, anchor="lm")
        return np.asarray(image, np.uint8)


def _svg(mark: Mark) -> str:
    title = f"<title>{escape(mark.title)}</title>" if mark.title else ""
    x, y = mark.points[0]
    if mark.shape == "dot":
        attributes = f'circle cx="{x:.1f}" cy="{y:.1f}" r="{mark.size:.1f}" fill="{mark.colour}"'
    elif mark.shape == "text":
        size = f'font-size="{mark.size:.0f}" dominant-baseline="middle" fill="{mark.colour}"'
        return f'<text x="{x:.1f}" y="{y:.1f}" {size}>{escape(mark.text)}</text>'
    elif mark.shape == "polygon":
        attributes = f'polygon points="{_path(mark.points)}" fill="{mark.colour}"'
    else:
        stroke = f'fill="none" stroke="{mark.colour}" stroke-width="{mark.size:.1f}"'
        attributes = f'polyline points="{_path(mark.points)}" {stroke}'
    return f"<{attributes}>{title}</{attributes.split()[0]}>"


def _path(points: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _paint(pen: ImageDraw.ImageDraw, mark: Mark) -> None:
    points = [(2 * x, 2 * y) for x, y in mark.points]
    if mark.shape == "polygon" and len(points) >= 3:
        pen.polygon(points, fill=mark.colour)
    elif mark.shape == "line":
        pen.line(points, fill=mark.colour, width=max(1, round(2 * mark.size)), joint="curve")
    elif mark.shape == "dot":
        (x, y), r = points[0], 2 * mark.size
        pen.ellipse((x - r, y - r, x + r, y + r), fill=mark.colour)
