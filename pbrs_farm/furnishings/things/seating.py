"""Sofas, armchairs, chairs, stools and benches; no effects."""

from __future__ import annotations

from itertools import product

from numpy import cos, pi, sin

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import CHAIR, SOFA
from pbrs_farm.core.frames import rotation_x
from pbrs_farm.core.house import Material
from pbrs_farm.furnishings.things.bodies import (
    bevelled,
    board,
    disc,
    frustum,
    loft,
    revolve,
    rounded,
    sheared,
    slab,
    sphere,
    square_tube,
    tube,
)
from pbrs_farm.furnishings.things.cloth import bulged, chair_shell, tub
from pbrs_farm.furnishings.things.joints import Inside, Look, four_legs, fronts_of, hollow, leg
from pbrs_farm.furnishings.things.maker import Maker, Size, family, thing
from pbrs_farm.furnishings.things.materials import (
    BLACK_STEEL,
    CHROME,
    STEEL,
    WHITE,
    WHITE_STEEL,
    WICKER,
    glossy,
    plain,
)
from pbrs_farm.furnishings.things.outlines import bent, gathered, oval, rect, rings


@thing(group="ottoman", nyu40=CHAIR, place=Place.FLOOR)
def ottoman(m: Maker) -> None:
    """A square seat without a back: on feet, in a skirt, or a box; buttons on some."""
    w, d, h = m.uniform(0.45, 0.85), m.uniform(0.42, 0.55), m.uniform(0.36, 0.44)
    form = m.weighted(0.4, 0.35, 0.25)
    low = 0.03 if form == 2 else m.uniform(0.1, 0.16)
    with m.of(m.cloth()):
        m.add(rounded((-w / 2 + 0.006, low, -d / 2 + 0.006), (w / 2 - 0.006, h - 0.08, d / 2 - 0.006),
            0.02, n=1))  # fmt: skip
        m.add(bulged((w, 0.13, d), n=10, edge=0.7, bulge=5.0), at=(0.0, h - 0.065, 0.0))
        if form == 1:
            skirt(m, w, d, low + 0.06)
        if m.chance(0.4):
            for x, z in product((-0.22, 0.0, 0.22), (-0.2, 0.2)):
                m.add(sphere((x * w, h - 0.004, z * d), 0.011, n=6))
    four_legs(m, m.pick("tapered", "bun", "square"), w, d, low + 0.004, 0.045, 0.06, 0.0,
        m.pick(m.timber, m.dark_timber, BLACK_STEEL))  # fmt: skip


@thing(group="stool", nyu40=CHAIR, place=Place.FLOOR)
def stool(m: Maker) -> None:
    """A round seat of wood on three or four legs that lean outwards."""
    r, tall = m.uniform(0.15, 0.19), m.uniform(0.42, 0.5)
    white = plain("stool white", (0.88, 0.88, 0.86), 0.4)
    board = plain("stool " + m.style.wood.name, m.wood, 0.45)
    m.add(revolve([(0, 0), (r - 0.006, 0), (r, 0.008), (r, 0.022), (r - 0.006, 0.03), (0, 0.03)],
        n=28), at=(0, tall - 0.03, 0), of=board)  # fmt: skip
    leg, n = frustum((0.013, 0), (0.018, 1.0), n=12), m.integers(3, 5)
    with m.of(white if m.chance(0.3) else board):
        for k in range(n):
            x, z = cos(2 * pi * (k + 0.5) / n), sin(2 * pi * (k + 0.5) / n)
            m.add(sheared(leg, (x * (r - 0.005), 0, z * (r - 0.005)),
                (x * (r - 0.07), tall - 0.028, z * (r - 0.07))))  # fmt: skip


def seat_legs(m: Maker, kind: str, w: float, d: float, high: float, material: Material) -> None:
    """Legs of a sofa or armchair, w by d, up to `high`.

    Tapered, square, round, a sled, a plinth, buns.
    """
    hd = d / 2
    match kind:
        case "plinth":
            m.add(slab((-w / 2 + 0.04, 0.0, -hd + 0.04), (w / 2 - 0.04, high + 0.002, hd - 0.06)),
                of=material)  # fmt: skip
        case "sled":
            for x in (-w / 2 + 0.1, w / 2 - 0.1):
                m.add(tube(bent([(x, high + 0.01, -hd + 0.08), (x, 0.008, -hd + 0.08),
                    (x, 0.008, hd - 0.08), (x, high + 0.01, hd - 0.08)], 0.03, n=3), 0.008, n=8),
                    of=material)  # fmt: skip
    if kind not in ("plinth", "sled"):
        four_legs(m, kind, w, d, high + 0.002, 0.05, 0.08, 0.03 if kind == "tapered" else 0.0,
            material)  # fmt: skip
    if w > 1.5 and kind not in ("plinth", "sled"):
        leg(m, kind, (0.0, 0.0), (0.0, 0.0), high + 0.002, 0.05, material)


