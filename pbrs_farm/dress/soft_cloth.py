"""Weave and print cushions, covers, throws and generated seats.

Generated soft items have one plain colour each, as do the cushions of many library sofas; without
visible threads they look like plastic. cloths.toml beside gives the weave of each material. Effects:
those of textures.families.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from pydantic import Field

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.classes import SOFA
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import Item, Material, MaterialKind, Surface
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.core.record import Record, read_toml
from pbrs_farm.dress.box_mapping import box_mapped
from pbrs_farm.dress.content import content
from pbrs_farm.dress.finishes import tinted
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.part_kinds import PartKind, kind_by_name
from pbrs_farm.dress.patterns import Pattern, pattern_material, photographed
from pbrs_farm.dress.style import Rgb, Style, mix

PASS: Final = "cloth"


class _Cloth(Record):
    families: tuple[str, ...]  # of textures.families, equal chances
    printed: float = Field(ge=0, le=1)  # chance of a print instead
    repeat: float = Field(1.0, gt=0)  # size of the print, as a share of a wallpaper's
    contrast: float = Field(ge=0, le=1)  # of the print: 0 = tone in tone, 1 = in another colour


_SEATS: Final = ("sofa", "armchair")  # groups of which any large plain part is cloth
_SEAT_CLOTH: Final = _Cloth(families=("weave", "twill"), printed=0.0, contrast=0.0)
_LEAST_M2: Final = 0.3  # of such a part: feet and buttons are smaller

_CLOTHS: Final = read_toml(Path(__file__).with_name("cloths.toml"), dict[str, _Cloth])


def weave_soft_things(
    house: MutableHouse, catalogue: Catalogue, style: Style, share: float
) -> None:
    """Give a share of plain soft parts threads, some a print, one look for a colour and room."""
    seats = {p.id for p in catalogue.of(*_SEATS)}
    for index, item in enumerate(house.items):
        if item.kind.is_structure:
            continue
        is_seat = item.nyu40 == SOFA or item.source_class in seats
        woven = tuple(
            _woven(house, catalogue, style, share, item, s, is_seat=is_seat) for s in item.surfaces
        )
        if any(a is not b for a, b in zip(woven, item.surfaces, strict=True)):
            house.change(index, replace(item, surfaces=woven), PASS)
            house.done[PASS] += 1


def _woven(
    house: MutableHouse,
    catalogue: Catalogue,
    style: Style,
    share: float,
    item: Item,
    surface: Surface,
    *,
    is_seat: bool,
) -> Surface:
    material = house.materials[surface.material]
    name = _plain_name(material)
    cloth = _CLOTHS.get(name)
    if material.texture_ids or material.opacity < 1 or material.kind is not MaterialKind.OPAQUE:
        return surface
    if cloth is None and is_seat and kind_by_name(name) in (None, PartKind.SOFT):
        is_large = face_areas(triangle_corners(surface.positions, surface.faces)).sum() >= _LEAST_M2
        cloth = _SEAT_CLOTH if is_large else None
    if cloth is None:
        return surface
    shade = "".join(f"{round(31 * c):02x}" for c in material.diffuse)
    rng = house.rng(PASS, item.level_id, item.room_id or "", name, shade)
    if rng.random() >= share:
        return surface
    if rng.random() < cloth.printed:
        print_colour = style.textiles[int(rng.integers(len(style.textiles)))]
        colour: Rgb = material.diffuse
        # Tone in tone a print is lighter on dark cloth and darker on light one.
        near = mix(colour, (0.95, 0.94, 0.9) if max(colour) < 0.5 else (0.2, 0.18, 0.16), 0.3)
        tints = (colour, mix(near, print_colour, cloth.contrast), style.accent)
        pattern = Pattern(
            "wallpaper", int(rng.integers(4)), tints, variant=str(rng.choice(content().wallpapers))
        )
        woven = pattern_material(house, pattern)
        size = woven.size_m[0] * cloth.repeat, woven.size_m[1] * cloth.repeat
        mapped = box_mapped(surface, _own_axes(surface, item), size, is_grained=False)
        return replace(mapped, material=woven.number)
    family = str(rng.choice(cloth.families))
    seed = int(house.rng(PASS, family).integers(2**31))
    pattern = photographed(house, catalogue, Pattern(family, seed))
    laid = tinted(house, pattern, linear_from_srgb(np.array(material.diffuse)), is_grained=False)
    size = pattern_material(house, pattern).size_m
    return replace(box_mapped(surface, np.eye(3), size, is_grained=False), material=laid.number)


def _plain_name(material: Material) -> str:
    """The name as its maker gave it: packed models have a number before it."""
    return re.sub(r"^m\d+_", "", material.name).replace("_", " ")


def _own_axes(surface: Surface, item: Item) -> F64:
    """(3, 3) axes of a print: those of the piece, or of a cushion wherever it leans."""
    if item.box is not None:
        return item.box.axes
    points = surface.positions.astype(np.float64)
    _, axes = np.linalg.eigh(np.cov((points - points.mean(0)).T))
    return np.asarray(axes)
