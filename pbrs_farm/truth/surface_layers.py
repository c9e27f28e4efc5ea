"""Layers of the hit surface: albedo, gloss, shading normals, model coordinates, hha; no effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32, HitRecord, UnitVectors
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear, transform_points
from pbrs_farm.core.gloss import GLASS_F0, MIN_ALPHA, coat_of, mirror_reflectance
from pbrs_farm.core.house import Geometry, House, Item, Material, MaterialKind, corners_of_surfaces
from pbrs_farm.core.mesh import triangle_corners, unit_normals
from pbrs_farm.core.normal_maps import normals_from_picture, perturbed_normals, tangents
from pbrs_farm.core.resampling import bilinear

_SMOOTH = (MaterialKind.MIRROR, MaterialKind.GLASS, MaterialKind.PANE)  # without any roughness
_LINEAR_OF_BYTE = linear_from_srgb(np.arange(256) / 255).astype(np.float32)
_STEPS = 4096  # entries of the encoding table: fine enough that every byte is rounded as by formula
_BYTE_OF_LINEAR = np.rint(srgb_from_linear(np.arange(_STEPS + 1) / _STEPS) * 255).astype(np.uint8)
_DISPARITY_CM = 31000.0  # disparity = this / depth in cm
_NEAREST_CM = 100.0  # nearer depths count as this: the disparity fits into a byte
_ANGLE_OFFSET = 128 - 90  # a wall, at 90 degrees, is 128
_FLOOR_IN_VIEW_CM = -90.0  # the lowest point below this, from the eye, is taken for the floor
_ASSUMED_FLOOR_CM = -130.0  # the floor's height from the eye when none is in view


def albedo_label(
    hit: HitRecord,
    house: House,
    geometry: Geometry,
    textures: Mapping[str, NDArray[np.uint8]],
    most: float = 1.0,
) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB: diffuse colour times texture, multiplied in linear light; 0 = nothing.

    most: upper limit of the product in each channel, as in the traced light. textures: id -> (H, W, 3 or 4) uint8 sRGB,
    row 0 = top (v = 1), repeated; interpolated between the four nearest texels, not filtered over the pixel. A missing
    texture counts as white.
    """
    linear = np.zeros((*hit.face.shape, 3), np.float32)
    if len(geometry.faces):
        is_hit = hit.valid
        uv = hit.points.uv[is_hit]
        linear[is_hit] = albedo_of_points(hit.face[is_hit], uv, house, geometry, textures)
    # Encode by table: 8-bit sRGB.
    steps = np.rint(np.clip(linear, 0, most) * _STEPS).astype(np.int32)
    return np.asarray(_BYTE_OF_LINEAR[steps])


def albedo_of_points(
    face: I32, uv: F32, house: House, geometry: Geometry, textures: Mapping[str, NDArray[np.uint8]]
) -> F32:
    """(N, 3) linear diffuse colour times texture (as of albedo_label) at uv (N, 2) of faces (N,)."""
    linear = np.zeros((len(face), 3), np.float32)
    # Shade material by material: each texture is looked up once, for all its points.
    material = geometry.face_material[face]
    for number in np.unique(material):
        shaded, of_material = house.materials[int(number)], material == number
        linear[of_material] = linear_from_srgb(np.array(shaded.diffuse)).astype(np.float32)
        pixels = textures.get(shaded.texture_id) if shaded.texture_id else None
        if pixels is not None:
            linear[of_material] *= bilinear(pixels[..., :3], uv[of_material], _LINEAR_OF_BYTE)
    return linear


