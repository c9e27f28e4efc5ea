"""Furniture of boards: how it is put together, then bookcases, chests, cupboards, desks, chairs; no effects."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import (
    BOOKSHELF,
    CABINET,
    CHAIR,
    DESK,
    DRESSER,
    NIGHT_STAND,
    SHELVES,
    TABLE,
)
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import Rgb
from pbrs_farm.dress.things.assembly import (
    Made,
    Part,
    bulged,
    made,
    plain,
    slab,
    transformed,
    turned,
)

Size = tuple[float, float, float]

BOARD_M: Final = 0.018
THIN_M: Final = 0.006  # of back panels
_GAP_M: Final = 0.004  # between two fronts


@dataclass(frozen=True, slots=True)
class Boards:
    """What a piece is made of."""

    body: Material
    front: Material
    top: Material
    metal: Material
    cloth: Rgb = (0.6, 0.58, 0.55)


def board(boards: Boards, low: Size, high: Size) -> Part:
    return slab(low, high), boards.body


def sides(boards: Boards, size: Size) -> list[Part]:
    # Two uprights from the floor to the top.
    w, h, d = size
    return [
        board(boards, (-w / 2, 0.0, -d / 2), (-w / 2 + BOARD_M, h, d / 2)),
        board(boards, (w / 2 - BOARD_M, 0.0, -d / 2), (w / 2, h, d / 2)),
    ]


def carcass(
    rng: np.random.Generator, boards: Boards, size: Size, *, legs: bool = True
) -> list[Part]:
    """The closed box behind fronts, a top over it, a plinth or legs under it; the box comes first."""
    w, h, d = size
    top = float(rng.choice([0.018, 0.025]))
    has_legs = legs and rng.random() < 0.55
    foot = float(rng.uniform(0.09, 0.16)) if has_legs else float(rng.uniform(0.04, 0.07))
    parts: list[Part] = [
        (slab((-w / 2, foot, -d / 2), (w / 2, h - top, d / 2 - 0.018)), boards.body),
        (slab((-w / 2 - 0.004, h - top, -d / 2), (w / 2 + 0.004, h, d / 2 + 0.006)), boards.top),
    ]
    if not has_legs:
        parts.append(
            (slab((-w / 2 + 0.01, 0.0, -d / 2), (w / 2 - 0.01, foot, d / 2 - 0.05)), boards.body)
        )
        return parts
    # Legs taper towards the floor.
    leg = turned([(0.0, 0.0), (0.013, 0.0), (0.022, foot), (0.0, foot)], n=12)
    for x in (-w / 2 + 0.06, w / 2 - 0.06):
        for z in (-d / 2 + 0.05, d / 2 - 0.08):
            parts.append((transformed(leg, np.eye(3), (x, 0.0, z)), boards.top))
    return parts


def foot_of(parts: list[Part]) -> float:
    # Where the box of a carcass begins.
    return float(parts[0][0].positions[:, 1].min())


def all_fronts(
    rng: np.random.Generator, boards: Boards, size: Size, foot: float,
    columns: list[tuple[str, ...]],
) -> list[Part]:  # fmt: skip
    """Fronts before a carcass, a column of kinds from the top downwards for each."""
    w, h, d = size
    step = w / len(columns)
    own, parts = int(rng.integers(1 << 30)), list[Part]()
    for k, kinds in enumerate(columns):
        x = (-w / 2 + k * step, -w / 2 + (k + 1) * step)
        handle = np.random.default_rng(own)
        hinge = k % 2 == 0
        parts += fronts(
            handle, boards, x, (foot, h - 0.026), d / 2 - 0.018, kinds, rows=True, hinge=hinge
        )
    return parts


def fronts(
    rng: np.random.Generator, boards: Boards, x: tuple[float, float], y: tuple[float, float],
    z: float, kinds: tuple[str, ...], *, rows: bool = False, hinge: bool = True,
) -> list[Part]:  # fmt: skip
    """Doors side by side, or fronts from the top downwards (rows), 16 mm thick before z."""
    n = len(kinds)
    weight = np.array([3.2 if kind == "door" and n > 1 and rows else 1.0 for kind in kinds])
    share = np.concatenate([[0.0], np.cumsum(weight) / weight.sum()])
    knob, parts = rng.random() < 0.4, list[Part]()
    for k, kind in enumerate(kinds):
        if rows:
            a, b = x
            low, high = (y[1] - (y[1] - y[0]) * float(share[j]) for j in (k + 1, k))
        else:
            a, b = (x[0] + (x[1] - x[0]) * j / n for j in (k, k + 1))
            low, high = y
        g = _GAP_M / 2
        parts.append(
            (slab((a + g, low + g, z + 0.0005), (b - g, high - g, z + 0.0165)), boards.front)
        )
        opens_left = hinge if rows else k % 2 == 0
        parts += _handle(boards, kind, (a, b), (low, high), z + 0.0165, knob=knob, left=opens_left)
    return parts


def _handle(
    boards: Boards, kind: str, x: tuple[float, float], y: tuple[float, float], z: float, *,
    knob: bool, left: bool,
) -> list[Part]:  # fmt: skip
    # A door's handle stands at the side that is not hinged, a drawer's lies across.
    middle = ((x[0] + x[1]) / 2, (y[0] + y[1]) / 2)
    if kind == "door":
        at = x[1] - 0.035 if left else x[0] + 0.035
        long = min(0.16, 0.3 * (y[1] - y[0]))
        height = y[0] + 0.55 * (y[1] - y[0]) if y[1] - y[0] > 0.9 else y[1] - 0.05 - long
        if knob:
            return [_knob(boards, at, height, z)]
        return _bar(boards, (at - 0.005, height - long), (at + 0.005, height + long), z)
    height = y[1] - 0.035 if kind == "flap" else middle[1]
    if knob:
        reach = 0.25 * (x[1] - x[0]) if x[1] - x[0] > 0.5 else 0.0
        return [
            _knob(boards, middle[0] + s * reach, height, z) for s in ((-1, 1) if reach else (0,))
        ]
    half = min(0.08, 0.3 * (x[1] - x[0]))
    return _bar(boards, (middle[0] - half, height - 0.005), (middle[0] + half, height + 0.005), z)


def _knob(boards: Boards, x: float, y: float, z: float) -> Part:
    profile = [
        (0.0, 0.0),
        (0.006, 0.0),
        (0.006, 0.012),
        (0.014, 0.016),
        (0.012, 0.026),
        (0.0, 0.028),
    ]
    out = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    return transformed(turned(profile, n=12), out, (x, y, z)), boards.metal


def _bar(
    boards: Boards, low: tuple[float, float], high: tuple[float, float], z: float
) -> list[Part]:
    # A bar on two short feet.
    parts: list[Part] = [(slab((*low, z + 0.018), (*high, z + 0.028)), boards.metal)]
    is_wide = high[0] - low[0] > high[1] - low[1]
    for end in (0.1, 0.9):
        x, y = (
            a + (b - a) * (end if wide else 0.5)
            for a, b, wide in ((low[0], high[0], is_wide), (low[1], high[1], not is_wide))
        )
        parts.append(
            (slab((x - 0.004, y - 0.004, z), (x + 0.004, y + 0.004, z + 0.018)), boards.metal)
        )
    return parts


# Furniture to keep things in: bookcases, racks, chests, cupboards, wardrobes.
# Each stands with its back at -z and its front at +z; sizes are width, height, depth in metres.


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


# Tables to put at a wall, and what one sits on: consoles, desks, chairs, benches.
# Each stands with its back at -z and its front at +z; sizes are width, height, depth in metres.


def console(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    """A narrow table on four legs, some with a board near the floor."""
    w, _h, d = size
    parts = _table(boards, size, float(rng.uniform(0.03, 0.045)))
    if rng.random() < 0.6:
        y = float(rng.uniform(0.12, 0.2))
        parts.append(
            board(
                boards,
                (-w / 2 + 0.03, y, -d / 2 + 0.025),
                (w / 2 - 0.03, y + BOARD_M, d / 2 - 0.025),
            )
        )
    return made("console", parts, group="coffee_table", nyu40=TABLE, place=Place.FLOOR)


def desk(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    """A table to write at, drawers under one end of it."""
    w, h, d = size
    parts = _table(boards, size, 0.04)
    if rng.random() < 0.7:
        # Hang three drawers between the legs of one end.
        side = float(rng.choice([-1.0, 1.0]))
        x0, x1 = sorted((side * (w / 2 - 0.06), side * (w / 2 - 0.44)))
        low, high = (0.06 if rng.random() < 0.5 else h - 0.24), h - 0.026
        parts.append((slab((x0, low, -d / 2 + 0.03), (x1, high, d / 2 - 0.04)), boards.body))
        n = max(1, round((high - low) / 0.19))
        parts += fronts(
            rng, boards, (x0, x1), (low, high), d / 2 - 0.04, ("drawer",) * n, rows=True
        )
    return made("desk", parts, nyu40=DESK, place=Place.FLOOR)


def desk_chair(rng: np.random.Generator, boards: Boards) -> Made:
    """A plain chair of wood: four legs, a seat, two bars as its back."""
    w, d, seat, h = 0.43, 0.44, 0.46, float(rng.uniform(0.8, 0.92))
    leg = 0.034
    parts: list[Part] = []
    for sx in (-1, 1):
        x = sx * (w / 2 - leg / 2)
        for z, top in ((d / 2 - leg / 2, seat - 0.022), (-d / 2 + leg / 2, h)):
            parts.append(
                (
                    slab((x - leg / 2, 0.0, z - leg / 2), (x + leg / 2, top, z + leg / 2)),
                    boards.body,
                )
            )
    parts.append(
        (
            slab((-w / 2 + leg, seat - 0.022, -d / 2 + 0.003), (w / 2 - leg, seat, d / 2)),
            boards.body,
        )
    )
    for sx in (-1, 1):
        a, b = sorted((sx * w / 2, sx * (w / 2 - leg)))
        parts.append((slab((a, seat - 0.022, -d / 2 + leg), (b, seat, d / 2)), boards.body))
    for y in (h - 0.09, h - 0.24):
        bar = ((-w / 2 + leg, y, -d / 2 + 0.006), (w / 2 - leg, y + 0.07, -d / 2 + 0.024))
        parts.append((slab(*bar), boards.body))
    return made("desk_chair", parts, group="chair", nyu40=CHAIR, place=Place.FLOOR)


def bench(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    """A bench for two with a cushion on it."""
    w, h, d = size
    parts = _table(boards, (w, h - 0.05, d), 0.045)
    pad = bulged((w - 0.02, 0.05, d - 0.02), n=8, edge=0.6, bulge=8.0)
    parts.append(
        (
            transformed(pad, np.eye(3), (0.0, h - 0.0255, 0.0)),
            plain("bench cushion", boards.cloth, 0.95),
        )
    )
    return made("bench", parts, group="ottoman", nyu40=CHAIR, place=Place.FLOOR)


def _table(boards: Boards, size: Size, leg: float) -> list[Part]:
    """A top on four legs with rails under it."""
    w, h, d = size
    t = 0.025
    parts: list[Part] = [(slab((-w / 2, h - t, -d / 2), (w / 2, h, d / 2)), boards.top)]
    for sx in (-1, 1):
        for sz in (-1, 1):
            x, z = sx * (w / 2 - 0.01 - leg / 2), sz * (d / 2 - 0.01 - leg / 2)
            parts.append(
                (
                    slab((x - leg / 2, 0.0, z - leg / 2), (x + leg / 2, h - t, z + leg / 2)),
                    boards.body,
                )
            )
    reach_x, reach_z = w / 2 - 0.01 - leg, d / 2 - 0.01 - leg
    for sz in (-1, 1):
        z = sz * (d / 2 - 0.01 - leg / 2)
        parts.append(
            (slab((-reach_x, h - t - 0.06, z - 0.009), (reach_x, h - t, z + 0.009)), boards.body)
        )
    for sx in (-1, 1):
        x = sx * (w / 2 - 0.01 - leg / 2)
        parts.append(
            (slab((x - 0.009, h - t - 0.06, -reach_z), (x + 0.009, h - t, reach_z)), boards.body)
        )
    return parts
