"""Tables, desks, nightstands, television benches and screens of the generated catalogue; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated

from numpy import pi

from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import (
    BLACK_GLASS,
    BLACK_STEEL,
    BRASS,
    RUBBER,
    STEEL,
    WHITE,
    WHITE_STEEL,
    glass,
    glossy,
)
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.joints import Inside, Look, fronts_of, hollow
from pbrs_farm.furnishings.things.maker import Maker, Size
from pbrs_farm.furnishings.things.parameters import Choice, Front, Legs, Pull, Range
from pbrs_farm.furnishings.things.shapes import on_side, row
from pbrs_farm.geometry.outlines import bent, oval, polar, rect, rings


# fmt: off
def under_top(m: Maker, kind: str, w: float, d: float, high: float, material: Material,
    leg_kind: str, column: bool = True) -> None:
    """Support for a top w by d at `high`.

    Four legs with or without rails, frames, trestles, one foot, crossed legs, panels.
    """
    hw, hd = w / 2, d / 2
    match kind:
        case "legs" | "rails":
            m.legs(leg_kind, w, d, high, 0.055, 0.07 if leg_kind in ("tapered",
                "hairpin") else 0.035, 0.03 if leg_kind == "tapered" else 0.0, of=material)
            if kind == "rails":
                with m.of(material):
                    m.box(w - 0.08, (high - 0.085, high), 0.02, 0.002, against=0.045 - d / 2,
                        mirrored="z")
                    m.box(0.02, (high - 0.085, high), d - 0.13, 0.002, left=0.045 - w / 2,
                        mirrored="x")
        case "frames":
            with m.of(material):
                for s in (-1.0, 1.0):
                    x = s * (hw - 0.16)
                    m.box(0.06, high, 0.04, 0.002, x=x, against=0.03 - d / 2, mirrored="z")
                    m.box(0.06, 0.03, d - 0.14, 0.002, x=x)
                    m.box(0.06, (high - 0.03, high), d - 0.14, 0.002, x=x)
        case "crossed":
            with m.of(material):
                for s in (-1.0, 1.0):
                    x = s * (hw - 0.2)
                    m.square_tube((x, 0.012, -hd + 0.06), (x, high - 0.012, hd - 0.06), 0.07, 0.035)
                    m.square_tube((x + s * 0.036, 0.012, hd - 0.06),
                        (x + s * 0.036, high - 0.012, -hd + 0.06), 0.07, 0.035)
                m.box(w - 0.4, 0.06, 0.04, 0.003, on=high / 2 - 0.03)
        case "trestles":
            with m.of(material):
                for s in (-1.0, 1.0):
                    x = s * (hw - 0.22)
                    for e, z in product((-1.0, 1.0), (-hd + 0.06, hd - 0.06)):
                        m.square_tube((x + e * 0.14, 0.008, z), (x + e * 0.03, high - 0.02, z),
                            0.03, 0.04)
                    m.box(0.1, (high - 0.05, high), d - 0.06, 0.003, x=x)
                    m.box(0.22, (0.2, 0.235), 0.02, 0.002, x=x, against=0.05 - d / 2, mirrored="z")
        case "foot":
            with m.of(material):
                r = 0.34 * min(w, d)
                if column:
                    m.turned([(r, 0.0), (r, 0.012), (r * 0.3, 0.04), (0.045, 0.09),
                        (0.04, high - 0.06), (r * 0.4, high - 0.005), (r * 0.4, high)], n=28)
                else:
                    m.turned([(0.05, 0.12), (0.035, 0.25), (0.06, 0.4), (0.045, high - 0.03),
                        (0.1, high)], n=18)
                    for k in range(4):
                        m.tube(bent([(0.0, 0.2, 0.0), polar(0.5 * r, 0.16, k * pi / 2 + pi / 4),
                            polar(1.2 * r, 0.02, k * pi / 2 + pi / 4)], 0.1, n=3), 0.028, end=0.018)
        case "panels":
            with m.of(material):
                m.box(0.03, high, d - 0.04, 0.002, left=0.02 - w / 2, mirrored="x")
                m.box(w - 0.1, (high - 0.3, high), 0.024, 0.002)


def top_of(m: Maker, kind: str, w: float, d: float, low: float, high: float,
    material: Material) -> None:
    """A top w by d between low and high: rectangle, round corners, oval, or boards side by side."""
    with m.of(material):
        match kind:
            case "rect":
                m.board(w, d, low, high, 0.004, 0.003, n=1)
            case "round_rect":
                m.board(w, d, low, high, 0.08, 0.006)
            case "oval":
                m.disc(w, d, low, high, 0.006, n=40, power=2.4)
            case "round":
                m.disc(w, d, low, high, 0.006, n=40)
            case "boards":
                for plank in row(-d / 2, d / 2, 5, gap=0.001):
                    m.box(w, (low, high), plank, 0.003)


@dataclass(frozen=True, slots=True)
class DiningTable:
    """Parameters of a dining table."""

    top: Annotated[str, Choice("rect", "round_rect", "round", "oval", "boards")]
    under: Annotated[str, Choice("legs", "rails", "frames", "crossed", "trestles", "foot",
        "panels")]
    legs: Legs
    top_m: Annotated[float, Range(0.01, 0.1)]  # thickness
    top_material: Material
    frame: Material
    column: bool  # a foot in one piece instead of four feet


def draw_dining_table(m: Maker, size: Size) -> DiningTable:
    """Draw a dining table's parameters."""
    w, d, _h = size
    if w == d:
        top = m.pick("round", "round", "rect", "round_rect")
    else:
        top = m.pick("rect", "rect", "boards", "round_rect", "oval")
    t = m.pick(0.02, 0.025, 0.03, 0.04)
    if top in ("round", "oval"):
        under = m.pick("foot", "legs", "legs")
    elif w > 1.1:
        under = m.pick("legs", "rails", "rails", "frames", "crossed", "trestles")
    else:
        under = m.pick("rails", "legs", "foot")
    body = m.finish()
    frame = body if under == "rails" else m.pick(body, body, BLACK_STEEL, m.metal, WHITE)
    if under == "legs":
        legs = m.pick("square", "tapered", "turned", "round", "hairpin")
    else:
        legs = m.pick("square", "square", "turned", "tapered")
    if under == "foot":
        material = m.pick(body, glossy("stone", (0.88, 0.87, 0.84), 0.25), body)
    else:
        material = m.pick(body, body, body, m.timber)
    column = under != "foot" or m.chance(0.5)
    return DiningTable(top, under, legs, t, material, frame, column)


