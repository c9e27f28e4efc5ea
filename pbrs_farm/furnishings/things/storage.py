"""Bookcases, shelves, wardrobes, chests, cabinets and coat stands of the generated catalogue; no effects."""

from __future__ import annotations

from itertools import product

from numpy import cos, pi, sin

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import BOOKSHELF, CABINET, DRESSER, OTHERPROP, SHELVES
from pbrs_farm.core.house import Material
from pbrs_farm.furnishings.things.bodies import (
    bevelled,
    board,
    cylinder,
    hoop,
    revolve,
    rounded,
    slab,
    sphere,
    square_tube,
    tube,
)
from pbrs_farm.furnishings.things.joints import (
    Inside,
    Look,
    four_legs,
    fronts_of,
    hollow,
    panel,
    shelves,
)
from pbrs_farm.furnishings.things.maker import Maker, Size, family
from pbrs_farm.furnishings.things.materials import (
    BLACK_STEEL,
    BRASS,
    CHROME,
    SILVERED,
    STEEL,
    WHITE,
    WHITE_STEEL,
    glossy,
)
from pbrs_farm.furnishings.things.outlines import bent, oval, rect


def case(m: Maker, w: float, h: float, d: float, low: float, t: float, material: Material,
    has_back: bool) -> None:  # fmt: skip
    """Sides, top, bottom and back of boards t thick, from low to h."""
    hw, hd = w / 2, d / 2
    with m.of(material):
        for x in (-hw, hw - t):
            m.add(bevelled((x, low, -hd), (x + t, h, hd), 0.0015))
        for y in (low, h - t):
            m.add(bevelled((-hw + t, y, -hd), (hw - t, y + t, hd - 0.001), 0.0015))
        if has_back:
            m.add(slab((-hw + t, low + t, -hd), (hw - t, h - t, -hd + 0.006)))


@family(group="bookcase", nyu40=BOOKSHELF, place=Place.FLOOR, called="bookcase", variants=40,
    size=lambda m: (m.pick(0.45, 0.6, 0.8, 0.8, 0.9, 1.0, 1.2), m.pick(0.26, 0.28, 0.3, 0.34),
    m.pick(0.9, 1.1, 1.5, 1.8, 1.9, 2.0, 2.1)))  # fmt: skip
