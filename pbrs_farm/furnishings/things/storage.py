"""Storage furniture of the generated catalogue, and racks for coats; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Annotated

from numpy import cos, pi, sin

from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import (
    BLACK_STEEL,
    BRASS,
    CHROME,
    SILVERED,
    STEEL,
    WHITE,
    WHITE_STEEL,
    glossy,
)
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.joints import Inside, Look, fronts_of, hollow, panel, shelves
from pbrs_farm.furnishings.things.maker import Maker, Size
from pbrs_farm.furnishings.things.parameters import Choice, Front, Legs, Pull, Range
from pbrs_farm.furnishings.things.shapes import Pair, row
from pbrs_farm.geometry.outlines import bent, oval, polar, rect

# fmt: off
_SPLIT_M = 0.95  # wider shelves get an upright in the middle


def case(m: Maker, w: float, h: float, d: float, low: float, t: float, material: Material,
    has_back: bool) -> None:
    """Sides, top, bottom and back of boards t thick, from low to h."""
    hd = d / 2
    with m.of(material):
        m.box(t, (low, h), d, 0.0015, left=-w / 2, mirrored="x")
        for y in (low, h - t):
            m.box(w - 2 * t, t, (-hd, hd - 0.001), 0.0015, on=y)
        if has_back:
            m.box(w - 2 * t, (low + t, h - t), 0.006, against=-hd)


@dataclass(frozen=True, slots=True)
class Bookcase:
    """Parameters of a bookcase."""

    form: Annotated[str, Choice("plain", "fronts_below", "crown", "staggered", "metal_frame")]
    body: Material
    front: Material
    front_kind: Front
    pull: Pull
    pull_material: Material
    board_m: Annotated[float, Range(0.01, 0.06)]  # thickness
    rows: Annotated[int, Range(2, 12)]  # shelves above each other
    foot: Annotated[str, Choice("plinth", "legs", "none")]  # of a plain one
    back: bool
    legs: Legs
    leg_material: Material
    front_rows: Annotated[int, Range(1, 6)]  # rows that the fronts below cover
    front_columns: tuple[Annotated[str, Choice("door", "drawer", "drawers")], ...]
    bars: Material  # the frame of metal
    planks: Material  # the boards in it
    cross: bool  # at the back of the frame


_BOOKCASE_FRONTS = {"door": ("door",), "drawer": ("drawer",), "drawers": ("drawer", "drawer")}


def draw_bookcase(m: Maker, size: Size) -> Bookcase:
    """Draw a bookcase's parameters."""
    w, _d, h = size
    body = m.finish(whites=2)
    kind = m.pick("flat", "flat", "shaker", "raised", "grooved", "glazed")
    front, pull = m.pick(body, body, WHITE), m.pick("knob", "bar", "disc", "edge", "ring")
    form = ("plain", "fronts_below", "crown", "staggered",
        "metal_frame")[m.weighted(0.3, 0.24, 0.14, 0.12, 0.2)]
    t = m.pick(0.018, 0.022, 0.028)
    rows = max(2, round((h - 0.06) / m.uniform(0.3, 0.38)))
    p = Bookcase(form, body, front, kind, pull, m.metal, t, rows, "none", True, "square", body, 1,
        ("door",), BLACK_STEEL, body, False)
    match form:
        case "plain" | "fronts_below":
            p = replace(p, foot=m.pick("plinth", "plinth", "legs", "none"), back=m.chance(0.85))
            if p.foot == "legs":
                p = replace(p, legs=m.pick("tapered", "square", "round"),
                    leg_material=m.pick(body, BLACK_STEEL))
            if form == "fronts_below":
                n = m.pick(1, 2) if rows > 3 else 1
                columns = m.pick(("door", "door") if w > 0.5 else ("door",),
                    ("drawers",) if n > 1 else ("drawer",))
                p = replace(p, front_rows=n, front_columns=columns)
        case "staggered":
            p = replace(p, back=m.chance(0.5))
        case "metal_frame":
            p = replace(p, bars=m.pick(BLACK_STEEL, BLACK_STEEL, WHITE_STEEL, BRASS, m.metal),
                planks=m.pick(body, body, m.timber), cross=m.chance(0.5))
    return p