def skirt(m: Maker, w: float, d: float, high: float) -> None:
    """Cloth round what is w by d, from `high` almost down to the floor, in folds that open downwards."""
    fold, deep = m.uniform(0.1, 0.16), m.pick(0.003, 0.006, 0.009)
    m.add(loft([(gathered(w + 0.012, d + 0.012, fold, deep), 0.012),
        (gathered(w + 0.012, d + 0.012, fold, 0.3 * deep), high)], sharp=80.0))  # fmt: skip


@family(group="sofa", nyu40=SOFA, place=Place.FLOOR, variants=56,
    size=lambda m: (m.pick(1.45, 1.6, 1.7, 1.85, 1.95, 2.1, 2.2), m.uniform(0.82, 0.98),
    m.uniform(0.74, 0.88)))  # fmt: skip
def sofa(m: Maker, size: Size) -> None:
    """A sofa of two or three seats.

    Arms, backs, cushions and feet of many kinds; some have a throw over an arm.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    material = m.cloth()
    feet = m.pick("tapered", "square", "round", "sled", "plinth", "bun")
    feet_stuff = m.pick(m.timber, m.dark_timber, m.metal, BLACK_STEEL)
    low, seat = 0.06 if feet in ("plinth", "bun") else m.pick(0.1, 0.14, 0.17), m.uniform(0.4, 0.45)
    arm = m.pick("box", "box", "round", "slope", "thin", "low", "wood")
    aw = 0.1 if arm in ("thin", "wood") else m.uniform(0.15, 0.24)
    ah = seat + (0.1 if arm == "low" else m.uniform(0.16, 0.24))
    n = 2 if w < 1.8 else m.pick(2, 3, 3)
    style = m.pick("cushions", "cushions", "firm", "tufted", "one")
    base = low + 0.12
    seat_legs(m, feet, w, d, low, feet_stuff)
    x0, x1, back = -hw + aw, hw - aw, m.uniform(0.14, 0.2)
    with m.of(material):
        m.add(rounded((-hw + (0.0 if arm != "wood" else 0.02), low, -hd + 0.01),
            (hw - (0.0 if arm != "wood" else 0.02), base + 0.04, hd - 0.015), 0.02, n=1))  # fmt: skip
        # The back.
        m.add(rounded((x0 - 0.02, low, -hd), (x1 + 0.02,
            h - (0.0 if style in ("firm", "one") else 0.07), -hd + back), 0.05, n=1))  # fmt: skip
        # Seat cushions.
        n_seats = 1 if style == "one" else n
        for k in range(n_seats):
            m.add(rounded((x0 + (x1 - x0) * k / n_seats + 0.003, base + 0.03, -hd + back - 0.02),
                (x0 + (x1 - x0) * (k + 1) / n_seats - 0.003, seat, hd), m.uniform(0.035, 0.06),
                n=2 if n_seats < 3 else 1))  # fmt: skip
        # Back cushions.
        match style:
            case "cushions":
                t, bh = m.uniform(0.15, 0.2), h - seat + 0.02
                for k in range(n):
                    m.add(bulged(((x1 - x0) / n - 0.01, t, bh), n=7, edge=0.45, bulge=3.4),
                        turn=rotation_x(pi / 2 - 0.16), at=(x0 + (x1 - x0) * (k + 0.5) / n,
                        seat + bh / 2 - 0.02, -hd + back + t * 0.42))  # fmt: skip
            case "firm":
                for k in range(n):
                    m.add(rounded((x0 + (x1 - x0) * k / n + 0.003, seat - 0.01, -hd + back - 0.03),
                        (x0 + (x1 - x0) * (k + 1) / n - 0.003, h - 0.015, -hd + back + 0.09), 0.04,
                        n=2))  # fmt: skip
            case "tufted":
                m.add(rounded((x0, seat - 0.01, -hd + back - 0.03), (x1, h, -hd + back + 0.06),
                    0.04, n=2))  # fmt: skip
                for i, k in product(range(2), range(3 * n)):
                    m.add(sphere((x0 + (x1 - x0) * (k + 0.5 + 0.25 * (i - 0.5)) / (3 * n),
                        seat + (h - seat) * (0.38 + 0.32 * i), -hd + back + 0.062), 0.011, n=5))  # fmt: skip
        # Arms.
        for s in (-1.0, 1.0):
            a, b = min(s * hw, s * (hw - aw)), max(s * hw, s * (hw - aw))
            match arm:
                case "box" | "thin" | "low":
                    m.add(rounded((a, low, -hd + 0.005), (b, ah, hd - 0.01),
                        0.05 if arm == "low" else 0.03, n=2))  # fmt: skip
                case "round":
                    m.add(rounded((a + 0.02, low, -hd + 0.01), (b - 0.02, ah - 0.04, hd - 0.02),
                        0.02, n=1))  # fmt: skip
                    m.add(tube([((a + b) / 2, ah - aw * 0.5, -hd + 0.005),
                        ((a + b) / 2, ah - aw * 0.5, hd - 0.01)], aw * 0.5, n=16))  # fmt: skip
                case "slope":
                    m.add(loft([(rect(aw - 0.01, d - 0.02, 0.02, x=(a + b) / 2), low),
                        (rect(aw, d - 0.01, 0.025, x=(a + b) / 2), low + 0.05),
                        (rect(aw, d - 0.01, 0.025, x=(a + b) / 2), seat),
                        (rect(aw, d * 0.75, 0.025, x=(a + b) / 2, z=-d * 0.12), ah - 0.02),
                        (rect(aw - 0.03, d * 0.7, 0.02, x=(a + b) / 2, z=-d * 0.12), ah)]))  # fmt: skip
                case "wood":
                    m.add(bevelled((a + 0.01, ah - 0.035, -hd + 0.02), (b - 0.01, ah, hd - 0.02),
                        0.006), of=m.timber)  # fmt: skip
                    for z in (-hd + 0.06, hd - 0.1):
                        m.add(bevelled(((a + b) / 2 - 0.02, low * 0.5, z),
                            ((a + b) / 2 + 0.02, ah - 0.034, z + 0.045), 0.004), of=m.timber)  # fmt: skip
    # A skirt hides the feet, and what is under it.
    if arm != "wood" and feet in ("plinth", "bun", "square") and m.chance(0.5):
        with m.of(material):
            skirt(m, w, d, base + 0.03)
    # A throw over one arm.
    if arm in ("box", "round", "low") and m.chance(0.2):
        s, other = (m.pick(-1.0, 1.0), plain("fabric throw",
            m.style.accent if m.chance(0.4) else m.textile(), 0.95))  # fmt: skip
        m.add(rounded((s * (hw - aw / 2) - aw / 2 - 0.008, ah - 0.2, -0.1),
            (s * (hw - aw / 2) + aw / 2 + 0.008, ah + 0.008, 0.28), 0.03, n=2), of=other)  # fmt: skip


@family(group="corner_sofa", nyu40=SOFA, place=Place.FLOOR, called="corner_sofa", variants=16,
    size=lambda m: (m.pick(2.2, 2.4, 2.6), m.pick(1.5, 1.6, 1.7), m.uniform(0.76, 0.86)))  # fmt: skip
def chaise_sofa(m: Maker, size: Size) -> None:
    """A sofa with one seat that is long enough to lie on."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    material, s = m.cloth(), m.pick(-1.0, 1.0)
    low, seat, aw, back, main = m.pick(0.06, 0.1, 0.14), 0.43, m.uniform(0.12, 0.22), 0.17, 0.95
    ah, wide = seat + m.uniform(0.14, 0.22), 0.36 * w
    z1 = -hd + main
    for x, z in ((-hw + 0.1, -hd + 0.1), (hw - 0.1, -hd + 0.1), (-s * (hw - 0.1), z1 - 0.1),
        (s * (hw - 0.1), hd - 0.1), (s * (hw - wide + 0.1), hd - 0.1)):  # fmt: skip
        leg(m, m.pick("tapered", "square", "round"), (x, z), (x, z), low + 0.002, 0.05, m.timber)
    with m.of(material):
        m.add(rounded((-hw, low, -hd + 0.01), (hw, low + 0.16, z1 - 0.01), 0.02, n=1))
        a, b = min(s * hw, s * (hw - wide)), max(s * hw, s * (hw - wide))
        m.add(rounded((a, low, z1 - 0.1), (b, low + 0.16, hd - 0.01), 0.02, n=1))
        m.add(rounded((a + (0.003 if s > 0 else aw), low + 0.15, -hd + back - 0.02),
            (b - (aw if s > 0 else 0.003), seat, hd), 0.05, n=2))  # fmt: skip
        c, e = (-hw + aw, a) if s > 0 else (b, hw - aw)
        for k in range(2):
            m.add(rounded((c + (e - c) * k / 2 + 0.003, low + 0.15, -hd + back - 0.02),
                (c + (e - c) * (k + 1) / 2 - 0.003, seat, z1), 0.05, n=2))  # fmt: skip
        m.add(rounded((-hw + aw - 0.02, low, -hd), (hw - aw + 0.02, h - 0.06, -hd + back), 0.05,
            n=2))  # fmt: skip
        for x in (-1.0, 0.0, 1.0):
            m.add(bulged(((w - 2 * aw) / 3 - 0.01, 0.18, h - seat + 0.02), n=7, edge=0.45,
                bulge=3.4), turn=rotation_x(pi / 2 - 0.16), at=(x * (w - 2 * aw) / 3,
                seat + (h - seat) / 2 - 0.01, -hd + back + 0.075))  # fmt: skip
        for x in (-1.0, 1.0):
            m.add(rounded((min(x * hw, x * (hw - aw)), low, -hd + 0.005),
                (max(x * hw, x * (hw - aw)), ah, z1 - 0.02), 0.04, n=2))  # fmt: skip


