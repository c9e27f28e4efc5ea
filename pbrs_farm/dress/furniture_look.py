"""Materials of added furniture: wood of the home, white or painted boards. Effects: adds materials to the house."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.house import Material
from pbrs_farm.dress.box_mapping import box_mapped
from pbrs_farm.dress.content import content
from pbrs_farm.dress.finishes import grain_pattern
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.patterns import pattern_material, photographed
from pbrs_farm.dress.style import COLOURS, Rgb, Style, mix
from pbrs_farm.dress.thing_materials import plain

_WHITE: Rgb = (0.9, 0.9, 0.88)


@dataclass(frozen=True, slots=True)
class BoardLook:
    """Boards, and of materials that show a picture how large one repeat of it is."""

    style: Style
    boards: Any  # Content.boards
    size_m: Mapping[Material, tuple[float, float]]


def look_of(
    house: MutableHouse, catalogue: Catalogue, style: Style, rng: np.random.Generator
) -> BoardLook:
    """Materials of the furniture added to a room."""
    pattern = photographed(house, catalogue, grain_pattern(house, style.wood))
    grain = pattern_material(house, pattern)
    wood = house.materials[grain.number]
    kind, tone = rng.random(), float(rng.uniform(0.3, 0.45))
    white = plain("board white", _WHITE, tone)
    colour = COLOURS["boards"][int(rng.integers(len(COLOURS["boards"])))]
    painted = plain("board painted", mix(colour, style.palette[4], 0.25), tone)
    # Half of it is of wood; white and painted carcasses may have tops or fronts of wood.
    if kind < 0.5:
        body, front, top = wood, wood, wood
    elif kind < 0.62:
        body, front, top = wood, white, wood
    elif kind < 0.75:
        body, front, top = white, white, wood
    elif kind < 0.88:
        body, front, top = white, white, white
    else:
        body, front, top = painted, painted, wood
    cloth = style.textiles[int(rng.integers(len(style.textiles)))]
    return BoardLook(style, content().boards(body, front, top, cloth), {wood: grain.size_m})


def grained(model: Model, look: BoardLook) -> Model:
    """The piece with the grain of its wood along each board."""
    piece, shape = model
    surfaces = []
    for surface in shape.surfaces:
        size_m = look.size_m.get(shape.materials[surface.material])
        surfaces.append(box_mapped(surface, np.eye(3), size_m) if size_m else surface)
    return piece, replace(shape, surfaces=tuple(surfaces))