@catalogued(draw=draw_bookcase)
def open_bookcase(m: Maker, size: Size, p: Bookcase) -> None:
    """A bookcase: plain, fronts below, a crown and a plinth, staggered, or a frame of metal."""
    match p.form:
        case "plain" | "fronts_below":
            plain_bookcase(m, size, p)
        case "crown":
            crowned_bookcase(m, size, p)
        case "staggered":
            staggered_bookcase(m, size, p)
        case "metal_frame":
            metal_bookcase(m, size, p)


def plain_bookcase(m: Maker, size: Size, p: Bookcase) -> None:
    """Shelves in a case on a plinth, on legs or on the floor, with fronts below or without."""
    w, d, h = size
    t, n, hd = p.board_m, p.rows, d / 2
    low = {"plinth": 0.06, "legs": 0.12, "none": 0.0}[p.foot]
    f = d if p.form == "plain" else d - 0.05
    with m.moved(at=(0.0, 0.0, (f - d) / 2)):
        case(m, w, h, f, low, t, p.body, p.back)
        with m.of(p.body):
            for k in range(1, n):
                y = low + (h - low - t) * k / n
                m.box(w - 2 * t, t, (-f / 2 + 0.006, f / 2 - 0.004), on=y)
            if w > _SPLIT_M:
                m.box(0.02, (low + t, h - t), f - 0.012)
            if p.foot == "plinth":
                m.box(w - 0.01, low, (-f / 2, f / 2 - 0.03))
        if p.foot == "legs":
            m.legs(p.legs, w, f, low + 0.001, 0.045, 0.05, of=p.leg_material)
    if p.form == "fronts_below":
        look = Look(p.front_kind, p.front, p.body, p.body, p.pull, p.pull_material)
        high = low + (h - low - t) * min(p.front_rows, n) / n + t
        columns = [_BOOKCASE_FRONTS[name] for name in p.front_columns]
        fronts_of(m, look, (-w / 2, w / 2), (low, high), hd - 0.05, columns, False,
            Inside(-hd + 0.006, has_boards=False))


def crowned_bookcase(m: Maker, size: Size, p: Bookcase) -> None:
    """A bookcase with a moulded top, a plinth and strips before its sides."""
    w, d, h = size
    hd, t, n = d / 2, p.board_m, p.rows
    with m.moved(at=(0.0, 0.0, -0.015)), m.of(p.body):
        case(m, w - 0.05, h - 0.02, d - 0.03, 0.07, t, p.body, True)
        for k in range(1, n):
            y = 0.07 + (h - 0.1) * k / n
            m.box(w - 2 * t - 0.05, t, (-hd + 0.021, hd - 0.02), on=y)
        if w > _SPLIT_M:
            m.box(0.02, (0.07 + t, h - 0.02 - t), (-hd + 0.021, hd - 0.022))
    with m.of(p.body):
        m.box(w - 0.02, 0.08, (-hd, hd - 0.01), 0.004)
        m.box(w - 0.024, 0.028, (-hd, hd - 0.012), 0.004, on=h - 0.05)
        m.box(w, (h - 0.022, h), d, 0.005)
        m.box(0.04, (0.08, h - 0.05), 0.013, 0.002, left=0.022 - w / 2, against=hd - 0.031,
            mirrored="x")


def staggered_bookcase(m: Maker, size: Size, p: Bookcase) -> None:
    """Shelves with an upright in each row, to the left and to the right by turns."""
    w, d, h = size
    t, n, z = p.board_m, p.rows, (-d / 2 + 0.006, d / 2 - 0.003)
    case(m, w, h, d, 0.0, t, p.body, p.back)
    with m.of(p.body):
        for k in range(1, n):
            m.box(w - 2 * t, t, z, on=(h - t) * k / n)
        for k in range(n):
            y = (h - t) * k / n
            m.box(t, (y + t, y + (h - t) / n), z, x=w * (0.18 if k % 2 == 0 else -0.18))


