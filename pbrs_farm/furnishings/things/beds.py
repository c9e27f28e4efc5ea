"""Beds of the generated catalogue, with their linen; no effects."""

from __future__ import annotations

from itertools import product

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import BED
from pbrs_farm.core.frames import rotation_x
from pbrs_farm.dress.style import mix
from pbrs_farm.furnishings.things.bodies import bevelled
from pbrs_farm.furnishings.things.cloth import draped
from pbrs_farm.furnishings.things.joints import leg
from pbrs_farm.furnishings.things.maker import Maker, Size, family
from pbrs_farm.furnishings.things.materials import (
    BLACK_STEEL,
    BRASS,
    WHITE,
    WHITE_STEEL,
    glossy,
    plain,
)
from pbrs_farm.furnishings.things.outlines import bent

# fmt: off


def bed_of(m: Maker, w: float, d: float, h: float, n: int) -> None:
    """A bed w by d, its head h high.

    Frame, mattress, duvet, throw, pillows; n: how many sleep in it.
    """
    hw, hd = w / 2, d / 2
    frame = m.pick(
        m.timber, m.timber, m.dark_timber, WHITE, glossy("paint", m.paint(), 0.4), m.cloth()
    )
    head = m.pick("panel", "slats", "soft", "channels", "buttons", "metal", "boards", "low")
    bar = m.pick(BLACK_STEEL, WHITE_STEEL, BRASS)
    body = bar if head == "metal" else frame
    under = m.pick("legs", "legs", "box", "drawers") if head != "metal" else "legs"
    side, rest = m.uniform(0.26, 0.34), m.uniform(0.16, 0.22)
    low = side - 0.14 if under == "legs" else 0.03
    top = side - 0.04 + rest
    a, b = -hd + 0.07, hd
    # The frame: two sides, a foot, slats' board.
    with m.of(body):
        m.box(0.03, (low, side), (a - 0.01, b - 0.03), 0.004, left=-w / 2, mirrored="x")
        m.add(bevelled((-hw, low, b - 0.03),
            (hw, side + (0.12 if head == "metal" and m.chance(0.5) else 0.0), b), 0.004))
        m.box(w - 0.06, 0.04, (a, b - 0.03), on=side - 0.09)
        if under == "legs":
            for x, z in product((-hw + 0.05, hw - 0.05), (a + 0.03, b - 0.05)):
                leg(m, m.pick("square", "square", "tapered") if head != "metal" else "round",
                    (x, z), (x, z), low + 0.001, 0.055 if head != "metal" else 0.035, body)
        if under != "legs":
            m.box(w - 0.08, low + 0.001, (a, b - 0.04))
        if under == "drawers":
            for k in range(2):
                m.box(0.013, (low + 0.03, side - 0.03), (a + 0.08 + k * (d - 0.2) / 2,
                    a + 0.06 + (k + 1) * (d - 0.2) / 2), 0.002, left=hw - 0.001)
    # The head.
    match head:
        case "panel" | "low":
            m.box(w, (low, h), (-hd + 0.02, a), 0.006, of=frame)
        case "boards":
            with m.of(frame):
                for k in range(4):
                    m.box(w, (side - 0.1 + k * (h - side + 0.1) / 4,
                        side - 0.1 + (k + 1) * (h - side + 0.1) / 4 - 0.012),
                        (-hd + 0.03, a - 0.005), 0.004)
                m.box(0.06, h, 0.025, 0.003, left=-w / 2, against=-hd + 0.005, mirrored="x")
        case "slats":
            with m.of(frame):
                m.box(0.05, h, (-hd + 0.02, a), 0.004, left=-w / 2, mirrored="x")
                m.box(w - 0.1, 0.07, (-hd + 0.025, a - 0.005), 0.004, on=h - 0.08)
                m.box(w - 0.1, 0.06, (-hd + 0.025, a - 0.005), 0.004, on=side)
                n_slats = round(w / 0.13)
                for k in range(n_slats):
                    m.box((-hw + 0.06 + (w - 0.12) * (k + 0.25) / n_slats,
                        -hw + 0.06 + (w - 0.12) * (k + 0.75) / n_slats), (side + 0.06, h - 0.08),
                        (-hd + 0.035, a - 0.012), 0.002)
        case "soft" | "channels" | "buttons":
            with m.of(frame if head == "soft" else m.cloth()):
                if head == "channels":
                    n_slats = round(w / 0.14)
                    for k in range(n_slats):
                        m.rounded((-hw + w * k / n_slats + 0.001,
                            -hw + w * (k + 1) / n_slats - 0.001), (low, h), (-hd, a + 0.02), 0.04,
                            n=1)
                else:
                    m.rounded(w, (low, h), (-hd, a + 0.01), 0.03)
                    for k, j in product(range(round(w / 0.22)), range(2)):
                        if head == "buttons":
                            m.sphere((-hw + w * (k + 0.5) / round(w / 0.22), h - 0.14 - 0.2 * j,
                                a + 0.008), 0.012, n=6)
        case "metal":
            with m.of(bar):
                r = 0.016
                m.tube(bent([(-hw + r, 0.0, -hd + 0.03), (-hw + r, h - r, -hd + 0.03),
                    (hw - r, h - r, -hd + 0.03), (hw - r, 0.0, -hd + 0.03)], m.pick(0.05, 0.25),
                    n=6), r, n=10)
                m.rod((-hw + r, hw - r), side + 0.12, -hd + 0.03, 0.01)
                n_slats = round(w / 0.16)
                for k in range(1, n_slats):
                    m.rod(-hw + w * k / n_slats, (side + 0.12, h - 2.5 * r), -hd + 0.03, 0.006, n=6)
    # The mattress, and linen on it.
    linen = mix((0.91, 0.9, 0.88), m.textile(3), m.pick(0.0, 0.3, 0.8))
    m.rounded(w - 0.07, (side - 0.05, top), (a + 0.012, b - 0.035), 0.04, n=1,
        of=plain("mattress fabric", (0.9, 0.89, 0.86), 0.95))
    duvet, has_throw, p = plain("fabric duvet", linen, 0.95), m.chance(0.5), m.uniform(0.42, 0.5)
    # From below the pillows to the foot, over both sides.
    long = d - 0.07 - 0.05 - p + 0.06
    if m.chance(0.86):
        m.add(draped(w - 0.1, long, m.uniform(0.13, 0.22), m.uniform(0.035, 0.06),
            folds=m.uniform(0.012, 0.028), wave=m.uniform(0.7, 1.3), n=10),
            at=(0.0, top + 0.03, a + p - 0.03 + long / 2), of=duvet)
    if has_throw:
        m.add(draped(w - 0.06, 0.55, 0.24, 0.014, folds=0.014, wave=1.2, n=7),
            at=(0.0, top + 0.075, b - 0.38), of=plain("fabric throw",
            m.style.accent if m.chance(0.4) else m.textile(), 0.95))
    slip = plain("fabric pillow", mix(linen, (0.92, 0.91, 0.89), m.pick(0.2, 0.6, 1.0)), 0.95)
    pw, ph = (w - 0.16) / n - 0.04, m.uniform(0.12, 0.16)
    for k in range(n):
        m.bulged((min(pw, 0.75), ph, p - 0.06), n=7, bulge=2.6, turn=rotation_x(0.12),
            at=((k - (n - 1) / 2) * (w - 0.12) / n, top + 0.45 * ph, a + p * 0.5), of=slip)
    # Some have a second row against the head.
    for k in range(n) if h > top + 0.3 and m.chance(0.35) else ():
        m.bulged((min(pw, 0.7), ph, p - 0.04), n=6, bulge=2.6, turn=rotation_x(1.15),
            at=((k - (n - 1) / 2) * (w - 0.12) / n, top + 0.5 * p - 0.02, a + 0.11), of=slip)


@family(group="bed", nyu40=BED, place=Place.FLOOR, called="bed", variants=36,
    size=lambda m: (m.pick(1.45, 1.65, 1.65, 1.85), m.pick(2.08, 2.12, 2.16),
    m.pick(0.85, 0.95, 1.05, 1.15)))
def double_bed(m: Maker, size: Size) -> None:
    """A bed for two with mattress, duvet and two pillows; some have a throw."""
    bed_of(m, size[0], size[1], size[2], 2)


@family(group="bed", nyu40=BED, place=Place.FLOOR, called="single_bed", variants=24,
    size=lambda m: (m.pick(0.86, 0.95, 0.95, 1.05), m.pick(2.04, 2.08, 2.12),
    m.pick(0.7, 0.8, 0.9, 1.0)))
def single_bed(m: Maker, size: Size) -> None:
    """A bed for one with mattress, duvet and a pillow."""
    bed_of(m, size[0], size[1], size[2], 1)
