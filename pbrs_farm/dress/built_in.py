"""Doors, windows, stairs, railings, radiators, appliances and steps of one home in its scheme.

What has a picture of its own, and glass, stay. Effects: on the draft.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeVar

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.classes import DOOR, MIRROR, OTHERFURNITURE, OTHERSTRUCTURE, REFRIGERATOR
from pbrs_farm.core.house import Item, ItemKind, Material, MaterialKind, Surface
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.finishes import box_mapped, connected_parts, grain_pattern
from pbrs_farm.dress.style import (
    COLOURS,
    METALS,
    WOODS,
    WOODS_FOR,
    Metal,
    Rgb,
    Style,
    Wood,
    mix,
    rgb,
    shade,
)
from pbrs_farm.dress.textures.families import pattern_material
from pbrs_farm.home.names import RADIATORS, words_of_item

# One scheme of joinery a home: the coats of trim, doors, windows, stairs and what is fitted.
# The shares are suggestions of ours for European homes: half of the trim is some white, a third
# wood. Colours are sRGB-encoded, 0..1.


_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Coat:
    """What a part is painted with or made of; the first of wood, metal and paint that is there."""

    name: str
    paint: Rgb = (0.93, 0.925, 0.91)
    roughness: float = 0.4
    wood: Wood | None = None
    metal: Metal | None = None


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


# Surfaces under a coat of paint, wood or metal; effects: materials and textures of the draft.


COATED = "coated"
"""First word of the names of these materials: the part `parts` leaves them as they are."""

_SHEEN = (0.4, 0.4, 0.4)


def coated(draft: Draft, surface: Surface, coat: Coat, axes: F64) -> Surface:
    """The surface under a coat; axes: (3, 3), columns are the thing's own, along which wood grows."""
    if coat.wood is None:
        return replace(surface, material=plain_material(draft, coat))
    veneer = pattern_material(draft, grain_pattern(draft, coat.wood))
    mapped = box_mapped(surface, axes, veneer.size_m)
    return replace(mapped, material=veneer.number)


def coated_item(draft: Draft, item: Item, coat: Coat) -> Item:
    """The item with every plain opaque surface under the coat; itself where it has none."""
    if not has_plain(draft, item):
        return item
    axes = np.eye(3) if item.box is None else item.box.axes
    return replace(
        item,
        surfaces=tuple(
            coated(draft, s, coat, axes) if is_plain(draft.materials[s.material]) else s
            for s in item.surfaces
        ),
    )


def has_plain(draft: Draft, item: Item) -> bool:
    """Whether a coat would cover any of its surfaces."""
    return any(is_plain(draft.materials[s.material]) for s in item.surfaces)


def is_plain(material: Material) -> bool:
    """Whether a coat would cover it: opaque and without a picture."""
    is_solid = material.kind is MaterialKind.OPAQUE and material.opacity == 1
    return is_solid and material.texture_id is None


def part_of_surface(surface: Surface, faces: Bools) -> Surface:
    """The surface with those of its faces (F,) alone, and the vertices they use."""
    kept = surface.faces[faces]
    used, numbers = np.unique(kept, return_inverse=True)
    return replace(
        surface,
        positions=surface.positions[used],
        faces=numbers.reshape(-1, 3).astype(np.int32),
        uvs=None if surface.uvs is None else surface.uvs[used],
        normals=None if surface.normals is None else surface.normals[used],
    )


def plain_material(draft: Draft, coat: Coat) -> int:
    """The number of the material of a coat without a picture; wood counts as its mean colour."""
    return draft.material(coat_material(coat))


def coat_material(coat: Coat) -> Material:
    """The material of a coat without a picture; wood counts as its mean colour."""
    if coat.metal is not None:
        return _polished(coat.metal)
    paint = coat.paint if coat.wood is None else coat.wood.mean
    return _painted_coat(coat.name, paint, coat.roughness)


def _painted_coat(name: str, colour: Rgb, roughness: float) -> Material:
    r, g, b = (round(c, 4) for c in colour)
    code = "".join(f"{round(255 * c):02x}" for c in (r, g, b))
    return Material(
        f"{COATED} {name} {code} {roughness:.2f}", diffuse=(r, g, b), specular=_SHEEN,
        shininess=round(2.0 / roughness**4 - 2.0, 1), roughness=roughness,
    )  # fmt: skip