def metal_bookcase(m: Maker, size: Size, p: Bookcase) -> None:
    """Boards in a frame of metal, with a cross at the back or without."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    with m.of(p.bars):
        m.box(0.02, h, 0.02, 0.001, left=-hw, against=-hd, mirrored="xz")
        m.box(0.014, 0.018, d - 0.04, 0.001, left=0.003 - hw, on=h - 0.02, mirrored="x")
        for s in (-1.0, 1.0) if p.cross else ():
            x, z = s * (hw - 0.02), -hd + 0.006 + s * 0.002
            m.square_tube((-x, 0.1, z), (x, h - 0.1, z), 0.012, 0.004)
    for k in range(p.rows + 1):
        y = 0.08 + (h - 0.13) * k / p.rows
        m.box(w - 0.04, 0.024, d - 0.012, 0.002, on=y, of=p.planks)
        m.box(0.014, 0.016, d - 0.04, 0.001, left=0.003 - hw, on=y + 0.004, mirrored="x", of=p.bars)


@catalogued()
def open_shelves(m: Maker, size: Size) -> None:
    """Shelves.

    Cubes, a ladder that leans, posts and boards, of wire, corner steps, with baskets' places.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    body = m.finish(whites=2)
    form, bar = m.weighted(0.35, 0.2, 0.25, 0.2), m.pick(BLACK_STEEL, WHITE_STEEL, m.metal, CHROME)
    match form:
        case 0:  # cubes behind a thick rim
            a, b = max(1, round(w / 0.37)), max(2, round(h / 0.37))
            case(m, w, h, d, 0.0, 0.035, body, m.chance(0.3))
            with m.of(body):
                for k in range(1, a):
                    m.box(0.016, (0.035, h - 0.035), d - 0.004, x=k * w / a - w / 2)
                for k, j in product(range(1, b), range(a)):
                    m.box((-hw + (0.035 if j == 0 else j * w / a + 0.008),
                        -hw + ((j + 1) * w / a - 0.008 if j < a - 1 else w - 0.035)), 0.016,
                        d - 0.004, on=k * h / b - 0.008)
            if m.chance(0.35):
                panel(m, "flat", (-hw + 0.036, -hw + w / a - 0.01), (0.036, h / b - 0.01),
                    hd - 0.025, m.pick(body, m.timber, glossy("paint", m.any_colour(), 0.4)))
        case 1:  # a ladder against the wall
            n = max(3, round(h / 0.36))
            with m.of(body):
                for s in (-1.0, 1.0):
                    m.square_tube((s * (hw - 0.012), 0.006, hd - 0.02),
                        (s * (hw - 0.012), h - 0.006, -hd + 0.02), 0.024, 0.035)
                    m.square_tube((s * (hw - 0.012), 0.0, -hd + 0.012),
                        (s * (hw - 0.012), h * 0.8, -hd + 0.012), 0.023, 0.023)
                for k in range(n):
                    y = 0.15 + (h - 0.28) * k / (n - 1)
                    z = hd - 0.01 - (d - 0.05) * y / h
                    m.box(w - 0.048, 0.018, (-hd, z + 0.01), 0.002, on=y)
                    m.box(w - 0.048, 0.032, 0.01, on=y + 0.018, against=-hd)
        case 2:  # posts and boards
            p, n = m.pick(0.03, 0.04), max(2, round(h / m.uniform(0.34, 0.44)))
            post = m.pick(body, body, bar)
            for x, z in product((-hw, hw - p), (-hd, hd - p)):
                m.box(p, h, p, 0.003, left=x, against=z, of=post)
            is_slatted = m.chance(0.5)
            for k in range(n + 1):
                y = 0.07 + (h - 0.13) * k / n
                if is_slatted:
                    for j in range(4):
                        m.box(w - 0.008, 0.02, (-hd + p + 0.002 + j * (d - 2 * p) / 4,
                            -hd + p - 0.004 + (j + 1) * (d - 2 * p) / 4), 0.002, on=y, of=body)
                else:
                    m.box(w - 2 * p, 0.02, d - 0.008, on=y, of=body)
        case 3:  # of wire or sheet
            n = max(2, round(h / 0.4))
            with m.of(bar):
                for x, z in product((-hw + 0.012, hw - 0.012), (-hd + 0.012, hd - 0.012)):
                    m.rod(x, (0.0, h), z, 0.012, n=10)
                for k in range(n + 1):
                    y = 0.1 + (h - 0.14) * k / n
                    m.hoop(rect(w - 0.024, d - 0.024, 0.01, n=1), y, 0.005, n=5)
                    for j in range(9):
                        m.rod((-hw + 0.015, hw - 0.015), y + 0.004, -hd + 0.03 + j * (d - 0.06) / 8,
                            0.003, n=4)


