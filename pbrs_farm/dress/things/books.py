"""Books and magazines: runs on shelves, stacks, leaning ones; no effects. Spines face +z."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import BOOKS, PAPER
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Material, Surface, Texture
from pbrs_farm.dress.style import COLOURS, Rgb, Style, shade
from pbrs_farm.dress.things.assembly import Made, Part, made, transformed
from pbrs_farm.dress.things.materials import any_colour
from pbrs_farm.geometry.solids import box

# One picture with the spines, covers and page edges of a home's books.


_EDGE_PX = 1024
_COLUMNS, _ROWS = 30, 3
_SPINE_W, _SPINE_H, _PAGES_H = 34, 180, 20
_COVER_W, _COVER_H = 144, 208
_COVERS_TOP = _ROWS * (_SPINE_H + _PAGES_H) + 4
N_COVERS = 14  # cells that have a front cover; the first ones
N_CELLS = _COLUMNS * _ROWS

Box4 = tuple[float, float, float, float]  # u0, v0, u1, v1; v up
_SYLLABLES = (
    "an", "ar", "be", "bor", "ca", "da", "del", "den", "el", "en", "er", "es", "fa", "fin", "ga",
    "gar", "hel", "in", "is", "jo", "ka", "la", "len", "lo", "ma", "mar", "mi", "mor", "na", "nor",
    "o", "or", "pa", "per", "ra", "ren", "ri", "ro", "sa", "sen", "so", "ta", "ter", "ti", "tor",
    "u", "va", "ven", "vi", "wal", "win", "ya",
)  # fmt: skip


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
        """Its front cover; a plain one for cells that have none."""
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


def _draw_spine(
    image: Image.Image, draw: ImageDraw.ImageDraw, cell: int, colour: Rgb,
    ink: tuple[int, int, int], title: str, rng: np.random.Generator,
) -> None:  # fmt: skip
    x, y = _corner(cell)
    draw.rectangle((x, y, x + _SPINE_W - 1, y + _SPINE_H - 1), _bytes(colour))
    # Bands, a label or a publisher's mark.
    if rng.random() < 0.4:
        for at in (8, 14, _SPINE_H - 22):
            draw.line((x, y + at, x + _SPINE_W - 1, y + at), ink, int(rng.integers(1, 3)))
    if rng.random() < 0.25:
        label = _bytes(shade(colour, float(rng.uniform(0.4, 0.7))))
        draw.rectangle((x, y + 25, x + _SPINE_W - 1, y + 95), label)
    # Titles run from the top down.
    size = int(rng.integers(13, 20))
    line = Image.new("L", (_SPINE_H - 50, _SPINE_W), 0)
    ImageDraw.Draw(line).text(
        ((_SPINE_H - 50) / 2, _SPINE_W / 2), title, 255, ImageFont.load_default(size), anchor="mm"
    )
    image.paste(ink, (x, y + 22), line.rotate(-90, expand=True))
    # Pages between two boards.
    top = y + _SPINE_H
    draw.rectangle((x, top, x + _SPINE_W - 1, top + _PAGES_H - 1), _bytes(colour))
    paper = float(rng.uniform(0.78, 0.93))
    for column in range(3, _SPINE_W - 3):
        tone = paper * (0.88 if column % 2 else 1.0)
        draw.line(
            (x + column, top, x + column, top + _PAGES_H - 1), _bytes((tone, tone, tone * 0.92))
        )


def _draw_front(
    image: Image.Image, cell: int, colour: Rgb, ink: tuple[int, int, int], title: str,
    rng: np.random.Generator,
) -> None:  # fmt: skip
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
        at = (_COVER_W / 2, 20 + 22 * k)
        draw.text(at, word, ink, ImageFont.load_default(22), anchor="mm")
    image.paste(front, (x, y))


# Books and magazines.


_BOARD_M = 0.0025
_GAP_M = 0.0004  # between neighbours, so that no faces coincide

# A book that lies with its front cover up: its right side turned up.
_LYING: F64 = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def run_of_books(
    rng: np.random.Generator, covers: Covers, length: float, height: float, depth: float
) -> tuple[Made, float]:
    """Upright books side by side, at most length wide and height high, and the last one's height.

    depth: of the place; the spines stand in one line, or nearly.
    """
    most = min(0.30, height)
    # Sets of a publisher have one size; the rest differ.
    usual = float(np.clip(rng.normal(0.225, 0.025), 0.12, most))
    parts: list[Part] = []
    x = last = 0.0
    while len(parts) < 25:
        if parts and rng.random() < 0.25:
            usual = float(np.clip(rng.normal(0.215, 0.03), 0.12, most))
        thick = float(np.clip(rng.gamma(4.0, 0.0065), 0.009, 0.06))
        tall = float(np.clip(usual + rng.normal(0, 0.012), 0.11, most))
        deep = float(np.clip(tall * rng.uniform(0.62, 0.78), 0.1, depth))
        if x + thick > length:
            break
        surface = _upright(covers, int(rng.integers(N_CELLS)), thick, tall, deep)
        back = float(abs(rng.normal(0, 0.004)))
        parts.append(
            (transformed(surface, np.eye(3), (x + thick / 2, 0, -deep / 2 - back)), covers.material)
        )
        x += thick + _GAP_M
        last = tall
    if not parts:
        surface = _upright(covers, int(rng.integers(N_CELLS)), min(0.015, length), most * 0.9, 0.12)
        parts.append((surface, covers.material))
        last = most * 0.9
    return (made("books", parts, group="book", nyu40=BOOKS, textures=(covers.texture,)), last)


def leaning_book(rng: np.random.Generator, covers: Covers, height: float, depth: float) -> Made:
    """A book that leans to the left against one at least height high; it touches at its top."""
    tall = float(np.clip(rng.normal(0.2, 0.02), 0.12, height))
    thick, deep = float(rng.uniform(0.012, 0.03)), min(tall * 0.7, depth)
    angle = float(rng.uniform(0.12, 0.3))
    c, s = np.cos(angle), np.sin(angle)
    surface = _upright(covers, int(rng.integers(N_CELLS)), thick, tall, deep)
    # Turn it about its lower left edge.
    lean = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    part = transformed(transformed(surface, np.eye(3), (thick / 2, 0, 0)), lean)
    return made("leaning_book", [(part, covers.material)], group="book", nyu40=BOOKS,
                textures=(covers.texture,))  # fmt: skip


def stack_of_books(rng: np.random.Generator, covers: Covers, n: int, most: float = 1.0) -> Made:
    """n lying books, the larger below, each a little turned; at most `most` wide."""
    tall = sorted(
        (float(min(np.clip(rng.normal(0.23, 0.035), 0.15, 0.31), most)) for _ in range(n)),
        reverse=True,
    )
    parts: list[Part] = []
    y = 0.0
    for k, length in enumerate(tall):
        thick = float(np.clip(rng.gamma(4.0, 0.007), 0.012, 0.05))
        cell = int(rng.integers(N_COVERS)) if k == n - 1 else int(rng.integers(N_CELLS))
        deep = length * float(rng.uniform(0.64, 0.76))
        turn = rotation_y(float(rng.normal(0, 0.12)))
        for surface in _bound(covers, cell, thick, length, deep):
            # Lay it down and put its middle over the stack's.
            lying = transformed(surface, _LYING, (length / 2, thick / 2, 0))
            parts.append((transformed(lying, turn, (0, y, 0)), covers.material))
        y += thick + _GAP_M
    return made("stack_of_books" if n > 1 else "book", parts, group="book", nyu40=BOOKS,
                textures=(covers.texture,))  # fmt: skip


def magazines(rng: np.random.Generator, covers: Covers, n: int) -> Made:
    """n magazines on top of each other."""
    parts: list[Part] = []
    y = 0.0
    for _ in range(n):
        thick = float(rng.uniform(0.003, 0.008))
        surface = _upright(covers, int(rng.integers(N_COVERS)), thick, 0.285, 0.215)
        lying = transformed(surface, _LYING, (0.1425, thick / 2, 0))
        turn = rotation_y(float(rng.normal(0, 0.15)))
        parts.append((transformed(lying, turn, (0, y, 0)), covers.material))
        y += thick + _GAP_M / 2
    return made("magazines", parts, group="newspaper", nyu40=PAPER, textures=(covers.texture,))


def open_book(rng: np.random.Generator, covers: Covers) -> Made:
    """A book that lies open."""
    tall, wide = float(rng.uniform(0.19, 0.25)), float(rng.uniform(0.13, 0.17))
    cell = int(rng.integers(N_CELLS))
    parts: list[Part] = []
    for side in (-1.0, 1.0):
        board = box("board", np.array([side * wide / 2, 0.00125, 0]),
                    np.array([wide / 2, 0.00125, tall / 2]), 0)  # fmt: skip
        parts.append((_mapped(board, {}, covers.board(cell)), covers.material))
        pages = box("pages", np.array([side * (wide / 2 - 0.002), 0.0085, 0]),
                    np.array([wide / 2 - 0.004, 0.006, tall / 2 - 0.004]), 0)  # fmt: skip
        parts.append((_mapped(pages, {}, covers.paper(cell)), covers.material))
    return made("open_book", parts, group="book", nyu40=BOOKS, textures=(covers.texture,))


def _upright(covers: Covers, cell: int, thick: float, tall: float, deep: float) -> Surface:
    # A closed box (thick, tall, deep) on its base, its spine at +z, its front cover at +x.
    surface = box("book", np.array([0, tall / 2, 0]), np.array([thick, tall, deep]) / 2, 0)
    pages = covers.pages(cell)
    sides = {1: covers.front(cell), 3: pages, 4: pages, 5: covers.spine(cell)}
    return _mapped(surface, sides, covers.board(cell))


def _bound(covers: Covers, cell: int, thick: float, tall: float, deep: float) -> list[Surface]:
    # The same as two boards, a spine and pages that stand back from their edges.
    b, plain = _BOARD_M, covers.board(cell)

    def part(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Surface:
        low, high = np.array([x[0], y[0], z[0]]), np.array([x[1], y[1], z[1]])
        return box("book", (low + high) / 2, (high - low) / 2, 0)

    t, h, d = thick / 2, tall, deep / 2
    return [
        _mapped(part((t - b, t), (0, h), (-d, d)), {1: covers.front(cell)}, plain),
        _mapped(part((-t, -t + b), (0, h), (-d, d)), {}, plain),
        _mapped(part((-t + b, t - b), (0, h), (d - b, d)), {5: covers.spine(cell)}, plain),
        _mapped(part((-t + b, t - b), (0.003, h - 0.003), (-d + 0.004, d - b)), {},
                covers.paper(cell)),
    ]  # fmt: skip


# Texture corners of a box's quads left, right, bottom, top, back, front: see primitives.box_quads.
_UPRIGHT = {
    0: ((0, 0), (1, 0), (1, 1), (0, 1)),
    1: ((1, 0), (1, 1), (0, 1), (0, 0)),
    2: ((0, 0), (1, 0), (1, 1), (0, 1)),
    3: ((0, 1), (0, 0), (1, 0), (1, 1)),
    4: ((1, 0), (1, 1), (0, 1), (0, 0)),
    5: ((0, 0), (1, 0), (1, 1), (0, 1)),
}


def _mapped(surface: Surface, sides: Mapping[int, Box4], rest: Box4) -> Surface:
    """A box's surface with a part of the picture on each of its sides."""
    uvs = np.empty((24, 2), np.float32)
    for k, corners in _UPRIGHT.items():
        u0, v0, u1, v1 = sides.get(k, rest)
        for j, (a, b) in enumerate(corners):
            uvs[4 * k + j] = (u0 + a * (u1 - u0), v0 + b * (v1 - v0))
    return replace(surface, uvs=uvs)