@catalogued(draw=draw_dining_table)
def dining_table(m: Maker, size: Size, p: DiningTable) -> None:
    """A table for two to eight: square, long, round or oval on legs, frames, trestles or one foot."""
    w, d, h = size
    inset = 0.72 if p.top in ("round", "oval") else 1.0
    low = h - p.top_m
    top_of(m, p.top, w, d, low, h, p.top_material)
    under_top(m, p.under, w * inset, d * inset, low + 0.001, p.frame, p.legs, p.column)


@catalogued()
def coffee_table(m: Maker, size: Size) -> None:
    """A low table before a sofa.

    On legs, a shelf below, drawers, a drum, two that nest, a top of glass.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    form = m.weighted(0.4, 0.2, 0.14, 0.12, 0.14)
    body = m.finish()
    top = (m.pick("rect", "round_rect",
        "boards") if abs(w - d) > 0.05 and m.chance(0.7) else m.pick("oval", "oval", "round_rect"))
    t = m.pick(0.018, 0.025, 0.035)
    match form:
        case 0:  # a top on legs
            glassy = m.chance(0.2)
            top_of(m, top, w, d, h - t, h, glass((0.85, 0.93, 0.92),
                0.3) if glassy else m.pick(body, body, body, glossy("stone", (0.86, 0.85, 0.82),
                0.25)))
            kind = m.pick("legs", "legs", "frames") if top not in ("oval", "round") else "legs"
            under_top(m, kind, w * (0.72 if top == "oval" else 1.0),
                d * (0.72 if top == "oval" else 1.0), h - t + 0.001,
                m.pick(body, BLACK_STEEL, m.metal), m.pick("tapered", "hairpin", "round", "square"))
            if kind == "legs" and top != "oval" and m.chance(0.4):
                m.board(w - 0.16, d - 0.16, 0.14, 0.158, 0.01, 0.003, of=body)
        case 1:  # drawers or niches below the top
            look = Look("flat", m.pick(body, WHITE), body, body,
                m.pick("knob", "bar", "edge", "disc"), m.metal)
            top_of(m, "rect", w, d, h - t, h, body)
            if m.chance(0.6):
                hollow(m, (-hw + 0.02, hw - 0.02), (h - t - 0.16, h - t), (-hd + 0.02, hd - 0.045),
                    0.016, body)
                fronts_of(m, look, (-hw + 0.02, hw - 0.02), (h - t - 0.16, h - t - 0.002),
                    hd - 0.045, [("flap",)] * m.pick(1, 2), False, Inside(-hd + 0.028))
                m.legs(m.pick("tapered", "square", "round"), w, d, h - t - 0.158, 0.05, 0.06,
                    of=body)
            else:
                m.box(0.025, h - t, d - 0.02, 0.002, left=0.01 - w / 2, mirrored="x", of=body)
                m.box(w - 0.07, (0.08, 0.1), d - 0.04, of=body)
                if m.chance(0.5):
                    m.box(0.02, (0.1, h - t), d - 0.06, of=body)
        case 2:  # a drum, ribbed or plain
            m.loft(rings(oval, [(w * 0.9, d * 0.9, 0.0), (w * 0.94, d * 0.94, h * 0.5),
                (w * 0.9, d * 0.9, h - t)], n=36), of=body)
            m.disc(w, d, h - t, h, 0.006, n=40, of=m.pick(body, m.timber,
                glossy("stone", (0.86, 0.85, 0.82), 0.25)))
            for k in range(24) if m.chance(0.5) else ():
                m.tube([polar((0.47 * w, 0.47 * d), 0.0, k * pi / 12),
                    polar((0.47 * w, 0.47 * d), h - t, k * pi / 12)], 0.018, n=6, of=body)
        case 3:  # two that nest
            with m.moved(at=(-0.12 * w, 0.0, -0.08 * d)):
                m.disc(w * 0.76, d * 0.84, h - t, h, 0.005, n=36, of=body)
                m.legs("round", w * 0.6, d * 0.62, h - t + 0.001, 0.024, 0.0,
                    of=m.pick(BLACK_STEEL, m.metal, body))
            with m.moved(at=(0.27 * w, 0.0, 0.19 * d)):
                m.disc(w * 0.46, d * 0.62, h * 0.72 - t, h * 0.72, 0.005, n=36,
                    of=m.pick(body, WHITE, m.timber))
                m.legs("round", w * 0.34, d * 0.44, h * 0.72 - t + 0.001, 0.024, 0.0,
                    of=m.pick(BLACK_STEEL, m.metal, body))
        case 4:  # a tray on crossed legs, a block
            if m.chance(0.5):
                under_top(m, "crossed", w, d, h - 0.02, body, "square")
                m.board(w, d, h - 0.04, h - 0.02, 0.03, 0.004, of=body)
                m.hoop(rect(w - 0.02, d - 0.02, 0.03, n=3), h - 0.01, 0.01, of=body)
            else:
                m.box(w, (0.05, h), d, 0.006, of=body)
                m.box(w - 0.12, 0.05, d - 0.12, of=RUBBER)


@dataclass(frozen=True, slots=True)
class Desk:
    """Parameters of a desk."""

    form: Annotated[str, Choice("legs", "drawers_left", "drawers_right", "drawers_both", "flaps",
        "shelf")]
    body: Material
    front: Material
    front_kind: Front
    pull: Pull
    pull_material: Material
    top: Annotated[str, Choice("rect", "round_rect", "boards")]
    top_m: Annotated[float, Range(0.01, 0.1)]  # thickness
    top_material: Material
    under: Annotated[str, Choice("legs", "rails", "frames", "trestles", "crossed")]  # of form legs
    legs: tuple[Legs, ...]  # behind and in front, where drawers do not carry the top
    leg_materials: tuple[Material, ...]
    columns: tuple[Annotated[str, Choice("low_drawers", "drawers", "low_door", "door")], ...]
    flaps: Annotated[int, Range(1, 4)]  # side by side below the whole top
    back_panel: bool


_DESK_COLUMNS = {"low_drawers": ("low", "drawer", "drawer"),
    "drawers": ("drawer", "drawer", "drawer"), "low_door": ("low", "door"), "door": ("door",)}


def draw_desk(m: Maker, size: Size) -> Desk:
    """Draw a desk's parameters."""
    body = m.finish(whites=2)
    kind, front = m.pick("flat", "flat", "raised", "shaker"), m.pick(body, body, WHITE)
    pull = m.pick("knob", "bar", "edge", "disc", "square", "bow")
    t, number = m.pick(0.02, 0.025, 0.03), m.weighted(0.25, 0.25, 0.15, 0.2, 0.15)
    top, top_material = m.pick("rect", "rect", "round_rect", "boards"), m.pick(body, m.timber)
    p = Desk("shelf", body, front, kind, pull, m.metal, top, t, top_material, "legs",
        ("square", "square"), (body, body), ("drawers", "drawers"), 1, False)
    match number:
        case 0:
            under = m.pick("legs", "rails", "frames", "trestles", "crossed")
            material = m.pick(body, BLACK_STEEL, WHITE_STEEL, m.metal)
            legs = m.pick("square", "tapered", "hairpin", "round")
            return replace(p, form="legs", under=under, legs=(legs, legs),
                leg_materials=(material, material))
        case 1:
            form = m.pick("drawers_left", "drawers_right")
            column = m.pick(*_DESK_COLUMNS)
            rows = [(m.pick("square", "square", "round"), m.pick(body, BLACK_STEEL)) for _ in "ab"]
            kinds, materials = zip(*rows, strict=True)
            return replace(p, form=form, columns=(column, column), legs=kinds,
                leg_materials=materials, back_panel=m.chance(0.6))
        case 2:
            columns = (m.pick(*_DESK_COLUMNS), m.pick(*_DESK_COLUMNS))
            return replace(p, form="drawers_both", columns=columns, back_panel=m.chance(0.6))
        case 3:
            n = m.pick(1, 2, 3)
            legs = m.pick("tapered", "square", "turned", "round", "hairpin")
            material = m.pick(body, body, BLACK_STEEL)
            return replace(p, form="flaps", flaps=n, legs=(legs, legs),
                leg_materials=(material, material))
    return p


