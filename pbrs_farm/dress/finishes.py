"""The pass `parts`: wood, cloth, leather and metals for furniture with plain colours.

Wood keeps a colour near the part's own and takes the grain of the home's wood; cloth and leather
take colours of the style; metals have measured colours. White lacquer, glass, mirrors, bulbs,
screens and textured parts are unchanged. Effects: those of textures.families.
"""

from __future__ import annotations

import colorsys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import Item, Material, MaterialKind, Surface
from pbrs_farm.core.mesh import area_vectors, triangle_corners
from pbrs_farm.dress.box_mapping import area_of_look, box_mapped
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.part_kinds import (
    PartKind,
    has_taps,
    is_bed,
    is_brown,
    is_dark,
    is_furniture,
    is_lacquered,
    is_loud,
    is_upholstered,
    is_vivid,
    is_white,
    kind_by_name,
    kind_of_part,
    metal_of,
)
from pbrs_farm.dress.patterns import SEEDS, Pattern, pattern_material, photographed
from pbrs_farm.dress.style import COLOURS, METALS, WOODS, Rgb, Style, Wood

PASS: Final = "parts"
_LEAST_BOARD_M2: Final = 0.05  # smaller parts of unknown kind are unchanged: knobs, feet
_UPWARD: Final = 0.7  # minimum cosine of faces to sit or lie on
_LEATHER_SHARE: Final = 0.25  # share of sofas and armchairs
_MAX_SATURATION, _MAX_VALUE = 0.5, 0.72  # of painted furniture, as people buy it
_PAINT_STAYS: Final = 0.15  # chance that furniture in a colour that wood never has stays painted
_GREY_STAYS: Final = 0.6
_DARKEST: Final = 0.02  # linear: black wood still shows its grain, black paint some light
_SHEEN: Final = (0.5, 0.5, 0.5)  # Ks of lacquer: 4 % at normal incidence
_PALE: Final = "birch"


@dataclass(frozen=True, slots=True)
class LaidMaterial:
    """A material, and how its picture is laid; size None: its coordinates stay."""

    number: int
    size_m: tuple[float, float] | None = None
    is_grained: bool = False


def finish_furniture(house: MutableHouse, catalogue: Catalogue, style: Style, share: float) -> None:
    """Give a share of the plain parts the look of their material, one for a colour and room."""
    groups = {p.id: p.group for p in catalogue.pieces}
    n_source = len(house.source.items)
    for index, item in enumerate(house.items):
        # Among added items only models of the catalogue have plain parts.
        is_finished = index >= n_source and item.source_class not in groups
        if item.kind.is_structure or not item.n_faces or is_finished:
            continue
        group = groups.get(item.source_class, "")
        kinds = _kinds_of_surfaces(house, item, group)
        surfaces = tuple(
            _finish_surface(house, catalogue, style, share, item, group, surface, kind)
            for surface, kind in zip(item.surfaces, kinds, strict=True)
        )
        if any(a is not b for a, b in zip(surfaces, item.surfaces, strict=True)):
            house.change(index, replace(item, surfaces=surfaces), PASS)
            house.done[f"{PASS}: {item.kind.value}"] += 1


def _kinds_of_surfaces(house: MutableHouse, item: Item, group: str) -> list[PartKind]:
    kinds = [kind_of_part(house.materials[s.material], item, group) for s in item.surfaces]
    materials = [house.materials[s.material] for s in item.surfaces]
    # The part to sit or lie on is soft, whatever its name.
    if is_upholstered(item, group):
        areas = [
            0.0 if kind_by_name(m.name) in (PartKind.WOOD, PartKind.METAL) else _upward_area(s)
            for s, m in zip(item.surfaces, materials, strict=True)
        ]
        k = int(np.argmax(areas))
        if areas[k] > 0 and materials[k].texture_id is None and materials[k].opacity == 1:
            item_material = materials[k]
            kinds = [
                PartKind.SOFT if m is item_material and kind is not PartKind.METAL else kind
                for m, kind in zip(materials, kinds, strict=True)
            ]
    # Boards are of wood in any colour but white; a draw per colour decides later.
    is_simple = len(set(materials)) <= 2
    for k, (surface, material) in enumerate(zip(item.surfaces, materials, strict=True)):
        if kinds[k] is PartKind.OTHER and _may_be_board(surface, material, item, group):
            # A grey part of a bed may be its frame as well as a blanket: it stays.
            is_frame = (
                is_bed(item)
                and is_simple
                and (is_vivid(material.diffuse) or is_dark(material.diffuse))
            )
            if not is_upholstered(item, group) or is_frame:
                kinds[k] = PartKind.WOOD
            elif is_bed(item) and is_vivid(material.diffuse):
                kinds[k] = PartKind.SOFT
    # Remaining parts of furniture are painted; those of beds and sofas are linen.
    for k, material in enumerate(materials):
        is_free = kinds[k] is PartKind.OTHER and kind_by_name(material.name) is None
        if is_free and not is_upholstered(item, group) and is_lacquered(item, material, group):
            kinds[k] = PartKind.LACQUER
    return kinds


