"""Furniture that fills a wall up to the ceiling: wardrobes, bookcases, show cases; no effects.

Furnishing stretches them to the wall they are for (generate/furnish/small_rooms.py), and so does dressing.
"""

from __future__ import annotations

from typing import Final

from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import (
    BLACK_STEEL,
    CHROME,
    CLEAR,
    SILVERED,
    STEEL,
    WHITE,
    WHITE_STEEL,
    glossy,
)
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.joints import (
    Inside,
    Look,
    fronts_of,
    hollow,
    opens,
    pull,
    shelves,
)
from pbrs_farm.furnishings.things.maker import Maker, Size
from pbrs_farm.furnishings.things.shapes import Pair

# fmt: off
_BOARD_M: Final = 0.018
_BACK_M: Final = 0.008


def _stuff(m: Maker, dark_share: float) -> Material:
    """White, a paint, the home's wood, or the same stained dark."""
    if m.chance(dark_share):
        return m.dark_timber
    return m.pick(m.timber, WHITE, WHITE, glossy("paint", m.paint(), 0.4))


def _filled_in(m: Maker, size: Size, front: float, foot: float, of: Material) -> tuple[Pair, Pair]:
    """A plinth, and strips at both ends and at the ceiling. Returns x and y of the space between."""
    w, d, h = size
    side, top = m.uniform(0.02, 0.05), m.uniform(0.02, 0.06)
    with m.of(of):
        m.box(w, foot, (-d / 2, front - 0.03))
        for a, b in ((-w / 2, -w / 2 + side), (w / 2 - side, w / 2)):
            m.box((a, b), (foot, h), 0.04, 0.001, z=front)
        m.box(w - 2 * side, (h - top, h), 0.04, 0.001, z=front)
    return (-w / 2 + side, w / 2 - side), (foot, h - top)


@catalogued()
def fitted_wardrobe(m: Maker, size: Size) -> None:
    """Doors from wall to wall: as high as the room, in two rows, or sliding, some of mirror."""
    _w, d, _h = size
    body = _stuff(m, 0.2)
    front = m.pick(body, body, WHITE, m.timber)
    form = m.weighted(0.4, 0.28, 0.32)
    kinds = ("flat", "flat", "raised") if form == 1 else ("flat", "shaker", "shaker", "grooved")
    look = Look(m.pick(*kinds), front, body, body, m.pick("square", "none", "edge", "disc"),
        m.metal)
    f = d / 2 - 0.02
    x, y = _filled_in(m, size, f, m.pick(0.05, 0.07, 0.1), body)
    hollow(m, x, y, (-d / 2, f), _BOARD_M, body)
    inside = Inside(-d / 2 + _BACK_M, rail=CHROME)
    n = max(2, round((x[1] - x[0]) / (0.62 if look.kind == "grooved" else 0.5)))
    match form:
        case 0:
            fronts_of(m, look, x, y, f, [("door",)] * n, False, inside)
        case 1:  # small doors over tall ones
            cut = y[1] - m.uniform(0.42, 0.55)
            fronts_of(m, look, x, (y[0], cut), f, [("door",)] * n, False, inside)
            m.box((x[0] + _BOARD_M, x[1] - _BOARD_M), 0.016, (-d / 2 + _BACK_M, f), on=cut, of=body)
            fronts_of(m, look, x, (cut, y[1]), f, [("door",)] * n, True, inside)
        case 2:
            _leaves(m, x, y, f - 0.03, -d / 2 + _BACK_M, front, body)


