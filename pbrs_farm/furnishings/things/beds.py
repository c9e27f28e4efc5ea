"""Beds of the generated catalogue, with their linen; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Annotated

from pbrs_farm.core.frames import rotation_x
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import mix
from pbrs_farm.dress.thing_materials import BLACK_STEEL, BRASS, WHITE, WHITE_STEEL, glossy, plain
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.cloth import draped
from pbrs_farm.furnishings.things.maker import Maker, Size
from pbrs_farm.furnishings.things.parameters import Choice, Legs, Range
from pbrs_farm.furnishings.things.shapes import Pair, row
from pbrs_farm.geometry.outlines import bent

# fmt: off
Metres = Annotated[float, Range(0.005, 2.0)]

_USUAL_DUVET = (0.17, 0.05, 0.02, 1.0)
_HEAD_M = 0.07  # depth of the head


@dataclass(frozen=True, slots=True)
class Bed:
    """Parameters of a bed. Its height is that of the head."""

    sleepers: Annotated[int, Range(1, 3)]
    head: Annotated[str, Choice("panel", "slats", "soft", "channels", "buttons", "metal", "boards",
        "low")]
    under: Annotated[str, Choice("legs", "box", "drawers")]
    frame: Material
    bar: Material  # of a head of metal, and of the frame below it
    padding: Material  # of a head with channels or buttons
    side_m: Annotated[float, Range(0.2, 0.6)]  # height of the frame's upper edge
    mattress_m: Annotated[float, Range(0.1, 0.4)]  # thickness above the frame
    high_foot: bool
    legs: tuple[Legs, ...]  # of each of the four
    bend_m: Annotated[float, Range(0.02, 0.4)]  # radius of the corners of a head of metal
    duvet: bool
    duvet_cloth: Material
    duvet_form: tuple[Metres, ...]  # drop at the sides, thickness, depth and length of folds
    throw: bool
    throw_cloth: Material
    pillow_cloth: Material
    pillow_m: tuple[Metres, ...]  # depth of the part of the bed that pillows take, their height
    second_row: bool  # of pillows, against the head
    mattress: bool = True  # with linen; without it the base shows
    slats: bool = False  # a base of slats instead of a board


def draw_bed(m: Maker, size: Size, sleepers: int) -> Bed:
    """Draw a bed's parameters."""
    frame = m.pick(m.timber, m.timber, m.dark_timber, WHITE, glossy("paint", m.paint(), 0.4),
        m.cloth())
    head = m.pick("panel", "slats", "soft", "channels", "buttons", "metal", "boards", "low")
    bar = m.pick(BLACK_STEEL, WHITE_STEEL, BRASS)
    under = m.pick("legs", "legs", "box", "drawers") if head != "metal" else "legs"
    side, mattress = m.uniform(0.26, 0.34), m.uniform(0.16, 0.22)
    high_foot = head == "metal" and m.chance(0.5)
    legs: tuple[Legs, ...] = ("round",) * 4 if head == "metal" else ("square",) * 4
    if under == "legs" and head != "metal":
        legs = tuple(m.pick("square", "square", "tapered") for _ in range(4))
    padding = m.cloth() if head in ("channels", "buttons") else frame
    bend = m.pick(0.05, 0.25) if head == "metal" else 0.05
    linen = mix((0.91, 0.9, 0.88), m.textile(3), m.pick(0.0, 0.3, 0.8))
    has_throw, pillow_depth, form = m.chance(0.5), m.uniform(0.42, 0.5), _USUAL_DUVET
    if has_duvet := m.chance(0.86):
        form = (m.uniform(0.13, 0.22), m.uniform(0.035, 0.06), m.uniform(0.012, 0.028),
            m.uniform(0.7, 1.3))
    throw = m.style.accent if not has_throw or m.chance(0.4) else m.textile()
    slip = mix(linen, (0.92, 0.91, 0.89), m.pick(0.2, 0.6, 1.0))
    pillow_height = m.uniform(0.12, 0.16)
    has_second_row = size[2] > side - 0.04 + mattress + 0.3 and m.chance(0.35)
    return Bed(sleepers, head, under, frame, bar, padding, side, mattress, high_foot, legs, bend,
        has_duvet, plain("fabric duvet", linen, 0.95), form, has_throw,
        plain("fabric throw", throw, 0.95), plain("fabric pillow", slip, 0.95),
        (pillow_depth, pillow_height), has_second_row)