def _may_be_board(surface: Surface, material: Material, item: Item, group: str) -> bool:
    is_plain = material.texture_id is None and material.kind is MaterialKind.OPAQUE
    is_free = is_plain and kind_by_name(material.name) is None and not is_white(material.diffuse)
    return is_free and is_furniture(item, group) and area_of_look(item, surface) >= _LEAST_BOARD_M2


def _finish_surface(
    house: MutableHouse,
    catalogue: Catalogue,
    style: Style,
    share: float,
    item: Item,
    group: str,
    surface: Surface,
    kind: PartKind,
) -> Surface:
    material = house.materials[surface.material]
    if kind is PartKind.OTHER:
        return surface
    shade = "".join(f"{round(31 * c):02x}" for c in material.diffuse)
    rng = house.rng(
        PASS, item.level_id, item.room_id or "", kind.value, group * (kind is PartKind.SOFT), shade
    )
    if rng.random() >= share:
        return surface
    make = {
        PartKind.WOOD: _finish_wood,
        PartKind.SOFT: _finish_soft,
        PartKind.METAL: _finish_metal,
    }.get(kind, _finish_lacquer)
    finish = make(house, catalogue, style, item, material, rng)
    if finish is None:
        return surface
    if finish.size_m is None:
        return replace(surface, material=finish.number)
    axes = np.eye(3) if item.box is None else item.box.axes
    mapped = box_mapped(surface, axes, finish.size_m, is_grained=finish.is_grained)
    return replace(mapped, material=finish.number)


def _finish_wood(
    house: MutableHouse,
    catalogue: Catalogue,
    style: Style,
    item: Item,
    material: Material,
    rng: np.random.Generator,
) -> LaidMaterial | None:
    colour, stays = material.diffuse, rng.random()
    # Paint may stay paint; so may grey.
    is_other = not (is_brown(colour) or is_dark(colour) or is_vivid(colour))
    if (is_vivid(colour) and stays < _PAINT_STAYS) or (is_other and stays < _GREY_STAYS):
        return _finish_lacquer(house, catalogue, style, item, material, rng)
    mean = linear_from_srgb(np.array(style.wood.mean))
    mine = np.maximum(linear_from_srgb(np.array(colour)), _DARKEST)
    # The stronger a brown, the less of it is of wood.
    strength = (max(colour) - min(colour)) * max(colour)
    weight = 1.0 if is_vivid(colour) else float(rng.uniform(0.25, 0.85)) ** (1 - 0.8 * strength)
    # Mix in the logarithm, so that dark colours stay dark.
    target = np.exp((1 - weight) * np.log(mine) + weight * np.log(mean))
    if is_dark(colour):
        target = mean * float(mine @ LUMINANCE + 0.02) / float(mean @ LUMINANCE)
    is_pale = float(target @ LUMINANCE) > float(mean @ LUMINANCE)
    wood = WOODS[_PALE] if is_pale else style.wood
    pattern = photographed(house, catalogue, grain_pattern(house, wood))
    return tinted(house, pattern, target, is_grained=True)


def grain_pattern(house: MutableHouse, wood: Wood) -> Pattern:
    """The one veneer that a home's furniture of that wood shows."""
    seed = int(house.rng(PASS, "grain", wood.name).integers(SEEDS))
    return Pattern("grain", seed, wood=wood)


