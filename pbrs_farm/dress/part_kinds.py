"""Material kind of a furniture part, by its class, its material's name and colour; no effects."""

from __future__ import annotations

import colorsys
import re
from enum import StrEnum
from pathlib import Path
from typing import Final

from pydantic import field_validator

from pbrs_farm.core.classes import BED
from pbrs_farm.core.house import Item, ItemKind, Material, MaterialKind
from pbrs_farm.core.record import Nyu40, Record, read_toml
from pbrs_farm.dress.style import METALS, Metal, Rgb


class PartKind(StrEnum):
    """Material kinds that dressing distinguishes."""

    WOOD = "wood"
    SOFT = "soft"  # cloth or leather
    METAL = "metal"
    LACQUER = "lacquer"  # keeps its colour and gets a sheen
    OTHER = "other"  # unchanged by dressing


class _Classes(Record):
    wooden: frozenset[Nyu40]
    upholstered: frozenset[Nyu40]
    wet: frozenset[Nyu40]


class _Groups(Record):
    wooden: frozenset[str]
    soft: frozenset[str]
    fronts: frozenset[str]


class _Finishes(Record):
    # The file finishes.toml.
    words: dict[PartKind, frozenset[str]]
    metals: dict[str, tuple[str, ...]]
    classes: _Classes
    groups: _Groups

    @field_validator("metals")
    @classmethod
    def _metals_are_known(cls, metals: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        if unknown := metals.keys() - METALS.keys():
            raise ValueError(f"no metal {', '.join(sorted(unknown))}")
        return metals


_FILE: Final = read_toml(Path(__file__).with_name("finishes.toml"), _Finishes)
_LARGE_M: Final = 0.3
_BRIGHT: Final = 0.75
_KINDS: Final = (ItemKind.OBJECT, ItemKind.LAMP, ItemKind.DOOR)


def kind_of_part(material: Material, item: Item, group: str) -> PartKind:
    """Material kind of an item's material; OTHER for glass, screens, and what its group is never made of."""
    if material.kind is not MaterialKind.OPAQUE or item.kind not in _KINDS:
        return PartKind.OTHER
    if material.texture_id is not None or material.opacity < 1:
        return PartKind.OTHER
    named = kind_by_name(material.name)
    if named in (PartKind.METAL, PartKind.OTHER):
        return named
    may_be_wood = item.nyu40 in _FILE.classes.wooden or group in _FILE.groups.wooden
    if named is PartKind.WOOD or (named is None and is_brown(material.diffuse)):
        return PartKind.WOOD if may_be_wood else PartKind.OTHER
    if named is PartKind.SOFT:
        may_be_soft = (
            may_be_wood or item.nyu40 in _FILE.classes.upholstered or group in _FILE.groups.soft
        )
        return PartKind.SOFT if may_be_soft else PartKind.OTHER
    return PartKind.OTHER


def kind_by_name(name: str) -> PartKind | None:
    """Kind by whole words of a material's name, or None."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = set(re.findall(r"[a-z]+", parted.lower()))
    for kind, kind_words in _FILE.words.items():
        if words & kind_words:
            return kind
    return None


def is_bed(item: Item) -> bool:
    """Whether it is a bed."""
    return item.nyu40 == BED


def has_taps(item: Item) -> bool:
    """Whether its metal is a tap, a sink or a rail: bright whatever the home's taste."""
    return item.nyu40 in _FILE.classes.wet


def is_upholstered(item: Item, group: str) -> bool:
    """Whether its largest soft part is cloth or leather whatever its name."""
    return item.nyu40 in _FILE.classes.upholstered or group in _FILE.groups.soft


def is_furniture(item: Item, group: str) -> bool:
    """Whether boards of any colour may be of wood: furniture, but no door."""
    is_known = item.nyu40 in _FILE.classes.wooden or group in _FILE.groups.wooden
    return is_known and item.kind is ItemKind.OBJECT


def is_lacquered(item: Item, material: Material, group: str) -> bool:
    """Whether a plain part of no known kind is painted board: of furniture and kitchens."""
    is_plain = material.texture_id is None and material.kind is MaterialKind.OPAQUE
    may_be = item.kind is ItemKind.OBJECT and (
        is_furniture(item, group) or group in _FILE.groups.fronts
    )
    is_toned_down = is_loud(material.diffuse) and _is_large(item)
    return is_plain and (may_be or is_toned_down) and material.roughness is None


def _is_large(item: Item) -> bool:
    # A lampshade is, a toy is not.
    low, high = item.bounds
    return item.kind in (ItemKind.OBJECT, ItemKind.LAMP) and float((high - low).max()) > _LARGE_M


def is_loud(colour: Rgb) -> bool:
    """True for saturated screen colours, which are rare on large items in homes."""
    _, saturation, value = colorsys.rgb_to_hsv(*colour)
    is_of_wood = is_brown(colour) and value < _BRIGHT
    return saturation > 0.6 and value > 0.35 and not is_of_wood


def is_brown(colour: Rgb) -> bool:
    """Whether an sRGB-encoded colour is one that wood has."""
    hue, saturation, value = colorsys.rgb_to_hsv(*colour)
    is_bright_wood = saturation >= 0.5 and value > 0.93  # the yellow that models call pine
    is_wood = saturation >= 0.18 and 0.1 <= value <= 0.93
    return 8 / 360 <= hue <= 52 / 360 and (is_wood or is_bright_wood)


def is_white(colour: Rgb) -> bool:
    """Whether it is white lacquer, or near it."""
    _, saturation, value = colorsys.rgb_to_hsv(*colour)
    return value >= 0.72 and saturation <= 0.15


def is_dark(colour: Rgb) -> bool:
    """Whether it is black or nearly so."""
    return max(colour) < 0.28


def is_vivid(colour: Rgb) -> bool:
    """Whether it is a colour that wood never has: paint."""
    _, saturation, _ = colorsys.rgb_to_hsv(*colour)
    return saturation >= 0.3 and not is_brown(colour) and not is_dark(colour)


def metal_of(name: str, usual: Metal) -> Metal:
    for metal_name, words in _FILE.metals.items():
        if any(word in name for word in words):
            return METALS[metal_name]
    return usual