@dataclass(frozen=True, slots=True)
class Wardrobe:
    """Parameters of a wardrobe."""

    form: Annotated[str, Choice("hinged", "sliding", "one_mirror", "panels")]
    parts: Annotated[int, Range(1, 6)]  # doors or leaves side by side
    body: Material
    front: Material
    front_kind: Front
    pull: Pull
    pull_material: Material
    foot_m: Annotated[float, Range(0.02, 0.2)]
    crown: bool
    plinth: bool
    legs: Legs
    column: Annotated[str, Choice("door", "door_drawer", "door_low_drawers")]  # of each hinged part
    rail: Material  # of sliding leaves, with their grips
    mirror: Annotated[int, Range(-1, 5)]  # number of the part with a mirror, -1 for none


_WARDROBE_COLUMNS = {"door": ("door",), "door_drawer": ("door", "drawer"),
    "door_low_drawers": ("door", "low", "low")}


def draw_wardrobe(m: Maker, size: Size) -> Wardrobe:
    """Draw a wardrobe's parameters."""
    w = size[0]
    body = m.finish(whites=2)
    front = m.pick(body, body, WHITE, m.timber)
    kind = m.pick("flat", "flat", "shaker", "raised", "grooved", "shaker")
    pull = m.pick("knob", "bar", "disc", "square", "bow", "none")
    number = m.weighted(0.4, 0.3, 0.3) if w > 1.1 else m.weighted(0.65, 0.0, 0.35)
    foot, crown, plinth = m.pick(0.05, 0.07, 0.1), m.chance(0.2), m.chance(0.7)
    legs = "square" if plinth else m.pick("square", "bun", "tapered")
    p = Wardrobe("panels", max(2, round(w / 0.48)), body, front, kind, pull, m.metal, foot, crown,
        plinth, legs, "door", STEEL, -1)
    if number == 0:
        return replace(p, form="hinged", column=m.pick("door", "door", "door_drawer",
            "door_low_drawers"))
    if number == 1:
        n = 2 if w < 1.6 else m.pick(2, 3)
        mirror = (-1, 0, 1)[m.weighted(0.4, 0.35, 0.25)]
        rail = m.pick(STEEL, BLACK_STEEL, WHITE_STEEL, body)
        return replace(p, form="sliding", parts=n, mirror=mirror, rail=rail)
    return replace(p, form="one_mirror", mirror=m.pick(0, 1)) if m.chance(0.6) else p