def _finish_soft(
    house: MutableHouse,
    catalogue: Catalogue,
    style: Style,
    item: Item,
    material: Material,
    rng: np.random.Generator,
) -> LaidMaterial | None:
    colours: Mapping[bool, tuple[Rgb, ...]] = {False: style.textiles, True: style.textiles[:3]}
    target = linear_from_srgb(
        np.array(colours[is_bed(item)][int(rng.integers(len(colours[is_bed(item)])))])
    )
    family = (
        "leather" if "leather" in material.name.lower() else str(rng.choice(["weave", "twill"]))
    )
    # Bed linen is light; some sofas are of leather, in its own browns and blacks.
    if is_bed(item):
        target = 0.45 * target + 0.55 * np.array([0.8, 0.79, 0.76])
    elif family != "leather" and rng.random() < _LEATHER_SHARE:
        family = "leather"
    if family == "leather":
        hides = COLOURS["hides"]
        target = linear_from_srgb(np.array(hides[int(rng.integers(len(hides)))]))
    seed = int(house.rng(PASS, family).integers(SEEDS))
    pattern = photographed(house, catalogue, Pattern(family, seed))
    return tinted(house, pattern, target, is_grained=False)


def _finish_lacquer(
    house: MutableHouse,
    catalogue: Catalogue,
    style: Style,
    item: Item,
    material: Material,
    rng: np.random.Generator,
) -> LaidMaterial | None:
    has_sheen = material.specular != (0.0, 0.0, 0.0) and material.shininess > 1
    colour = material.diffuse
    # Screen colours are mixed down to those that paint has.
    if is_vivid(colour) or is_loud(colour):
        hue, saturation, value = colorsys.rgb_to_hsv(*colour)
        colour = colorsys.hsv_to_rgb(hue, min(saturation, _MAX_SATURATION), min(value, _MAX_VALUE))
    if has_sheen and colour == material.diffuse and max(colour) > 0.1:
        return None
    linear = np.maximum(linear_from_srgb(np.array(colour)), _DARKEST)
    r, g, b = (round(float(c), 4) for c in srgb_from_linear(linear))
    roughness = round(float(rng.uniform(0.25, 0.5)), 2)
    painted = replace(
        material,
        diffuse=(r, g, b),
        specular=_SHEEN,
        roughness=roughness,
        shininess=round(2 / roughness**4 - 2, 1),
    )
    return LaidMaterial(house.material(painted))


def _finish_metal(
    house: MutableHouse,
    catalogue: Catalogue,
    style: Style,
    item: Item,
    material: Material,
    rng: np.random.Generator,
) -> LaidMaterial | None:
    if is_dark(material.diffuse) or (is_vivid(material.diffuse) and not is_brown(material.diffuse)):
        return None
    metal = metal_of(material.name.lower(), METALS["chrome"] if has_taps(item) else style.metal)
    # Nearly all light is in the highlight: a metal has no colour beneath it.
    r, g, b = (0.4 * c for c in metal.colour)
    polished = replace(
        material,
        diffuse=(r, g, b),
        specular=metal.colour,
        roughness=metal.roughness,
        shininess=round(2 / max(metal.roughness, 0.1) ** 4 - 2, 1),
    )
    return LaidMaterial(house.material(polished))


def tinted(house: MutableHouse, pattern: Pattern, colour: F64, *, is_grained: bool) -> LaidMaterial:
    """The pattern's material in another mean colour, linear: its picture times a diffuse of at most 1."""
    laid = pattern_material(house, pattern)
    ratio = colour / np.maximum(np.array(laid.mean_rgb), 1e-3)
    ratio = ratio / max(1.0, float(ratio.max()))
    r, g, b = (round(float(c), 4) for c in srgb_from_linear(ratio))
    tinted = replace(house.materials[laid.number], diffuse=(r, g, b))
    return LaidMaterial(house.material(tinted), laid.size_m, is_grained)


def _upward_area(surface: Surface) -> float:
    vectors = area_vectors(triangle_corners(surface.positions, surface.faces))
    length = np.linalg.norm(vectors, axis=1)
    return float(length[vectors[:, 1] > _UPWARD * length].sum())