def open_bookcase(m: Maker, size: Size) -> None:
    """A bookcase.

    Plain shelves, doors or drawers below, a crown and a plinth, a ladder, a staggered one, a frame of metal.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    body = m.pick(m.timber, m.timber, m.dark_timber, WHITE, WHITE, glossy("paint", m.paint(), 0.4))
    look = Look(m.pick("flat", "flat", "shaker", "raised", "grooved", "glazed"),
        m.pick(body, body, WHITE), body, body, m.pick("knob", "bar", "disc", "edge", "ring"),
        m.metal)  # fmt: skip
    form = m.weighted(0.3, 0.24, 0.14, 0.12, 0.2)
    t = m.pick(0.018, 0.022, 0.028)
    n = max(2, round((h - 0.06) / m.uniform(0.3, 0.38)))
    split = w > 0.95
    match form:
        case 0 | 1:  # plain, or fronts below
            foot = m.pick("plinth", "plinth", "legs", "none")
            low = 0.06 if foot == "plinth" else 0.12 if foot == "legs" else 0.0
            f = d if form == 0 else d - 0.05
            with m.moved(at=(0.0, 0.0, (f - d) / 2)):
                case(m, w, h, f, low, t, body, m.chance(0.85))
                with m.of(body):
                    for k in range(1, n):
                        m.add(slab((-hw + t, low + (h - low - t) * k / n, -f / 2 + 0.006), (hw - t,
                            low + (h - low - t) * k / n + t, f / 2 - 0.004)))  # fmt: skip
                    if split:
                        m.add(slab((-0.01, low + t, -f / 2 + 0.006), (0.01, h - t, f / 2 - 0.006)))
                    if foot == "plinth":
                        m.add(slab((-hw + 0.005, 0.0, -f / 2), (hw - 0.005, low, f / 2 - 0.03)))
                if foot == "legs":
                    four_legs(m, m.pick("tapered", "square", "round"), w, f, low + 0.001, 0.045,
                        0.05, 0.0, m.pick(body, BLACK_STEEL))  # fmt: skip
            # What is behind fronts below.
            if form == 1:
                rows = m.pick(1, 2) if n > 3 else 1
                fronts_of(m, look, (-hw, hw), (low, low + (h - low - t) * rows / n + t), hd - 0.05,
                    m.pick([("door",), ("door",)] if w > 0.5 else [("door",)],
                    [("drawer", "drawer")] if rows > 1 else [("drawer",)]), False,
                    Inside(-hd + 0.006, has_boards=False))  # fmt: skip
        case 2:  # a crown and a plinth as of old
            with m.moved(at=(0.0, 0.0, -0.015)):
                case(m, w - 0.05, h - 0.02, d - 0.03, 0.07, t, body, True)
                for k in range(1, n):
                    m.add(slab((-hw + t + 0.025, 0.07 + (h - 0.1) * k / n, -hd + 0.021),
                        (hw - t - 0.025, 0.07 + (h - 0.1) * k / n + t, hd - 0.02)), of=body)  # fmt: skip
                if split:
                    m.add(slab((-0.01, 0.07 + t, -hd + 0.021), (0.01, h - 0.02 - t, hd - 0.022)),
                        of=body)  # fmt: skip
            with m.of(body):
                m.add(bevelled((-hw + 0.01, 0.0, -hd), (hw - 0.01, 0.08, hd - 0.01), 0.004))
                m.add(bevelled((-hw + 0.012, h - 0.05, -hd), (hw - 0.012, h - 0.022, hd - 0.012),
                    0.004))  # fmt: skip
                m.add(bevelled((-hw, h - 0.022, -hd), (hw, h, hd), 0.005))
                for x in (-hw + 0.022, hw - 0.062):
                    m.add(bevelled((x, 0.08, hd - 0.031), (x + 0.04, h - 0.05, hd - 0.018), 0.002))
        case 3:  # staggered boxes
            case(m, w, h, d, 0.0, t, body, m.chance(0.5))
            with m.of(body):
                for k in range(1, n):
                    y = (h - t) * k / n
                    m.add(slab((-hw + t, y, -hd + 0.006), (hw - t, y + t, hd - 0.003)))
                for k in range(n):
                    y, x = (h - t) * k / n, w * (0.18 if k % 2 == 0 else -0.18)
                    m.add(slab((x - t / 2, y + t, -hd + 0.006),
                        (x + t / 2, y + (h - t) / n, hd - 0.003)))  # fmt: skip
        case 4:  # boards in a frame of metal, some with crosses at the back
            bar, plank = (m.pick(BLACK_STEEL, BLACK_STEEL, WHITE_STEEL, BRASS, m.metal),
                m.pick(body, body, m.timber))  # fmt: skip
            with m.of(bar):
                for x, z in product((-hw, hw - 0.02), (-hd, hd - 0.02)):
                    m.add(bevelled((x, 0.0, z), (x + 0.02, h, z + 0.02), 0.001))
                for x in (-hw + 0.003, hw - 0.017):
                    m.add(bevelled((x, h - 0.02, -hd + 0.02), (x + 0.014, h - 0.002, hd - 0.02),
                        0.001))  # fmt: skip
                if m.chance(0.5):
                    for s in (-1.0, 1.0):
                        m.add(square_tube((-s * (hw - 0.02), 0.1, -hd + 0.006 + s * 0.002),
                            (s * (hw - 0.02), h - 0.1, -hd + 0.006 + s * 0.002), 0.012, 0.004))  # fmt: skip
            for k in range(n + 1):
                y = 0.08 + (h - 0.13) * k / n
                m.add(bevelled((-hw + 0.02, y, -hd + 0.006), (hw - 0.02, y + 0.024, hd - 0.006),
                    0.002), of=plank)  # fmt: skip
                for x in (-hw + 0.003, hw - 0.017):
                    m.add(bevelled((x, y + 0.004, -hd + 0.02), (x + 0.014, y + 0.02, hd - 0.02),
                        0.001), of=bar)  # fmt: skip


@family(group="shelves", nyu40=SHELVES, place=Place.FLOOR, called="shelves", variants=32,
    size=lambda m: (m.pick(0.36, 0.42, 0.6, 0.77, 0.8, 0.9), m.pick(0.28, 0.32, 0.36, 0.39),
    m.pick(0.77, 1.1, 1.47, 1.6, 1.8)))  # fmt: skip
def open_shelves(m: Maker, size: Size) -> None:
    """Shelves.

    Cubes, a ladder that leans, posts and boards, of wire, corner steps, with baskets' places.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    body = m.pick(m.timber, m.timber, m.dark_timber, WHITE, WHITE, glossy("paint", m.paint(), 0.4))
    form, bar = m.weighted(0.35, 0.2, 0.25, 0.2), m.pick(BLACK_STEEL, WHITE_STEEL, m.metal, CHROME)
    match form:
        case 0:  # cubes behind a thick rim
            a, b = max(1, round(w / 0.37)), max(2, round(h / 0.37))
            case(m, w, h, d, 0.0, 0.035, body, m.chance(0.3))
            with m.of(body):
                for k in range(1, a):
                    m.add(slab((-hw + k * w / a - 0.008, 0.035, -hd + 0.002),
                        (-hw + k * w / a + 0.008, h - 0.035, hd - 0.002)))  # fmt: skip
                for k, j in product(range(1, b), range(a)):
                    m.add(slab((-hw + (0.035 if j == 0 else j * w / a + 0.008), k * h / b - 0.008,
                        -hd + 0.002), (-hw + ((j + 1) * w / a - 0.008 if j < a - 1 else w - 0.035),
                        k * h / b + 0.008, hd - 0.002)))  # fmt: skip
            if m.chance(0.35):
                panel(m, "flat", (-hw + 0.036, -hw + w / a - 0.01), (0.036, h / b - 0.01),
                    hd - 0.025, m.pick(body, m.timber, glossy("paint", m.any_colour(), 0.4)))  # fmt: skip
        case 1:  # a ladder against the wall
            n = max(3, round(h / 0.36))
            with m.of(body):
                for s in (-1.0, 1.0):
                    m.add(square_tube((s * (hw - 0.012), 0.006, hd - 0.02),
                        (s * (hw - 0.012), h - 0.006, -hd + 0.02), 0.024, 0.035))  # fmt: skip
                    m.add(square_tube((s * (hw - 0.012), 0.0, -hd + 0.012),
                        (s * (hw - 0.012), h * 0.8, -hd + 0.012), 0.023, 0.023))  # fmt: skip
                for k in range(n):
                    y = 0.15 + (h - 0.28) * k / (n - 1)
                    z = hd - 0.01 - (d - 0.05) * y / h
                    m.add(bevelled((-hw + 0.024, y, -hd), (hw - 0.024, y + 0.018, z + 0.01), 0.002))
                    m.add(slab((-hw + 0.024, y + 0.018, -hd), (hw - 0.024, y + 0.05, -hd + 0.01)))
        case 2:  # posts and boards
            p, n = m.pick(0.03, 0.04), max(2, round(h / m.uniform(0.34, 0.44)))
            post = m.pick(body, body, bar)
            for x, z in product((-hw, hw - p), (-hd, hd - p)):
                m.add(bevelled((x, 0.0, z), (x + p, h, z + p), 0.003), of=post)
            is_slatted = m.chance(0.5)
            for k in range(n + 1):
                y = 0.07 + (h - 0.13) * k / n
                if is_slatted:
                    for j in range(4):
                        m.add(bevelled((-hw + 0.004, y, -hd + p + 0.002 + j * (d - 2 * p) / 4),
                            (hw - 0.004, y + 0.02, -hd + p - 0.004 + (j + 1) * (d - 2 * p) / 4),
                            0.002), of=body)  # fmt: skip
                else:
                    m.add(slab((-hw + p, y, -hd + 0.004), (hw - p, y + 0.02, hd - 0.004)), of=body)
        case 3:  # of wire or sheet
            n = max(2, round(h / 0.4))
            with m.of(bar):
                for x, z in product((-hw + 0.012, hw - 0.012), (-hd + 0.012, hd - 0.012)):
                    m.add(tube([(x, 0.0, z), (x, h, z)], 0.012, n=10))
                for k in range(n + 1):
                    y = 0.1 + (h - 0.14) * k / n
                    m.add(hoop(rect(w - 0.024, d - 0.024, 0.01, n=1), y, 0.005, n=5))
                    for j in range(9):
                        m.add(tube([(-hw + 0.015, y + 0.004, -hd + 0.03 + j * (d - 0.06) / 8),
                            (hw - 0.015, y + 0.004, -hd + 0.03 + j * (d - 0.06) / 8)], 0.003, n=4))  # fmt: skip


