"""Finish scheme of a home: paints and materials of its doors, windows, stairs and fittings. No effects.

The shares are this project's estimates for European homes: half of the trim is some white, a third
wood. Colours are sRGB-encoded, 0..1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import COLOURS, METALS, WOODS, WOODS_FOR, Rgb, Style, mix, rgb, shade
from pbrs_farm.dress.surface_finishes import Finish

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class FinishScheme:
    """The finishes of one home."""

    trim: Finish  # frames of doors, skirting boards
    leaf: Finish  # of doors
    front: Finish  # of the doors to the street and the garage
    window: Finish
    stair: Finish
    railing: Finish
    fitting: Finish  # handles, hinges
    radiator: Finish
    pipe: Finish
    appliance: Finish
    spotlight: Finish
    stone: Finish  # steps outdoors, hearths
    render: Finish  # walls outside
    plaster: Finish  # the tops of walls, the sides of openings


def finish_scheme(house: MutableHouse, style: Style) -> FinishScheme:
    """The home's scheme of finishes by seed and style, the same in every pass."""
    rng = house.rng("joinery")
    trim = _trim_finish(rng, style)
    leaf = _leaf_finish(rng, style, trim)
    return FinishScheme(
        trim=trim,
        leaf=leaf,
        front=_front_door_finish(rng, leaf),
        window=_window_finish(rng, style, trim),
        stair=_stair_finish(rng, style, trim),
        railing=_railing_finish(rng, style, trim),
        fitting=Finish("fitting", metal=style.metal),
        radiator=_radiator_finish(rng, trim),
        pipe=_pick_by_share(
            rng,
            (0.5, _white_finish(rng)),
            (0.25, _metal_finish("brushed steel")),
            (0.25, _metal_finish("copper")),
        ),
        appliance=_appliance_finish(rng),
        spotlight=_pick_by_share(
            rng,
            (0.35, _metal_finish("brushed steel")),
            (0.2, _metal_finish("black steel")),
            (0.2, _white_finish(rng)),
            (0.25, Finish("metal", metal=style.metal)),
        ),
        stone=Finish("stone", aged(rng, _pick(rng, COLOURS["stones"])), 0.6),
        render=Finish("render", aged(rng, _pick(rng, COLOURS["renders"])), 0.85),
        plaster=Finish(
            "plaster",
            aged(rng, _pick(rng, (*COLOURS["whites"], *COLOURS["greys"][:3], *COLOURS["renders"]))),
            0.7,
        ),
    )


def _trim_finish(rng: np.random.Generator, style: Style) -> Finish:
    wood = style.wood if rng.random() < 0.5 else WOODS[_pick(rng, WOODS_FOR.trim)]
    grey, painted = aged(rng, _pick(rng, COLOURS["greys"])), _paint_colour(rng, style)
    return _pick_by_share(
        rng,
        (0.5, _white_finish(rng)),
        (0.12, Finish("paint", grey)),
        (0.12, Finish("paint", painted)),
        (0.26, Finish("wood", wood=wood)),
    )


def _leaf_finish(rng: np.random.Generator, style: Style, trim: Finish) -> Finish:
    # Doors are bought with their frames; some have a leaf of wood in a white frame, or the reverse.
    plain_wood = _white_finish(rng) if trim.wood else Finish("wood", wood=style.wood)
    painted = Finish("paint", _paint_colour(rng, style))
    return _pick_by_share(rng, (0.64, trim), (0.24, plain_wood), (0.12, painted))


def _front_door_finish(rng: np.random.Generator, leaf: Finish) -> Finish:
    wood = WOODS[_pick(rng, WOODS_FOR.front_doors)]
    painted = Finish("paint", aged(rng, _pick(rng, COLOURS["front_doors"])))
    return _pick_by_share(rng, (0.5, painted), (0.3, Finish("wood", wood=wood)), (0.2, leaf))


def _window_finish(rng: np.random.Generator, style: Style, trim: Finish) -> Finish:
    dark = Finish("paint", aged(rng, _pick(rng, COLOURS["darks"])), 0.45)
    wood = Finish("wood", wood=style.wood)
    return _pick_by_share(
        rng, (0.45, _white_finish(rng, 0.3)), (0.3, trim), (0.15, dark), (0.1, wood)
    )


def _stair_finish(rng: np.random.Generator, style: Style, trim: Finish) -> Finish:
    wood = style.wood if rng.random() < 0.5 else WOODS[_pick(rng, WOODS_FOR.stairs)]
    stone = Finish("stone", aged(rng, _pick(rng, COLOURS["stones"])), 0.5)
    return _pick_by_share(rng, (0.72, Finish("wood", wood=wood)), (0.14, trim), (0.14, stone))


def _railing_finish(rng: np.random.Generator, style: Style, trim: Finish) -> Finish:
    return _pick_by_share(
        rng,
        (0.3, trim),
        (0.22, _metal_finish("black steel")),
        (0.18, _metal_finish("brushed steel")),
        (0.08, Finish("metal", metal=style.metal)),
        (0.22, Finish("wood", wood=style.wood)),
    )


def _radiator_finish(rng: np.random.Generator, trim: Finish) -> Finish:
    dark = Finish("paint", aged(rng, _pick(rng, COLOURS["darks"])), 0.45)
    # Few paint them as they paint their doors.
    like_trim = _white_finish(rng, 0.3) if trim.wood else trim
    return _pick_by_share(
        rng,
        (0.72, _white_finish(rng, 0.3)),
        (0.13, like_trim),
        (0.1, dark),
        (0.05, _metal_finish("chrome")),
    )


def _appliance_finish(rng: np.random.Generator) -> Finish:
    dark = Finish("paint", aged(rng, _pick(rng, COLOURS["darks"])), 0.25)
    cream = Finish("paint", aged(rng, rgb("e6dcc3")), 0.25)
    return _pick_by_share(
        rng,
        (0.5, _white_finish(rng, 0.25)),
        (0.3, _metal_finish("brushed steel")),
        (0.12, dark),
        (0.08, cream),
    )


def _paint_colour(rng: np.random.Generator, style: Style) -> Rgb:
    # A paint of the carpenter's card, or the style's own, calmed.
    base = mix(shade(style.palette[2], 0.9), rgb("a8a49a"), 0.3)
    draw = rng.random()
    if draw < 0.35:
        return aged(rng, base)
    return aged(rng, _pick(rng, COLOURS["darks"] if draw > 0.85 else COLOURS["paints"]))


def _white_finish(rng: np.random.Generator, roughness: float = 0.4) -> Finish:
    return Finish("paint", aged(rng, _pick(rng, COLOURS["whites"])), roughness)


def aged(rng: np.random.Generator, colour: Rgb) -> Rgb:
    """Another maker's tin of that colour, some years old: lighter or darker, warmer or colder."""
    light, warm = rng.normal(0, 0.018), rng.normal(0, 0.008)
    shifts = (light + warm, light, light - warm)
    r, g, b = (
        round(float(np.clip(c + s, 0.05, 0.965)), 4) for c, s in zip(colour, shifts, strict=True)
    )
    return (r, g, b)


def _metal_finish(name: str) -> Finish:
    return Finish("metal", metal=METALS[name])


def _pick_by_share(rng: np.random.Generator, *choices: tuple[float, Finish]) -> Finish:
    shares = np.array([share for share, _finish in choices])
    return choices[int(rng.choice(len(choices), p=shares / shares.sum()))][1]


def _pick(rng: np.random.Generator, choices: Sequence[_T]) -> _T:
    return choices[int(rng.integers(len(choices)))]