def _polished(metal: Metal) -> Material:
    # Nearly all light is in the highlight, as the metals of furniture have it.
    r, g, b = (round(0.4 * c, 4) for c in metal.colour)
    return Material(
        f"{COATED} {metal.name}", diffuse=(r, g, b), specular=metal.colour,
        roughness=metal.roughness, shininess=round(2 / max(metal.roughness, 0.1) ** 4 - 2, 1),
    )  # fmt: skip


# Doors, windows, stairs, railings, radiators, appliances and steps of one home in its scheme.


PART: Final = "joinery"
_SMALL_M: Final = 0.25  # handles and hinges; what is larger belongs to the frame or the leaf
_FRAME: Final = 0.97  # of the width: what reaches so far is the frame
_SLENDER_M: Final = 0.13  # rails, balusters and pipes: their second longest side
_FRONT_SHARE: Final = 0.3  # of an appliance's faces: a part that has more is its body
_APPLIANCES: Final = frozenset(
    {"cooker", "dishwasher", "washer", "hood", "oven", "dryer", "fridge", "freezer"}
)
_TO_STREET: Final = ("front", "garage", "entrance")


def joinery(draft: Draft, catalogue: Catalogue, style: Style, share: float) -> None:
    """Give what carpenters and fitters bring the coats of the home's one scheme.

    share: of the kinds of things (all doors, all windows, ...) that are changed.
    """
    scheme = joinery_scheme(draft, style)
    kinds = {
        kind: float(draft.rng(PART, kind).random()) < share
        for kind in (
            "door",
            "window",
            "stairs",
            "railing",
            "radiator",
            "appliance",
            "spotlight",
            "mirror",
        )
    }
    for index, item in enumerate(draft.items):
        if item.kind.is_structure or not item.n_faces:
            continue
        kind = _kind(item)
        if not kinds.get(kind, False):
            continue
        made = _in_scheme(draft, item, kind, scheme)
        if made is not item:
            draft.change(index, made, PART)
            draft.done[f"{PART}: {kind}"] += 1


def _kind(item: Item) -> str:
    """Which of the scheme's kinds of things it is, "" for none."""
    words = words_of_item(item)
    if item.kind is ItemKind.WINDOW:
        return "window"
    if item.kind is ItemKind.DOOR or item.nyu40 == DOOR:
        return "door"
    if item.kind is ItemKind.STAIRS:
        return "stairs"
    if item.nyu40 == MIRROR:
        return "mirror"
    if item.nyu40 == OTHERSTRUCTURE:
        return "railing"
    if item.kind is ItemKind.LAMP:
        return "spotlight" if any("spot" in word for word in words) else ""
    if item.nyu40 == OTHERFURNITURE and words & RADIATORS:
        return "radiator"
    is_appliance = item.nyu40 in (OTHERFURNITURE, REFRIGERATOR)
    return "appliance" if is_appliance and words & _APPLIANCES else ""


def _in_scheme(draft: Draft, item: Item, kind: str, scheme: JoineryScheme) -> Item:
    if kind == "door":
        said = f"{item.name} {item.source_class}".casefold()
        is_front = any(word in said for word in _TO_STREET)
        return _fitted(draft, item, scheme, scheme.front if is_front else scheme.leaf, scheme.trim)
    if kind == "window":
        return _fitted(draft, item, scheme, scheme.window, scheme.window)
    if kind == "stairs":
        coat = scheme.stone if item.room_id is None and len(item.surfaces) > 1 else scheme.stair
        return coated_item(draft, item, coat)
    if kind == "railing":
        return coated_item(draft, item, _coat_of_structure(item, scheme))
    if kind == "radiator":
        return coated_item(draft, item, scheme.radiator)
    if kind == "mirror":
        return _framed_mirror(draft, item, scheme)
    if kind == "spotlight":
        return _spotlight(draft, item, scheme)
    return _appliance(draft, item, scheme)


def _coat_of_structure(item: Item, scheme: JoineryScheme) -> Coat:
    # Rails and balusters are thin two ways; what is not is built of stone.
    if float(np.sort(item.oriented_box.half * 2)[1]) > _SLENDER_M:
        return scheme.stone
    return scheme.pipe if "pipe" in item.name.casefold() else scheme.railing


