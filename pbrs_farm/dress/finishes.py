"""The part `parts`: wood, cloth, leather and metals on furniture that has plain colours.

Wood keeps near the part's own colour and takes the grain of the home's wood; cloth and leather
take colours of the style; metals have measured colours. White lacquer, glass, mirrors, bulbs,
screens and what has a picture already stay. Effects: those of textures.families.
"""

from __future__ import annotations

import colorsys
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.classes import BED
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import Item, ItemKind, Material, MaterialKind, Surface
from pbrs_farm.core.mesh import area_vectors, face_areas, triangle_corners
from pbrs_farm.core.record import Nyu40, Record, read_toml
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.style import COLOURS, METALS, WOODS, Metal, Rgb, Style, Wood
from pbrs_farm.dress.textures.families import Pattern, pattern_material, photographed

# Texture coordinates for meshes without any: each face by the side of its own axes it looks to.
# Each connected board has its grain along its longest side. No effects.


_WELD_M = 1e-4  # vertices no farther apart are one
_GOLDEN = 0.6180339887498949  # how far each board's picture is shifted against the one before it
# Of a face that looks along an axis: the two others.
_ACROSS = np.array([[2, 1], [0, 2], [0, 1]])

Int = NDArray[np.int64]


def box_mapped(
    surface: Surface, axes: F64, size_m: tuple[float, float], *, is_grained: bool = True
) -> Surface:
    """The surface with uv in repeats of size_m; vertices are split where faces look elsewhere.

    axes: (3, 3), columns are the piece's own axes. is_grained: u runs along the longest side of
    each connected part, else along the horizontal.
    """
    local = surface.positions.astype(np.float64) @ axes
    normals = area_vectors(triangle_corners(surface.positions, surface.faces)) @ axes
    axis = np.abs(normals).argmax(1)
    part = _parts_of(local, surface.faces)
    # Choose for each face which of the two axes across its own is u.
    face_part = part[surface.faces[:, 0]]
    extent = _extents(local, part)[face_part]
    first, second = _ACROSS[axis, 0], _ACROSS[axis, 1]
    rows = np.arange(len(axis))
    if is_grained:
        swap = extent[rows, second] > extent[rows, first]
        first, second = np.where(swap, second, first), np.where(swap, first, second)
    # Split vertices by how their faces are mapped.
    key = surface.faces.ravel().astype(np.int64) * 9 + np.repeat(first * 3 + second, 3)
    unique, number = np.unique(key, return_inverse=True)
    vertex, way = np.divmod(unique, 9)
    count = np.arange(len(vertex))
    u, v = local[vertex][count, way // 3], local[vertex][count, way % 3]
    # Shift each part, so that no two boards show the same knot.
    shift = (part[vertex] * _GOLDEN) % 1.0
    uvs = np.stack([u / size_m[0] + shift, v / size_m[1] + (7 * shift) % 1.0], -1)
    return replace(
        surface,
        positions=surface.positions[vertex],
        faces=number.reshape(-1, 3).astype(np.int32),
        uvs=uvs.astype(np.float32),
        normals=None if surface.normals is None else surface.normals[vertex],
    )


def connected_parts(surface: Surface, axes: F64) -> Int:
    """(V,) number of the connected part of each vertex of a surface; equal places are one."""
    return _parts_of(surface.positions.astype(np.float64) @ axes, surface.faces)


def _parts_of(local: F64, faces: NDArray[np.int32]) -> Int:
    """(V,) number of the connected part of each vertex; equal positions are one."""
    places = np.rint(local / _WELD_M).astype(np.int64).reshape(-1, 3)
    # Number the cells in one row where 62 bits hold them: sorting rows takes three times as long.
    x, y, z = (places - places.min(0, initial=0)).T
    n_y, n_z = (int(k.max(initial=0)) + 1 for k in (y, z))
    if (int(x.max(initial=0)) + 1) * n_y * n_z < 1 << 62:
        _, welded = np.unique((x * n_y + y) * n_z + z, return_inverse=True)
    else:
        _, welded = np.unique(places, axis=0, return_inverse=True)
    welded = welded.ravel()
    n = int(welded.max()) + 1 if len(welded) else 0
    a, b, c = (welded[faces[:, k]] for k in range(3))
    links = coo_array((np.ones(2 * len(faces), np.int8), (np.r_[a, b], np.r_[b, c])), shape=(n, n))
    _, label = connected_components(links, directed=False)
    return np.asarray(label[welded], np.int64)


def _extents(local: F64, part: Int) -> F64:
    n = int(part.max()) + 1
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    np.minimum.at(low, part, local)
    np.maximum.at(high, part, local)
    return np.asarray(high - low)


# What a part of a piece of furniture is made of, by its class, its material's name and colour.


class PartKind(StrEnum):
    """What a part is made of, as far as dressing changes it."""

    WOOD = "wood"
    SOFT = "soft"  # cloth or leather
    METAL = "metal"
    LACQUER = "lacquer"  # keeps its colour and gets a sheen
    OTHER = "other"  # stays as it is


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
    def _metals_are_known(cls, told: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        if unknown := told.keys() - METALS.keys():
            raise ValueError(f"no metal {', '.join(sorted(unknown))}")
        return told


_FILE: Final = read_toml(Path(__file__).with_name("finishes.toml"), _Finishes)
_LARGE_M: Final = 0.3
_BRIGHT: Final = 0.75
_KINDS: Final = (ItemKind.OBJECT, ItemKind.LAMP, ItemKind.DOOR)


def kind_of_part(material: Material, item: Item, group: str) -> PartKind:
    """What a material of an item is made of. group: the catalogue's, "" where it is not known.

    Glass, mirrors, bulbs, pictures and screens are OTHER; so is all wood and cloth of things that
    are never made of it.
    """
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
    """What whole words of a material's name say, or None."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = set(re.findall(r"[a-z]+", parted.lower()))
    for kind, known in _FILE.words.items():
        if words & known:
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
    """Whether it is a colour of screens, such as few large things in homes have."""
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


# The part `parts`.


PART: Final = "parts"
_LEAST_BOARD_M2: Final = 0.05  # a part of no class that is smaller stays: knobs, feet
_UPWARD: Final = 0.7  # cosine: what one sits or lies on
_LEATHER_SHARE: Final = 0.25  # of sofas and armchairs
_MAX_SATURATION, _MAX_VALUE = 0.5, 0.72  # of painted furniture, as people buy it
_PAINT_STAYS: Final = 0.15  # of furniture painted in a colour that wood never has
_GREY_STAYS: Final = 0.6
_DARKEST: Final = 0.02  # linear: black wood still shows its grain, black paint some light
_SHEEN: Final = (0.5, 0.5, 0.5)  # Ks of lacquer: 4 % at normal incidence
_PALE: Final = "birch"


@dataclass(frozen=True, slots=True)
class _Finish:
    # A material, and how its picture is laid; size None: its coordinates stay.
    number: int
    size_m: tuple[float, float] | None = None
    is_grained: bool = False


def parts(draft: Draft, catalogue: Catalogue, style: Style, share: float) -> None:
    """Give a share of the furniture's plain parts the look of what they are made of.

    Parts of one colour in one room get one look, so that sets stay sets.
    """
    groups = {p.id: p.group for p in catalogue.pieces}
    n_source = len(draft.source.items)
    for index, item in enumerate(draft.items):
        # Of what was added only models of the catalogue have plain parts.
        is_finished = index >= n_source and item.source_class not in groups
        if item.kind.is_structure or not item.n_faces or is_finished:
            continue
        group = groups.get(item.source_class, "")
        kinds = _kinds(draft, item, group)
        surfaces = tuple(
            _finished(draft, catalogue, style, share, item, group, surface, kind)
            for surface, kind in zip(item.surfaces, kinds, strict=True)
        )
        if any(a is not b for a, b in zip(surfaces, item.surfaces, strict=True)):
            draft.change(index, replace(item, surfaces=surfaces), PART)
            draft.done[f"{PART}: {item.kind.value}"] += 1


def _kinds(draft: Draft, item: Item, group: str) -> list[PartKind]:
    kinds = [kind_of_part(draft.materials[s.material], item, group) for s in item.surfaces]
    materials = [draft.materials[s.material] for s in item.surfaces]
    # One sits or lies on the soft part, whatever it is called.
    if is_upholstered(item, group):
        areas = [
            0.0 if kind_by_name(m.name) in (PartKind.WOOD, PartKind.METAL) else _upward_area(s)
            for s, m in zip(item.surfaces, materials, strict=True)
        ]
        k = int(np.argmax(areas))
        if areas[k] > 0 and materials[k].texture_id is None and materials[k].opacity == 1:
            own = materials[k]
            kinds = [
                PartKind.SOFT if m is own and kind is not PartKind.METAL else kind
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
    # What is left of furniture is painted; beds and sofas have linen there.
    for k, material in enumerate(materials):
        is_free = kinds[k] is PartKind.OTHER and kind_by_name(material.name) is None
        if is_free and not is_upholstered(item, group) and is_lacquered(item, material, group):
            kinds[k] = PartKind.LACQUER
    return kinds


def _may_be_board(surface: Surface, material: Material, item: Item, group: str) -> bool:
    is_plain = material.texture_id is None and material.kind is MaterialKind.OPAQUE
    is_free = is_plain and kind_by_name(material.name) is None and not is_white(material.diffuse)
    return is_free and is_furniture(item, group) and _area(surface) >= _LEAST_BOARD_M2


def _finished(
    draft: Draft, catalogue: Catalogue, style: Style, share: float, item: Item, group: str,
    surface: Surface, kind: PartKind,
) -> Surface:  # fmt: skip
    material = draft.materials[surface.material]
    if kind is PartKind.OTHER:
        return surface
    shade = "".join(f"{round(31 * c):02x}" for c in material.diffuse)
    rng = draft.rng(
        PART, item.level_id, item.room_id or "", kind.value, group * (kind is PartKind.SOFT), shade
    )
    if rng.random() >= share:
        return surface
    make = {PartKind.WOOD: _wood, PartKind.SOFT: _soft, PartKind.METAL: _metal}.get(kind, _lacquer)
    finish = make(draft, catalogue, style, item, material, rng)
    if finish is None:
        return surface
    if finish.size_m is None:
        return replace(surface, material=finish.number)
    axes = np.eye(3) if item.box is None else item.box.axes
    mapped = box_mapped(surface, axes, finish.size_m, is_grained=finish.is_grained)
    return replace(mapped, material=finish.number)


def _wood(
    draft: Draft, catalogue: Catalogue, style: Style, item: Item, material: Material,
    rng: np.random.Generator,
) -> _Finish | None:  # fmt: skip
    own, stays = material.diffuse, rng.random()
    # Paint may stay paint; so may grey.
    is_other = not (is_brown(own) or is_dark(own) or is_vivid(own))
    if (is_vivid(own) and stays < _PAINT_STAYS) or (is_other and stays < _GREY_STAYS):
        return _lacquer(draft, catalogue, style, item, material, rng)
    mean = linear_from_srgb(np.array(style.wood.mean))
    mine = np.maximum(linear_from_srgb(np.array(own)), _DARKEST)
    # The stronger a brown, the less of it is of wood.
    strength = (max(own) - min(own)) * max(own)
    weight = 1.0 if is_vivid(own) else float(rng.uniform(0.25, 0.85)) ** (1 - 0.8 * strength)
    # What is dark stays dark: mix in the logarithm.
    wanted = np.exp((1 - weight) * np.log(mine) + weight * np.log(mean))
    if is_dark(own):
        wanted = mean * float(mine @ LUMINANCE + 0.02) / float(mean @ LUMINANCE)
    is_pale = float(wanted @ LUMINANCE) > float(mean @ LUMINANCE)
    wood = WOODS[_PALE] if is_pale else style.wood
    pattern = photographed(draft, catalogue, grain_pattern(draft, wood))
    return _tinted(draft, pattern, wanted, is_grained=True)


def grain_pattern(draft: Draft, wood: Wood) -> Pattern:
    """The one veneer that a home's furniture of that wood shows."""
    seed = int(draft.rng(PART, "grain", wood.name).integers(2**31))
    return Pattern("grain", seed, wood=wood)


def _soft(
    draft: Draft, catalogue: Catalogue, style: Style, item: Item, material: Material,
    rng: np.random.Generator,
) -> _Finish | None:  # fmt: skip
    colours: Mapping[bool, tuple[Rgb, ...]] = {False: style.textiles, True: style.textiles[:3]}
    wanted = linear_from_srgb(
        np.array(colours[is_bed(item)][int(rng.integers(len(colours[is_bed(item)])))])
    )
    family = (
        "leather" if "leather" in material.name.lower() else str(rng.choice(["weave", "twill"]))
    )
    # Bed linen is light; some sofas are of leather, in its own browns and blacks.
    if is_bed(item):
        wanted = 0.45 * wanted + 0.55 * np.array([0.8, 0.79, 0.76])
    elif family != "leather" and rng.random() < _LEATHER_SHARE:
        family = "leather"
    if family == "leather":
        hides = COLOURS["hides"]
        wanted = linear_from_srgb(np.array(hides[int(rng.integers(len(hides)))]))
    seed = int(draft.rng(PART, family).integers(2**31))
    pattern = photographed(draft, catalogue, Pattern(family, seed))
    return _tinted(draft, pattern, wanted, is_grained=False)


def _lacquer(
    draft: Draft, catalogue: Catalogue, style: Style, item: Item, material: Material,
    rng: np.random.Generator,
) -> _Finish | None:  # fmt: skip
    has_sheen = material.specular != (0.0, 0.0, 0.0) and material.shininess > 1
    own = material.diffuse
    # Screen colours are mixed down to those that paint has.
    if is_vivid(own) or is_loud(own):
        hue, saturation, value = colorsys.rgb_to_hsv(*own)
        own = colorsys.hsv_to_rgb(hue, min(saturation, _MAX_SATURATION), min(value, _MAX_VALUE))
    if has_sheen and own == material.diffuse and max(own) > 0.1:
        return None
    linear = np.maximum(linear_from_srgb(np.array(own)), _DARKEST)
    r, g, b = (round(float(c), 4) for c in srgb_from_linear(linear))
    roughness = round(float(rng.uniform(0.25, 0.5)), 2)
    painted = replace(
        material, diffuse=(r, g, b), specular=_SHEEN, roughness=roughness,
        shininess=round(2 / roughness**4 - 2, 1),
    )  # fmt: skip
    return _Finish(draft.material(painted))


def _metal(
    draft: Draft, catalogue: Catalogue, style: Style, item: Item, material: Material,
    rng: np.random.Generator,
) -> _Finish | None:  # fmt: skip
    if is_dark(material.diffuse) or (is_vivid(material.diffuse) and not is_brown(material.diffuse)):
        return None
    metal = _metal_of(material.name.lower(), METALS["chrome"] if has_taps(item) else style.metal)
    # Nearly all light is in the highlight: a metal has no colour beneath it.
    r, g, b = (0.4 * c for c in metal.colour)
    polished = replace(
        material, diffuse=(r, g, b), specular=metal.colour, roughness=metal.roughness,
        shininess=round(2 / max(metal.roughness, 0.1) ** 4 - 2, 1),
    )  # fmt: skip
    return _Finish(draft.material(polished))


def _metal_of(name: str, usual: Metal) -> Metal:
    for known, words in _FILE.metals.items():
        if any(word in name for word in words):
            return METALS[known]
    return usual


def _tinted(draft: Draft, pattern: Pattern, wanted: F64, *, is_grained: bool) -> _Finish:
    # The pattern's material in another colour: its picture times a diffuse of at most 1.
    made = pattern_material(draft, pattern)
    ratio = wanted / np.maximum(np.array(made.mean_rgb), 1e-3)
    ratio = ratio / max(1.0, float(ratio.max()))
    r, g, b = (round(float(c), 4) for c in srgb_from_linear(ratio))
    tinted = replace(draft.materials[made.number], diffuse=(r, g, b))
    return _Finish(draft.material(tinted), made.size_m, is_grained)


def _area(surface: Surface) -> float:
    return float(face_areas(triangle_corners(surface.positions, surface.faces)).sum())


def _upward_area(surface: Surface) -> float:
    vectors = area_vectors(triangle_corners(surface.positions, surface.faces))
    length = np.linalg.norm(vectors, axis=1)
    return float(length[vectors[:, 1] > _UPWARD * length].sum())
