"""Furniture to keep things in: bookcases, racks, chests, cupboards, wardrobes; no effects.

Each stands with its back at -z and its front at +z; sizes are width, height, depth in metres.
"""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import BOOKSHELF, CABINET, DRESSER, NIGHT_STAND, SHELVES
from pbrs_farm.dress.generated.assembly import Made, Part, made
from pbrs_farm.dress.generated.carcass import (
    BOARD_M,
    THIN_M,
    Boards,
    Size,
    all_fronts,
    board,
    carcass,
    foot_of,
    fronts,
    sides,
)
from pbrs_farm.dress.generated.turned import slab

_DIVIDED_M: Final = 0.95  # wider shelves sag: they get an upright between


def bookcase(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    """Open shelves between two sides; some have doors below, some no back."""
    w, h, d = size
    parts = sides(boards, size)
    has_doors, plinth = h > 1.5 and rng.random() < 0.25, float(rng.uniform(0.05, 0.09))
    parts.append(
        board(
            boards, (-w / 2 + BOARD_M, 0.0, d / 2 - 0.04), (w / 2 - BOARD_M, plinth, d / 2 - 0.025)
        )
    )
    if has_doors or rng.random() < 0.75:
        back = ((-w / 2 + BOARD_M, plinth, -d / 2), (w / 2 - BOARD_M, h - BOARD_M, -d / 2 + THIN_M))
        parts.append(board(boards, *back))
    # Space the shelves evenly, as high as large books.
    n = max(2, round((h - plinth) / float(rng.uniform(0.28, 0.37))))
    levels = np.linspace(plinth, h - BOARD_M, n + 1)
    for y in levels:
        parts.append(
            board(
                boards,
                (-w / 2 + BOARD_M, float(y), -d / 2 + THIN_M),
                (w / 2 - BOARD_M, float(y) + BOARD_M, d / 2 - 0.002),
            )
        )
    if w > _DIVIDED_M:
        for low, high in itertools.pairwise(levels):
            parts.append(
                board(
                    boards,
                    (-BOARD_M / 2, float(low) + BOARD_M, -d / 2 + THIN_M),
                    (BOARD_M / 2, float(high), d / 2 - 0.004),
                )
            )
    if has_doors:
        y = (float(levels[0]), float(levels[2]) + BOARD_M)
        parts += fronts(rng, boards, (-w / 2, w / 2), y, d / 2, ("door",) * (2 if w > 0.55 else 1))
    return made("bookcase", parts, nyu40=BOOKSHELF, place=Place.FLOOR)


def cube_shelf(boards: Boards, columns: int, rows: int) -> Made:
    """A grid of open boxes of 34 cm, a thick board around it."""
    inner, outer, d = 0.34, 0.045, 0.38
    w = columns * inner + (columns - 1) * BOARD_M + 2 * outer
    h = rows * inner + (rows - 1) * BOARD_M + 2 * outer
    z = (-d / 2, d / 2)
    parts = [
        board(boards, (-w / 2, 0.0, z[0]), (w / 2, outer, z[1])),
        board(boards, (-w / 2, h - outer, z[0]), (w / 2, h, z[1])),
    ]
    for sign in (-1, 1):
        a, b = sorted((sign * w / 2, sign * (w / 2 - outer)))
        parts.append(board(boards, (a, outer, z[0]), (b, h - outer, z[1])))
    for k in range(1, columns):
        x = -w / 2 + outer + k * (inner + BOARD_M) - BOARD_M
        parts.append(
            board(boards, (x, outer, z[0] + 0.002), (x + BOARD_M, h - outer, z[1] - 0.002))
        )
    # Shelves run from upright to upright.
    for i in range(1, rows):
        y = outer + i * (inner + BOARD_M) - BOARD_M
        for k in range(columns):
            x = -w / 2 + outer + k * (inner + BOARD_M)
            parts.append(
                board(boards, (x, y, z[0] + 0.002), (x + inner, y + BOARD_M, z[1] - 0.002))
            )
    return made("cube_shelf", parts, group="shelves", nyu40=SHELVES, place=Place.FLOOR)


def rack(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    """Boards between four posts of metal, open on all sides."""
    w, h, d = size
    post, t = 0.022, 0.024
    parts: list[Part] = []
    for sx in (-1, 1):
        for sz in (-1, 1):
            x, z = sx * (w / 2 - post / 2), sz * (d / 2 - post / 2)
            parts.append(
                (
                    slab((x - post / 2, 0.0, z - post / 2), (x + post / 2, h, z + post / 2)),
                    boards.metal,
                )
            )
    n = max(3, round(h / float(rng.uniform(0.34, 0.42))))
    for y in np.linspace(0.09, h - t - 0.004, n):
        parts.append(
            board(
                boards,
                (-w / 2 + post, float(y), -d / 2 + 0.004),
                (w / 2 - post, float(y) + t, d / 2 - 0.004),
            )
        )
        # A rail under each end carries the board.
        for sx in (-1, 1):
            a, b = sorted((sx * (w / 2 - post), sx * (w / 2 - 0.004)))
            parts.append(
                (slab((a, float(y), -d / 2 + post), (b, float(y) + t, d / 2 - post)), boards.metal)
            )
    return made("rack", parts, group="shelves", nyu40=SHELVES, place=Place.FLOOR)


def chest(rng: np.random.Generator, boards: Boards, size: Size, *, nyu40: int = DRESSER) -> Made:
    """A chest of drawers, one or two of them side by side."""
    w, h, _d = size
    n_columns = 2 if w > 0.95 else 1
    n_rows = max(1, round((h - 0.12) / float(rng.uniform(0.17, 0.25))))
    family = "nightstand" if nyu40 == NIGHT_STAND else "chest"
    parts = carcass(rng, boards, size)
    columns = [("drawer",) * n_rows] * n_columns
    parts += all_fronts(rng, boards, size, foot_of(parts), columns)
    return made(
        family,
        parts,
        group="nightstand" if nyu40 == NIGHT_STAND else "dresser",
        nyu40=nyu40,
        place=Place.FLOOR,
    )


def sideboard(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    """A long low cupboard with doors, and drawers in one column."""
    w = size[0]
    n = max(2, round(w / 0.46))
    drawers = int(rng.integers(0, n))
    columns: list[tuple[str, ...]] = [
        ("drawer",) * 3 if k == drawers else ("door",) for k in range(n)
    ]
    parts = carcass(rng, boards, size)
    parts += all_fronts(rng, boards, size, foot_of(parts), columns)
    return made("sideboard", parts, group="cabinet", nyu40=CABINET, place=Place.FLOOR)


def wardrobe(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    """A tall cupboard of two to four doors; some have drawers below."""
    n = max(2, round(size[0] / 0.48))
    column = ("door", "drawer") if rng.random() < 0.3 else ("door",)
    parts = carcass(rng, boards, size, legs=False)
    parts += all_fronts(rng, boards, size, foot_of(parts), [column] * n)
    return made("wardrobe", parts, nyu40=CABINET, place=Place.FLOOR)


def tall_cabinet(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    """A narrow cupboard: shelves that are open in the middle, doors above and below."""
    w, h, d = size
    parts = sides(boards, size)
    parts.append(
        board(
            boards,
            (-w / 2 + BOARD_M, 0.06, -d / 2),
            (w / 2 - BOARD_M, h - BOARD_M, -d / 2 + THIN_M),
        )
    )
    parts.append(
        board(boards, (-w / 2 + BOARD_M, 0.0, d / 2 - 0.03), (w / 2 - BOARD_M, 0.06, d / 2 - 0.015))
    )
    low, high = 0.4 * h, 0.62 * h
    for y in (0.06, low, (low + high) / 2, high, h - BOARD_M):
        parts.append(
            board(
                boards,
                (-w / 2 + BOARD_M, y, -d / 2 + THIN_M),
                (w / 2 - BOARD_M, y + BOARD_M, d / 2 - 0.002),
            )
        )
    for span in ((0.06, low + BOARD_M), (high, h)):
        parts += fronts(rng, boards, (-w / 2, w / 2), span, d / 2, ("door",))
    return made("tall_cabinet", parts, group="cabinet", nyu40=CABINET, place=Place.FLOOR)


def shoe_cabinet(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    """A flat cupboard with flaps one above another."""
    parts = carcass(rng, boards, size, legs=False)
    column = ("flap",) * max(2, round(size[1] / 0.42))
    n = 2 if size[0] > 0.85 else 1
    parts += all_fronts(rng, boards, size, foot_of(parts), [column] * n)
    return made("shoe_cabinet", parts, group="cabinet", nyu40=CABINET, place=Place.FLOOR)