def roughness_label(
    hit: HitRecord, house: House, geometry: Geometry, textures: Mapping[str, NDArray[np.uint8]]
) -> NDArray[np.uint8]:
    """(H, W) uint8: 255 times the root of the coat's GGX roughness, as glTF counts it; 0 = nothing.

    Matte surfaces are 255, mirrors and glass 0. textures: as of albedo_label; a roughness map's green
    is looked up as its colours are.
    """
    roughness = np.zeros(hit.face.shape, np.float64)
    if not len(geometry.faces):
        return roughness.astype(np.uint8)
    material = np.where(hit.valid, geometry.face_material[hit.face], -1)
    for number in np.unique(material[material >= 0]):
        shaded, of_material = house.materials[int(number)], material == number
        coat = None if shaded.kind in _SMOOTH else coat_of(shaded)
        if coat is None:
            roughness[of_material] = 0.0 if shaded.kind in _SMOOTH else 1.0
            continue
        alpha = np.full(int(of_material.sum()), coat.alpha)
        name = shaded.roughness_texture_id if shaded.shows_maps else None
        pixels = textures.get(name) if name else None
        if pixels is not None:
            green = pixels[..., None] if pixels.ndim == 2 else pixels[..., 1:2]
            share = bilinear(green, hit.points.uv[of_material])[:, 0] / 255
            alpha = np.maximum(coat.alpha * share**2, MIN_ALPHA)
        roughness[of_material] = np.sqrt(alpha)
    return np.rint(255 * roughness).astype(np.uint8)


def f0_label(hit: HitRecord, house: House, geometry: Geometry) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB reflectance at right angles of coat, metal, mirror or glass; 0 for matte."""
    return _of_materials(_f0_srgb8, 3, hit, house, geometry)


def metallic_label(hit: HitRecord, house: House, geometry: Geometry) -> NDArray[np.uint8]:
    """(H, W) uint8: 255 = a metal or a mirror, else 0."""

    def metallic(material: Material) -> int:
        coat = None if material.kind in _SMOOTH else coat_of(material)
        is_metal = material.kind is MaterialKind.MIRROR or (coat is not None and coat.is_metal)
        return 255 if is_metal else 0

    return _of_materials(metallic, 1, hit, house, geometry)[..., 0]


def _f0_srgb8(material: Material) -> NDArray[np.uint8]:
    f0 = np.full(3, GLASS_F0)
    if material.kind is MaterialKind.MIRROR:
        f0 = mirror_reflectance(material)
    elif material.kind not in _SMOOTH:
        coat = coat_of(material)
        f0 = np.zeros(3) if coat is None else coat.f0
    return np.rint(255 * srgb_from_linear(f0)).astype(np.uint8)


def _of_materials(
    value: Callable[[Material], object], n: int, hit: HitRecord, house: House, geometry: Geometry
) -> NDArray[np.uint8]:
    """(H, W, n) uint8 value of the hit material; 0 = nothing."""
    if not len(geometry.faces):
        return np.zeros((*hit.face.shape, n), np.uint8)
    table = np.array([value(m) for m in house.materials], np.uint8).reshape(-1, n)
    return np.where(hit.valid[..., None], table[geometry.face_material[hit.face]], np.uint8(0))


def shading_normals(
    hit: HitRecord, house: House, geometry: Geometry, textures: Mapping[str, NDArray[np.uint8]]
) -> UnitVectors:
    """(H, W, 3) unit shading normals with normal maps, turned as the hit's own; (0, 0, 0) = nothing.

    textures: as in LabelInputs; looked up between the four nearest texels, not filtered over the
    pixel. The geometric normals of every other layer stay what they are.
    """
    normals = hit.points.shading_normal_world.copy()
    if not len(geometry.faces):
        return normals
    is_hit = hit.valid
    faces, uv = hit.face[is_hit], hit.points.uv[is_hit]
    normals[is_hit] = bent_by_maps(normals[is_hit], faces, uv, house, geometry, textures)
    return normals


def bent_by_maps(
    normals: UnitVectors,
    face: I32,
    uv: F32,
    house: House,
    geometry: Geometry,
    textures: Mapping[str, NDArray[np.uint8]],
) -> UnitVectors:
    """(N, 3) float32 interpolated normals at uv (N, 2) on faces (N,), with normal maps; on the same side."""
    normals = normals.copy()
    # Bend material by material: each map is looked up once, for all its points.
    material = geometry.face_material[face]
    for number in np.unique(material):
        shaded = house.materials[int(number)]
        pixels = textures.get(shaded.normal_texture_id or "") if shaded.shows_maps else None
        if pixels is None or pixels.ndim != 3:
            continue
        of_material = material == number
        values = bilinear(pixels[..., :3], uv[of_material])
        mapped = normals_from_picture(values, shaded.normal_scale).astype(np.float64)
        faces, turned = face[of_material], normals[of_material].astype(np.float64)
        normals[of_material] = _bent(geometry, faces, turned, mapped).astype(np.float32)
    return normals


def _bent(geometry: Geometry, faces: I32, seen: F64, mapped: F64) -> F64:
    """(N, 3) normals seen at faces, bent by the map's; both turned to the camera."""
    corners = triangle_corners(geometry.positions, geometry.faces[faces])
    dp_du, side, is_defined = tangents(
        corners, geometry.uvs[geometry.faces[faces]].astype(np.float64)
    )
    # A map belongs to the front: turn the normals there and back.
    turn = np.where((seen * unit_normals(corners)).sum(1) < 0, -1.0, 1.0)[:, None]
    bent = turn * perturbed_normals(turn * seen, dp_du, side, mapped)
    return np.where(is_defined[:, None], bent, seen)