@catalogued(draw=draw_wardrobe)
def wardrobe(m: Maker, size: Size, p: Wardrobe) -> None:
    """A wardrobe: doors on hinges, some with drawers, panels or a mirror, or sliding leaves."""
    w, d, h = size
    hw, hd, low = w / 2, d / 2, p.foot_m
    f, top = hd - 0.05, h - (0.04 if p.crown else 0.0)
    x, y, inside = (-hw, hw), (low, top), Inside(-hd + 0.008, rail=CHROME)
    hollow(m, x, y, (-hd, f), 0.016, p.body)
    if p.plinth:
        m.box(w - 0.02, low, (-hd, f - 0.03), of=p.body)
    else:
        m.legs(p.legs, w, d - 0.06, low + 0.001, 0.06, 0.07, of=p.body)
    if p.crown:
        m.box(w, 0.02, (-hd, f + 0.025), 0.005, on=top, of=p.body)
        m.box(w, (top + 0.02, h), d, 0.008, of=p.body)
    look = Look(p.front_kind, p.front, p.body, p.body, p.pull, p.pull_material)
    if p.form == "hinged":
        columns = [_WARDROBE_COLUMNS[p.column]] * p.parts
        fronts_of(m, look, x, y, f, columns, False, inside)
        return
    if p.form == "sliding":
        sliding_leaves(m, p, x, y, (f, hd), inside)
        return

    def add_panel(k: int) -> None:
        a, b = -hw + k * w / p.parts, -hw + (k + 1) * w / p.parts
        if p.form == "panels":
            m.box((a + 0.07, b - 0.07), 0.43, 0.0075, 0.006, on=low + 0.12, against=f + 0.0185,
                of=p.front)
        elif k == p.mirror:
            m.box((a + 0.09, b - 0.09), (low + 0.3, top - 0.25), 0.0015, against=f + 0.0195,
                of=SILVERED)

    fronts_of(m, look, x, y, f, [("door",)] * p.parts, False, inside, add_panel)


def sliding_leaves(m: Maker, p: Wardrobe, x: Pair, y: Pair, z: Pair, inside: Inside) -> None:
    """Leaves on rails, one before the other, with grips let in, and the shelves behind them."""
    n, w, low, top = p.parts, x[1] - x[0], y[0], y[1]
    for rail in (low, top - 0.03):
        m.box(w, 0.03, z, 0.002, on=rail, of=p.rail)
    for k in range(n):
        a, b = x[0] + k * w / n - (0.02 if k else 0.0), x[0] + (k + 1) * w / n
        b += 0.02 if k < n - 1 else 0.0
        face = z[0] + 0.004 + 0.02 * (k % 2)
        # A leaf slides before or behind its neighbour; the last goes back.
        way = 1.0 if k < n - 1 else -1.0
        with m.sliding("leaf", along=(way, 0.0, 0.0), upper_m=w / n - 0.02):
            m.box((a + 0.003, b - 0.003), (low + 0.031, top - 0.031), 0.018, 0.002, against=face,
                of=p.front)
            if k == p.mirror:
                m.box((a + 0.035, b - 0.035), (low + 0.06, top - 0.06), 0.0007,
                    against=face + 0.0181, of=SILVERED)
            # The grips of a leaf behind another are flat, so that it slides past.
            grip = (face + 0.0182, face + (0.024 if k % 2 else 0.0196))
            for edge in (a + 0.003, b - 0.023):
                m.box(0.02, (low + 0.031, top - 0.031), grip, 0.0006, left=edge, of=p.rail)
        space = (x[0] + k * w / n + (0.008 if k else 0.016),
            x[0] + (k + 1) * w / n - (0.008 if k < n - 1 else 0.016))
        if k:
            m.box(0.016, (low + 0.016, top), (inside.back, z[0]), left=space[0] - 0.016, of=p.body)
        clothes_rail = CHROME if k % 2 == 0 else None
        shelves(m, space, (low, top), (inside.back, z[0]), p.body, clothes_rail)