@catalogued(draw=draw_desk)
def desk(m: Maker, size: Size, p: Desk) -> None:
    """A desk on legs, with drawers at one side or both, with flaps below the top, or with a shelf."""
    w, d, h = size
    hw, hd, low = w / 2, d / 2, h - p.top_m
    look = Look(p.front_kind, p.front, p.body, p.body, p.pull, p.pull_material)
    top_of(m, p.top, w, d, low, h, p.top_material)
    y = low + 0.001
    match p.form:
        case "legs":
            under_top(m, p.under, w, d, y, p.leg_materials[0], p.legs[0])
        case "drawers_left" | "drawers_right" | "drawers_both":
            desk_drawers(m, size, p, look)
            if p.back_panel:
                m.box(w - 0.12, (low - 0.3, y), 0.015, against=-hd + 0.03, of=p.body)
        case "flaps":
            x = (-hw + 0.02, hw - 0.02)
            hollow(m, x, (low - 0.11, y), (-hd + 0.02, hd - 0.05), 0.012, p.body)
            fronts_of(m, look, x, (low - 0.11, low - 0.002), hd - 0.05, [("flap",)] * p.flaps,
                False, Inside(-hd + 0.028))
            m.legs(p.legs[0], w, d, low - 0.108, 0.05, 0.06, of=p.leg_materials[0])
        case "shelf":
            under_top(m, "panels", w, d, y, p.body, "square")
            m.box(w - 0.1, 0.015, d - 0.08, on=low - 0.14, of=p.body)


