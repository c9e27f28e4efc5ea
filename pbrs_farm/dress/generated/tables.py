"""Tables to put at a wall, and what one sits on: consoles, desks, chairs, benches; no effects.

Each stands with its back at -z and its front at +z; sizes are width, height, depth in metres.
"""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import CHAIR, DESK, TABLE
from pbrs_farm.dress.generated.assembly import Made, Part, made, plain, transformed
from pbrs_farm.dress.generated.carcass import BOARD_M, Boards, Size, board, fronts
from pbrs_farm.dress.generated.turned import bulged, slab


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
