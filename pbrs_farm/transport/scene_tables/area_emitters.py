"""Area emitters: the faces of a house's lamps that emit, and their radiance, coloured as black bodies; pure numpy, no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, I64, Bools, triple
from pbrs_farm.core.edits import is_lamp_on
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import Geometry, House, Item, LightPart, MaterialKind
from pbrs_farm.core.lighting import flux_lm
from pbrs_farm.core.mesh import face_areas, outside_area, triangle_corners
from pbrs_farm.core.recipe import EmissionFields, Recipe

_RGB_FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)
_HC_OVER_K = 1.438777e7  # nm K
_MIN_LIGHT_OUTPUT_RATIO: Final = 0.25  # a bulb gets at most four times stronger for its shade
_NO_FACES = np.zeros(0, np.int64)


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
    """The emitters of every lit light part with a face, in the order of items and their light parts.

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
        is_on = is_lamp_on(item.id, house.id, recipe)
        for k, part in enumerate(item.lights):
            mine = [number + j for j in part.emitting if number + j not in taken]
            taken.update(mine)
            faces = np.concatenate(
                [np.zeros(0, np.int64), *(face_of.get(j, _NO_FACES) for j in mine)]
            )
            name = f"{item.id}/{k}" if len(item.lights) > 1 else item.id
            if len(faces) and is_on:
                flux = _flux_and_rgb(house, part, k, item, recipe)
                emitters.append(_bulb_emitter(house, geometry, (index, name), faces, flux, recipe))
        # Let shades emit by themselves where the published renderer had them do so.
        if released and is_on:
            for j, surface in enumerate(item.surfaces):
                is_shade = house.materials[surface.material].kind is MaterialKind.SHADE
                if is_shade and number + j in face_of and number + j not in taken:
                    emitters.append(
                        _shade_emitter(item, geometry, index, face_of[number + j], recipe)
                    )
        number += len(item.surfaces)
    return tuple(emitters)


def _faces_by_surface(geometry: Geometry, keep: Bools) -> dict[int, I64]:
    """Number of a surface -> its kept faces; a surface's faces are consecutive."""
    numbers, starts = np.unique(geometry.face_surface, return_index=True)
    runs = np.split(np.arange(len(geometry.face_surface)), starts[1:])
    faces_of = {int(n): faces[keep[faces]] for n, faces in zip(numbers, runs, strict=True)}
    return {number: faces for number, faces in faces_of.items() if len(faces)}


def _flux_and_rgb(
    house: House, part: LightPart, k: int, item: Item, recipe: Recipe
) -> tuple[float, F64]:
    """(flux in lm, colour of luminance 1) of a light part: what leaves the lamp over the output ratio part.escape."""
    e = recipe.emission
    flux = flux_lm(part.power, part.unit, part.share, lamp_lm=e.lamp_lm, lm_per_watt=e.lm_per_watt)
    if e.compensate_shades and part.escape is not None and not part.is_bare:
        flux /= min(max(part.escape, _MIN_LIGHT_OUTPUT_RATIO), 1.0)
    return max(flux, 0.0), lamp_rgb(part, f"{house.id}/{item.id}/{k}", e, recipe.seed)


def lamp_rgb(part: LightPart, name: str, fields: EmissionFields, seed: int) -> F64:
    """(3,) colour of luminance 1: the source's, or a seeded warm white where it gives none."""
    rgb = np.maximum(np.asarray(part.rgb_linear, np.float64), 0.0)
    if (part.is_coloured or np.ptp(rgb) > 0.02) and rgb @ LUMINANCE > 0:
        return np.asarray(rgb / (rgb @ LUMINANCE))
    u = keys.seed("lamp", name, seed) / 2**32
    low, high = fields.lamp_kelvin_min, fields.lamp_kelvin_max
    return rgb_from_kelvin(low + (high - low) * u)


def _bulb_emitter(
    house: House,
    geometry: Geometry,
    place: tuple[int, str],
    faces: I64,
    flux_and_rgb: tuple[float, F64],
    recipe: Recipe,
) -> AreaEmitter:
    index, name = place
    item = house.items[index]
    corners = corners_of_faces(geometry, faces)
    areas = face_areas(corners)
    area = float(areas.sum())
    flux, rgb = flux_and_rgb
    outside = outside_area(corners)
    radiance = rgb * (flux / (LM_PER_W * math.pi * outside))
    # Replace both by the published radiance, which is the same for every size.
    if recipe.emission.preset == "released":
        radiance = np.full(3, recipe.emission.released_bulb)
        flux = LM_PER_W * math.pi * outside * recipe.emission.released_bulb
    return AreaEmitter(name, index, item.room_id, faces, areas, triple(radiance), area, flux)


def _shade_emitter(
    item: Item, geometry: Geometry, index: int, faces: I64, recipe: Recipe
) -> AreaEmitter:
    areas = face_areas(corners_of_faces(geometry, faces))
    area, level = float(areas.sum()), recipe.emission.released_shade
    flux = LM_PER_W * 2 * math.pi * area * level
    name, radiance = f"{item.id}/shade", (level, level, level)
    return AreaEmitter(name, index, item.room_id, faces, areas, radiance, area, flux)


def corners_of_faces(geometry: Geometry, faces: I64) -> F64:
    return triangle_corners(geometry.positions, geometry.faces[faces])


def rgb_from_kelvin(kelvin: float) -> F64:
    """(3,) linear sRGB, luminance 1, none negative, of Planck's radiator at 1000 to 20000 K."""
    # Weight Planck's law by the matching functions, every 5 nm of the visible spectrum.
    wavelength = np.arange(380.0, 781.0, 5.0)
    power = wavelength**-5 / np.expm1(_HC_OVER_K / (wavelength * kelvin))
    xyz = (_matching_functions(wavelength) * power).sum(1)
    # Clip colours outside the gamut of sRGB and scale to luminance 1.
    rgb = np.maximum(_RGB_FROM_XYZ @ (xyz / xyz[1]), 0.0)
    return np.asarray(rgb / (rgb @ LUMINANCE))


def _matching_functions(wavelength: F64) -> F64:
    """(3, N) CIE 1931 matching functions, the multi-lobe fit of Wyman et al. 2013."""

    def lobe(mean: float, below: float, above: float) -> F64:
        t = (wavelength - mean) * np.where(wavelength < mean, below, above)
        return np.asarray(np.exp(-0.5 * t * t))

    x = (
        0.362 * lobe(442.0, 0.0624, 0.0374)
        + 1.056 * lobe(599.8, 0.0264, 0.0323)
        - 0.065 * lobe(501.1, 0.0490, 0.0382)
    )
    y = 0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322)
    z = 1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725)
    return np.stack([x, y, z])
