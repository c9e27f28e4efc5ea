"""The generated small things, as the TOML files beside describe them; no effects but reading.

Here are the words of their expressions, and the few solids that are more than numbers.
"""

from __future__ import annotations

from itertools import pairwise, product
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import LYING_ALONG_X, LYING_ALONG_Z, rotation_x, rotation_y, rotation_z
from pbrs_farm.core.house import Material, MaterialKind, Surface
from pbrs_farm.dress.style import COLOURS, METALS, WOODS, Rgb, Style, mix, shade
from pbrs_farm.dress.things import bodies
from pbrs_farm.dress.things.assembly import (
    Part,
    any_colour,
    bulged,
    glass,
    metal,
    plain,
    slab,
    smooth,
    turned,
    vessel,
)
from pbrs_farm.dress.things.descriptions import Things
from pbrs_farm.geometry.solids import box, sphere


def words(rng: np.random.Generator, style: Style) -> dict[str, Any]:
    """What expressions know of a style, and how they draw."""

    def textile(n: int = len(style.textiles)) -> Rgb:
        return style.textiles[int(rng.integers(min(n, len(style.textiles))))]

    def china() -> Material:
        # Glazed ceramic: white more often than coloured.
        colour = (0.9, 0.89, 0.86) if rng.random() >= 0.45 else any_colour(rng, style)
        return plain("china", colour, (0.12, 0.25)[int(rng.integers(2))])

    def colour_within(low: float, high: float) -> Rgb:
        r, g, b = (float(v) for v in rng.uniform(low, high, 3))
        return (r, g, b)

    def paint() -> Rgb:
        # What furniture is painted with: whites and greys more often than colours.
        names = ("whites", "greys", "paints", "darks", "boards")
        known = COLOURS[names[int(rng.choice(5, p=(0.42, 0.18, 0.2, 0.1, 0.1)))]]
        return known[int(rng.integers(len(known)))]

    return {
        "rng": rng,
        "paint": paint,
        "timber": plain(f"{style.wood.name} wood", style.wood.mean, 0.45),
        "dark_timber": plain(f"dark {style.wood.name} wood", style.wood.dark, 0.45),
        "cloth": lambda: plain("fabric", textile(), 0.95),
        "uniform": lambda low, high: float(rng.uniform(low, high)),
        "normal": lambda middle, spread: float(rng.normal(middle, spread)),
        "integers": lambda low, high: int(rng.integers(low, high)),
        "chance": lambda share: bool(rng.random() < share),
        "pick": lambda *choices: choices[int(rng.integers(len(choices)))],
        "weighted": lambda *shares: int(rng.choice(len(shares), p=shares)),
        "any_colour": lambda: any_colour(rng, style),
        "colour_within": colour_within,
        "textile": textile,
        "china": china,
        "metal": metal(style),
        "accent": style.accent,
        "textiles": style.textiles,
        "palette": style.palette,
        "wood": style.wood.mean,
        "dark_wood": style.wood.dark,
        "wood_name": style.wood.name,
    }


def handle(radius: float, tall: float) -> Surface:
    """A cup's: a bent strip of six pieces, 8 mm wide, its ends inside the cup's side."""
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


def photograph(
    rng: np.random.Generator, low: tuple[float, float], high: tuple[float, float]
) -> list[Part]:
    """A mount with sky, land and a figure as flat panes, a little in front of each other."""

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


def smoothed_vessel(r: float, waist: float, mouth: float, belly: float, tall: float) -> Surface:
    """A vessel through foot, belly, waist and mouth, smoothed by a binomial filter."""
    t = np.linspace(0, 1, 8)
    curve = np.interp(t, [0, belly, 0.85, 1], [r * 0.6, r, waist, mouth])
    curve = np.convolve(np.pad(curve, 1, mode="edge"), [0.25, 0.5, 0.25], "valid")
    outside = [(0.0, 0.0), *((float(a), float(b)) for a, b in zip(curve, t * tall, strict=True))]
    return vessel(outside, 0.004, n=20)


def sculpture(rng: np.random.Generator) -> Surface:
    """Bodies turned about one axis, each smaller than the one below it."""
    n, y, profile = int(rng.integers(2, 5)), 0.0, [(0.0, 0.0)]
    r = float(rng.uniform(0.035, 0.055))
    for _ in range(n):
        # Each is part of a sine's arch.
        tall = r * float(rng.uniform(0.8, 1.9))
        for t in (0.0, 0.25, 0.5, 0.75, 1.0):
            profile.append((max(r * np.sin(np.pi * (0.12 + 0.76 * t)), 0.004), y + tall * t))
        y, r = y + tall, r * float(rng.uniform(0.6, 0.9))
    profile.append((0.0, y))
    profile[1] = (profile[1][0] + 0.01, 0.0)
    return turned(profile, n=14)


def stretched(surface: Surface, size: tuple[float, float, float]) -> Surface:
    """A body stretched along the axes."""
    scale = np.asarray(size)
    # Normals scale by the inverse, so that they stay at right angles to the surface.
    normals = np.asarray(surface.normals, np.float64) / scale
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    points = (surface.positions.astype(np.float64) * scale).astype(np.float32)
    return Surface(surface.name, points, surface.faces, 0, None, normals.astype(np.float32))