def build_bed(m: Maker, size: Size, p: Bed) -> None:
    """Build a bed: frame, head, mattress and linen."""
    low = p.side_m - 0.14 if p.under == "legs" else 0.03
    with m.of(p.bar if p.head == "metal" else p.frame):
        bed_frame(m, size, p, low)
    bed_head(m, size, p, low)
    if p.mattress:
        bed_linen(m, size, p)


def bed_frame(m: Maker, size: Size, p: Bed, low: float) -> None:
    """Two sides and a foot from height `low`, the base, and what carries it."""
    w, d, _h = size
    side, back, front = p.side_m, -d / 2 + _HEAD_M, d / 2
    m.box(0.03, (low, side), (back - 0.01, front - 0.03), 0.004, left=-w / 2, mirrored="x")
    m.box(w, (low, side + (0.12 if p.high_foot else 0.0)), (front - 0.03, front), 0.004)
    if p.slats:
        for slat in row(back, front - 0.03, round(d / 0.13), gap=0.06):
            m.box(w - 0.06, 0.02, slat, on=side - 0.07)
    else:
        m.box(w - 0.06, 0.04, (back, front - 0.03), on=side - 0.09)
    if p.under == "legs":
        is_metal = p.head == "metal"
        body, thick = (p.bar, 0.035) if is_metal else (p.frame, 0.055)
        corners = product((-w / 2 + 0.05, w / 2 - 0.05), (back + 0.03, front - 0.05))
        for kind, (x, z) in zip(p.legs, corners, strict=True):
            m.leg(kind, (x, z), low + 0.001, thick, of=body)
    else:
        m.box(w - 0.08, low + 0.001, (back, front - 0.04))
    if p.under == "drawers":
        step = (d - 0.2) / 2
        for k in range(2):
            span = (back + 0.08 + k * step, back + 0.06 + (k + 1) * step)
            m.box(0.013, (low + 0.03, side - 0.03), span, 0.002, left=w / 2 - 0.001)


def bed_head(m: Maker, size: Size, p: Bed, low: float) -> None:
    """The head, from height `low` to the bed's height."""
    w, d, h = size
    back = -d / 2
    front = back + _HEAD_M
    match p.head:
        case "panel" | "low":
            m.box(w, (low, h), (back + 0.02, front), 0.006, of=p.frame)
        case "boards":
            with m.of(p.frame):
                for a, b in row(p.side_m - 0.1, h, 4):
                    m.box(w, (a, b - 0.012), (back + 0.03, front - 0.005), 0.004)
                m.box(0.06, h, 0.025, 0.003, left=-w / 2, against=back + 0.005, mirrored="x")
        case "slats":
            with m.of(p.frame):
                slatted_head(m, w, h, p.side_m, (back, front))
        case "soft" | "channels" | "buttons":
            with m.of(p.frame if p.head == "soft" else p.padding):
                padded_head(m, p.head, w, (low, h), (back, front))
        case "metal":
            with m.of(p.bar):
                metal_head(m, p, w, h, back + 0.03)


def slatted_head(m: Maker, w: float, h: float, low: float, z: Pair) -> None:
    """Upright slats between two posts and two rails."""
    m.box(0.05, h, (z[0] + 0.02, z[1]), 0.004, left=-w / 2, mirrored="x")
    for y in ((h - 0.08, h - 0.01), (low, low + 0.06)):
        m.box(w - 0.1, y, (z[0] + 0.025, z[1] - 0.005), 0.004)
    n = round(w / 0.13)
    for x in row(0.06 - w / 2, w / 2 - 0.06, n, gap=(w - 0.12) / n / 2):
        m.box(x, (low + 0.06, h - 0.08), (z[0] + 0.035, z[1] - 0.012), 0.002)