def desk_drawers(m: Maker, size: Size, p: Desk, look: Look) -> None:
    """A column of drawers at one side and two legs at the other, or a column at both sides."""
    w, d, h = size
    hw, hd, low = w / 2, d / 2, h - p.top_m
    is_single = p.form != "drawers_both"
    sides = (-1.0 if p.form == "drawers_left" else 1.0,) if is_single else (-1.0, 1.0)
    for s, column in zip(sides, p.columns, strict=False):
        a, b = x = on_side(s, hw - 0.01, hw - 0.01 - (0.4 if is_single else 0.32))
        hollow(m, x, (0.05, low + 0.001), (-hd + 0.02, hd - 0.05), 0.016, p.body)
        m.box((a + 0.02, b - 0.02), 0.05, (-hd + 0.04, hd - 0.09), of=p.body)
        fronts_of(m, look, x, (0.06, low - 0.003), hd - 0.05, [_DESK_COLUMNS[column]], False,
            Inside(-hd + 0.028))
        if is_single:
            foot = -s * (hw - 0.05)
            for z, kind, of in zip((-hd + 0.05, hd - 0.05), p.legs, p.leg_materials, strict=True):
                m.leg(kind, (foot, z), low + 0.001, 0.045, of=of)


@catalogued()
def nightstand(m: Maker, size: Size) -> None:
    """A nightstand.

    Drawers, a niche, a door, on legs or a plinth, a round one, a stool, of wire.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    body = m.finish()
    look = Look(m.pick("flat", "flat", "shaker", "raised", "grooved"), m.pick(body, body, WHITE),
        body, body, m.pick("knob", "bar", "edge", "disc", "ring", "cup", "bow"), m.metal)
    form = m.weighted(0.42, 0.2, 0.12, 0.12, 0.14)
    t = m.pick(0.016, 0.02, 0.025)
    if form < 2:
        legs = m.pick("tapered", "square", "round", "bun", "plinth", "hairpin")
        low = (0.04 if legs == "plinth" else 0.06 if legs == "bun" else min(m.uniform(0.1, 0.22),
            0.4 * h))
        if legs == "plinth":
            m.box(w - 0.02, low, (-hd, hd - 0.06), of=body)
        else:
            m.legs(legs, w, d - 0.03, low + 0.001, 0.045, 0.045, 0.02 if legs == "tapered" else 0.0,
                of=m.pick(body, body, BLACK_STEEL, m.metal))
        m.board(w, d - 0.012, h - t, h, 0.006, 0.004, z=-0.006, n=2, of=body)
        if form == 0:
            hollow(m, (-hw + 0.005, hw - 0.005), (low, h - t), (-hd, hd - 0.05), 0.016, body)
            fronts_of(m, look, (-hw + 0.005, hw - 0.005), (low, h - t - 0.002), hd - 0.05,
                [m.pick(("drawer",), ("drawer", "drawer"), ("drawer", "drawer", "drawer"),
                ("door",), ("low", "door"))], False, Inside(-hd + 0.008))
        else:
            # A niche over a drawer, or under it.
            mid, is_low = low + (h - low) * m.uniform(0.4, 0.55), m.chance(0.5)
            with m.of(body):
                m.box(w - 0.01, (low, h - t), 0.008, against=-hd)
                m.box(0.016, (low, h - t), (-hd + 0.008, hd - 0.045), left=0.005 - w / 2,
                    mirrored="x")
                for y in (low, mid):
                    m.box(w - 0.042, 0.016, (-hd + 0.008, hd - 0.05), on=y)
            fronts_of(m, look, (-hw + 0.006, hw - 0.006), (low,
                mid + 0.008) if is_low else (mid + 0.008, h - t - 0.002), hd - 0.045, [("drawer",)],
                False, Inside(-hd + 0.008))
    match form:
        case 2:  # round, with a rim
            m.disc(w, d, h - t, h, 0.004, of=body)
            if m.chance(0.5):
                under_top(m, "foot", w, d, h - t + 0.001, m.pick(body, BLACK_STEEL, m.metal),
                    "round", m.chance(0.5))
            else:
                m.legs("tapered", w * 0.8, d * 0.8, h - t + 0.001, 0.03, 0.06, 0.04, of=body)
                m.disc(w * 0.7, d * 0.7, h * 0.4, h * 0.4 + 0.014, 0.003, n=28, of=body)
        case 3:  # a cube of boards, open to the front
            with m.of(body):
                for y in (0.0, h - 0.02):
                    m.box(w, 0.02, d, 0.002, on=y)
                m.box(0.02, (0.0201, h - 0.0201), d, 0.002, left=-w / 2, mirrored="x")
                for k in range(m.pick(1, 2)):
                    m.box(w - 0.04, 0.016, d - 0.02, on=0.0 + h * (k + 1) / 3)
                if m.chance(0.6):
                    m.box(w - 0.04, (0.02, h - 0.02), 0.008, against=-hd)
        case 4:  # a frame of metal with two boards
            bar = m.pick(BLACK_STEEL, m.metal, WHITE_STEEL, BRASS)
            with m.of(bar):
                m.box(0.016, h - 0.016, 0.016, 0.001, x=-hw + 0.008, z=-hd + 0.008, mirrored="xz")
                for y in (0.12, h - 0.032):
                    m.hoop(rect(w - 0.016, d - 0.016, 0.005, n=1), y, 0.007, n=4)
            m.board(w, d, h - 0.016, h, 0.004, 0.003, n=1, of=m.pick(m.timber, body,
                glossy("stone", (0.86, 0.85, 0.82), 0.25)))
            m.box(w - 0.034, (0.127, 0.139), d - 0.02, of=m.pick(m.timber, body))


@catalogued()
def tv_bench(m: Maker, size: Size) -> None:
    """A low bench for a television.

    Doors, flaps, drawers and niches in a row, on legs, a plinth, or open.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    body = m.finish(whites=2)
    look = Look(m.pick("flat", "flat", "shaker", "grooved", "glazed"),
        m.pick(body, body, WHITE, m.timber), body, body, m.pick("knob", "bar", "edge", "disc",
        "none", "none", "square"), m.metal)
    legs = m.pick("tapered", "square", "round", "hairpin", "plinth", "plinth")
    low, t = 0.05 if legs == "plinth" else m.uniform(0.1, 0.18), m.pick(0.018, 0.025, 0.03)
    if legs == "plinth":
        m.box(w - 0.04, low, (-hd + 0.02, hd - 0.07), of=body)
    else:
        m.legs(legs, w, d - 0.03, low + 0.001, 0.05, 0.08, 0.03 if legs == "tapered" else 0.0,
            of=m.pick(body, BLACK_STEEL, m.metal))
    n = m.pick(2, 3, 3, 4)
    open = m.pick((), (0,), (1,), (n - 1,), (0, 1))
    f = hd - 0.05
    with m.of(body):
        m.board(w, d - 0.02, h - t, h, 0.004, 0.003, z=-0.01, n=1)
        m.box(w - 0.006, (low, h - t), 0.008, against=-hd)
        m.box(w - 0.006, 0.018, (-hd + 0.008, f), on=low)
        for k in range(n + 1):
            x = -hw + 0.003 + k * (w - 0.024) / n
            m.box(0.018, (low + 0.018, h - t), (-hd + 0.008, f), left=x)
    for k in range(n):
        a, b = -hw + 0.003 + k * (w - 0.006) / n, -hw + 0.003 + (k + 1) * (w - 0.006) / n
        if k in open:
            m.box((a + 0.012, b - 0.012), 0.016, (-hd + 0.01, f - 0.01), on=(low + h) / 2 - 0.008,
                of=body)
        else:
            fronts_of(m, look, (a, b), (low, h - t - 0.002), f,
                [m.pick(("door",), ("drawer", "drawer"), ("flap",), ("drawer",))], False,
                Inside(-hd + 0.008))