@catalogued()
def drawer_chest(m: Maker, size: Size) -> None:
    """A chest of drawers: rows of one to three, doors beside them, legs, plinth or buns."""
    w, d, h = size
    hw = w / 2
    body = m.finish(whites=2)
    look = Look(m.pick("flat", "flat", "raised", "shaker", "grooved"),
        m.pick(body, body, body, WHITE), body, body, m.pick("knob", "bar", "disc", "edge", "cup",
        "ring", "bow", "square"), m.metal)
    legs = m.pick("plinth", "plinth", "tapered", "square", "bun", "turned")
    low, f, t = (0.05 if legs == "plinth" else 0.07 if legs == "bun" else m.uniform(0.12, 0.2),
        d / 2 - 0.05, m.pick(0.018, 0.025, 0.03))
    hollow(m, (-hw + 0.006, hw - 0.006), (low, h - t), (-d / 2, f), 0.016, body)
    inside = Inside(-d / 2 + 0.008)
    m.board(w, d - 0.012, h - t, h, 0.006, 0.005, z=-0.006, n=2, of=m.pick(body, body, m.timber))
    if legs == "plinth":
        m.box(w - 0.032, low, (-d / 2, f - 0.03), of=body)
    else:
        m.legs(legs, w, d - 0.03, low + 0.001, 0.05, 0.055, 0.02 if legs == "tapered" else 0.0,
            of=m.pick(body, body, BLACK_STEEL))
    rows, y0, y1 = max(2, round((h - low) / m.uniform(0.18, 0.26))), low, h - t - 0.002
    wide = w > 0.95
    form = m.weighted(0.4, 0.35, 0.25)
    match form:
        case 0:  # alike
            fronts_of(m, look, (-hw + 0.006, hw - 0.006), (y0, y1), f,
                [("drawer",) * rows] * (2 if wide else 1), False, inside)
        case 1:  # small ones above wide ones
            cut = y1 - (y1 - y0) / (rows + 0.3)
            fronts_of(m, look, (-hw + 0.006, hw - 0.006), (cut, y1), f,
                [("drawer",)] * (3 if w > 0.85 else 2), False, inside)
            fronts_of(m, look, (-hw + 0.006, hw - 0.006), (y0, cut), f,
                [("drawer",) * (rows - 1)] * (2 if w > 1.15 else 1), False, inside)
        case 2:  # drawers beside a door
            fronts_of(m, look, (-hw + 0.006, hw - 0.006), (y0, y1), f,
                m.pick([("drawer",) * rows, ("door",)], [("door",), ("drawer",) * rows],
                [("low", "door"), ("low", "door")]), False, inside)


@catalogued()
def sideboard_cabinet(m: Maker, size: Size) -> None:
    """A cabinet: a sideboard, a highboard, a show case with glass, a narrow tall one."""
    w, d, h = size
    hw = w / 2
    body = m.finish()
    look = Look(m.pick("flat", "shaker", "raised", "grooved", "glazed", "glazed"),
        m.pick(body, body, WHITE), body, body, m.pick("knob", "bar", "disc", "edge", "ring",
        "square"), m.metal)
    legs = m.pick("plinth", "tapered", "square", "round")
    low, f, t = 0.05 if legs == "plinth" else m.uniform(0.1, 0.2), d / 2 - 0.05, 0.02
    if legs == "plinth":
        m.box(w - 0.02, low, (-d / 2, f - 0.03), of=body)
    else:
        m.legs(legs, w, d - 0.05, low + 0.001, 0.045, 0.06, 0.025 if legs == "tapered" else 0.0,
            of=m.pick(body, BLACK_STEEL))
    with m.moved(at=(0.0, 0.0, -0.025)):
        case(m, w, h, d - 0.05, low, t, body, True)
    n = max(1, round(w / 0.45))
    form, inside = m.weighted(0.4, 0.35, 0.25) if h > 1.1 else 0, Inside(-d / 2 + 0.006)
    if form == 0:
        fronts_of(m, look, (-hw, hw), (low, h), f, [m.pick(("door",), ("door",), ("low", "door"),
            ("drawer", "drawer", "drawer"))] + [("door",)] * (n - 1), False, inside)
    # Glass or open above, doors or drawers below.
    if form > 0:
        cut = low + (h - low) * m.uniform(0.36, 0.48)
        fronts_of(m, look, (-hw, hw), (low, cut), f, m.pick([("door",)] * n,
            [("drawer", "drawer")] * max(1, n - 1)), False, inside)
        # A board between, and shelves over it that show.
        m.box(w - 2 * t, 0.016, (-d / 2 + 0.006, f - 0.006), on=cut - 0.008, of=body)
        shelves(m, (-hw + t, hw - t), (cut, h), (-d / 2 + 0.006, f + 0.014), body)
        if form == 1:
            fronts_of(m, look._replace(kind="glazed"), (-hw, hw), (cut, h), f, [("door",)] * n,
                False, inside._replace(has_boards=False))


