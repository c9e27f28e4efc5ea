"""Books and magazines: runs on shelves, stacks, leaning ones; no effects. Spines face +z."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import BOOKS, PAPER
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.models import Model, Part, standing_piece, transformed
from pbrs_farm.furnishings.things.book_covers import N_CELLS, N_COVERS, Box4, Covers
from pbrs_farm.geometry.solids import box

# fmt: off
_BOARD_M = 0.0025
_GAP_M = 0.0004  # between neighbours, so that no faces coincide

# a book with its front cover up
_LYING: F64 = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def run_of_books(rng: np.random.Generator, covers: Covers, length: float, height: float,
    depth: float) -> tuple[Model, float]:
    """Upright books side by side, at most length wide and height high, and the last one's height.

    depth: of the shelf; the spines are aligned to a few millimetres.
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
        parts.append((transformed(surface, np.eye(3), (x + thick / 2, 0, -deep / 2 - back)),
            covers.material))
        x += thick + _GAP_M
        last = tall
    if not parts:
        surface = _upright(covers, int(rng.integers(N_CELLS)), min(0.015, length), most * 0.9, 0.12)
        parts.append((surface, covers.material))
        last = most * 0.9
    return (standing_piece("books", parts, group="book", nyu40=BOOKS, textures=(covers.texture,)),
        last)


def leaning_book(rng: np.random.Generator, covers: Covers, height: float, depth: float) -> Model:
    """A book that leans to the left against one at least height high; it touches at its top."""
    tall = float(np.clip(rng.normal(0.2, 0.02), 0.12, height))
    thick, deep = float(rng.uniform(0.012, 0.03)), min(tall * 0.7, depth)
    angle = float(rng.uniform(0.12, 0.3))
    c, s = np.cos(angle), np.sin(angle)
    surface = _upright(covers, int(rng.integers(N_CELLS)), thick, tall, deep)
    # Turn it about its lower left edge.
    lean = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    part = transformed(transformed(surface, np.eye(3), (thick / 2, 0, 0)), lean)
    return standing_piece("leaning_book", [(part, covers.material)], group="book", nyu40=BOOKS,
        textures=(covers.texture,))


def stack_of_books(rng: np.random.Generator, covers: Covers, n: int, most: float = 1.0) -> Model:
    """A stack of n books, larger ones below, each turned a little; at most `most` wide."""
    tall = sorted((float(min(np.clip(rng.normal(0.23, 0.035), 0.15, 0.31),
        most)) for _ in range(n)), reverse=True)
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
    return standing_piece("stack_of_books" if n > 1 else "book", parts, group="book", nyu40=BOOKS,
        textures=(covers.texture,))


def magazines(rng: np.random.Generator, covers: Covers, n: int) -> Model:
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
    return standing_piece("magazines", parts, group="newspaper", nyu40=PAPER,
        textures=(covers.texture,))


def open_book(rng: np.random.Generator, covers: Covers) -> Model:
    """An open book."""
    tall, wide = float(rng.uniform(0.19, 0.25)), float(rng.uniform(0.13, 0.17))
    cell = int(rng.integers(N_CELLS))
    parts: list[Part] = []
    for side in (-1.0, 1.0):
        board = box("board", np.array([side * wide / 2, 0.00125, 0]),
            np.array([wide / 2, 0.00125, tall / 2]), 0)
        parts.append((_mapped(board, {}, covers.board(cell)), covers.material))
        pages = box("pages", np.array([side * (wide / 2 - 0.002), 0.0085, 0]),
            np.array([wide / 2 - 0.004, 0.006, tall / 2 - 0.004]), 0)
        parts.append((_mapped(pages, {}, covers.paper(cell)), covers.material))
    return standing_piece("open_book", parts, group="book", nyu40=BOOKS, textures=(covers.texture,))


def _upright(covers: Covers, cell: int, thick: float, tall: float, deep: float) -> Surface:
    # A closed box (thick, tall, deep) on its base, its spine at +z, its front cover at +x.
    surface = box("book", np.array([0, tall / 2, 0]), np.array([thick, tall, deep]) / 2, 0)
    pages = covers.pages(cell)
    sides = {1: covers.front(cell), 3: pages, 4: pages, 5: covers.spine(cell)}
    return _mapped(surface, sides, covers.board(cell))


def _bound(covers: Covers, cell: int, thick: float, tall: float, deep: float) -> list[Surface]:
    # A book of two boards, a spine and pages set back from their edges.
    b, plain = _BOARD_M, covers.board(cell)

    def part(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Surface:
        low, high = np.array([x[0], y[0], z[0]]), np.array([x[1], y[1], z[1]])
        return box("book", (low + high) / 2, (high - low) / 2, 0)

    t, h, d = thick / 2, tall, deep / 2
    return [_mapped(part((t - b, t), (0, h), (-d, d)), {1: covers.front(cell)}, plain),
        _mapped(part((-t, -t + b), (0, h), (-d, d)), {}, plain),
        _mapped(part((-t + b, t - b), (0, h), (d - b, d)), {5: covers.spine(cell)}, plain),
        _mapped(part((-t + b, t - b), (0.003, h - 0.003), (-d + 0.004, d - b)), {},
        covers.paper(cell))]


# Texture corners of a box's quads left, right, bottom, top, back, front: see primitives.box_quads.
_UPRIGHT = {0: ((0, 0), (1, 0), (1, 1), (0, 1)), 1: ((1, 0), (1, 1), (0, 1), (0, 0)),
    2: ((0, 0), (1, 0), (1, 1), (0, 1)), 3: ((0, 1), (0, 0), (1, 0), (1, 1)),
    4: ((1, 0), (1, 1), (0, 1), (0, 0)), 5: ((0, 0), (1, 0), (1, 1), (0, 1))}


def _mapped(surface: Surface, sides: Mapping[int, Box4], rest: Box4) -> Surface:
    """A box's surface with a part of the picture on each of its sides."""
    uvs = np.empty((24, 2), np.float32)
    for k, corners in _UPRIGHT.items():
        u0, v0, u1, v1 = sides.get(k, rest)
        for j, (a, b) in enumerate(corners):
            uvs[4 * k + j] = (u0 + a * (u1 - u0), v0 + b * (v1 - v0))
    return replace(surface, uvs=uvs)
