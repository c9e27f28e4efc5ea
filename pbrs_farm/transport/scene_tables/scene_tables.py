"""Scene tables: a house as the flat arrays that the kernels gather from; pure numpy, no effects.

A scene is one mesh and a few arrays, so that the kernels are the same for every house, camera and
sky, and none is compiled again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F32, F64, I32, I64, Bools, triple
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import Geometry, House, Item, LightPart, MaterialKind, geometry_from_house
from pbrs_farm.core.lighting import flux_lm
from pbrs_farm.core.mesh import (
    dots,
    face_areas,
    faces_with_area,
    lengths,
    outside_area,
    triangle_corners,
    unit_normals,
)
from pbrs_farm.core.recipe import EmissionFields, Recipe
from pbrs_farm.transport.scene_tables.material_rows import (
    MATERIAL_FLOATS,
    TAU,
    material_rows,
    max_albedo,
)
from pbrs_farm.transport.scene_tables.texture_atlas import texture_atlas

# Blackbody colour: linear sRGB of luminance 1 from a temperature.


_RGB_FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)
_HC_OVER_K = 1.438777e7  # nm K


def rgb_from_kelvin(kelvin: float) -> F64:
    """(3,) linear sRGB, luminance 1, none negative, of Planck's radiator at 1000 to 20000 K."""
    # Weight Planck's law by the matching functions, every 5 nm of the visible spectrum.
    wavelength = np.arange(380.0, 781.0, 5.0)
    power = wavelength**-5 / np.expm1(_HC_OVER_K / (wavelength * kelvin))
    xyz = (_matching(wavelength) * power).sum(1)
    # Clip colours outside the gamut of sRGB and scale to luminance 1.
    rgb = np.maximum(_RGB_FROM_XYZ @ (xyz / xyz[1]), 0.0)
    return np.asarray(rgb / (rgb @ LUMINANCE))


def _matching(wavelength: F64) -> F64:
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


# Area emitters: the faces of a house's lamps that emit, and their radiance.


_MIN_LIGHT_OUTPUT_RATIO: Final = 0.25  # a bulb gets at most four times stronger for its shade


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
    the bulb emits more: flux over the light output ratio, which repair stores as part.escape. A
    bare part's flux is its surfaces' own.
    """
    e = recipe.emission
    flux = flux_lm(part.power, part.unit, part.share, lamp_lm=e.lamp_lm, lm_per_watt=e.lm_per_watt)
    if e.compensate_shades and part.escape is not None and not part.is_bare:
        flux /= min(max(part.escape, _MIN_LIGHT_OUTPUT_RATIO), 1.0)
    return max(flux, 0.0), lamp_rgb(part, f"{house.id}/{item.id}/{k}", e, recipe.seed)


def lamp_rgb(part: LightPart, name: str, fields: EmissionFields, seed: int) -> F64:
    """(3,) colour of luminance 1: the source's, or a seeded warm white where it tells none."""
    rgb = np.maximum(np.asarray(part.rgb_linear, np.float64), 0.0)
    if (part.is_coloured or np.ptp(rgb) > 0.02) and rgb @ LUMINANCE > 0:
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
    outside = outside_area(corners)
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


# Which lamps are convex and symmetric about a point, as bulbs are; pure numpy.
# From outside the sphere around it just one of two opposite points of such a lamp faces a vertex,
# or neither: shadow rays to the other one could never arrive.


_TOLERANCE_M: Final = 1e-5  # what float32 leaves of equal places far from the origin
_MAX_FACES: Final = 4096  # of a lamp that is looked at: every face is held against every corner


def symmetry_row(corners: F64) -> F32:
    """(4,) centre and radius in m of a lamp of triangles (T, 3, 3).

    The radius is of the sphere around it: negative where its triangles face inwards, 0 where it is
    not convex, closed and symmetric.
    """
    centre = 0.5 * (corners.min((0, 1)) + corners.max((0, 1)))
    row = np.zeros(4, np.float32)
    row[:3] = centre
    if len(corners) > _MAX_FACES:
        return row
    # Ask whether every corner has its opposite, and no corner lies beyond a face's plane.
    places = np.unique((corners - centre).reshape(-1, 3), axis=0)
    if np.asarray(cKDTree(places).query(-places)[0]).max() > _TOLERANCE_M:
        return row
    normals = unit_normals(corners)
    heights = ((corners[:, 0] - centre) * normals).sum(1)
    side = np.sign(heights[0])
    if (side * heights).min() <= 0:
        return row
    if (side * (places @ normals.T - heights)).max() > _TOLERANCE_M:
        return row
    # Ask whether the faces are the whole hull, each once.
    middles = np.unique(np.rint(corners.mean(1) / _TOLERANCE_M), axis=0)
    if len(middles) < len(corners):
        return row
    try:
        hull_area = ConvexHull(places).area
    except QhullError:
        return row
    areas = face_areas(corners)
    radius = np.sqrt((places**2).sum(1).max()) + _TOLERANCE_M
    row[3] = side * radius if abs(areas.sum() - hull_area) < 0.5 * areas.min() else 0
    return row