def raised_heel(shoe: Surface) -> Surface:
    """A shoe's dome over the toes, as it rises towards the heel."""
    points = shoe.positions.astype(np.float64)
    points[:, 1] *= np.interp(points[:, 2], [-0.135, -0.02, 0.135], [1.15, 1.0, 0.5])
    return Surface(shoe.name, points.astype(np.float32), shoe.faces, 0, None, shoe.normals)


def sheared(surface: Surface, foot: tuple[float, ...], top: tuple[float, ...]) -> Surface:
    """An upright body 1 m high as a leg from foot to top: what was level stays level."""
    shear = np.eye(3)
    shear[:, 1] = np.asarray(top) - foot
    points = surface.positions.astype(np.float64) @ shear.T + np.asarray(foot)
    return smooth(surface.name, points, surface.faces)


def _linspace(low: float, high: float, n: int) -> list[float]:
    return [float(v) for v in np.linspace(low, high, n)]


def _sphere(centre: tuple[float, float, float], radius: float, *, n: int = 16) -> Surface:
    return sphere("sphere", np.asarray(centre, np.float64), radius, 0, n=n)


def _box(centre: tuple[float, float, float], half: tuple[float, float, float]) -> Surface:
    return box("box", np.array(centre), np.array(half), 0)


SOLIDS: Final = {
    "turned": turned, "vessel": vessel, "slab": slab, "bulged": bulged, "sphere": _sphere,
    "box": _box, "handle": handle, "photograph": photograph, "smoothed_vessel": smoothed_vessel, "sculpture": sculpture,
    "stretched": stretched, "raised_heel": raised_heel, "sheared": sheared,
    "solid": lambda surface: surface,
}  # fmt: skip


def glossy(name: str, colour: Rgb, roughness: float = 0.35) -> Material:
    """A lacquer, enamel or glaze of one colour, which the part `parts` leaves as it is."""
    r, g, b = (round(float(min(max(c, 0.02), 0.95)), 3) for c in colour)
    return Material(
        f"coated {name}", diffuse=(r, g, b), specular=(0.4, 0.4, 0.4),
        shininess=round(2.0 / max(roughness, 0.1) ** 4 - 2.0, 1), roughness=roughness,
    )  # fmt: skip


def _metal(name: str) -> Material:
    of = METALS[name]
    return Material(
        name, diffuse=(0.03, 0.03, 0.03), specular=of.colour, shininess=40.0, roughness=of.roughness
    )


STUFFS: Final = {
    "chrome": _metal("chrome"), "steel": _metal("brushed steel"), "black_steel": _metal("black steel"),
    "brass": _metal("brass"), "white_steel": glossy("white steel", (0.9, 0.9, 0.89), 0.4),
    "ceramic": glossy("ceramic", (0.93, 0.93, 0.92), 0.12), "enamel": glossy("enamel", (0.92, 0.92, 0.91), 0.2),
    "black_glass": glossy("black glass", (0.02, 0.02, 0.022), 0.08), "rubber": plain("black rubber", (0.06, 0.06, 0.06), 0.7),
    "cast_iron": plain("cast black", (0.05, 0.05, 0.052), 0.6), "white": glossy("white lacquer", (0.92, 0.92, 0.9), 0.35),
    "opal": Material("opal glass", MaterialKind.BULB), "silvered": Material("mirror", MaterialKind.MIRROR, (0.9, 0.9, 0.9)),
    "clear": glass(), "frosted": glass((0.93, 0.96, 0.96), 0.35), "earth": plain("earth", (0.16, 0.11, 0.08), 0.95),
    "wicker": plain("wicker", (0.66, 0.52, 0.36), 0.9), "light_oak": plain("oak wood", WOODS["pale oak"].mean, 0.5),
}  # fmt: skip
"""Materials that families share."""

ARITHMETIC: Final = {
    "pi": np.pi, "sin": np.sin, "cos": np.cos, "min": min, "max": max, "round": round, "int": int,
    "abs": abs, "sorted": sorted, "range": range, "linspace": _linspace, "pairwise": pairwise,
    "product": product, "enumerate": enumerate, "len": len, "single": lambda v: float(np.float32(v)),
    "mix": mix, "shade": shade, "plain": plain, "glossy": glossy, "glass": glass, "rotation_x": rotation_x,
    "rotation_y": rotation_y, "rotation_z": rotation_z, "lying_along_x": LYING_ALONG_X,
    "lying_along_z": LYING_ALONG_Z, "half_turn": np.diag([-1.0, 1.0, -1.0]),
}  # fmt: skip


def things_of(*names: str, **solids: object) -> Things:
    """The things that these files beside this module describe; solids: more of them."""
    files = [Path(__file__).with_name(f"{name}.toml") for name in names]
    return Things(files, words, {**ARITHMETIC, **SOLIDS, **solids})


THINGS: Final = things_of(
    "decor", "vessels", "belongings", "tableware", "household", "desk", "bath", "floor_things", "soft",
    "appliances",
    **{name: bodies.SOLIDS[name] for name in ("bevelled", "rounded", "loft", "hoop", "tube")},
    **{name: bodies.OUTLINES[name] for name in ("oval", "rect", "fluted", "bent", "ring_path")},
    **{name: STUFFS[name] for name in ("chrome", "steel", "black_steel", "black_glass", "rubber")},
)  # fmt: skip

CASE_GOODS: Final = things_of(
    "case_goods",
    lowest=lambda part: float(part[0].positions[:, 1].min()),
    chance_of=lambda seed, share: bool(np.random.default_rng(seed).random() < share),
)
"""Furniture of boards: most take what it is made of and its size."""
