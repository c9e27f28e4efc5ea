"""One scheme of finishes a home: what its doors, windows, stairs and fitted things are painted with or made of. No effects.

The shares are suggestions of ours for European homes: half of the trim is some white, a third wood.
Colours are sRGB-encoded, 0..1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.style import COLOURS, METALS, WOODS, WOODS_FOR, Rgb, Style, mix, rgb, shade
from pbrs_farm.dress.surface_finishes import Coat

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class JoineryScheme:
    """The coats of one home."""

    trim: Coat  # frames of doors, skirting boards
    leaf: Coat  # of doors
    front: Coat  # of the doors to the street and the garage
    window: Coat
    stair: Coat
    railing: Coat
    fitting: Coat  # handles, hinges
    radiator: Coat
    pipe: Coat
    appliance: Coat
    spotlight: Coat
    stone: Coat  # steps outdoors, hearths
    render: Coat  # walls outside
    plaster: Coat  # the tops of walls, the sides of openings


def joinery_scheme(draft: Draft, style: Style) -> JoineryScheme:
    """The home's scheme, from streams of its own: equal for every part that asks."""
    rng = draft.rng("joinery")
    trim = _trim(rng, style)
    leaf = _leaf(rng, style, trim)
    return JoineryScheme(
        trim=trim,
        leaf=leaf,
        front=_front(rng, leaf),
        window=_window(rng, style, trim),
        stair=_stair(rng, style, trim),
        railing=_railing(rng, style, trim),
        fitting=Coat("fitting", metal=style.metal),
        radiator=_radiator(rng, trim),
        pipe=_one_of(rng, (0.5, _white(rng)), (0.25, _metal("brushed steel")), (0.25, _metal("copper"))),
        appliance=_appliance_coat(rng),
        spotlight=_one_of(
            rng, (0.35, _metal("brushed steel")), (0.2, _metal("black steel")), (0.2, _white(rng)),
            (0.25, Coat("metal", metal=style.metal)),
        ),
        stone=Coat("stone", aged(rng, _one(rng, COLOURS["stones"])), 0.6),
        render=Coat("render", aged(rng, _one(rng, COLOURS["renders"])), 0.85),
        plaster=Coat("plaster", aged(rng, _one(rng, (*COLOURS["whites"], *COLOURS["greys"][:3], *COLOURS["renders"]))), 0.7),
    )  # fmt: skip


def _trim(rng: np.random.Generator, style: Style) -> Coat:
    wood = style.wood if rng.random() < 0.5 else WOODS[_one(rng, WOODS_FOR.trim)]
    grey, painted = aged(rng, _one(rng, COLOURS["greys"])), _painted(rng, style)
    return _one_of(
        rng, (0.5, _white(rng)), (0.12, Coat("paint", grey)), (0.12, Coat("paint", painted)),
        (0.26, Coat("wood", wood=wood)),
    )  # fmt: skip


def _leaf(rng: np.random.Generator, style: Style, trim: Coat) -> Coat:
    # Doors are bought with their frames; some have a leaf of wood in a white frame, or the reverse.
    other = _white(rng) if trim.wood else Coat("wood", wood=style.wood)
    painted = Coat("paint", _painted(rng, style))
    return _one_of(rng, (0.64, trim), (0.24, other), (0.12, painted))


def _front(rng: np.random.Generator, leaf: Coat) -> Coat:
    wood = WOODS[_one(rng, WOODS_FOR.front_doors)]
    painted = Coat("paint", aged(rng, _one(rng, COLOURS["front_doors"])))
    return _one_of(rng, (0.5, painted), (0.3, Coat("wood", wood=wood)), (0.2, leaf))


def _window(rng: np.random.Generator, style: Style, trim: Coat) -> Coat:
    dark = Coat("paint", aged(rng, _one(rng, COLOURS["darks"])), 0.45)
    wood = Coat("wood", wood=style.wood)
    return _one_of(rng, (0.45, _white(rng, 0.3)), (0.3, trim), (0.15, dark), (0.1, wood))


def _stair(rng: np.random.Generator, style: Style, trim: Coat) -> Coat:
    wood = style.wood if rng.random() < 0.5 else WOODS[_one(rng, WOODS_FOR.stairs)]
    stone = Coat("stone", aged(rng, _one(rng, COLOURS["stones"])), 0.5)
    return _one_of(rng, (0.72, Coat("wood", wood=wood)), (0.14, trim), (0.14, stone))


def _railing(rng: np.random.Generator, style: Style, trim: Coat) -> Coat:
    return _one_of(
        rng, (0.3, trim), (0.22, _metal("black steel")), (0.18, _metal("brushed steel")),
        (0.08, Coat("metal", metal=style.metal)), (0.22, Coat("wood", wood=style.wood)),
    )  # fmt: skip


def _radiator(rng: np.random.Generator, trim: Coat) -> Coat:
    dark = Coat("paint", aged(rng, _one(rng, COLOURS["darks"])), 0.45)
    # Few paint them as they paint their doors.
    like_trim = _white(rng, 0.3) if trim.wood else trim
    return _one_of(
        rng, (0.72, _white(rng, 0.3)), (0.13, like_trim), (0.1, dark), (0.05, _metal("chrome"))
    )


def _appliance_coat(rng: np.random.Generator) -> Coat:
    dark = Coat("paint", aged(rng, _one(rng, COLOURS["darks"])), 0.25)
    cream = Coat("paint", aged(rng, rgb("e6dcc3")), 0.25)
    return _one_of(
        rng, (0.5, _white(rng, 0.25)), (0.3, _metal("brushed steel")), (0.12, dark), (0.08, cream)
    )


def _painted(rng: np.random.Generator, style: Style) -> Rgb:
    # A paint of the carpenter's card, or the style's own, calmed.
    own = mix(shade(style.palette[2], 0.9), rgb("a8a49a"), 0.3)
    draw = rng.random()
    if draw < 0.35:
        return aged(rng, own)
    return aged(rng, _one(rng, COLOURS["darks"] if draw > 0.85 else COLOURS["paints"]))


def _white(rng: np.random.Generator, roughness: float = 0.4) -> Coat:
    return Coat("paint", aged(rng, _one(rng, COLOURS["whites"])), roughness)


def aged(rng: np.random.Generator, colour: Rgb) -> Rgb:
    """Another maker's tin of that colour, some years old: lighter or darker, warmer or colder."""
    light, warm = rng.normal(0, 0.018), rng.normal(0, 0.008)
    shifts = (light + warm, light, light - warm)
    r, g, b = (
        round(float(np.clip(c + s, 0.05, 0.965)), 4) for c, s in zip(colour, shifts, strict=True)
    )
    return (r, g, b)


def _metal(name: str) -> Coat:
    return Coat("metal", metal=METALS[name])


def _one_of(rng: np.random.Generator, *choices: tuple[float, Coat]) -> Coat:
    shares = np.array([share for share, _coat in choices])
    return choices[int(rng.choice(len(choices), p=shares / shares.sum()))][1]


def _one(rng: np.random.Generator, choices: Sequence[_T]) -> _T:
    return choices[int(rng.integers(len(choices)))]