def _fitted(draft: Draft, item: Item, scheme: JoineryScheme, leaf: Coat, frame: Coat) -> Item:
    """A door or window by its connected parts: what spans its width is frame, small parts fittings."""
    # What lights is named by the number of its surface, which parting would change.
    if any(light.emitting for light in item.lights) or not has_plain(draft, item):
        return item
    box = item.oriented_box
    wide = float(box.half[0] * 2)
    found: list[Surface] = []
    for surface in item.surfaces:
        if not is_plain(draft.materials[surface.material]):
            found.append(surface)
            continue
        for part, size in _parts(surface, box.axes):
            is_frame = size[0] > _FRAME * wide and frame != leaf
            coat = scheme.fitting if size.max() < _SMALL_M else frame if is_frame else leaf
            found.append(coated(draft, part, coat, box.axes))
    return replace(item, surfaces=tuple(_merged(found)))


def _parts(surface: Surface, axes: F64) -> Iterator[tuple[Surface, F64]]:
    """Each connected part of a surface, and its size along the axes (3,)."""
    part = connected_parts(surface, axes)[surface.faces[:, 0]]
    for k in range(int(part.max(initial=-1)) + 1):
        mine = part_of_surface(surface, part == k)
        if len(mine.faces):
            yield mine, np.ptp(mine.positions.astype(np.float64) @ axes, axis=0)


def _merged(surfaces: list[Surface]) -> list[Surface]:
    """Surfaces of one name and material as one, in the order they are first met."""
    groups: dict[tuple[str, int], list[Surface]] = {}
    for surface in surfaces:
        groups.setdefault((surface.name, surface.material), []).append(surface)
    return [_joined(some) for some in groups.values()]


def _joined(some: list[Surface]) -> Surface:
    if len(some) == 1:
        return some[0]
    starts = np.cumsum([0, *(len(s.positions) for s in some)])
    uvs = [s.uvs for s in some if s.uvs is not None]
    normals = [s.normals for s in some if s.normals is not None]
    return replace(
        some[0],
        positions=np.concatenate([s.positions for s in some]),
        faces=np.concatenate([s.faces + n for s, n in zip(some, starts, strict=False)]).astype(np.int32),
        uvs=np.concatenate(uvs) if len(uvs) == len(some) else None,
        normals=np.concatenate(normals) if len(normals) == len(some) else None,
    )  # fmt: skip


def _appliance(draft: Draft, item: Item, scheme: JoineryScheme) -> Item:
    # The body alone: plates, doors and panels keep their glass and black.
    areas = [float(face_areas(triangle_corners(s.positions, s.faces)).sum()) for s in item.surfaces]
    return _with_coat(
        draft, item, scheme.appliance,
        [a >= _FRONT_SHARE * sum(areas) and _is_bright(draft, s)
         for a, s in zip(areas, item.surfaces, strict=True)],
    )  # fmt: skip


def _framed_mirror(draft: Draft, item: Item, scheme: JoineryScheme) -> Item:
    # Where no surface is known to be glass, all of it may be.
    materials = [draft.materials[s.material] for s in item.surfaces]
    if not any(m.kind is MaterialKind.MIRROR for m in materials):
        return item
    return coated_item(draft, item, scheme.trim)


def _spotlight(draft: Draft, item: Item, scheme: JoineryScheme) -> Item:
    emitting = {k for light in item.lights for k in light.emitting}
    return _with_coat(
        draft, item, scheme.spotlight, [k not in emitting for k in range(len(item.surfaces))]
    )


def _with_coat(draft: Draft, item: Item, coat: Coat, covers: list[bool]) -> Item:
    axes = item.oriented_box.axes
    surfaces = tuple(
        coated(draft, s, coat, axes) if is_mine and is_plain(draft.materials[s.material]) else s
        for s, is_mine in zip(item.surfaces, covers, strict=True)
    )
    if all(a is b for a, b in zip(surfaces, item.surfaces, strict=True)):
        return item
    return replace(item, surfaces=surfaces)


def _is_bright(draft: Draft, surface: Surface) -> bool:
    return max(draft.materials[surface.material].diffuse) > 0.25