def nocs_label(hit: HitRecord, house: House) -> NDArray[np.uint16]:
    """(H, W, 3) uint16: 65535 times the point's x, y, z in its model's frame; (0, 0, 0) = nothing.

    The model's axis-aligned box in its own frame is centred at 0.5 and scaled by one over its diagonal. Items that are
    not placed models count as nothing.
    """
    out = np.zeros((*hit.face.shape, 3), np.uint16)
    for instance in np.unique(hit.item[hit.valid]):
        item = house.items[int(instance) - 1]
        if item.pose is None:
            continue
        mask = hit.valid & (hit.item == instance)
        model_from_world = np.linalg.inv(np.array(item.pose.world_from_model))
        centre, diagonal = _model_box(item, model_from_world)
        points = transform_points(model_from_world, hit.points.position_world[mask])
        share = (points - centre) / diagonal + 0.5
        out[mask] = np.rint(65535 * np.clip(share, 0, 1)).astype(np.uint16)
    return out


def _model_box(item: Item, model_from_world: F64) -> tuple[F64, float]:
    """(3,) centre and diagonal of the item's triangles in its model's frame, metres."""
    corners = transform_points(model_from_world, corners_of_surfaces(item.surfaces).reshape(-1, 3))
    low, high = corners.min(0), corners.max(0)
    return (low + high) / 2, float(np.linalg.norm(high - low))


def hha_label(hit: HitRecord, camera: Camera) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: H, H, A; (0, 0, 0) = nothing.

    R: 31000 / depth_z in cm, depth at least 100 cm. G: height in cm above the lowest visible point, or above 130 cm
    below the camera when no point is more than 90 cm below it. B: degrees between gravity and the normal that points
    away from the camera, plus 38: floors are 38, walls 128, ceilings 218. Each is rounded and clipped to 0..255.
    """
    out = np.zeros((*hit.face.shape, 3), np.float32)
    if not hit.valid.any():
        return out.astype(np.uint8)
    above_eye_cm = (hit.points.position_world[..., 1] - np.float32(camera.eye[1])) * np.float32(100)
    lowest_cm = float(above_eye_cm[hit.valid].min())
    floor_cm = lowest_cm if lowest_cm <= _FLOOR_IN_VIEW_CM else _ASSUMED_FLOOR_CM
    # Encode the three channels.
    out[..., 0] = _DISPARITY_CM / np.maximum(hit.depth_z * np.float32(100), _NEAREST_CM)
    out[..., 1] = above_eye_cm - floor_cm
    up = np.clip(hit.geo_normal_world[..., 1], -1, 1)
    out[..., 2] = np.degrees(np.arccos(up)) + _ANGLE_OFFSET
    return np.where(hit.valid[..., None], np.clip(np.rint(out), 0, 255), 0).astype(np.uint8)
