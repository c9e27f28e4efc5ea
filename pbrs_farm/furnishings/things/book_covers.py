"""One picture with the spines, covers and page edges of a home's books; no effects."""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pbrs_farm.core.house import Material, Texture
from pbrs_farm.dress.style import COLOURS, Rgb, Style, shade
from pbrs_farm.dress.thing_materials import any_colour

# fmt: off
_EDGE_PX = 1024
_COLUMNS, _ROWS = 30, 3
_SPINE_W, _SPINE_H, _PAGES_H = 34, 180, 20
_COVER_W, _COVER_H = 144, 208
_COVERS_TOP = _ROWS * (_SPINE_H + _PAGES_H) + 4
N_COVERS = 14  # cells that have a front cover; the first ones
N_CELLS = _COLUMNS * _ROWS

Box4 = tuple[float, float, float, float]  # u0, v0, u1, v1; v up
_SYLLABLES = ("an", "ar", "be", "bor", "ca", "da", "del", "den", "el", "en", "er", "es", "fa",
    "fin", "ga", "gar", "hel", "in", "is", "jo", "ka", "la", "len", "lo", "ma", "mar", "mi", "mor",
    "na", "nor", "o", "or", "pa", "per", "ra", "ren", "ri", "ro", "sa", "sen", "so", "ta", "ter",
    "ti", "tor", "u", "va", "ven", "vi", "wal", "win", "ya")