@catalogued()
def screen(m: Maker, size: Size) -> None:
    """A television.

    A thin screen on two feet, one foot, a bar or a plate; an old deep one is rare.
    """
    w, d, h = size
    hd = d / 2
    black = glossy("screen case", m.pick((0.05, 0.05, 0.055), (0.05, 0.05, 0.055),
        (0.35, 0.35, 0.36)), 0.35)
    low, form, edge = (h - (w - 0.02) * 0.5625 - 0.025, m.weighted(0.35, 0.25, 0.2, 0.2),
        m.pick(0.008, 0.012, 0.025))
    m.box(w, (low, h), 0.024, 0.003, of=black)
    m.box(0.72 * w, (low + 0.03, h - 0.1), 0.039, 0.012, against=-0.05, of=black)
    m.box(w - 2 * edge, (low + edge + 0.008, h - edge), (0.012, 0.0128), of=BLACK_GLASS)
    match form:
        case 0:  # two feet
            for x, s in product((-0.36 * w, 0.36 * w), (-1.0, 1.0)):
                m.tube([(x, low + 0.03, 0.0), (x, 0.006, s * (hd - 0.006))], 0.006,
                    of=m.pick(black, STEEL))
        case 1:  # one foot
            m.board(0.42 * w, d, 0.0, 0.012, 0.03, 0.003, of=m.pick(black, STEEL, BLACK_GLASS))
            m.box(0.1, (0.011, low + 0.1), 0.025, 0.003, against=-0.045, of=black)
        case 2:  # a bar
            m.tube(bent([(-0.22 * w, 0.008, hd - 0.008), (-0.22 * w, 0.008, -hd + 0.008),
                (0.22 * w, 0.008, -hd + 0.008), (0.22 * w, 0.008, hd - 0.008)], 0.04, n=4), 0.008,
                of=m.pick(STEEL, BLACK_STEEL))
            m.tube([(0.0, 0.008, -hd + 0.008), (0.0, low + 0.12, -0.03)], 0.014, n=10,
                of=m.pick(STEEL, BLACK_STEEL))
        case 3:  # a round plate
            m.disc(0.4 * w, d, 0.0, 0.014, 0.004, of=BLACK_GLASS)
            m.rod(0.0, (0.01, low + 0.08), -0.02, 0.022, n=12, of=STEEL)