def padded_head(m: Maker, kind: str, w: float, y: Pair, z: Pair) -> None:
    """A padded head: plain, in upright channels, or with two rows of buttons."""
    if kind == "channels":
        for x in row(-w / 2, w / 2, round(w / 0.14), gap=0.002):
            m.rounded(x, y, (z[0], z[1] + 0.02), 0.04, n=1)
        return
    m.rounded(w, y, (z[0], z[1] + 0.01), 0.03)
    n = round(w / 0.22)
    for k, j in product(range(n), range(2)) if kind == "buttons" else ():
        m.sphere((-w / 2 + w * (k + 0.5) / n, y[1] - 0.14 - 0.2 * j, z[1] + 0.008), 0.012, n=6)


def metal_head(m: Maker, p: Bed, w: float, h: float, z: float) -> None:
    """A bent bar with upright ones below it."""
    r, rail = 0.016, p.side_m + 0.12
    x, top = w / 2 - r, h - r
    m.tube(bent([(-x, 0.0, z), (-x, top, z), (x, top, z), (x, 0.0, z)], p.bend_m, n=6), r, n=10)
    m.rod((-x, x), rail, z, 0.01)
    n = round(w / 0.16)
    for k in range(1, n):
        m.rod(-w / 2 + w * k / n, (rail, h - 2.5 * r), z, 0.006, n=6)


def bed_linen(m: Maker, size: Size, p: Bed) -> None:
    """Mattress, duvet, throw and pillows."""
    w, d, _h = size
    back, front, top = -d / 2 + _HEAD_M, d / 2, p.side_m - 0.04 + p.mattress_m
    depth, height = p.pillow_m
    m.rounded(w - 0.07, (p.side_m - 0.05, top), (back + 0.012, front - 0.035), 0.04, n=1,
        of=plain("mattress fabric", (0.9, 0.89, 0.86), 0.95))
    # The duvet hangs over both sides, from below the pillows to the foot.
    long = d - 0.07 - 0.05 - depth + 0.06
    if p.duvet:
        drop, thick, folds, wave = p.duvet_form
        m.add(draped(w - 0.1, long, drop, thick, folds=folds, wave=wave, n=10),
            at=(0.0, top + 0.03, back + depth - 0.03 + long / 2), of=p.duvet_cloth)
    if p.throw:
        m.add(draped(w - 0.06, 0.55, 0.24, 0.014, folds=0.014, wave=1.2, n=7),
            at=(0.0, top + 0.075, front - 0.38), of=p.throw_cloth)
    n = p.sleepers
    wide = (w - 0.16) / n - 0.04
    places = [(k - (n - 1) / 2) * (w - 0.12) / n for k in range(n)]
    with m.of(p.pillow_cloth):
        for x in places:
            m.bulged((min(wide, 0.75), height, depth - 0.06), n=7, bulge=2.6, turn=rotation_x(0.12),
                at=(x, top + 0.45 * height, back + depth * 0.5))
        for x in places if p.second_row else ():
            m.bulged((min(wide, 0.7), height, depth - 0.04), n=6, bulge=2.6, turn=rotation_x(1.15),
                at=(x, top + 0.5 * depth - 0.02, back + 0.11))


@catalogued(draw=lambda m, size: draw_bed(m, size, 2))
def double_bed(m: Maker, size: Size, p: Bed) -> None:
    """A bed for two with mattress, duvet and two pillows; some have a throw."""
    build_bed(m, size, p)


@catalogued(draw=lambda m, size: draw_bed(m, size, 1))
def single_bed(m: Maker, size: Size, p: Bed) -> None:
    """A bed for one with mattress, duvet and a pillow."""
    build_bed(m, size, p)