@catalogued()
def coat_stand(m: Maker, size: Size) -> None:
    """A coat stand.

    A tree, a rail on posts, a ladder, a panel with hooks over a bench, a row of pegs on a frame.
    """
    w = size[0]
    material = m.pick(m.timber, m.timber, m.dark_timber, BLACK_STEEL, WHITE_STEEL, m.metal,
        glossy("paint", m.paint(), 0.4))
    form = m.weighted(0.45, 0.35, 0.2) if w < 0.6 else 3 + m.weighted(0.3, 0.45, 0.25)
    with m.of(material):
        on_panel = partial(coat_panel, material=material)
        (coat_tree, crossed_sticks, coat_post, coat_rail, on_panel, coat_ladder)[form](m, size)


def coat_tree(m: Maker, size: Size) -> None:
    """A post with arms in two rings."""
    w, d, h = size
    n, foot = m.integers(3, 5), m.weighted(0.4, 0.35, 0.25)
    m.rod(0.0, (0.02, h - 0.06), 0.0, 0.018, n=12)
    m.sphere((0.0, h - 0.032, 0.0), 0.032, n=12)
    if foot == 0:
        m.turned([(d * 0.42, 0.0), (d * 0.42, 0.012), (0.03, 0.035)], n=30)
    else:
        for k in range(4):
            m.tube(bent([(0.0, 0.28 if foot == 1 else 0.03, 0.0),
                polar((0.2 * w, 0.2 * d), 0.14 if foot == 1 else 0.03, k * pi / 2),
                polar((0.48 * w, 0.48 * d), 0.012, k * pi / 2)], 0.08, n=3), 0.013)
    for k in range(2 * n):
        a, y, r = pi * k / n, h - (0.16 if k % 2 else 0.34), 0.5 * w - 0.012
        y = h - 0.18 if k % 2 else h - 0.34
        m.tube(bent([(0.0, y - 0.04, 0.0), polar(0.6 * r, y - 0.01, a), polar(r, y + 0.1, a)],
            0.06, n=3), 0.009, n=6)
        m.sphere(polar(r, y + 0.105, a), 0.014, n=8)


def crossed_sticks(m: Maker, size: Size) -> None:
    """Four or eight sticks that cross."""
    w, d, h = size
    n = m.pick(4, 4, 8)
    for k in range(n):
        a, b = 2 * pi * k / n, 2 * pi * k / n + 2.2
        m.tube([polar((0.47 * w, 0.47 * d), 0.006, a), polar((0.4 * w, 0.4 * d), h - 0.006, b)],
            0.015, end=0.011)
        for s in (0.8, 0.93):
            m.tube([polar((s * 0.4 * w, s * 0.4 * d), s * h, b, x=(1 - s) * 0.47 * w * cos(a),
                z=(1 - s) * 0.47 * d * sin(a)), polar(0.06, s * h + 0.04, b,
                x=(1 - s) * 0.47 * w * cos(a) + s * 0.4 * w * cos(b),
                z=(1 - s) * 0.47 * d * sin(a) + s * 0.4 * d * sin(b))], 0.007, n=6)
    m.hoop(oval(0.2 * w, 0.2 * d, n=16), h * 0.5, 0.008)


def coat_post(m: Maker, size: Size) -> None:
    """A post with a round board and a ring for umbrellas."""
    w, d, h = size
    m.rod(0.0, (0.0, h), 0.0, 0.016, n=10)
    m.cylinder(d * 0.4, 0.0, 0.018, n=28)
    m.hoop(oval(w * 0.6, d * 0.6, n=20), 0.5, 0.007)
    for k in range(3):
        m.tube([polar((0.3 * w, 0.3 * d), 0.5, 2.1 * k), (0.0, 0.5, 0.0)], 0.006, n=6)
    for k in range(6):
        m.tube(bent([(0.0, h - 0.1, 0.0), polar((0.3 * w, 0.3 * d), h - 0.14, k * 1.047),
            (0.5 * w * cos(k * 1.047) * 0.97, h - 0.05, 0.5 * d * sin(k * 1.047) * 0.97)], 0.05,
            n=3), 0.008, n=6)


