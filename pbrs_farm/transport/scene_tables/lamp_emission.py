"""Area emitters: the faces of a house's lamps that emit, and their radiance; no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, I64, Bools, triple
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import Geometry, House, Item, LightPart, MaterialKind
from pbrs_farm.core.lighting import flux_lm
from pbrs_farm.core.mesh import closed_edge_share, face_areas, triangle_corners
from pbrs_farm.core.recipe import EmissionFields, Recipe
from pbrs_farm.transport.scene_tables.blackbody import rgb_from_kelvin

_MIN_LIGHT_OUTPUT_RATIO: Final = 0.25  # a bulb gets at most four times stronger for its shade
_PLACE_DIGITS: Final = 5  # corners that agree to 10 micrometres are one
_CLOSED: Final = 0.95  # share of closed edges from which a mesh has an inside


@dataclass(frozen=True, slots=True, eq=False)
class AreaEmitter:
    """A light source of a lamp: all faces that emit with one radiance."""

    name: str  # of the item, with the number of the source where it has several
    item: int  # index into House.items
    room_id: str | None
    faces: I64  # (T,) of the geometry
    face_areas: F64  # (T,) m2
    radiance: tuple[float, float, float]  # W m-2 sr-1, linear RGB, from both sides of every face
    area_m2: float  # the sum of face_areas
    flux_lm: float


def area_emitters_of_house(
    house: House, geometry: Geometry, keep: Bools, recipe: Recipe
) -> tuple[AreaEmitter, ...]:
    """The emitters of every light part with a face, in the order of items and their light parts.

    Preset `photometric`: radiance = flux / (179 pi area), where the area of a closed bulb is its
    outside and that of an open surface both its sides (faces emit to both; what a bulb emits
    inwards stays inside). Preset `released`: bulbs 400, shades 0.5, white, whatever their size.
    """
    # Number the surfaces through the whole house, as geometry.face_surface does.
    released = recipe.emission.preset == "released"
    face_of = _faces_by_surface(geometry, keep)
    number = 0  # of the item's first surface
    emitters: list[AreaEmitter] = []
    taken: set[int] = set()  # surfaces that an earlier light part emits from
    for index, item in enumerate(house.items):
        for k, part in enumerate(item.lights):
            mine = [number + j for j in part.emitting if number + j not in taken]
            taken.update(mine)
            faces = np.concatenate([np.zeros(0, np.int64), *(face_of.get(j, _NONE) for j in mine)])
            if len(faces):
                flux = _flux_and_rgb(house, part, k, item, recipe)
                emitters.append(_bulb_emitter(house, geometry, (index, k), faces, flux, recipe))
        # Let shades emit by themselves where the published renderer had them do so.
        if released:
            for j, surface in enumerate(item.surfaces):
                is_shade = house.materials[surface.material].kind is MaterialKind.SHADE
                if is_shade and number + j in face_of and number + j not in taken:
                    emitters.append(
                        _shade_emitter(item, geometry, index, face_of[number + j], recipe)
                    )
        number += len(item.surfaces)
    return tuple(emitters)


_NONE = np.zeros(0, np.int64)


def _faces_by_surface(geometry: Geometry, keep: Bools) -> dict[int, I64]:
    """Number of a surface -> its faces that are kept; a surface's faces follow one another."""
    numbers, starts = np.unique(geometry.face_surface, return_index=True)
    runs = np.split(np.arange(len(geometry.face_surface)), starts[1:])
    found = {int(n): faces[keep[faces]] for n, faces in zip(numbers, runs, strict=True)}
    return {number: faces for number, faces in found.items() if len(faces)}


def _flux_and_rgb(
    house: House, part: LightPart, k: int, item: Item, recipe: Recipe
) -> tuple[float, F64]:
    """(flux in lm, colour of luminance 1) of a light part.

    The source states the flux that leaves the lamp. Its shade keeps part of the bulb's flux, so
    the bulb emits more: flux over the light output ratio, which repair stores as part.escape.
    """
    e = recipe.emission
    flux = flux_lm(part.power, part.unit, part.share, lamp_lm=e.lamp_lm, lm_per_watt=e.lm_per_watt)
    if e.compensate_shades and part.escape is not None:
        flux /= min(max(part.escape, _MIN_LIGHT_OUTPUT_RATIO), 1.0)
    return max(flux, 0.0), lamp_rgb(part.rgb_linear, f"{house.id}/{item.id}/{k}", e, recipe.seed)


def lamp_rgb(
    rgb_linear: tuple[float, float, float], name: str, fields: EmissionFields, seed: int
) -> F64:
    """(3,) colour of luminance 1: the source's, or a seeded warm white where that is white."""
    rgb = np.maximum(np.asarray(rgb_linear, np.float64), 0.0)
    if np.ptp(rgb) > 0.02 and rgb @ LUMINANCE > 0:
        return np.asarray(rgb / (rgb @ LUMINANCE))
    u = keys.seed("lamp", name, seed) / 2**32
    low, high = fields.lamp_kelvin_min, fields.lamp_kelvin_max
    return rgb_from_kelvin(low + (high - low) * u)


def _bulb_emitter(
    house: House,
    geometry: Geometry,
    place: tuple[int, int],
    faces: I64,
    flux_and_rgb: tuple[float, F64],
    recipe: Recipe,
) -> AreaEmitter:
    index, k = place
    item = house.items[index]
    corners = _corners(geometry, faces)
    areas = face_areas(corners)
    area = float(areas.sum())
    flux, rgb = flux_and_rgb
    # Count both sides of an open mesh, the outside of one that is closed but for a few edges.
    is_closed = closed_edge_share(np.round(corners.astype(np.float32), _PLACE_DIGITS)) > _CLOSED
    outside = area if is_closed else 2 * area
    radiance = rgb * (flux / (LM_PER_W * math.pi * outside))
    # Replace both by the published radiance, which knows no size.
    if recipe.emission.preset == "released":
        radiance = np.full(3, recipe.emission.released_bulb)
        flux = LM_PER_W * math.pi * outside * recipe.emission.released_bulb
    name = f"{item.id}/{k}" if len(item.lights) > 1 else item.id
    return AreaEmitter(name, index, item.room_id, faces, areas, triple(radiance), area, flux)


def _shade_emitter(
    item: Item, geometry: Geometry, index: int, faces: I64, recipe: Recipe
) -> AreaEmitter:
    areas = face_areas(_corners(geometry, faces))
    area, level = float(areas.sum()), recipe.emission.released_shade
    flux = LM_PER_W * 2 * math.pi * area * level
    name, radiance = f"{item.id}/shade", (level, level, level)
    return AreaEmitter(name, index, item.room_id, faces, areas, radiance, area, flux)


def _corners(geometry: Geometry, faces: I64) -> F64:
    return triangle_corners(geometry.positions, geometry.faces[faces])
