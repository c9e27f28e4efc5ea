"""Photographed surfaces of libraries in the place of procedural ones. Effects: adds materials to the house."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Catalogue, Picture
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import Material, Note
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import Rgb
from pbrs_farm.images import decode_texture


@dataclass(frozen=True, slots=True)
class _Shown:
    # Pictures for a family, and their reflectance.
    group: str
    roughness: float
    gloss: float
    least_m: float = 0.8  # of one repeat: a smaller one is seen to repeat on a floor or a wall
    across: float = 1.0  # share of the stated width across the grain


_WOOD_FLOOR: Final = _Shown("planks", 0.4, 0.5)
# fmt: off
_SHOWN: Final = {
    "strip": _WOOD_FLOOR, "planks": _WOOD_FLOOR, "laminate": _WOOD_FLOOR,
    "herringbone": _WOOD_FLOOR, "chevron": _WOOD_FLOOR,
    "tiles": _Shown("tiles", 0.22, 0.5, 0.15), "terracotta": _Shown("tiles", 0.4, 0.35, 0.15),
    "marble": _Shown("marble", 0.12, 0.5), "brick": _Shown("brick", 0.9, 0.0),
    "carpet": _Shown("carpet", 1.0, 0.0), "loop carpet": _Shown("carpet", 1.0, 0.0),
    "wallpaper": _Shown("wallpaper", 0.8, 0.0, 0.4), "plaster": _Shown("plaster", 0.9, 0.0),
    "concrete": _Shown("concrete", 0.62, 0.15), "grain": _Shown("wood", 0.4, 0.5, 0.0, 0.6),
    "weave": _Shown("cloth", 0.95, 0.0, 0.0), "twill": _Shown("cloth", 0.95, 0.0, 0.0),
    "leather": _Shown("leather", 0.46, 0.4, 0.0),
}
# fmt: on
_DRAWN: Final = 12  # pictures of which as many would be liked as much as drawn ones
# Prefix in MutableHouse.kept, followed by the id of a picture's texture.
_KEPT: Final = "photograph "


def photograph_for(house: MutableHouse, catalogue: Catalogue, family: str, seed: int) -> str:
    """Texture id of one of n fitting pictures of the catalogue, n of n + 12 times; else "" = draw it."""
    shown = _SHOWN.get(family)
    if shown is None:
        return ""
    fitting = [
        p for p in catalogue.pictures if p.group == shown.group and min(p.size) >= shown.least_m
    ]
    rng = house.rng("photograph", family, seed, len(fitting))
    if rng.random() * (len(fitting) + _DRAWN) >= len(fitting):
        return ""
    picture = fitting[int(rng.integers(len(fitting)))]
    if _KEPT + picture.texture.id in house.kept:
        return picture.texture.id
    # Take the mean colour now: a picture that cannot be read is drawn instead.
    try:
        mean = _mean_rgb(picture)
    except BadInput as error:
        note = Note("unreadable-texture", picture.texture.name[:80], error.message)
        if note not in house.notes:
            house.notes.append(note)
        return ""
    house.kept[_KEPT + picture.texture.id] = (picture, mean)
    return picture.texture.id


def photograph_material(
    house: MutableHouse, texture_id: str, family: str
) -> tuple[int, tuple[float, float], Rgb]:
    """The material that shows a picture of photograph_for: its number, size in metres, mean linear colour."""
    cached = house.kept[_KEPT + texture_id]
    assert isinstance(cached, tuple)
    picture, mean = cached
    shown = _SHOWN[family]
    material = Material(
        name=f"{family} {picture.texture.name[:40]}",
        texture_id=texture_id,
        specular=(shown.gloss,) * 3,
        roughness=shown.roughness,
        shininess=round(2.0 / max(shown.roughness, 0.1) ** 4 - 2.0, 1) if shown.gloss else 0.0,
    )
    width, height = picture.size
    size = (width, height * shown.across)
    return house.material(material, (picture.texture,)), size, mean


def _mean_rgb(picture: Picture) -> Rgb:
    pixels = decode_texture(picture.texture.data, picture.texture.name, picture.texture.media_type)
    table = linear_from_srgb(np.arange(256) / 255)
    r, g, b = (float(table[pixels[::4, ::4, k]].mean()) for k in range(3))
    return (r, g, b)
