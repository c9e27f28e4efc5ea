"""Lamps made in code, for homes without a catalogue: an opal dome, a globe, a shade on a cord; no effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.catalogue import Piece, Place, Shape
from pbrs_farm.core.classes import LAMP
from pbrs_farm.core.house import ItemKind, LightPart, Material, MaterialKind, Surface
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.dress.style import Style
from pbrs_farm.geometry.solids import lathe, sphere

_WARM = (1.0, 0.79, 0.55)  # linear, of a lamp of about 3000 K
_O = np.zeros(3)


def ceiling_dome(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """A flat opal dish under the ceiling that shines as a whole."""
    r = float(rng.uniform(0.16, 0.24))
    plate = lathe(
        "plate", np.array([[0, 0.09], [r + 0.01, 0.09], [r + 0.01, 0.11], [0, 0.11]]), _O, 0, n=40
    )
    t = np.linspace(0, np.pi / 2, 9)
    dish = np.stack([r * np.sin(t), 0.085 * (1 - np.cos(t))], -1)
    dish[0, 0] = 0.0
    opal = lathe("opal", np.concatenate([dish, [[0, 0.085]]]), _O, 1, n=40)
    return _lamp_of(
        "ceiling_dome", Place.CEILING, (plate, opal), style, emitting=1, at=0.04, radius=r
    )


def globe_pendant(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """An opal ball on a cord."""
    r, height = float(rng.uniform(0.11, 0.17)), 0.5
    ball = sphere("opal", np.array([0, r, 0]), r, 1, n=32)
    return _lamp_of(
        "globe_pendant",
        Place.CEILING,
        (_cord(2 * r, height), ball),
        style,
        emitting=1,
        at=r,
        radius=r,
    )


def shade_pendant(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """A metal cone on a cord, a bulb in it."""
    r, tall, height = float(rng.uniform(0.15, 0.24)), float(rng.uniform(0.14, 0.2)), 0.55
    outside = np.array([[r, 0.0], [0.7 * r, 0.55 * tall], [0.03, tall]])
    inside = np.array([[0.027, tall - 0.003], [0.7 * r - 0.003, 0.55 * tall], [r - 0.003, 0.0]])
    shell = lathe("shade", np.concatenate([inside, outside, inside[:1]]), _O, 2, n=40)
    bulb = sphere("bulb", np.array([0, 0.3 * tall, 0]), 0.035, 1, n=24)
    parts = (_cord(tall, height), bulb, shell)
    return _lamp_of(
        "shade_pendant", Place.CEILING, parts, style, emitting=1, at=0.3 * tall, radius=0.035
    )


def floor_lamp(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """A pole with a round foot and an opal ball."""
    height, r = float(rng.uniform(1.45, 1.7)), float(rng.uniform(0.1, 0.14))
    foot = np.array(
        [[0, 0], [0.14, 0], [0.14, 0.015], [0.014, 0.022], [0.012, height], [0, height]]
    )
    pole = lathe("pole", foot, _O, 0, n=32)
    ball = sphere("opal", np.array([0, height + r - 0.01, 0]), r, 1, n=32)
    return _lamp_of(
        "floor_lamp", Place.FLOOR, (pole, ball), style, emitting=1, at=height + r, radius=r
    )


def table_lamp(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """A small foot with an opal ball."""
    r = float(rng.uniform(0.06, 0.085))
    foot = np.array([[0, 0], [0.07, 0], [0.07, 0.012], [0.02, 0.03], [0.02, 0.16], [0, 0.16]])
    body = lathe("foot", foot, _O, 0, n=32)
    ball = sphere("opal", np.array([0, 0.15 + r, 0]), r, 1, n=32)
    return _lamp_of(
        "table_lamp", Place.SURFACE, (body, ball), style, emitting=1, at=0.15 + r, radius=r
    )


def _cord(low: float, high: float) -> Surface:
    # A thin cord up to a small canopy under the ceiling.
    profile = [
        [0, low],
        [0.005, low],
        [0.005, high - 0.03],
        [0.05, high - 0.02],
        [0.05, high],
        [0, high],
    ]
    return lathe("cord", np.array(profile, np.float64), _O, 0, n=24)


def _lamp_of(
    family: str,
    place: Place,
    surfaces: tuple[Surface, ...],
    style: Style,
    *,
    emitting: int,
    at: float,
    radius: float,
) -> tuple[Piece, Shape]:
    dark = (0.03, 0.03, 0.03)
    metal = Material(
        style.metal.name, diffuse=dark, specular=style.metal.colour, roughness=style.metal.roughness
    )
    r, g, b = (round(float(np.clip(c, 0.05, 0.9)), 3) for c in style.accent)
    enamel = Material("enamel", diffuse=(r, g, b), roughness=0.3)
    opal = Material("opal glass", MaterialKind.BULB)
    light = LightPart(
        (0.0, at, 0.0), radius, 1000.0, PowerUnit.LUMEN, rgb_linear=_WARM, emitting=(emitting,)
    )
    shape = Shape(surfaces, (metal, opal, enamel), lights=(light,))
    w, h, d = (float(x) for x in np.diff(shape.bounds, axis=0)[0])
    group = {Place.CEILING: "ceiling_lamp", Place.FLOOR: "floor_lamp"}.get(place, "table_lamp")
    name = family.replace("_", " ").capitalize()
    piece = Piece(
        f"generated#{family}",
        name,
        group,
        place,
        LAMP,
        (w, d, h),
        ItemKind.LAMP,
        library="generated",
    )
    return piece, shape


def with_flux(shape: Shape, flux_lm: float) -> Shape:
    """Scale the shape's lights, if any, to a total luminous flux (lm), in equal shares."""
    n = max(len(shape.lights), 1)
    lights = tuple(
        replace(light, power=round(flux_lm, 1), unit=PowerUnit.LUMEN, share=1.0 / n)
        for light in shape.lights
    )
    return replace(shape, lights=lights)