def _leaves(m: Maker, x: Pair, y: Pair, z: float, back: float, front: Material,
    body: Material) -> None:
    """Leaves that slide past each other on two rails; every second may be a mirror."""
    n = max(2, round((x[1] - x[0]) / 1.0))
    step, rail = (x[1] - x[0]) / n, m.pick(STEEL, BLACK_STEEL, WHITE_STEEL, body)
    mirror, is_panelled = m.pick(-1, -1, 0, 1), m.chance(0.4)
    for a, b in ((y[0] + _BOARD_M, y[0] + _BOARD_M + 0.03),
        (y[1] - _BOARD_M - 0.04, y[1] - _BOARD_M)):
        m.box((x[0] + _BOARD_M, x[1] - _BOARD_M), (a, b), 0.07, against=z - 0.022, of=rail)
    low, high = y[0] + _BOARD_M + 0.031, y[1] - _BOARD_M - 0.041
    for k in range(n):
        a = max(x[0] + k * step - 0.03, x[0] + _BOARD_M)
        b = min(x[0] + (k + 1) * step + 0.03, x[1] - _BOARD_M)
        face = z + 0.024 * (k % 2)
        with m.sliding("leaf", along=(1.0 if k < n - 1 else -1.0, 0.0, 0.0), upper_m=step - 0.08):
            m.box((a + 0.002, b - 0.002), (low, high), 0.018, 0.0015, against=face, of=front)
            if k % 2 == mirror:
                m.box((a + 0.03, b - 0.03), (low + 0.03, high - 0.03), 0.001, against=face + 0.0182,
                    of=SILVERED)
            elif is_panelled:
                for c in (1, 2):
                    mid = low + (high - low) * c / 3
                    m.box((a + 0.002, b - 0.002), 0.012, 0.001, on=mid - 0.006,
                        against=face + 0.0182, of=rail)
            for grip in (a + 0.002, b - 0.024):
                m.box(0.022, (low, high), 0.0016, left=grip, against=face + 0.0182, of=rail)
        inner = (x[0] + k * step + (0.008 if k else _BOARD_M),
            x[0] + (k + 1) * step - (0.008 if k < n - 1 else _BOARD_M))
        if k:
            m.box(0.016, (y[0] + _BOARD_M, y[1] - _BOARD_M), (back, z - 0.03),
                left=inner[0] - 0.016, of=body)
        shelves(m, inner, y, (back, z - 0.03), body, CHROME if k % 2 == 0 else None)


@catalogued()
def fitted_bookcase(m: Maker, size: Size) -> None:
    """Shelves from wall to wall: down to the floor, over cupboards or drawers, or beside a closed bay."""
    _w, d, _h = size
    body = _stuff(m, 0.3)
    look = Look(m.pick("flat", "flat", "shaker"), m.pick(body, body, WHITE), body, body,
        m.pick("none", "edge", "square"), m.metal)
    form = m.weighted(0.4, 0.4, 0.2)
    t, f = m.pick(0.018, 0.022, 0.03, 0.038), d / 2 - 0.02
    x, y = _filled_in(m, size, f, m.pick(0.05, 0.08), body)
    back = -d / 2 + 0.008
    n = max(2, round((x[1] - x[0]) / m.uniform(0.55, 0.8)))
    cut = y[0] + (m.uniform(0.55, 0.8) if form == 1 else 0.0)
    rows = max(3, round((y[1] - cut) / m.uniform(0.3, 0.38)))
    step = (x[1] - x[0] - t) / n
    closed = m.integers(0, n) if form == 2 else -1
    with m.of(body):
        m.box((x[0], x[1]), (y[0], y[1]), (-d / 2, back))
        for k in range(n + 1):
            a = x[0] + k * step
            m.box(t, (y[0], y[1]), (back, f), 0.0012, left=a)
        for k in range(n):
            a, b = x[0] + k * step + t, x[0] + (k + 1) * step
            # Boards at the foot and the top, and shelves not all at the heights of the next bay's.
            shift = m.pick(0.0, 0.0, 0.0, 0.06)
            for j in range(rows + 1):
                level = cut + (y[1] - t - cut) * j / rows - (shift if 1 < j < rows else 0.0)
                m.box((a, b), t, (back, f - 0.004), on=level)
    if form == 1:
        kinds = m.pick(("door",), ("door",), ("drawer", "drawer"))
        fronts_of(m, look, (x[0], x[1]), (y[0], cut + t), f, [kinds] * n, False,
            Inside(back, has_boards=False))
    elif closed >= 0:
        a = x[0] + closed * step + t / 2
        fronts_of(m, look, (a, a + step), (y[0], y[1]), f, [("door",)] * 2, False,
            Inside(back, has_boards=False))