@family(group="wardrobe", nyu40=CABINET, place=Place.FLOOR, variants=36,
    size=lambda m: (m.pick(0.8, 0.9, 1.0, 1.2, 1.5, 1.8), m.pick(0.5, 0.55, 0.58, 0.6),
    m.pick(1.85, 1.95, 2.0, 2.1, 2.2)))  # fmt: skip
def wardrobe(m: Maker, size: Size) -> None:
    """A wardrobe.

    Doors on hinges, sliding ones, a mirror, drawers below, a crown, open at one side.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    body = m.pick(m.timber, m.timber, m.dark_timber, WHITE, WHITE, glossy("paint", m.paint(), 0.4))
    front = m.pick(body, body, WHITE, m.timber)
    look = Look(m.pick("flat", "flat", "shaker", "raised", "grooved", "shaker"), front, body, body,
        m.pick("knob", "bar", "disc", "square", "bow", "none"), m.metal)  # fmt: skip
    form = m.weighted(0.4, 0.3, 0.3) if w > 1.1 else m.weighted(0.65, 0.0, 0.35)
    low, f = m.pick(0.05, 0.07, 0.1), hd - 0.05
    crown = m.chance(0.2)
    top = h - (0.04 if crown else 0.0)
    hollow(m, (-hw, hw), (low, top), (-hd, f), 0.016, body)
    inside = Inside(-hd + 0.008, rail=CHROME)
    if m.chance(0.7):
        m.add(slab((-hw + 0.01, 0.0, -hd), (hw - 0.01, low, f - 0.03)), of=body)
    else:
        four_legs(m, m.pick("square", "bun", "tapered"), w, d - 0.06, low + 0.001, 0.06, 0.07, 0.0,
            body)  # fmt: skip
    if crown:
        m.add(bevelled((-hw, top, -hd), (hw, top + 0.02, f + 0.025), 0.005), of=body)
        m.add(bevelled((-hw, top + 0.02, -hd), (hw, h, hd), 0.008), of=body)
    n = max(2, round(w / 0.48))
    match form:
        case 0:  # doors on hinges
            fronts_of(m, look, (-hw, hw), (low, top), f, [m.pick(("door",), ("door",),
                ("door", "drawer"), ("door", "low", "low"))] * n, False, inside)  # fmt: skip
        case 1:  # sliding: two or three leaves on rails, one before the other, with grips let in
            n, glassy = 2 if w < 1.6 else m.pick(2, 3), m.weighted(0.4, 0.35, 0.25)
            rail = m.pick(STEEL, BLACK_STEEL, WHITE_STEEL, body)
            for y in (low, top - 0.03):
                m.add(bevelled((-hw, y, f), (hw, y + 0.03, hd), 0.002), of=rail)
            for k in range(n):
                a, b, z = (-hw + k * w / n - (0.02 if k else 0.0),
                    -hw + (k + 1) * w / n + (0.02 if k < n - 1 else 0.0),
                    f + 0.004 + 0.02 * (k % 2))  # fmt: skip
                is_mirror = (glassy == 1 and k == 0) or (glassy == 2 and k == 1)
                # A leaf slides before or behind its neighbour; the last goes back.
                way = 1.0 if k < n - 1 else -1.0
                with m.sliding("leaf", along=(way, 0.0, 0.0), upper_m=w / n - 0.02):
                    m.add(bevelled((a + 0.003, low + 0.031, z), (b - 0.003, top - 0.031, z + 0.018),
                        0.002), of=front)  # fmt: skip
                    if is_mirror:
                        m.add(slab((a + 0.035, low + 0.06, z + 0.0181),
                            (b - 0.035, top - 0.06, z + 0.0188)), of=SILVERED)  # fmt: skip
                    for x in (a + 0.003, b - 0.023):
                        # The grips of a leaf behind another lie flat, so that it slides past.
                        m.add(bevelled((x, low + 0.031, z + 0.0182), (x + 0.02, top - 0.031,
                            z + (0.024 if k % 2 else 0.0196)), 0.0006), of=rail)  # fmt: skip
                space = (-hw + k * w / n + (0.008 if k else 0.016),
                    -hw + (k + 1) * w / n - (0.008 if k < n - 1 else 0.016))  # fmt: skip
                if k:
                    m.add(slab((space[0] - 0.016, low + 0.016, inside.back), (space[0], top, f)),
                        of=body)  # fmt: skip
                shelves(
                    m, space, (low, top), (inside.back, f), body, CHROME if k % 2 == 0 else None
                )
        case 2:  # one part open or with a mirror on its door
            at = m.pick(0, 1) if m.chance(0.6) else None

            def add_panel(k: int) -> None:
                a, b = -hw + k * w / n, -hw + (k + 1) * w / n
                if at is None:
                    m.add(bevelled((a + 0.07, low + 0.12, f + 0.0185),
                        (b - 0.07, low + 0.55, f + 0.026), 0.006), of=front)  # fmt: skip
                elif k == at:
                    m.add(slab((a + 0.09, low + 0.3, f + 0.0195), (b - 0.09, top - 0.25, f + 0.021)),
                        of=SILVERED)  # fmt: skip

            fronts_of(m, look, (-hw, hw), (low, top), f, [("door",)] * n, False, inside, add_panel)


@family(group="dresser", nyu40=DRESSER, place=Place.FLOOR, called="chest_of_drawers", variants=36,
    size=lambda m: (m.pick(0.6, 0.75, 0.8, 0.9, 1.0, 1.2, 1.4), m.pick(0.38, 0.42, 0.45, 0.48),
    m.uniform(0.62, 1.15)))  # fmt: skip
def drawer_chest(m: Maker, size: Size) -> None:
    """A chest of drawers: rows of one to three, doors beside them, legs, plinth or buns."""
    w, d, h = size
    hw = w / 2
    body = m.pick(m.timber, m.timber, m.dark_timber, WHITE, WHITE, glossy("paint", m.paint(), 0.4))
    look = Look(m.pick("flat", "flat", "raised", "shaker", "grooved"),
        m.pick(body, body, body, WHITE), body, body, m.pick("knob", "bar", "disc", "edge", "cup",
        "ring", "bow", "square"), m.metal)  # fmt: skip
    legs = m.pick("plinth", "plinth", "tapered", "square", "bun", "turned")
    low, f, t = (0.05 if legs == "plinth" else 0.07 if legs == "bun" else m.uniform(0.12, 0.2),
        d / 2 - 0.05, m.pick(0.018, 0.025, 0.03))  # fmt: skip
    hollow(m, (-hw + 0.006, hw - 0.006), (low, h - t), (-d / 2, f), 0.016, body)
    inside = Inside(-d / 2 + 0.008)
    m.add(board(w, d - 0.012, h - t, h, 0.006, 0.005, z=-0.006, n=2),
        of=m.pick(body, body, m.timber))  # fmt: skip
    if legs == "plinth":
        m.add(slab((-hw + 0.016, 0.0, -d / 2), (hw - 0.016, low, f - 0.03)), of=body)
    else:
        four_legs(m, legs, w, d - 0.03, low + 0.001, 0.05, 0.055,
            0.02 if legs == "tapered" else 0.0, m.pick(body, body, BLACK_STEEL))  # fmt: skip
    rows, y0, y1 = max(2, round((h - low) / m.uniform(0.18, 0.26))), low, h - t - 0.002
    wide = w > 0.95
    form = m.weighted(0.4, 0.35, 0.25)
    match form:
        case 0:  # alike
            fronts_of(m, look, (-hw + 0.006, hw - 0.006), (y0, y1), f,
                [("drawer",) * rows] * (2 if wide else 1), False, inside)  # fmt: skip
        case 1:  # small ones above wide ones
            cut = y1 - (y1 - y0) / (rows + 0.3)
            fronts_of(m, look, (-hw + 0.006, hw - 0.006), (cut, y1), f,
                [("drawer",)] * (3 if w > 0.85 else 2), False, inside)  # fmt: skip
            fronts_of(m, look, (-hw + 0.006, hw - 0.006), (y0, cut), f,
                [("drawer",) * (rows - 1)] * (2 if w > 1.15 else 1), False, inside)  # fmt: skip
        case 2:  # drawers beside a door
            fronts_of(m, look, (-hw + 0.006, hw - 0.006), (y0, y1), f,
                m.pick([("drawer",) * rows, ("door",)], [("door",), ("drawer",) * rows],
                [("low", "door"), ("low", "door")]), False, inside)  # fmt: skip


@family(group="cabinet", nyu40=CABINET, place=Place.FLOOR, called="cabinet", variants=32,
    size=lambda m: (m.pick(0.4, 0.6, 0.8, 0.9, 1.0, 1.2), m.pick(0.34, 0.38, 0.42),
    m.pick(0.8, 0.9, 1.15, 1.4, 1.75, 1.9)))  # fmt: skip
def sideboard_cabinet(m: Maker, size: Size) -> None:
    """A cabinet: a sideboard, a highboard, a show case with glass, a narrow tall one."""
    w, d, h = size
    hw = w / 2
    body = m.pick(m.timber, m.timber, m.dark_timber, WHITE, glossy("paint", m.paint(), 0.4))
    look = Look(m.pick("flat", "shaker", "raised", "grooved", "glazed", "glazed"),
        m.pick(body, body, WHITE), body, body,
        m.pick("knob", "bar", "disc", "edge", "ring", "square"), m.metal)  # fmt: skip
    legs = m.pick("plinth", "tapered", "square", "round")
    low, f, t = 0.05 if legs == "plinth" else m.uniform(0.1, 0.2), d / 2 - 0.05, 0.02
    if legs == "plinth":
        m.add(slab((-hw + 0.01, 0.0, -d / 2), (hw - 0.01, low, f - 0.03)), of=body)
    else:
        four_legs(m, legs, w, d - 0.05, low + 0.001, 0.045, 0.06,
            0.025 if legs == "tapered" else 0.0, m.pick(body, BLACK_STEEL))  # fmt: skip
    with m.moved(at=(0.0, 0.0, -0.025)):
        case(m, w, h, d - 0.05, low, t, body, True)
    n = max(1, round(w / 0.45))
    form, inside = m.weighted(0.4, 0.35, 0.25) if h > 1.1 else 0, Inside(-d / 2 + 0.006)
    if form == 0:
        fronts_of(m, look, (-hw, hw), (low, h), f, [m.pick(("door",), ("door",), ("low", "door"),
            ("drawer", "drawer", "drawer"))] + [("door",)] * (n - 1), False, inside)  # fmt: skip
    # Glass or open above, doors or drawers below.
    if form > 0:
        cut = low + (h - low) * m.uniform(0.36, 0.48)
        fronts_of(m, look, (-hw, hw), (low, cut), f, m.pick([("door",)] * n,
            [("drawer", "drawer")] * max(1, n - 1)), False, inside)  # fmt: skip
        # A board between, and shelves over it that show.
        m.add(
            slab((-hw + t, cut - 0.008, -d / 2 + 0.006), (hw - t, cut + 0.008, f - 0.006)), of=body
        )
        shelves(m, (-hw + t, hw - t), (cut, h), (-d / 2 + 0.006, f + 0.014), body)
        if form == 1:
            fronts_of(m, look._replace(kind="glazed"), (-hw, hw), (cut, h), f, [("door",)] * n,
                False, inside._replace(has_boards=False))  # fmt: skip


@family(group="clothes_rack", nyu40=OTHERPROP, place=Place.FLOOR, called="coat_rack", variants=40,
    size=lambda m: (*m.pick((0.46, 0.46), (0.5, 0.5), (0.8, 0.42), (0.9, 0.4), (1.0, 0.45), (0.7, 0.38)), m.pick(1.65, 1.7, 1.75, 1.8)))  # fmt: skip
def coat_stand(m: Maker, size: Size) -> None:
    """What coats hang on.

    A tree, a rail on posts, a ladder, a panel with hooks over a bench, a row of pegs on a frame.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    material = m.pick(m.timber, m.timber, m.dark_timber, BLACK_STEEL, WHITE_STEEL, m.metal,
        glossy("paint", m.paint(), 0.4))  # fmt: skip
    form = m.weighted(0.45, 0.35, 0.2) if w < 0.6 else 3 + m.weighted(0.3, 0.45, 0.25)
    match form:
        case 0:  # a tree: a post with arms in two rings
            with m.of(material):
                n, foot = m.integers(3, 5), m.weighted(0.4, 0.35, 0.25)
                m.add(tube([(0.0, 0.02, 0.0), (0.0, h - 0.06, 0.0)], 0.018, n=12))
                m.add(sphere((0.0, h - 0.032, 0.0), 0.032, n=12))
                if foot == 0:
                    m.add(revolve([(0.0, 0.0), (d * 0.42, 0.0), (d * 0.42, 0.012), (0.03, 0.035),
                        (0.0, 0.035)], n=30))  # fmt: skip
                else:
                    for k in range(4):
                        m.add(tube(bent([(0.0, 0.28 if foot == 1 else 0.03, 0.0),
                            (0.2 * w * cos(k * pi / 2), 0.14 if foot == 1 else 0.03,
                            0.2 * d * sin(k * pi / 2)), (0.48 * w * cos(k * pi / 2), 0.012,
                            0.48 * d * sin(k * pi / 2))], 0.08, n=3), 0.013, n=8))  # fmt: skip
                for k in range(2 * n):
                    a, y, r = pi * k / n, h - (0.16 if k % 2 else 0.34), 0.5 * w - 0.012
                    y = h - 0.18 if k % 2 else h - 0.34
                    m.add(tube(bent([(0.0, y - 0.04, 0.0),
                        (0.6 * r * cos(a), y - 0.01, 0.6 * r * sin(a)),
                        (r * cos(a), y + 0.1, r * sin(a))], 0.06, n=3), 0.009, n=6))  # fmt: skip
                    m.add(sphere((r * cos(a), y + 0.105, r * sin(a)), 0.014, n=8))
        case 1:  # three or four sticks that cross
            with m.of(material):
                n = m.pick(4, 4, 8)
                for k in range(n):
                    a, b = 2 * pi * k / n, 2 * pi * k / n + 2.2
                    m.add(tube([(0.47 * w * cos(a), 0.006, 0.47 * d * sin(a)),
                        (0.4 * w * cos(b), h - 0.006, 0.4 * d * sin(b))], 0.015, n=8, end=0.011))  # fmt: skip
                    for s in (0.8, 0.93):
                        m.add(tube([((1 - s) * 0.47 * w * cos(a) + s * 0.4 * w * cos(b), s * h,
                            (1 - s) * 0.47 * d * sin(a) + s * 0.4 * d * sin(b)),
                            ((1 - s) * 0.47 * w * cos(a) + s * 0.4 * w * cos(b) + 0.06 * cos(b),
                            s * h + 0.04,
                            (1 - s) * 0.47 * d * sin(a) + s * 0.4 * d * sin(b) + 0.06 * sin(b))],
                            0.007, n=6))  # fmt: skip
                m.add(hoop(oval(0.2 * w, 0.2 * d, n=16), h * 0.5, 0.008, n=6))
        case 2:  # a post with a round board and a ring for umbrellas
            with m.of(material):
                m.add(tube([(0.0, 0.0, 0.0), (0.0, h, 0.0)], 0.016, n=10))
                m.add(cylinder(d * 0.4, 0.0, 0.018, n=28))
                m.add(hoop(oval(w * 0.6, d * 0.6, n=20), 0.5, 0.007, n=6))
                for k in range(3):
                    m.add(tube([(0.3 * w * cos(2.1 * k), 0.5, 0.3 * d * sin(2.1 * k)),
                        (0.0, 0.5, 0.0)], 0.006, n=6))  # fmt: skip
                for k in range(6):
                    m.add(tube(bent([(0.0, h - 0.1, 0.0), (0.3 * w * cos(k * 1.047), h - 0.14,
                        0.3 * d * sin(k * 1.047)), (0.5 * w * cos(k * 1.047) * 0.97, h - 0.05,
                        0.5 * d * sin(k * 1.047) * 0.97)], 0.05, n=3), 0.008, n=6))  # fmt: skip
        case 3:  # a rail on two posts, shelf below
            is_a = m.chance(0.5)
            with m.of(material):
                for s in (-1.0, 1.0):
                    if is_a:
                        m.add(square_tube((s * (hw - 0.02), 0.006, hd - 0.02),
                            (s * (hw - 0.02), h - 0.02, 0.0), 0.03, 0.03))  # fmt: skip
                        m.add(square_tube((s * (hw - 0.02), 0.006, -hd + 0.02),
                            (s * (hw - 0.02), h - 0.02, 0.0), 0.03, 0.03))  # fmt: skip
                    else:
                        m.add(tube([(s * (hw - 0.02), 0.02, 0.0),
                            (s * (hw - 0.02), h - 0.012, 0.0)], 0.014, n=10))  # fmt: skip
                        m.add(tube([(s * (hw - 0.02), 0.015, -hd), (s * (hw - 0.02), 0.015, hd)],
                            0.015, n=10))  # fmt: skip
                m.add(tube([(-hw, h - 0.016, 0.0), (hw, h - 0.016, 0.0)], 0.0155, n=10))
                for z in (-0.1, -0.03, 0.04, 0.1):
                    m.add(slab((-hw + 0.02, 0.16, z - 0.02), (hw - 0.02, 0.178, z + 0.02)))
        case 4:  # a panel with hooks over a bench
            panel_of = m.pick(material, WHITE, m.timber)
            if m.chance(0.5):
                m.add(bevelled((-hw, 0.44, -hd), (hw, h, -hd + 0.02), 0.003), of=panel_of)
            else:
                for k in range(8):
                    m.add(bevelled((-hw + k * w / 8 + 0.001, 0.44, -hd),
                        (-hw + (k + 1) * w / 8 - 0.004, h, -hd + 0.02), 0.003), of=panel_of)  # fmt: skip
                for y in (0.6, h - 0.2):
                    m.add(slab((-hw + 0.01, y, -hd + 0.002), (hw - 0.01, y + 0.05, -hd + 0.016)),
                        of=panel_of)  # fmt: skip
            m.add(bevelled((-hw, 0.42, -hd), (hw, 0.45, hd), 0.003), of=panel_of)
            for x in (-hw + 0.01, hw - 0.035):
                m.add(slab((x, 0.0, -hd + 0.005), (x + 0.025, 0.42, hd - 0.01)), of=panel_of)
            m.add(slab((-hw + 0.035, 0.12, -hd + 0.01), (hw - 0.035, 0.138, hd - 0.02)),
                of=panel_of)  # fmt: skip
            if m.chance(0.5):
                m.add(rounded((-hw + 0.005, 0.45, -hd + 0.025), (hw - 0.005, 0.49, hd - 0.004),
                    0.015, n=1), of=m.cloth())  # fmt: skip
            hooks = m.pick(BLACK_STEEL, BRASS, CHROME, m.metal)
            n = m.integers(3, 7)
            for k in range(n):
                m.add(tube(bent([(-hw + w * (k + 0.5) / n, h - 0.18, -hd + 0.018),
                    (-hw + w * (k + 0.5) / n, h - 0.2, -hd + 0.07),
                    (-hw + w * (k + 0.5) / n, h - 0.15, -hd + 0.085)], 0.02, n=3), 0.006, n=6),
                    of=hooks)  # fmt: skip
            if m.chance(0.6):
                m.add(bevelled((-hw, h - 0.02, -hd), (hw, h, -hd + 0.22), 0.003), of=panel_of)
        case 5:  # a ladder with pegs
            with m.of(material):
                for s in (-1.0, 1.0):
                    m.add(square_tube((s * (hw - 0.02), 0.006, hd - 0.025),
                        (s * (hw - 0.02), h - 0.006, -hd + 0.025), 0.03, 0.04))  # fmt: skip
                    m.add(square_tube((s * (hw - 0.02), 0.006, -hd + 0.02),
                        (s * (hw - 0.02), h * 0.7, -hd + 0.02 + 0.0 * h), 0.028, 0.03))  # fmt: skip
                for k in range(4):
                    y = 0.2 + (h - 0.3) * k / 3
                    m.add(tube([(-hw + 0.02, y, hd - 0.025 - (d - 0.05) * y / h),
                        (hw - 0.02, y, hd - 0.025 - (d - 0.05) * y / h)], 0.013, n=8))  # fmt: skip
                for k in range(5):
                    m.add(tube([(-hw + w * (k + 0.5) / 5, h - 0.1, -hd + 0.045),
                        (-hw + w * (k + 0.5) / 5, h - 0.06, -hd + 0.13)], 0.009, n=6))  # fmt: skip
                m.add(bevelled((-hw + 0.035, 0.12, -hd + 0.01), (hw - 0.035, 0.14, hd - 0.04),
                    0.002))  # fmt: skip