@family(group="armchair", nyu40=CHAIR, place=Place.FLOOR, variants=36,
    size=lambda m: (m.uniform(0.68, 0.86), m.uniform(0.7, 0.88), m.uniform(0.74, 1.0)))  # fmt: skip
def armchair(m: Maker, size: Size) -> None:
    """An armchair: boxy, with wings, a tub, of bent wood, a shell on legs, a wooden frame."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    material = m.cloth()
    form = m.weighted(0.28, 0.18, 0.2, 0.18, 0.16) if h > 0.86 else m.weighted(0.36, 0.0, 0.28,
        0.18, 0.18)  # fmt: skip
    feet, feet_stuff = (m.pick("tapered", "square", "round", "sled"), m.pick(m.timber, m.timber,
        m.dark_timber, m.metal, BLACK_STEEL))  # fmt: skip
    low, seat = m.pick(0.12, 0.16, 0.2), m.uniform(0.4, 0.44)
    match form:
        case 0:  # boxy
            aw, ah = m.uniform(0.1, 0.18), seat + m.uniform(0.14, 0.2)
            seat_legs(m, feet, w, d, low, feet_stuff)
            with m.of(material):
                m.add(rounded((-hw, low, -hd + 0.005), (hw, seat - 0.11, hd - 0.012), 0.02, n=1))
                m.add(rounded((-hw + aw + 0.002, seat - 0.12, -hd + 0.12),
                    (hw - aw - 0.002, seat, hd), 0.05, n=2))  # fmt: skip
                m.add(rounded((-hw + 0.02, low, -hd), (hw - 0.02, h - 0.03, -hd + 0.15), 0.06, n=2))
                m.add(bulged((w - 2 * aw - 0.01, 0.16, h - seat + 0.03), n=7, edge=0.45, bulge=3.2),
                    turn=rotation_x(pi / 2 - 0.18),
                    at=(0.0, seat + (h - seat) / 2 - 0.015, -hd + 0.21))  # fmt: skip
                for s in (-1.0, 1.0):
                    m.add(rounded((min(s * hw, s * (hw - aw)), low, -hd + 0.01),
                        (max(s * hw, s * (hw - aw)), ah, hd - 0.015), min(0.05, 0.4 * aw), n=2))  # fmt: skip
        case 1:  # with wings
            seat_legs(m, m.pick("tapered", "turned"), w, d - 0.04, low, feet_stuff)
            with m.of(material):
                m.add(rounded((-hw + 0.02, low, -hd + 0.04), (hw - 0.02, seat - 0.1, hd - 0.01),
                    0.03, n=1))  # fmt: skip
                m.add(rounded((-hw + 0.12, seat - 0.11, -hd + 0.16), (hw - 0.12, seat, hd), 0.05,
                    n=2))  # fmt: skip
                m.add(loft([(rect(w - 0.1, 0.2, 0.06, z=-hd + 0.12), low),
                    (rect(w - 0.1, 0.17, 0.06, z=-hd + 0.09), h * 0.7),
                    (rect(w - 0.12, 0.14, 0.06, z=-hd + 0.07), h - 0.03),
                    (rect(w - 0.18, 0.08, 0.03, z=-hd + 0.07), h)]))  # fmt: skip
                for s in (-1.0, 1.0):
                    m.add(rounded((min(s * hw, s * (hw - 0.12)), low, -hd + 0.05),
                        (max(s * hw, s * (hw - 0.12)), seat + 0.2, hd - 0.03), 0.05, n=2))  # fmt: skip
                    m.add(rounded((min(s * hw, s * (hw - 0.1)), seat + 0.12, -hd + 0.02),
                        (max(s * hw, s * (hw - 0.1)), h - 0.04, -hd + 0.3), 0.05, n=2))  # fmt: skip
        case 2:  # a tub: a back that runs round into the arms
            ah = seat + m.uniform(0.12, 0.2) if m.chance(0.5) else h - 0.02
            four_legs(m, "tapered" if feet == "sled" else feet, w, d, low + 0.02, 0.045, 0.14, 0.05,
                feet_stuff)  # fmt: skip
            with m.of(material):
                m.add(loft(rings(oval, [(w * 0.86, d * 0.86, low), (w * 0.96, d * 0.96, low + 0.05),
                    (w * 0.97, d * 0.97, seat - 0.1)], n=26, power=2.6)))  # fmt: skip
                m.add(rounded((-hw + 0.12, seat - 0.11, -hd + 0.14), (hw - 0.12, seat, hd - 0.005),
                    0.06, n=2))  # fmt: skip
                tub_back(m, w, d, seat - 0.12, ah, h, 0.11)
        case 3:  # bent wood with loose cushions
            frame = m.pick(m.timber, m.timber, m.dark_timber, BLACK_STEEL)
            with m.of(frame):
                for s in (-1.0, 1.0):
                    x = s * (hw - 0.02)
                    m.add(tube(bent([(x, 0.018, hd - 0.1), (x, seat + 0.18, hd - 0.03),
                        (x, seat + 0.2, -hd + 0.12), (x, 0.018, -hd + 0.03)], 0.09, n=4), 0.018,
                        n=8))  # fmt: skip
                    m.add(tube([(s * (hw - 0.04), seat - 0.12, hd - 0.08),
                        (s * (hw - 0.04), seat - 0.18, -hd + 0.15)], 0.014, n=8))  # fmt: skip
                for z, y in ((hd - 0.1, seat - 0.13), (-hd + 0.2, seat - 0.18)):
                    m.add(tube([(-hw + 0.02, y, z), (hw - 0.02, y, z)], 0.014, n=8))
                m.add(tube([(-hw + 0.03, h - 0.12, -hd + 0.045),
                    (hw - 0.03, h - 0.12, -hd + 0.045)], 0.014, n=8))  # fmt: skip
                for x in (-0.5, 0.0, 0.5):
                    m.add(tube([(x * w * 0.6, seat - 0.18, -hd + 0.16),
                        (x * w * 0.6, h - 0.1, -hd + 0.045)], 0.01, n=6))  # fmt: skip
            with m.of(material):
                m.add(bulged((w - 0.1, 0.13, d - 0.16), n=7, edge=0.6, bulge=5.0),
                    turn=rotation_x(0.08), at=(0.0, seat - 0.07, 0.075))  # fmt: skip
                m.add(bulged((w - 0.1, 0.13, h - seat + 0.1), n=7, edge=0.6, bulge=5.0),
                    turn=rotation_x(pi / 2 - 0.22),
                    at=(0.0, seat + (h - seat) / 2 - 0.035, -hd + 0.205))  # fmt: skip
        case 4:  # a shell on four legs or a swivel foot
            if m.chance(0.35):
                m.add(revolve([(0.0, 0.0), (0.26, 0.0), (0.25, 0.012), (0.03, 0.03), (0.03, 0.3),
                    (0.0, 0.3)], n=28), of=m.pick(CHROME, BLACK_STEEL, STEEL))  # fmt: skip
            else:
                four_legs(m, "tapered", w, d, 0.3, 0.04, 0.22, 0.14, feet_stuff)
            with m.of(material):
                m.add(loft(rings(oval, [(w * 0.5, d * 0.5, 0.29), (w * 0.8, d * 0.8, 0.33),
                    (w * 0.86, d * 0.86, seat - 0.03), (w * 0.8, d * 0.8, seat)], n=26)))  # fmt: skip
                tub_back(m, w, d, seat - 0.1, seat + 0.12, h, 0.08)


def tub_back(m: Maker, w: float, d: float, y: float, low: float, high: float, t: float) -> None:
    """A wall of cloth round the back of an oval w by d.

    From y up to low at its ends and high in the middle.
    """
    m.add(tub(w, d, y, low, high, t))


@family(group="chair", nyu40=CHAIR, place=Place.FLOOR, variants=36,
    size=lambda m: (m.uniform(0.42, 0.5), m.uniform(0.46, 0.54), m.uniform(0.78, 0.98)))  # fmt: skip
def chair(m: Maker, size: Size) -> None:
    """A chair to eat at.

    Slats, a ladder, spindles, a panel, a shell, cane, upholstered; many legs.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    seat = m.uniform(0.44, 0.47)
    form = m.pick("slats", "ladder", "spindles", "panel", "shell", "soft", "cross", "bent")
    frame = m.pick(m.timber, m.timber, m.dark_timber, BLACK_STEEL, WHITE,
        glossy("paint", m.paint(), 0.4))  # fmt: skip
    soft = m.cloth()
    match form:
        case "slats" | "ladder" | "panel" | "cross":
            t, is_padded = m.uniform(0.028, 0.038), m.chance(0.4)
            with m.of(frame):
                for s in (-1.0, 1.0):
                    m.add(square_tube((s * (hw - t / 2 - 0.01), 0.0, hd - 0.04),
                        (s * (hw - t / 2 - 0.015), seat - 0.01, hd - 0.045), t, t))  # fmt: skip
                    m.add(square_tube((s * (hw - t / 2 - 0.02), 0.001, -hd + t / 2 + 0.0),
                        (s * (hw - t / 2 - 0.02), seat, -hd + 0.065), t, t))  # fmt: skip
                    m.add(square_tube((s * (hw - t / 2 - 0.02), seat - 0.02, -hd + 0.065),
                        (s * (hw - t / 2 - 0.02), h, -hd + t / 2 + 0.001), t, t * 0.9))  # fmt: skip
                m.add(board(w, d - 0.07, seat - 0.022, seat, 0.03, 0.006, z=0.035))
                for z in (-hd + 0.065, hd - 0.055):
                    m.add(bevelled((-hw + 0.04, seat - 0.08, z - 0.01),
                        (hw - 0.04, seat - 0.021, z + 0.01), 0.002))  # fmt: skip
                for x in (-hw + 0.03, hw - 0.05):
                    m.add(bevelled((x, seat - 0.08, -hd + 0.08),
                        (x + 0.02, seat - 0.021, hd - 0.06), 0.002))  # fmt: skip
                # What is between the posts of the back, which lean: a frame of its own.
                up, lean = h - seat, 0.045 / (h - seat)
                with m.moved(turn=rotation_x(-lean), at=(0.0, seat, -hd + 0.065)):
                    m.add(bevelled((-hw + 0.035, up - 0.075, -0.011),
                        (hw - 0.035, up - 0.005, 0.011), 0.004))  # fmt: skip
                    match form:
                        case "slats":
                            n = m.integers(3, 7)
                            for k in range(n):
                                m.add(bevelled((-hw + 0.05 + (w - 0.1) * (k + 0.5) / n - 0.012,
                                    0.09, -0.006), (-hw + 0.05 + (w - 0.1) * (k + 0.5) / n + 0.012,
                                    up - 0.07, 0.006), 0.002))  # fmt: skip
                            m.add(bevelled((-hw + 0.035, 0.06, -0.01), (hw - 0.035, 0.095, 0.01),
                                0.003))  # fmt: skip
                        case "ladder":
                            n = m.integers(1, 4)
                            for k in range(n):
                                m.add(bevelled((-hw + 0.035, up * (0.2 + 0.55 * k / n), -0.008),
                                    (hw - 0.035, up * (0.2 + 0.55 * k / n) + 0.05, 0.008), 0.003))  # fmt: skip
                        case "panel":
                            m.add(rounded((-hw + 0.035, up * 0.16, -0.012),
                                (hw - 0.035, up - 0.07, 0.012), 0.008, n=1),
                                of=m.pick(frame, soft, soft, WICKER))  # fmt: skip
                        case "cross":
                            for s in (-1.0, 1.0):
                                m.add(square_tube((s * (hw - 0.05), 0.05, 0.0),
                                    (-s * (hw - 0.05), up - 0.06, 0.0), 0.028, 0.014))  # fmt: skip
            if is_padded:
                m.add(bulged((w - 0.05, 0.05, d - 0.12), n=6, edge=0.5, bulge=5.0),
                    at=(0.0, seat + 0.016, 0.03), of=soft)  # fmt: skip
            if m.chance(0.4):
                for s in (-1.0, 1.0):
                    m.add(square_tube((s * (hw - 0.03), 0.16, hd - 0.045),
                        (s * (hw - 0.035), 0.16, -hd + 0.035), 0.018, 0.022), of=frame)  # fmt: skip
        case "spindles":
            with m.of(frame):
                m.add(loft(rings(oval, [(w - 0.01, d - 0.07, seat - 0.03),
                    (w, d - 0.06, seat - 0.02), (w, d - 0.06, seat - 0.006),
                    (w - 0.02, d - 0.08, seat)], z=0.03, power=2.6)))  # fmt: skip
                four_legs(m, "tapered", w, d - 0.04, seat - 0.02, 0.034, 0.1, 0.075, frame)
                for z in (-0.12, 0.14):
                    m.add(tube([(-hw + 0.07, 0.2, z), (hw - 0.07, 0.2, z)], 0.008, n=6))
                n = m.integers(5, 9)
                for k in range(n):
                    t = -1 + 2 * k / (n - 1)
                    m.add(tube([(t * 0.36 * w, seat - 0.015, -hd + 0.09 + 0.05 * t * t),
                        (t * 0.44 * w, h - 0.03 - 0.07 * t * t, -hd + 0.015 + 0.04 * t * t)], 0.006,
                        n=6))  # fmt: skip
                m.add(tube(bent([(-0.46 * w, seat - 0.01, -hd + 0.15),
                    (-0.5 * w + 0.012, h - 0.12, -hd + 0.06), (-0.3 * w, h - 0.012, -hd + 0.015),
                    (0.3 * w, h - 0.012, -hd + 0.015), (0.5 * w - 0.012, h - 0.12, -hd + 0.06),
                    (0.46 * w, seat - 0.01, -hd + 0.15)], 0.1, n=4), 0.012, n=8))  # fmt: skip
        case "shell" | "soft":
            coat = soft if form == "soft" else glossy("shell", m.pick((0.92, 0.92, 0.9),
                (0.1, 0.1, 0.1), m.any_colour(), m.textile()), 0.35)  # fmt: skip
            if m.chance(0.7):
                four_legs(m, m.pick("tapered", "round"), w, d, seat - 0.02, 0.032, 0.13, 0.1,
                    m.pick(m.timber, m.timber, BLACK_STEEL, CHROME))  # fmt: skip
            else:
                for x in (-hw + 0.05, hw - 0.05):
                    m.add(tube(bent([(x * 0.8, seat - 0.03, -hd + 0.1), (x, 0.008, -hd + 0.04),
                        (x, 0.008, hd - 0.03), (x * 0.8, seat - 0.03, hd - 0.12)], 0.03, n=3),
                        0.008, n=8), of=m.pick(CHROME, BLACK_STEEL, STEEL))  # fmt: skip
            with m.of(coat):
                thick = 0.012 if form == "shell" else 0.05
                m.add(chair_shell(w, d, seat, h, thick))
        case "bent":
            fittings = m.pick(CHROME, BLACK_STEEL, m.timber)
            with m.of(fittings):
                for s in (-1.0, 1.0):
                    m.add(tube(bent([(s * (hw - 0.015), h - 0.06, -hd + 0.012),
                        (s * (hw - 0.015), seat - 0.02, -hd + 0.07),
                        (s * (hw - 0.015), seat - 0.02, hd - 0.012),
                        (s * (hw - 0.015), 0.012, hd - 0.06),
                        (s * (hw - 0.015), 0.012, -hd + 0.05)], 0.06, n=4), 0.012, n=8))  # fmt: skip
                m.add(tube([(-hw + 0.015, 0.012, -hd + 0.05), (hw - 0.015, 0.012, -hd + 0.05)],
                    0.012, n=8))  # fmt: skip
            pad = m.pick(soft, WICKER, m.timber)
            m.add(rounded((-hw + 0.02, seat - 0.03, -hd + 0.08),
                (hw - 0.02, seat + 0.01, hd - 0.02), 0.018, n=1), of=pad)  # fmt: skip
            m.add(rounded((-hw + 0.02, 0.0, -0.016), (hw - 0.02, (h - seat) * 0.62, 0.016), 0.014,
                n=1), turn=rotation_x(-0.12), at=(0.0, seat + (h - seat) * 0.385, -hd + 0.057),
                of=pad)  # fmt: skip