@dataclass(frozen=True, slots=True, eq=False)
class Covers:
    """The picture and where in it each book's spine, page edge and front cover are."""

    texture: Texture
    material: Material

    def spine(self, cell: int) -> Box4:
        """The spine of a book, upright."""
        x, y = _corner(cell)
        return _box(x + 1, y + 1, x + _SPINE_W - 1, y + _SPINE_H - 1)

    def pages(self, cell: int) -> Box4:
        """Its pages between its boards, as seen from above."""
        x, y = _corner(cell)
        return _box(x + 1, y + _SPINE_H + 1, x + _SPINE_W - 1, y + _SPINE_H + _PAGES_H - 1)

    def board(self, cell: int) -> Box4:
        """A spot of its plain cover."""
        x, y = _corner(cell)
        return _box(x + 3, y + _SPINE_H - 6, x + 5, y + _SPINE_H - 4)

    def paper(self, cell: int) -> Box4:
        """The lines of its pages alone."""
        x, y = _corner(cell)
        return _box(x + 9, y + _SPINE_H + 3, x + _SPINE_W - 9, y + _SPINE_H + _PAGES_H - 3)

    def front(self, cell: int) -> Box4:
        """Its front cover, or a plain colour for cells without one."""
        if cell >= N_COVERS:
            return self.board(cell)
        x = (cell % 7) * (_COVER_W + 2)
        y = _COVERS_TOP + (cell // 7) * _COVER_H
        return _box(x + 1, y + 1, x + _COVER_W - 1, y + _COVER_H - 1)


def book_covers(rng: np.random.Generator, style: Style) -> Covers:
    """The covers of a home's library."""
    image = Image.new("RGB", (_EDGE_PX, _EDGE_PX), (200, 200, 200))
    draw = ImageDraw.Draw(image)
    # Every cell has a spine; only the first N_COVERS, which may lie flat, have a front.
    for cell in range(N_CELLS):
        colour = _cover_colour(rng, style)
        ink = _ink(colour, rng)
        title = _title(rng)
        _draw_spine(image, draw, cell, colour, ink, title, rng)
        if cell < N_COVERS:
            _draw_front(image, cell, colour, ink, title, rng)
    file = io.BytesIO()
    image.save(file, "PNG", optimize=False)
    data = file.getvalue()
    texture = Texture(hashlib.sha256(data).hexdigest()[:16], "book covers", "image/png", data)
    return Covers(texture, Material("book covers", texture_id=texture.id, roughness=0.5))


def _corner(cell: int) -> tuple[int, int]:
    return cell % _COLUMNS * _SPINE_W, cell // _COLUMNS * (_SPINE_H + _PAGES_H)


def _box(x0: float, y0: float, x1: float, y1: float) -> Box4:
    return x0 / _EDGE_PX, 1 - y1 / _EDGE_PX, x1 / _EDGE_PX, 1 - y0 / _EDGE_PX


def _cover_colour(rng: np.random.Generator, style: Style) -> Rgb:
    # Cloth and paper of publishers: dark, cream, white or loud.
    kind = rng.random()
    if kind < 0.25:
        return any_colour(rng, style)
    if kind < 0.45:
        grey = float(rng.uniform(0.82, 0.93))
        return (grey, grey * 0.98, grey * float(rng.uniform(0.85, 0.97)))
    if kind < 0.6:
        return tuple(float(v) for v in rng.uniform(0.08, 0.25, 3))  # type: ignore[return-value]
    loud = COLOURS["book_covers"]
    return shade(loud[int(rng.integers(len(loud)))], float(rng.uniform(0.7, 1.3)))


def _ink(colour: Rgb, rng: np.random.Generator) -> tuple[int, int, int]:
    if sum(colour) > 1.6:
        return _bytes(((0.1, 0.1, 0.12), (0.55, 0.12, 0.1), (0.1, 0.2, 0.4))[int(rng.integers(3))])
    return _bytes(((0.95, 0.94, 0.9), (0.88, 0.74, 0.4))[int(rng.integers(2))])


def _bytes(colour: Rgb) -> tuple[int, int, int]:
    r, g, b = (min(max(round(255 * c), 0), 255) for c in colour)
    return (r, g, b)


def _title(rng: np.random.Generator) -> str:
    # Words of no language.
    words = []
    for _ in range(int(rng.integers(1, 4))):
        k = rng.integers(len(_SYLLABLES), size=int(rng.integers(1, 4)))
        words.append("".join(_SYLLABLES[i] for i in k).capitalize())
    return " ".join(words)


def _draw_spine(image: Image.Image, draw: ImageDraw.ImageDraw, cell: int, colour: Rgb,
    ink: tuple[int, int, int], title: str, rng: np.random.Generator) -> None:
    x, y = _corner(cell)
    draw.rectangle((x, y, x + _SPINE_W - 1, y + _SPINE_H - 1), _bytes(colour))
    # Bands, a label or a publisher's mark.
    if rng.random() < 0.4:
        for level in (8, 14, _SPINE_H - 22):
            draw.line((x, y + level, x + _SPINE_W - 1, y + level), ink, int(rng.integers(1, 3)))
    if rng.random() < 0.25:
        label = _bytes(shade(colour, float(rng.uniform(0.4, 0.7))))
        draw.rectangle((x, y + 25, x + _SPINE_W - 1, y + 95), label)
    # Titles run from the top down.
    size = int(rng.integers(13, 20))
    line = Image.new("L", (_SPINE_H - 50, _SPINE_W), 0)
    ImageDraw.Draw(line).text(((_SPINE_H - 50) / 2, _SPINE_W / 2), title, 255,
        ImageFont.load_default(size), anchor="mm")
    image.paste(ink, (x, y + 22), line.rotate(-90, expand=True))
    # Pages between two boards.
    top = y + _SPINE_H
    draw.rectangle((x, top, x + _SPINE_W - 1, top + _PAGES_H - 1), _bytes(colour))
    paper = float(rng.uniform(0.78, 0.93))
    for column in range(3, _SPINE_W - 3):
        tone = paper * (0.88 if column % 2 else 1.0)
        draw.line((x + column, top, x + column, top + _PAGES_H - 1),
            _bytes((tone, tone, tone * 0.92)))


def _draw_front(image: Image.Image, cell: int, colour: Rgb, ink: tuple[int, int, int], title: str,
    rng: np.random.Generator) -> None:
    x, y = (cell % 7) * (_COVER_W + 2), _COVERS_TOP + (cell // 7) * _COVER_H
    front = Image.new("RGB", (_COVER_W + 2, _COVER_H), _bytes(colour))
    draw = ImageDraw.Draw(front)
    # A picture of a few plain shapes.
    for _ in range(int(rng.integers(1, 6))):
        x0, y0 = rng.integers(0, _COVER_W - 30), rng.integers(50, _COVER_H - 40)
        w, h = rng.integers(20, 90, 2)
        shape = _bytes(shade(colour, float(rng.uniform(0.5, 1.9))))
        corner = (int(x0), int(y0), int(x0 + w), int(y0 + h))
        if rng.random() < 0.5:
            draw.ellipse(corner, shape)
        else:
            draw.rectangle(corner, shape)
    for k, word in enumerate(title.split()):
        position = (_COVER_W / 2, 20 + 22 * k)
        draw.text(position, word, ink, ImageFont.load_default(22), anchor="mm")
    image.paste(front, (x, y))
