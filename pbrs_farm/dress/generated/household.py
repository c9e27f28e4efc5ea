"""Boxes, baskets, vases, candles, frames, clocks, toys: what lies about in a home; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import BAG, BOX, CLOTHES, PICTURE
from pbrs_farm.core.house import Surface
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
from pbrs_farm.dress.generated.tableware import china
from pbrs_farm.dress.generated.turned import slab, turned, vessel
from pbrs_farm.dress.style import Rgb, Style, mix, shade
from pbrs_farm.geometry.solids import box


def storage_box(rng: np.random.Generator, style: Style) -> Made:
    """A box with a lid."""
    w, h, d = (
        float(v) for v in (rng.uniform(0.2, 0.36), rng.uniform(0.1, 0.2), rng.uniform(0.16, 0.28))
    )
    colour = any_colour(rng, style)
    # The lid takes the upper 22 % of the height and stands out by 4 mm all round.
    body = slab((-w / 2, 0, -d / 2), (w / 2, h * 0.78, d / 2))
    lid = slab((-w / 2 - 0.004, h * 0.78, -d / 2 - 0.004), (w / 2 + 0.004, h, d / 2 + 0.004))
    parts = [(body, plain("box", colour, 0.7)), (lid, plain("lid", shade(colour, 0.9), 0.7))]
    return made("storage_box", parts, group="box", nyu40=BOX)


def carton(rng: np.random.Generator, style: Style) -> Made:
    """A cardboard box with tape."""
    w, h, d = (
        float(v) for v in (rng.uniform(0.28, 0.5), rng.uniform(0.2, 0.36), rng.uniform(0.25, 0.38))
    )
    board = plain("cardboard", shade((0.66, 0.5, 0.33), float(rng.uniform(0.9, 1.1))), 0.85)
    tape = plain("tape", (0.72, 0.6, 0.42), 0.25)
    body = slab((-w / 2, 0, -d / 2), (w / 2, h, d / 2))
    # The tape runs over the top along x and 6 cm down both sides.
    strip = slab((-w / 2 - 0.0005, h - 0.06, -0.025), (w / 2 + 0.0005, h + 0.0005, 0.025))
    return made("carton", [(body, board), (strip, tape)], group="box", nyu40=BOX)


def cartons(rng: np.random.Generator, style: Style) -> Made:
    """Two or three cardboard boxes on top of each other."""
    parts: list[Part] = []
    y = 0.0
    for _ in range(int(rng.integers(2, 4))):
        piece, shape = carton(rng, style)
        # Move the whole carton; 0.3 mm between two keeps their faces apart.
        for s in shape.surfaces:
            moved = transformed(s, np.eye(3), (float(rng.uniform(-0.02, 0.02)), y, 0))
            parts.append((moved, shape.materials[s.material]))
        y += piece.size[2] + 0.0003
    return made("cartons", parts, group="box", nyu40=BOX)


def basket(rng: np.random.Generator, style: Style) -> Made:
    """A round or square basket, open at the top."""
    tall, r = float(rng.uniform(0.14, 0.26)), float(rng.uniform(0.12, 0.17))
    weave = mix((0.62, 0.47, 0.3), any_colour(rng, style), float(rng.choice([0.0, 0.2, 0.7])))
    # (radius, height): a side that swells upwards and draws in at the rim.
    outside = [(0, 0), (r * 0.85, 0), (r * 0.95, tall * 0.3), (r, tall * 0.7), (r * 0.98, tall)]
    return made(
        "basket", [(vessel(outside, 0.01, n=20), plain("wicker", weave, 0.9))], group="basket"
    )


def shelf_basket(rng: np.random.Generator, style: Style) -> Made:
    """A rectangular basket for a shelf."""
    w, h, d = (
        float(v) for v in (rng.uniform(0.22, 0.34), rng.uniform(0.13, 0.2), rng.uniform(0.18, 0.24))
    )
    weave = plain(
        "wicker", mix((0.66, 0.52, 0.36), style.textiles[0], float(rng.choice([0.0, 0.8]))), 0.9
    )
    sides = _open_box(w, h, d, 0.008)
    return made("shelf_basket", [(s, weave) for s in sides], group="basket", nyu40=BOX)


def _open_box(w: float, h: float, d: float, t: float) -> list[Surface]:
    """A bottom and four sides of thickness t."""
    # Front and back fit between the left and right sides, all of them on the bottom.
    return [
        slab((-w / 2, 0, -d / 2), (w / 2, t, d / 2)),
        slab((-w / 2, t, -d / 2), (-w / 2 + t, h, d / 2)),
        slab((w / 2 - t, t, -d / 2), (w / 2, h, d / 2)),
        slab((-w / 2 + t, t, -d / 2), (w / 2 - t, h, -d / 2 + t)),
        slab((-w / 2 + t, t, d / 2 - t), (w / 2 - t, h, d / 2)),
    ]


def vase(rng: np.random.Generator, style: Style) -> Made:
    """A vase of one of many profiles."""
    tall, r = float(rng.uniform(0.14, 0.34)), float(rng.uniform(0.045, 0.085))
    waist, mouth = r * float(rng.uniform(0.3, 0.8)), r * float(rng.uniform(0.35, 0.9))
    t = np.linspace(0, 1, 8)
    belly = float(rng.uniform(0.25, 0.6))
    # Radius over height through foot, belly, waist and mouth, smoothed by a binomial filter.
    curve = np.interp(t, [0, belly, 0.85, 1], [r * 0.6, r, waist, mouth])
    curve = np.convolve(np.pad(curve, 1, mode="edge"), [0.25, 0.5, 0.25], "valid")
    outside = [(0.0, 0.0), *((float(a), float(b)) for a, b in zip(curve, t * tall, strict=True))]
    material = glass((0.8, 0.9, 0.88), 0.2) if rng.random() < 0.15 else china(rng, style)
    return made("vase", [(vessel(outside, 0.004, n=20), material)], group="vase")


def plant_pot(rng: np.random.Generator, style: Style) -> Made:
    """A pot with earth in it and no plant."""
    r = float(rng.uniform(0.06, 0.1))
    tall = r * 1.7
    # (radius, height): the outside up, the rim, and the earth at 85 % of the height.
    outside = [
        (0, 0),
        (r * 0.72, 0),
        (r, tall),
        (r, tall),
        (r - 0.006, tall),
        (r * 0.9, tall * 0.85),
        (0, tall * 0.86),
    ]
    clay: Rgb = (0.66, 0.36, 0.24)
    colour = clay if rng.random() < 0.5 else any_colour(rng, style)
    return made("plant_pot", [(turned(outside, n=20), plain("pot", colour, 0.8))], group="vase")


def candle(rng: np.random.Generator, style: Style) -> Made:
    """One to three pillar candles."""
    parts: list[Part] = []
    x = 0.0
    colour = mix((0.92, 0.88, 0.78), style.accent, float(rng.choice([0.0, 0.0, 0.8])))
    for _ in range(int(rng.integers(1, 4))):
        r, tall = float(rng.uniform(0.025, 0.04)), float(rng.uniform(0.06, 0.18))
        x += r
        # (radius, height): the rim stands 4 mm above the hollow that the wick rises from.
        body = turned([(0, 0), (r, 0), (r, tall - 0.004), (r - 0.004, tall), (0, tall - 0.004)])
        wick = turned(
            [(0, tall - 0.005), (0.0015, tall - 0.005), (0.001, tall + 0.008), (0, tall + 0.008)],
            n=5,
        )
        z = float(rng.uniform(-0.015, 0.015))
        parts.append((transformed(body, np.eye(3), (x, 0, z)), plain("wax", colour, 0.45)))
        parts.append((transformed(wick, np.eye(3), (x, 0, z)), plain("wick", (0.1, 0.1, 0.1), 0.9)))
        x += r + 0.012
    return made("candle", parts, group="candle")


def table_frame(rng: np.random.Generator, style: Style) -> Made:
    """A framed photograph that leans back on its stand."""
    w, h = sorted(float(v) for v in rng.uniform(0.12, 0.24, 2))
    if rng.random() < 0.4:
        w, h = h, w
    b, t = float(rng.uniform(0.012, 0.025)), 0.015
    frame = (
        plain("frame", style.wood.mean, 0.4)
        if rng.random() < 0.5
        else plain("frame", (0.1, 0.1, 0.1), 0.35)
    )
    # b: width of the frame's wood, t: its depth; left and right fit between the other two.
    sides = [
        slab((-w / 2, 0, 0), (w / 2, b, t)), slab((-w / 2, h - b, 0), (w / 2, h, t)),
        slab((-w / 2, b, 0), (-w / 2 + b, h - b, t)), slab((w / 2 - b, b, 0), (w / 2, h - b, t)),
    ]  # fmt: skip
    parts: list[Part] = [(s, frame) for s in sides]
    parts += _photograph(rng, (-w / 2 + b, b), (w / 2 - b, h - b))
    # Lean it back by ten degrees and prop it up.
    c, s = np.cos(-0.17), np.sin(-0.17)
    lean: F64 = np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])
    leaning = [(transformed(surface, lean), material) for surface, material in parts]
    foot = transformed(
        slab((-0.015, 0, -0.003), (0.015, h * 0.62, 0)), _lean_forward(h), (0, 0, -h * 0.352)
    )
    return made("table_frame", [*leaning, (foot, frame)], group="picture_frame", nyu40=PICTURE)


def _lean_forward(tall: float) -> F64:
    # The stand goes from behind up to the frame's back.
    angle = 0.42
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


def _photograph(
    rng: np.random.Generator, low: tuple[float, float], high: tuple[float, float]
) -> list[Part]:
    # A mount with sky, land and a figure as flat panes, a little in front of each other.
    def pane(x0: float, y0: float, x1: float, y1: float, z: float) -> Surface:
        return slab((x0, y0, z), (x1, y1, z + 0.001))

    (x0, y0), (x1, y1) = low, high
    m = 0.12 * min(x1 - x0, y1 - y0)
    horizon = y0 + m + (y1 - y0 - 2 * m) * float(rng.uniform(0.3, 0.6))
    sky, land = rng.uniform(0.45, 0.9, 3), rng.uniform(0.1, 0.6, 3)

    def colour(v: F64) -> Rgb:
        return (float(v[0]), float(v[1]), float(v[2]))

    return [
        (pane(x0, y0, x1, y1, 0.004), plain("mount", (0.92, 0.91, 0.88), 0.8)),
        (pane(x0 + m, horizon, x1 - m, y1 - m, 0.0052), plain("photo", colour(sky), 0.3)),
        (pane(x0 + m, y0 + m, x1 - m, horizon, 0.0052), plain("photo", colour(land), 0.3)),
    ]


def tissue_box(rng: np.random.Generator, style: Style) -> Made:
    """A box of tissues with one standing out."""
    body = slab((-0.115, 0, -0.06), (0.115, 0.085, 0.06))
    c, s = np.cos(0.35), np.sin(0.35)
    lean: F64 = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    # The tissue is a thin sheet that leans by 0.35 rad, its foot inside the box.
    sheet = transformed(
        box("tissue", np.array([0, 0.03, 0.0]), np.array([0.045, 0.035, 0.002]), 0),
        lean,
        (0, 0.08, 0.0),
    )
    parts = [
        (body, plain("box", any_colour(rng, style), 0.6)),
        (sheet, plain("tissue", (0.93, 0.93, 0.92), 0.95)),
    ]
    return made("tissue_box", parts, group="box", nyu40=BOX)


def clock(rng: np.random.Generator, style: Style) -> Made:
    """An alarm clock."""
    if rng.random() < 0.5:
        body = slab((-0.07, 0, -0.025), (0.07, 0.07, 0.025))
        face = slab((-0.055, 0.015, 0.025), (0.055, 0.055, 0.0255))
        parts = [
            (body, plain("clock", any_colour(rng, style), 0.4)),
            (face, plain("display", (0.05, 0.06, 0.05), 0.1)),
        ]
        return made("alarm_clock", parts, group="clock")
    # (radius, height) of case and dial about y; then turn their axis to z, to face the room.
    disc = turned(
        [(0, -0.02), (0.05, -0.02), (0.055, 0), (0.05, 0.02), (0.047, 0.021), (0, 0.021)], n=20
    )
    dial = turned([(0, 0.0211), (0.044, 0.0211), (0, 0.022)], n=20)
    upright: F64 = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    foot = slab((-0.035, 0, -0.02), (0.035, 0.012, 0.02))
    ring = metal(style) if rng.random() < 0.5 else plain("clock", any_colour(rng, style), 0.35)
    parts = [
        (transformed(disc, upright, (0, 0.062, 0)), ring),
        (transformed(dial, upright, (0, 0.062, 0)), plain("dial", (0.93, 0.93, 0.9), 0.5)),
        (foot, ring),
    ]
    return made("alarm_clock", parts, group="clock")


def ornament(rng: np.random.Generator, style: Style) -> Made:
    """A small sculpture: stacked turned bodies, or a bird of two balls."""
    colour = any_colour(rng, style)
    material = (
        metal(style)
        if rng.random() < 0.3
        else plain("ornament", colour, float(rng.uniform(0.2, 0.8)))
    )
    n, y, profile = int(rng.integers(2, 5)), 0.0, [(0.0, 0.0)]
    r = float(rng.uniform(0.035, 0.055))
    for _ in range(n):
        # Each body is part of a sine's arch, and smaller than the one below it.
        tall = r * float(rng.uniform(0.8, 1.9))
        for t in (0.0, 0.25, 0.5, 0.75, 1.0):
            profile.append((max(r * np.sin(np.pi * (0.12 + 0.76 * t)), 0.004), y + tall * t))
        y, r = y + tall, r * float(rng.uniform(0.6, 0.9))
    profile.append((0.0, y))
    profile[1] = (profile[1][0] + 0.01, 0.0)
    return made("ornament", [(turned(profile, n=14), material)], group="ornament")


def bin_(rng: np.random.Generator, style: Style) -> Made:
    """A waste paper bin."""
    r, tall = float(rng.uniform(0.11, 0.15)), float(rng.uniform(0.26, 0.36))
    material = metal(style) if rng.random() < 0.3 else plain("bin", any_colour(rng, style), 0.5)
    return made(
        "bin", [(vessel([(0, 0), (r * 0.85, 0), (r, tall)], 0.003, n=20), material)], group="bin"
    )


def bag(rng: np.random.Generator, style: Style) -> Made:
    """A shopping bag with two handles."""
    w, h, d = (
        float(v) for v in (rng.uniform(0.3, 0.4), rng.uniform(0.28, 0.38), rng.uniform(0.1, 0.14))
    )
    cloth = plain("bag", any_colour(rng, style), 0.85)
    t = 0.004
    sides = _open_box(w, h, d, t)
    # A handle on each side: two straps, 15 cm across, and a bar between them.
    for z in (-d / 2, d / 2 - t):
        for x in (-0.075, 0.063):
            sides.append(slab((x, h, z), (x + 0.012, h + 0.11, z + t)))
        sides.append(slab((-0.075, h + 0.11, z), (0.075, h + 0.122, z + t)))
    return made("shopping_bag", [(s, cloth) for s in sides], group="bag", nyu40=BAG)


def shoes(rng: np.random.Generator, style: Style) -> Made:
    """A pair of shoes, toes to the front."""
    upper = plain("shoe", any_colour(rng, style) if rng.random() < 0.5 else (0.14, 0.11, 0.1), 0.6)
    sole = plain("sole", (0.85, 0.84, 0.8) if rng.random() < 0.5 else (0.1, 0.09, 0.08), 0.8)
    parts: list[Part] = []
    for side in (-0.065, 0.065):
        # Feet are never quite parallel: turn each shoe about y.
        turn = float(rng.normal(0, 0.08))
        c, s = np.cos(turn), np.sin(turn)
        rotation: F64 = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        parts.append((transformed(_shoe_sole(), rotation, (side, 0, 0)), sole))
        parts.append((transformed(_shoe_upper(), rotation, (side, 0.022, 0)), upper))
    return made("shoes", parts, group="shoes", nyu40=CLOTHES)


def _shoe_sole() -> Surface:
    # (radius, height) of a unit body, stretched to 8.8 x 2.2 x 27 cm.
    return _stretched(
        turned([(0, 0), (0.5, 0), (0.52, 0.6), (0.5, 1), (0, 1)], n=14), (0.088, 0.022, 0.27)
    )


def _shoe_upper() -> Surface:
    # A dome over the toes that rises towards the heel.
    dome = turned([(0, 0), (0.48, 0), (0.47, 0.3), (0.4, 0.65), (0.25, 0.9), (0, 1)], n=14)
    upper = _stretched(dome, (0.086, 0.085, 0.27))
    points = upper.positions.astype(np.float64)
    points[:, 1] *= np.interp(points[:, 2], [-0.135, -0.02, 0.135], [1.15, 1.0, 0.5])
    return Surface(upper.name, points.astype(np.float32), upper.faces, 0, None, upper.normals)


def _stretched(surface: Surface, size: tuple[float, float, float]) -> Surface:
    scale = np.asarray(size)
    # Normals scale by the inverse, so that they stay at right angles to the surface.
    normals = np.asarray(surface.normals, np.float64) / scale
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    positions = surface.positions.astype(np.float64) * scale
    return Surface(
        surface.name,
        positions.astype(np.float32),
        surface.faces,
        0,
        None,
        normals.astype(np.float32),
    )
