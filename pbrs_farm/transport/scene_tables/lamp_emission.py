"""The lamps of a house as area emitters: which faces shine and how strongly; no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import Geometry, House, Item, LightPart, MaterialKind
from pbrs_farm.core.lighting import flux_lm
from pbrs_farm.core.mesh import closed_edge_share, face_areas, triangle_corners
from pbrs_farm.core.recipe import EmissionFields, Recipe
from pbrs_farm.transport.scene_tables.blackbody import rgb_from_kelvin

_MIN_ESCAPE: Final = 0.25
_PLACE_DIGITS: Final = 5  # corners that agree to 10 micrometres are one
_CLOSED: Final = 0.95  # share of closed edges from which a mesh has an inside


@dataclass(frozen=True, slots=True, eq=False)
class AreaEmitter:
    """One light source: all faces that shine with one radiance.

    item: index into House.items. faces: (T,) indices into the geometry's faces; face_areas: (T,)
    m2. radiance: (3,) W m-2 sr-1, linear RGB, from both sides of every face. area_m2: the sum.
    flux_lm: what leaves it.
    """

    name: str
    item: int
    room_id: str | None
    faces: NDArray[np.int64]
    face_areas: NDArray[np.float64]
    radiance: tuple[float, float, float]
    area_m2: float
    flux_lm: float


def area_emitters_of_house(
    house: House, geometry: Geometry, keep: NDArray[np.bool_], recipe: Recipe
) -> tuple[AreaEmitter, ...]:
    """Every lamp with a shining face, in the order of items and their light parts.

    Preset `photometric`: radiance = flux / (179 pi area), the area of a closed bulb being its
    outside and of an open sheet both its sides (faces shine to both; a bulb's inside is its own).
    Preset `released`: bulbs 400, shades 0.5, white, whatever their size.
    """
    released = recipe.emission.preset == "released"
    face_of = _faces_by_surface(geometry, keep)
    number = 0
    lamps: list[AreaEmitter] = []
    taken: set[int] = set()
    for index, item in enumerate(house.items):
        for k, part in enumerate(item.lights):
            mine = [number + j for j in part.emitting if number + j not in taken]
            taken.update(mine)
            faces = np.concatenate([np.zeros(0, np.int64), *(face_of.get(j, _NONE) for j in mine)])
            if len(faces):
                lamps.append(
                    _lamp(house, geometry, (index, k), faces, _radiated(house, part, k, item, recipe), recipe)
                )  # fmt: skip
        if released:
            for j, surface in enumerate(item.surfaces):
                is_shade = house.materials[surface.material].kind is MaterialKind.SHADE
                if is_shade and number + j in face_of and number + j not in taken:
                    lamps.append(_shade(house, geometry, index, face_of[number + j], recipe))
        number += len(item.surfaces)
    return tuple(lamps)


_NONE = np.zeros(0, np.int64)


def _faces_by_surface(geometry: Geometry, keep: NDArray[np.bool_]) -> dict[int, NDArray[np.int64]]:
    numbers, starts, counts = np.unique(
        geometry.face_surface, return_index=True, return_counts=True
    )
    found: dict[int, NDArray[np.int64]] = {}
    for number, start, count in zip(numbers, starts, counts, strict=True):
        faces = np.arange(start, start + count)
        found[int(number)] = faces[keep[faces]]
    return {number: faces for number, faces in found.items() if len(faces)}


def _radiated(
    house: House, part: LightPart, k: int, item: Item, recipe: Recipe
) -> tuple[float, NDArray[np.float64]]:
    """(flux in lm, colour of luminance 1) of a light part.

    The source's number is what leaves the lamp: a bulb deep in its shade shines stronger.
    """
    e = recipe.emission
    flux = flux_lm(part.power, part.unit, part.share, lamp_lm=e.lamp_lm, lm_per_watt=e.lm_per_watt)
    if e.compensate_shades and part.escape is not None:
        flux /= min(max(part.escape, _MIN_ESCAPE), 1.0)
    return max(flux, 0.0), lamp_rgb(part.rgb_linear, f"{house.id}/{item.id}/{k}", e, recipe.seed)


def lamp_rgb(
    rgb_linear: tuple[float, float, float], name: str, fields: EmissionFields, seed: int
) -> NDArray[np.float64]:
    """(3,) colour of luminance 1: the source's, or a seeded warm white where it says white."""
    rgb = np.maximum(np.asarray(rgb_linear, np.float64), 0.0)
    if np.ptp(rgb) > 0.02 and rgb @ LUMINANCE > 0:
        return np.asarray(rgb / (rgb @ LUMINANCE))
    u = keys.seed("lamp", name, seed) / 2**32
    low, high = fields.lamp_kelvin_min, fields.lamp_kelvin_max
    return rgb_from_kelvin(low + (high - low) * u)


def _lamp(
    house: House,
    geometry: Geometry,
    place: tuple[int, int],
    faces: NDArray[np.int64],
    radiated: tuple[float, NDArray[np.float64]],
    recipe: Recipe,
) -> AreaEmitter:
    index, k = place
    item = house.items[index]
    corners = _corners(geometry, faces)
    areas = face_areas(corners)
    area = float(areas.sum())
    flux, rgb = radiated
    # Count both sides of an open mesh, the outside of one that is closed but for a few edges.
    is_closed = closed_edge_share(np.round(corners.astype(np.float32), _PLACE_DIGITS)) > _CLOSED
    outside = area if is_closed else 2 * area
    radiance = rgb * (flux / (LM_PER_W * math.pi * outside))
    if recipe.emission.preset == "released":
        radiance = np.full(3, recipe.emission.released_bulb)
        flux = LM_PER_W * math.pi * outside * recipe.emission.released_bulb
    name = f"{item.id}/{k}" if len(item.lights) > 1 else item.id
    return AreaEmitter(name, index, item.room_id, faces, areas, _triple(radiance), area, flux)


def _shade(
    house: House, geometry: Geometry, index: int, faces: NDArray[np.int64], recipe: Recipe
) -> AreaEmitter:
    item = house.items[index]
    areas = face_areas(_corners(geometry, faces))
    radiance = np.full(3, recipe.emission.released_shade)
    flux = LM_PER_W * 2 * math.pi * float(areas.sum()) * recipe.emission.released_shade
    return AreaEmitter(
        f"{item.id}/shade", index, item.room_id, faces, areas, _triple(radiance), float(areas.sum()), flux
    )  # fmt: skip


def _corners(geometry: Geometry, faces: NDArray[np.int64]) -> NDArray[np.float64]:
    return triangle_corners(geometry.positions, geometry.faces[faces])


def _triple(v: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