@family(group="stool", nyu40=CHAIR, place=Place.FLOOR, called="stool", variants=20,
    size=lambda m: (m.uniform(0.32, 0.4), m.uniform(0.32, 0.4),
    m.pick(0.42, 0.45, 0.48, 0.62, 0.65)))  # fmt: skip
def kitchen_stool(m: Maker, size: Size) -> None:
    """A stool: round or square, of wood, with a pad, of metal."""
    w, d, h = size
    material, frame = (m.pick(m.timber, m.cloth(), glossy("paint", m.paint(), 0.4), m.dark_timber),
        m.pick(m.timber, BLACK_STEEL, WHITE_STEEL, CHROME, m.dark_timber))  # fmt: skip
    form, legs = (m.pick("round", "square", "saddle", "pad"),
        m.pick("tapered", "round", "hairpin", "square"))  # fmt: skip
    if legs == "square":
        four_legs(m, "square", w, d, h - 0.02, 0.032, 0.02, 0.0, frame)
    else:
        four_legs(m, legs, w, d, h - 0.02, 0.034, 0.075 if form in ("round", "pad") else 0.05,
            0.055 if form in ("round", "pad") else 0.034, frame)  # fmt: skip
    if h > 0.55 or m.chance(0.3):
        for s in (-1.0, 1.0):
            m.add(tube([(-w / 2 + 0.03, 0.22, s * (d / 2 - 0.035)),
                (w / 2 - 0.03, 0.22, s * (d / 2 - 0.035))], 0.008, n=6), of=frame)  # fmt: skip
            m.add(tube([(s * (w / 2 - 0.035), 0.18, -d / 2 + 0.03),
                (s * (w / 2 - 0.035), 0.18, d / 2 - 0.03)], 0.008, n=6), of=frame)  # fmt: skip
    with m.of(material):
        match form:
            case "round":
                m.add(disc(w, d, h - 0.03, h, 0.006, n=28))
            case "square":
                m.add(board(w, d, h - 0.03, h, 0.03, 0.005))
            case "saddle":
                m.add(disc(w, d, h - 0.035, h, 0.012, n=28, power=3.5))
            case "pad":
                m.add(disc(w, d, h - 0.07, h, 0.03, n=28))