# Scene tables.


FACE_FLOATS: Final = 28  # columns of a face's row: seven packets of four, gathered together
ORIGIN, EDGE1, EDGE2 = slice(0, 3), slice(4, 7), slice(8, 11)  # first corner, edges to the others
UV0, DUV1, DUV2 = [3, 7], [11, 12], [13, 14]  # uv of the first corner, steps to the others
NORMALS = slice(16, 19), slice(20, 23), slice(24, 27)  # of the corners
FRONT_PDF, BACK_PDF, TARGET_EMITTER = 19, 23, 27  # filled by guiding; column 15 is free
NO_LAMP: Final = 0xFFFF  # upper half of a face's tag that does not emit

_FACES_AT_ONCE: Final = 1 << 13  # in the making of rows, against memory


@dataclass(frozen=True, slots=True, eq=False)
class SceneTables:
    """The arrays that the kernels gather from."""

    positions: F32  # (V, 3) vertices of Mitsuba's mesh
    faces: I32  # (F, 3), without degenerate ones
    face_rows: F32  # (F, 28), columns as above
    face_tags: NDArray[np.uint32]  # (F,) material + 65536 * lamp
    transparent: Bools  # (F,) thin glass and alpha cut-outs: shadow rays may pass
    material_rows: F32  # (M, 20), columns as in material_rows.py
    max_albedo: float  # that Kd times its texture is held to
    texels: NDArray[np.uint32]  # the texture atlas
    lamps: tuple[AreaEmitter, ...]  # L of them
    lamp_rows: F32  # (L, 4) radiance r g b, area in m2
    lamp_first: NDArray[np.uint32]  # (L + 1,) first of each lamp's triangles in the next two
    lamp_faces: NDArray[np.uint32]  # (T,) face
    lamp_areas: F32  # (T,) running sum of areas over the lamp's area
    lamp_symmetries: F32  # (L, 4) as symmetry_row; no side where light may pass its faces
    notes: tuple[str, ...]  # what had to be changed or left out


def tables_from_house(
    house: House, textures: dict[str, NDArray[np.uint8]], recipe: Recipe
) -> SceneTables:
    """The tables of a house without its panes. Raises BadHouse when it has no surface."""
    # Leave out panes, which would only cost rays, and faces without a plane.
    geometry = geometry_from_house(house, with_panes=False)
    keep = _solid_faces(geometry)
    if not keep.any():
        raise BadHouse(house.source.file, house.id, "no surface that light could meet")
    n_left_out = int((~keep).sum())
    notes = [f"{n_left_out} degenerate faces left out of the light"] * (n_left_out > 0)

    # Tag each face with its material and its lamp.
    released = recipe.materials.preset == "released"
    packed = texture_atlas(house, textures, with_roughness=not released)
    rows, material_notes = material_rows(house, packed, recipe)
    lamps = area_emitters_of_house(house, geometry, keep, recipe)
    faces = geometry.faces[keep]
    face_lamp = np.full(len(geometry.faces), NO_LAMP, np.uint32)
    for index, lamp in enumerate(lamps):
        face_lamp[lamp.faces] = index
    material = geometry.face_material[keep].astype(np.uint32)
    first, lamp_faces, lamp_areas = _lamp_triangles(lamps, np.cumsum(keep) - 1)
    # Tell which materials let a shadow ray pass; in `released` opacity below 1 does, too.
    transparent = np.array([
        m.kind is MaterialKind.GLASS or m.alpha_cutout or (released and m.opacity < 1)
        for m in house.materials
    ])  # fmt: skip
    is_open = transparent[material] | rows[material, TAU].any(1)
    symmetries = np.zeros((len(lamps), 4), np.float32)
    for k, (a, b) in enumerate(pairwise(first)):
        emitting = lamp_faces[a:b]
        if not is_open[emitting].any():
            symmetries[k] = symmetry_row(triangle_corners(geometry.positions, faces[emitting]))
    return SceneTables(
        positions=geometry.positions,
        faces=faces,
        face_rows=_face_rows(geometry, faces),
        face_tags=material + (face_lamp[keep] << np.uint32(16)),
        transparent=transparent[material],
        material_rows=rows.reshape(-1, MATERIAL_FLOATS),
        max_albedo=max_albedo(recipe),
        texels=packed.texels,
        lamps=lamps,
        lamp_rows=np.array([[*x.radiance, x.area_m2] for x in lamps], np.float32).reshape(-1, 4),
        lamp_first=first,
        lamp_faces=lamp_faces,
        lamp_areas=lamp_areas,
        lamp_symmetries=symmetries,
        notes=(*notes, *material_notes),
    )


