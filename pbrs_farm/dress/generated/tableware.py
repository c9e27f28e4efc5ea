"""Cups, plates, glasses, bowls, bottles, pots: profiles turned about an axis; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Material, Surface
from pbrs_farm.dress.generated.assembly import (
    Made,
    Part,
    any_colour,
    glass,
    made,
    metal,
    plain,
    transformed,
)
from pbrs_farm.dress.generated.turned import smooth, turned, vessel
from pbrs_farm.dress.style import Rgb, Style, shade
from pbrs_farm.geometry.solids import sphere

_FRUIT = ((0.72, 0.12, 0.1), (0.85, 0.45, 0.08), (0.88, 0.75, 0.15), (0.45, 0.62, 0.15))


def china(rng: np.random.Generator, style: Style) -> Material:
    """Glazed ceramic: white more often than coloured."""
    colour: Rgb = (0.9, 0.89, 0.86)
    if rng.random() < 0.45:
        colour = any_colour(rng, style)
    return plain("china", colour, float(rng.choice([0.12, 0.25])))


def cup(rng: np.random.Generator, style: Style) -> Made:
    """A mug or a cup with a handle."""
    tall, r = float(rng.uniform(0.075, 0.105)), float(rng.uniform(0.036, 0.044))
    foot = r * float(rng.uniform(0.65, 1.0))
    material = china(rng, style)
    # (radius, height): the foot, a rounded bottom, then straight sides; 3 mm of wall.
    body = vessel(
        [(0, 0), (foot, 0), (foot + 0.3 * (r - foot), 0.012), (r, 0.4 * tall), (r, tall)], 0.003
    )
    return made("cup", [(body, material), (_handle(r, tall), material)], group="cup")


def _handle(radius: float, tall: float) -> Surface:
    # A bent strip of six pieces, 8 mm wide, its ends inside the cup's side.
    t = np.linspace(-0.5, 0.5, 7) * np.pi
    reach, half = 0.026, tall * 0.3
    # The strip's middle line (radius, height): half an ellipse beside the cup.
    middle = np.stack([radius - 0.002 + reach * np.cos(t), tall * 0.52 + half * np.sin(t)], -1)
    outward = np.stack([np.cos(t), np.sin(t)], -1)
    points = []
    # Four corners a station, (depth across the strip, side along z), metres.
    for along, out in zip(middle, outward, strict=True):
        for depth, side in ((-0.003, -0.004), (0.003, -0.004), (0.003, 0.004), (-0.003, 0.004)):
            x, y = along + out * depth
            points.append((x, y, side))
    # The caps at both ends, then two triangles a side between neighbouring stations.
    faces = [(0, 2, 1), (0, 3, 2), (24, 25, 26), (24, 26, 27)]
    for k in range(6):
        for j in range(4):
            a, b = 4 * k + j, 4 * k + (j + 1) % 4
            faces += [(a, b, b + 4), (a, b + 4, a + 4)]
    return smooth("handle", np.array(points), np.array(faces, np.int32))


def glass_of_water(rng: np.random.Generator, style: Style) -> Made:
    """A tumbler, or a wine glass."""
    if rng.random() < 0.35:
        r, tall = float(rng.uniform(0.032, 0.04)), float(rng.uniform(0.17, 0.22))
        # (radius, height): foot, stem and bowl outside, and the bowl's inside down to the axis.
        outside = [(0, 0), (0.034, 0), (0.032, 0.003), (0.005, 0.008), (0.004, tall * 0.45),
                   (0.02, tall * 0.5), (r, tall * 0.68), (r * 0.85, tall)]  # fmt: skip
        inside = [
            (r * 0.85 - 0.0015, tall - 0.0005),
            (r - 0.0015, tall * 0.68),
            (0.018, tall * 0.52),
            (0, tall * 0.49),
        ]
        return made("wine_glass", [(turned(outside + inside), glass())], group="glass")
    r, tall = float(rng.uniform(0.03, 0.04)), float(rng.uniform(0.09, 0.14))
    body = vessel([(0, 0), (r * 0.85, 0), (r, tall)], 0.0025)
    return made("tumbler", [(body, glass())], group="glass")


def plates(rng: np.random.Generator, style: Style) -> Made:
    """A plate, or a few on top of each other."""
    return _pile(rng, style, int(rng.choice([1, 1, 2, 4, 6])))


def one_plate(rng: np.random.Generator, style: Style) -> Made:
    """A plate to eat from."""
    return _pile(rng, style, 1)


def _pile(rng: np.random.Generator, style: Style, n: int) -> Made:
    r, material = float(rng.uniform(0.1, 0.14)), china(rng, style)
    parts: list[Part] = []
    for k in range(n):
        # (radius, height): flat in the middle, then the rim; plates nest 6.3 mm apart.
        outside = [(0, 0), (r * 0.6, 0), (r * 0.72, 0.006), (r, 0.02)]
        inside = [(r - 0.002, 0.0225), (r * 0.7, 0.0095), (r * 0.6, 0.005), (0, 0.005)]
        body = turned(outside + inside, n=24 if n == 1 else 16)
        parts.append((transformed(body, np.eye(3), (0, 0.0063 * k, 0)), material))
    return made("plates" if n > 1 else "plate", parts, group="plate")


def bowl(rng: np.random.Generator, style: Style) -> Made:
    """A bowl, empty or with fruit."""
    r = float(rng.uniform(0.07, 0.15))
    tall = r * float(rng.uniform(0.45, 0.7))
    # (radius, height): a foot, then a curve that opens towards the rim.
    outside = [(0, 0), (r * 0.45, 0), (r * 0.47, 0.006), (r * 0.78, tall * 0.45), (r, tall)]
    wood = plain("wood bowl", style.wood.mean, 0.4)
    material = wood if rng.random() < 0.3 else china(rng, style)
    parts: list[Part] = [(vessel(outside, 0.005, n=20), material)]
    if r > 0.1 and rng.random() < 0.7:
        parts += _fruit_in(rng, r, tall)
    return made("bowl", parts, group="bowl")


def _fruit_in(rng: np.random.Generator, r: float, tall: float) -> list[Part]:
    parts: list[Part] = []
    # Apples and oranges in a ring that touch each other less than they look it, one on top.
    radius = min(0.036, r * 0.32)
    n = int(rng.integers(3, 6))
    spread = r * 0.78 - radius
    for k in range(n):
        angle = 2 * np.pi * k / n + float(rng.uniform(-0.15, 0.15))
        at = (spread * np.cos(angle), 0.012 + radius + tall * 0.3, spread * np.sin(angle))
        parts.append(_one_fruit(rng, radius, at))
    parts.append(_one_fruit(rng, radius, (0.0, 0.012 + tall * 0.3 + radius * 2.1, 0.0)))
    return parts


def _one_fruit(rng: np.random.Generator, radius: float, at: tuple[float, float, float]) -> Part:
    colour = shade(_FRUIT[int(rng.integers(len(_FRUIT)))], float(rng.uniform(0.85, 1.15)))
    ball = sphere(
        "fruit", np.asarray(at, np.float64), radius * float(rng.uniform(0.9, 1.05)), 0, n=10
    )
    return ball, plain("fruit", colour, 0.4)


def fruit(rng: np.random.Generator, style: Style) -> Made:
    """One to three apples, oranges or lemons side by side."""
    parts: list[Part] = []
    x = 0.0
    for _ in range(int(rng.integers(1, 4))):
        # Fruit lie in a row along x, 8 mm apart; x is the row's end so far.
        radius = float(rng.uniform(0.028, 0.04))
        x += radius
        z = float(rng.uniform(-0.02, 0.02))
        colour = shade(_FRUIT[int(rng.integers(len(_FRUIT)))], float(rng.uniform(0.85, 1.15)))
        ball = sphere("fruit", np.array([x, radius, z]), radius, 0, n=12)
        parts.append((ball, plain("fruit", colour, 0.4)))
        x += radius + 0.008
    return made("fruit", parts, group="fruit")


def bottle(rng: np.random.Generator, style: Style) -> Made:
    """A bottle of wine, oil or water with a label."""
    r, tall = float(rng.uniform(0.03, 0.041)), float(rng.uniform(0.22, 0.32))
    neck, shoulder = 0.013, tall * float(rng.uniform(0.55, 0.68))
    tints: tuple[Rgb, ...] = (
        (0.1, 0.2, 0.08),
        (0.3, 0.16, 0.06),
        (0.8, 0.85, 0.85),
        (0.25, 0.3, 0.1),
    )
    tint = tints[int(rng.integers(4))]
    body = plain("bottle", tint, 0.08)
    # (radius, height): body, shoulder, neck, and the ring at its mouth.
    outside = [(0, 0), (r, 0), (r, shoulder), (r * 0.75, shoulder + 0.03), (neck, shoulder + 0.06),
               (neck, tall - 0.012), (neck + 0.002, tall - 0.012), (neck + 0.002, tall), (0, tall)]  # fmt: skip
    # The label is a sleeve of paper round the body, 0.4 mm proud of the glass.
    low, high, inner, outer = shoulder * 0.25, shoulder * 0.8, r - 0.001, r + 0.0004
    label = turned([(inner, low), (outer, low), (outer, high), (inner, high), (inner, low)])
    paper = plain(
        "label", any_colour(rng, style) if rng.random() < 0.5 else (0.88, 0.86, 0.78), 0.7
    )
    return made("bottle", [(turned(outside), body), (label, paper)], group="bottle")


def jar(rng: np.random.Generator, style: Style) -> Made:
    """A jar with a lid: coffee, sugar, pasta."""
    r, tall = float(rng.uniform(0.035, 0.055)), float(rng.uniform(0.09, 0.2))
    side = china(rng, style) if rng.random() < 0.6 else plain("filled jar", _grain(rng), 0.15)
    lid = plain("wood lid", style.wood.mean, 0.5) if rng.random() < 0.5 else metal(style)
    # (radius, height) of body and lid; the lid begins 0.2 mm above the body.
    body = turned(
        [
            (0, 0),
            (r * 0.95, 0),
            (r, 0.006),
            (r, tall - 0.02),
            (r * 0.9, tall - 0.012),
            (0, tall - 0.012),
        ]
    )
    top = turned(
        [(0, tall - 0.0118), (r * 0.93, tall - 0.0118), (r * 0.93, tall), (0, tall + 0.001)]
    )
    return made("jar", [(body, side), (top, lid)], group="kitchen_tool")


def _grain(rng: np.random.Generator) -> Rgb:
    colours: tuple[Rgb, ...] = (
        (0.35, 0.2, 0.1),
        (0.85, 0.75, 0.5),
        (0.9, 0.88, 0.82),
        (0.6, 0.3, 0.12),
    )
    return colours[int(rng.integers(len(colours)))]


def mills(rng: np.random.Generator, style: Style) -> Made:
    """Salt and pepper."""
    parts: list[Part] = []
    for k, colour in enumerate((style.wood.dark, (0.85, 0.84, 0.8))):
        tall = 0.11
        # (radius, height): foot, waist, head, and the knob that is turned.
        profile = [
            (0, 0),
            (0.024, 0),
            (0.02, 0.03),
            (0.024, 0.07),
            (0.018, 0.082),
            (0.02, 0.1),
            (0.012, tall),
            (0, tall),
        ]
        body = turned(profile, n=12)
        parts.append((transformed(body, np.eye(3), (0.055 * k, 0, 0)), plain("mill", colour, 0.35)))
    return made("mills", parts, group="kitchen_tool")


def pot(rng: np.random.Generator, style: Style) -> Made:
    """A cooking pot with its lid, two handles."""
    r = float(rng.uniform(0.09, 0.13))
    tall = r * float(rng.uniform(0.8, 1.2))
    side = metal(style) if rng.random() < 0.6 else plain("enamel", any_colour(rng, style), 0.2)
    # (radius, height): body, rim, the lid's dome and its knob in one closed profile.
    body = turned([(0, 0), (r * 0.95, 0), (r, 0.01), (r, tall), (r * 1.03, tall), (r * 0.9, tall + 0.012),
                   (r * 0.2, tall + 0.025), (0.012, tall + 0.028), (0.018, tall + 0.045), (0, tall + 0.048)], n=20)  # fmt: skip
    grip = turned([(0, -0.006), (0.04, -0.006), (0.04, 0.006), (0, 0.006)], n=12)
    ears = [
        (
            transformed(grip, np.eye(3), (x * r, tall * 0.8, 0)),
            plain("grip", (0.08, 0.08, 0.08), 0.4),
        )
        for x in (-1.0, 1.0)
    ]
    return made("pot", [(body, side), *ears], group="pot_pan")


def pan(rng: np.random.Generator, style: Style) -> Made:
    """A frying pan, its handle to the front."""
    r = float(rng.uniform(0.11, 0.14))
    body = vessel([(0, 0), (r * 0.85, 0), (r, 0.045)], 0.003, n=20)
    black = plain("black iron", (0.06, 0.06, 0.065), 0.35)
    handle = turned([(0, 0), (0.011, 0.0), (0.009, 0.1), (0.012, 0.18), (0, 0.18)], n=8)
    # Lay the handle, turned about y, along +z, and then turn the pan's front a little.
    along: F64 = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    turn = rotation_y(float(rng.uniform(-0.5, 0.5)))
    part = transformed(transformed(handle, along, (0, 0.035, r * 0.97)), turn)
    return made("pan", [(body, black), (part, black)], group="pot_pan")


def kettle(rng: np.random.Generator, style: Style) -> Made:
    """A kettle with a lid and a spout."""
    r = 0.085
    side = metal(style) if rng.random() < 0.7 else plain("enamel", any_colour(rng, style), 0.2)
    # (radius, height): a body that narrows upwards, its lid and the lid's knob.
    body = turned(
        [
            (0, 0),
            (r, 0),
            (r, 0.02),
            (r * 0.75, 0.17),
            (r * 0.6, 0.185),
            (0.012, 0.19),
            (0.016, 0.21),
            (0, 0.213),
        ]
    )
    spout = turned([(0, 0), (0.02, 0), (0.011, 0.07), (0, 0.07)], n=8)
    # The spout leans forward by 0.9 rad (+x); the grip is a cup's handle, turned to the back.
    c, s = np.cos(0.9), np.sin(0.9)
    lean: F64 = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    grip = _handle(0.068, 0.17)
    back: F64 = np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]])
    black = plain("grip", (0.08, 0.08, 0.08), 0.4)
    parts = [
        (body, side),
        (transformed(spout, lean, (0.055, 0.1, 0)), side),
        (transformed(grip, back), black),
    ]
    return made("kettle", parts, group="kettle")