@family(group="stool", nyu40=CHAIR, place=Place.FLOOR, called="bench", variants=20,
    size=lambda m: (m.pick(0.8, 0.9, 1.0, 1.2), m.pick(0.32, 0.36, 0.4), m.pick(0.44, 0.46, 0.48)))  # fmt: skip
def hall_bench(m: Maker, size: Size) -> None:
    """A bench for a hall or a bed's foot: boards, a pad, a shelf for shoes, or a box."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    material, form = (m.pick(m.timber, m.dark_timber, glossy("paint", m.paint(), 0.4)),
        m.weighted(0.35, 0.35, 0.3))  # fmt: skip
    soft = m.cloth()
    match form:
        case 0:  # on legs
            four_legs(m, m.pick("tapered", "square", "hairpin"), w, d, h - 0.05, 0.045, 0.06, 0.0,
                m.pick(material, BLACK_STEEL))  # fmt: skip
            m.add(board(w, d, h - 0.055, h - 0.03, 0.01, 0.004), of=material)
            m.add(rounded((-hw, h - 0.05, -hd), (hw, h, hd), 0.02, n=2), of=soft)
        case 1:  # boards, a shelf for shoes
            for x in (-hw + 0.02, hw - 0.045):
                m.add(bevelled((x, 0.0, -hd + 0.01), (x + 0.025, h - 0.03, hd - 0.01), 0.003),
                    of=material)  # fmt: skip
            m.add(board(w, d, h - 0.03, h, 0.006, 0.004), of=material)
            for y in (0.08, 0.24):
                m.add(slab((-hw + 0.045, y, -hd + 0.02), (hw - 0.045, y + 0.018, hd - 0.02)),
                    of=material)  # fmt: skip
        case 2:  # a box with fronts
            m.add(slab((-hw, 0.0, -hd), (hw, 0.04, hd - 0.05)), of=material)
            hollow(m, (-hw, hw), (0.04, h - 0.05), (-hd, hd - 0.05), 0.018, material)
            with m.moved(at=(0.0, 0.0, 0.0005)):
                fronts_of(m, Look("flat", material, material, material,
                    m.pick("knob", "edge", "disc"), m.metal), (-hw, hw), (0.04, h - 0.055),
                    hd - 0.0495, m.pick([("drawer",), ("drawer",)], [("door",), ("door",)],
                    [("flap",)]), False, Inside(-hd + 0.008))  # fmt: skip
            m.add(rounded((-hw, h - 0.05, -hd), (hw, h, hd), 0.02, n=2), of=soft)


@family(group="office_chair", nyu40=CHAIR, place=Place.FLOOR, called="office_chair", variants=28,
    size=lambda m: (m.uniform(0.58, 0.66), m.uniform(0.58, 0.66), m.uniform(0.86, 1.14)))  # fmt: skip
def swivel_chair(m: Maker, size: Size) -> None:
    """A chair that turns, on five arms with castors: a seat, a back of cloth or slats, armrests on some."""
    w, d, h = size
    r, seat = min(w, d) / 2 - 0.02, m.uniform(0.45, 0.5)
    black = plain(
        "office plastic", m.pick((0.05, 0.05, 0.05), (0.05, 0.05, 0.05), (0.75, 0.75, 0.75)), 0.5
    )
    star = m.pick(black, black, CHROME, STEEL)
    cover = m.pick(
        plain("fabric", (0.07, 0.07, 0.08), 0.95),
        plain("fabric", (0.25, 0.26, 0.28), 0.95),
        m.cloth(),
    )
    for k in range(5):
        a = pi / 2 + 2 * pi * k / 5
        x, z = cos(a), sin(a)
        m.add(
            tube([(0.03 * x, 0.1, 0.03 * z), (r * x, 0.07, r * z)], 0.02, n=8, end=0.013), of=star
        )
        for s in (-0.011, 0.011):
            m.add(tube([(r * x - z * (s - 0.008), 0.028, r * z + x * (s - 0.008)),
                (r * x - z * (s + 0.008), 0.028, r * z + x * (s + 0.008))], 0.028, n=10), of=black)  # fmt: skip
        m.add(tube([(r * x, 0.05, r * z), (r * x, 0.075, r * z)], 0.008, n=6), of=black)
    m.add(revolve([(0.0, 0.07), (0.034, 0.07), (0.034, 0.2), (0.022, 0.205), (0.022, seat - 0.08),
        (0.09, seat - 0.075), (0.09, seat - 0.055), (0.0, seat - 0.055)], n=14), of=star)  # fmt: skip
    wide = 0.82 * w
    m.add(rounded((-wide / 2, seat - 0.06, -0.24), (wide / 2, seat, 0.26), 0.028, n=2), of=cover)
    # A bar behind carries the back, which leans.
    m.add(tube(bent([(0.0, seat - 0.065, -0.1), (0.0, seat - 0.07, -0.25), (0.0, seat + 0.2, -0.29)],
        0.06, n=3), 0.018, n=8), of=black)  # fmt: skip
    tall = h - seat - 0.06
    with m.moved(turn=rotation_x(-0.12), at=(0.0, seat + 0.06, -0.25)):
        match m.weighted(0.5, 0.3, 0.2):
            case 0:
                m.add(
                    rounded((-0.45 * wide, 0.0, -0.03), (0.45 * wide, tall, 0.025), 0.025, n=2),
                    of=cover,
                )
            case 1:  # a net in a frame
                t = 0.018
                with m.of(black):
                    m.add(
                        rounded((-0.47 * wide, 0.0, -t), (-0.47 * wide + 0.03, tall, t), 0.012, n=1)
                    )
                    m.add(
                        rounded((0.47 * wide - 0.03, 0.0, -t), (0.47 * wide, tall, t), 0.012, n=1)
                    )
                    m.add(
                        rounded((-0.47 * wide, tall - 0.03, -t), (0.47 * wide, tall, t), 0.012, n=1)
                    )
                    m.add(rounded((-0.47 * wide, 0.0, -t), (0.47 * wide, 0.03, t), 0.012, n=1))
                m.add(
                    slab((-0.46 * wide, 0.015, -0.003), (0.46 * wide, tall - 0.015, 0.003)),
                    of=cover,
                )
            case 2:
                for k in range(3):
                    y = tall * (0.1 + 0.3 * k)
                    m.add(
                        rounded(
                            (-0.45 * wide, y, -0.02),
                            (0.45 * wide, y + 0.26 * tall, 0.02),
                            0.018,
                            n=1,
                        ),
                        of=cover,
                    )
    if m.chance(0.6):
        for s in (-1.0, 1.0):
            x = s * (wide / 2 + 0.015)
            m.add(tube(bent([(s * wide * 0.3, seat - 0.065, 0.0), (x, seat - 0.06, 0.0), (x, seat + 0.2, 0.0)],
                0.03, n=3), 0.013, n=8), of=black)  # fmt: skip
            m.add(
                rounded(
                    (x - 0.032, seat + 0.19, -0.12), (x + 0.032, seat + 0.215, 0.14), 0.011, n=1
                ),
                of=black,
            )