def _solid_faces(geometry: Geometry) -> Bools:
    """(F,) bool: finite corners and an area that defines the face's plane."""
    keep = np.empty(len(geometry.faces), np.bool_)
    for part in _parts(len(keep)):
        corners = triangle_corners(geometry.positions, geometry.faces[part])
        keep[part] = faces_with_area(corners, 0.5e-10)
    return keep


def _face_rows(geometry: Geometry, faces: I32) -> F32:
    """(F, FACE_FLOATS) what a ray needs to know of each face."""
    rows = np.zeros((len(faces), FACE_FLOATS), np.float32)
    for part in _parts(len(faces)):
        _fill_rows(rows[part], geometry, faces[part])
    return rows


def _parts(n_faces: int) -> Iterator[slice]:
    """Slices of n_faces that stay in the cache."""
    for start in range(0, n_faces, _FACES_AT_ONCE):
        yield slice(start, start + _FACES_AT_ONCE)


def _fill_rows(rows: F32, geometry: Geometry, faces: I32) -> None:
    corners = triangle_corners(geometry.positions, faces)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    flat = unit_normals(corners)

    # Take the face's own normal where a vertex has none or one that is not of unit length.
    normals = geometry.normals[faces].astype(np.float64)
    of_face = np.broadcast_to(flat[:, None], normals.shape)
    with np.errstate(invalid="ignore", divide="ignore"):
        length = lengths(normals)
        normals /= length[..., None]
        is_bad = ~((length > 0.5) & (length < 2))
    normals[is_bad] = of_face[is_bad]
    # Turn all three to the front; replace one that leans to the back by the face's own.
    side = np.sign(dots(normals[:, 0] + normals[:, 1] + normals[:, 2], flat))
    normals[side < 0] *= -1
    leans_back = ~((dots(normals, flat[:, None]) > 0.05) & (side != 0)[:, None])
    normals[leans_back] = of_face[leans_back]

    # Shift repeating textures by whole turns to start near 0: float32 keeps the fraction.
    uvs = np.nan_to_num(geometry.uvs[faces].astype(np.float64), posinf=0, neginf=0)
    least = np.minimum(np.minimum(uvs[:, 0], uvs[:, 1]), uvs[:, 2])
    uvs -= np.floor(least)[:, None]
    duv = uvs[:, 1:] - uvs[:, :1]

    rows[:, ORIGIN], rows[:, EDGE1], rows[:, EDGE2] = corners[:, 0], e1, e2
    rows[:, UV0], rows[:, DUV1], rows[:, DUV2] = uvs[:, 0], duv[:, 0], duv[:, 1]
    for k, columns in enumerate(NORMALS):
        rows[:, columns] = normals[:, k]


def _lamp_triangles(
    lamps: tuple[AreaEmitter, ...], new_number: I64
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], F32]:
    """(first, faces, areas) as in SceneTables; new_number: of each face of the geometry."""
    first = np.cumsum([0, *(len(lamp.faces) for lamp in lamps)]).astype(np.uint32)
    faces = [new_number[lamp.faces] for lamp in lamps]
    areas = [np.cumsum(lamp.face_areas) / np.sum(lamp.face_areas) for lamp in lamps]
    return (
        first,
        np.concatenate([np.zeros(0), *faces]).astype(np.uint32),
        np.concatenate([np.zeros(0), *areas]).astype(np.float32),
    )


def bounding_spheres(tables: SceneTables) -> F64:
    """(L, 4) centre and radius in m of the sphere around the bounding box of each lamp's faces."""
    spheres = np.zeros((len(tables.lamps), 4))
    for k in range(len(tables.lamps)):
        emitting = tables.lamp_faces[tables.lamp_first[k] : tables.lamp_first[k + 1]]
        corners = tables.positions[tables.faces[emitting]].reshape(-1, 3)
        low, high = corners.min(0), corners.max(0)
        spheres[k, :3], spheres[k, 3] = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    return spheres