def coat_rail(m: Maker, size: Size) -> None:
    """A rail on two posts with a shelf below."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    is_a = m.chance(0.5)
    for s in (-1.0, 1.0):
        if is_a:
            m.square_tube((s * (hw - 0.02), 0.006, hd - 0.02), (s * (hw - 0.02), h - 0.02, 0.0),
                0.03, 0.03)
            m.square_tube((s * (hw - 0.02), 0.006, -hd + 0.02),
                (s * (hw - 0.02), h - 0.02, 0.0), 0.03, 0.03)
        else:
            m.rod(s * (hw - 0.02), (0.02, h - 0.012), 0.0, 0.014, n=10)
            m.rod(s * (hw - 0.02), 0.015, (-hd, hd), 0.015, n=10)
    m.rod((-hw, hw), h - 0.016, 0.0, 0.0155, n=10)
    for z in (-0.1, -0.03, 0.04, 0.1):
        m.box(w - 0.04, (0.16, 0.178), 0.04, z=z)


def coat_panel(m: Maker, size: Size, material: Material) -> None:
    """A panel with hooks over a bench."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    panel_of = m.pick(material, WHITE, m.timber)
    if m.chance(0.5):
        m.box(w, (0.44, h), 0.02, 0.003, against=-hd, of=panel_of)
    else:
        for board in row(-hw - 0.0015, hw - 0.0015, 8, gap=0.005):
            m.box(board, (0.44, h), 0.02, 0.003, against=-hd, of=panel_of)
        for y in (0.6, h - 0.2):
            m.box(w - 0.02, 0.05, 0.014, on=y, against=-hd + 0.002, of=panel_of)
    m.box(w, (0.42, 0.45), d, 0.003, of=panel_of)
    m.box(0.025, 0.42, (-hd + 0.005, hd - 0.01), left=0.01 - w / 2, mirrored="x", of=panel_of)
    m.box(w - 0.07, (0.12, 0.138), (-hd + 0.01, hd - 0.02), of=panel_of)
    if m.chance(0.5):
        m.rounded(w - 0.01, (0.45, 0.49), (-hd + 0.025, hd - 0.004), 0.015, n=1, of=m.cloth())
    hooks = m.pick(BLACK_STEEL, BRASS, CHROME, m.metal)
    n = m.integers(3, 7)
    for k in range(n):
        m.tube(bent([(-hw + w * (k + 0.5) / n, h - 0.18, -hd + 0.018),
            (-hw + w * (k + 0.5) / n, h - 0.2, -hd + 0.07), (-hw + w * (k + 0.5) / n, h - 0.15,
            -hd + 0.085)], 0.02, n=3), 0.006, n=6, of=hooks)
    if m.chance(0.6):
        m.box(w, (h - 0.02, h), 0.22, 0.003, against=-hd, of=panel_of)


def coat_ladder(m: Maker, size: Size) -> None:
    """A ladder with pegs."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    for s in (-1.0, 1.0):
        m.square_tube((s * (hw - 0.02), 0.006, hd - 0.025),
            (s * (hw - 0.02), h - 0.006, -hd + 0.025), 0.03, 0.04)
        m.square_tube((s * (hw - 0.02), 0.006, -hd + 0.02),
            (s * (hw - 0.02), h * 0.7, -hd + 0.02 + 0.0 * h), 0.028, 0.03)
    for k in range(4):
        y = 0.2 + (h - 0.3) * k / 3
        m.rod((-hw + 0.02, hw - 0.02), y, hd - 0.025 - (d - 0.05) * y / h, 0.013)
    for k in range(5):
        m.tube([(-hw + w * (k + 0.5) / 5, h - 0.1, -hd + 0.045),
            (-hw + w * (k + 0.5) / 5, h - 0.06, -hd + 0.13)], 0.009, n=6)
    m.box(w - 0.07, (0.12, 0.14), (-hd + 0.01, hd - 0.04), 0.002)