@catalogued()
def fitted_cabinet(m: Maker, size: Size) -> None:
    """Doors of glass with china behind them over a deeper row of cupboards or drawers."""
    w, d, h = size
    hw = w / 2
    body = _stuff(m, 0.55)
    look = Look(m.pick("flat", "raised"), body, body, body, m.pick("edge", "square", "none"),
        m.metal)
    n, f = max(2, round(w / 0.56)), d / 2 - 0.025
    low, cut, shallow = m.pick(0.05, 0.08), m.uniform(0.8, 0.95), f - m.uniform(0.08, 0.14)
    has_crown = m.chance(0.6)
    top = h - 0.045 if has_crown else h
    m.box(w - 0.02, low, (-d / 2, f - 0.03), of=body)
    hollow(m, (-hw, hw), (low, cut - 0.025), (-d / 2, f), _BOARD_M, body)
    fronts_of(m, look, (-hw, hw), (low, cut - 0.025), f, [m.pick(("door",), ("door",),
        ("drawer", "drawer"))] * n, False, Inside(-d / 2 + _BACK_M))
    m.box(w, (cut - 0.025, cut), d, 0.004, of=m.pick(body, body, m.timber))
    hollow(m, (-hw + 0.004, hw - 0.004), (cut, top), (-d / 2, shallow), _BOARD_M, body)
    if has_crown:
        m.box(w, (top, h), (-d / 2, shallow + 0.05), 0.01, of=body)
    back, rows = -d / 2 + _BACK_M, max(2, round((top - cut) / 0.42))
    ware = m.china()
    for k in range(n):
        a, b = -hw + 0.004 + (w - 0.008) * k / n, -hw + 0.004 + (w - 0.008) * (k + 1) / n
        x = (a + (0.008 if k else _BOARD_M), b - (0.008 if k < n - 1 else _BOARD_M))
        if k:
            m.box(0.016, (cut + _BOARD_M, top - _BOARD_M), (back, shallow), x=a, of=body)
        with opens(m, "door", (a, b), (cut, top), shallow + 0.02, back, k % 2 == 0):
            _glass_door(m, look, (a, b), (cut, top), shallow, k % 2 == 0)
        for j in range(rows):
            y = cut + _BOARD_M + (top - 2 * _BOARD_M - cut) * j / rows
            if j:
                m.box((x[0], x[1]), (y - 0.016, y), (back, shallow - 0.02), of=body)
            _china(m, ware, x, y, (back + shallow - 0.02) / 2)


def _glass_door(m: Maker, look: Look, x: Pair, y: Pair, z: float, opens_left: bool) -> None:
    """A frame of wood about a pane, 20 mm thick before z."""
    a, b, c, e = x[0] + 0.0015, x[1] - 0.0015, y[0] + 0.0015, y[1] - 0.0015
    r = 0.05
    m.frame((a, b), (c, e), r, 0.02, 0.0015, against=z, of=look.front)
    m.box((a + r, b - r), (c + r, e - r), 0.004, against=z + 0.008, of=CLEAR)
    pull(m, "square", b - r / 2 if opens_left else a + r / 2, (c + e) / 2, z + 0.02, False, 0.12,
        look.pull_material)


def _china(m: Maker, ware: Material, x: Pair, y: float, z: float) -> None:
    """One or two dishes behind glass on a shelf at y."""
    n = m.weighted(0.35, 0.35, 0.3)
    for k in range(n):
        position = (x[0] + (x[1] - x[0]) * (k + 0.5) / n, y + 0.0002, z + m.normal(0, 0.01))
        r = min(0.1, 0.42 * (x[1] - x[0]) / n)
        match m.integers(0, 4):
            case 0:  # plates on each other
                high = m.uniform(0.03, 0.09)
                m.revolve([(0.0, 0.0), (0.6 * r, 0.0), (r, 0.012), (r, high), (0.0, high - 0.01)],
                    n=10, at=position, of=ware)
            case 1:  # a jug or a vase
                high = m.uniform(0.14, 0.22)
                m.revolve([(0.0, 0.0), (0.5 * r, 0.0), (0.75 * r, 0.35 * high),
                    (0.35 * r, 0.8 * high), (0.45 * r, high), (0.0, high - 0.01)], n=10,
                    at=position, of=m.pick(ware, m.china()))
            case _:  # bowls, cups upside down
                high = m.uniform(0.07, 0.11)
                wide, narrow = min(0.06, 0.7 * r), min(0.035, 0.4 * r)
                m.frustum((wide, 0.0), (narrow, high), n=10, at=position, of=ware)
