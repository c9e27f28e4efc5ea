"""Standard label layers, from one hit record at pixel centres (architecture, rule 8); no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import DepthZ, HitRecord, ItemBuffer, Mask, Matrix4, UnitVectors
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import PUBLISHED_FROM_OPENGL
from pbrs_farm.core.house import MAX_INSTANCES, House
from pbrs_farm.truth.boundary import instance_boundary

DEPTH_MAX_MM = 65535  # the largest 16-bit value
# n is valid while | |n|^2 - 1 | <= this: the published rule (docs/spec/suncg.md section 5).
UNIT_TOLERANCE = 0.1


def depth_mm(depth_z: DepthZ) -> NDArray[np.uint16]:
    """(H, W) uint16 planar z in millimetres, 1..65535 for a hit; 0 = nothing."""
    z = np.where(np.isnan(depth_z), np.float32(0), depth_z)
    rounded = np.clip(np.rint(z * np.float32(1000.0)), 1, DEPTH_MAX_MM)
    return np.where(z > 0, rounded, 0).astype(np.uint16)


def unit_mask(normal: UnitVectors) -> Mask:
    """(H, W) bool: the normal is finite and of unit length within UNIT_TOLERANCE."""
    squared = np.einsum("...i,...i->...", normal, normal)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(squared - 1.0) <= UNIT_TOLERANCE)


def normal_label(normal_world: UnitVectors, world_from_camera: Matrix4) -> NDArray[np.uint16]:
    """(H, W, 3) uint16 normals in the published camera frame: round((n + 1) 65535 / 2).

    x right, y forward, z up (docs/spec/suncg.md section 5). Normals that are not of unit length are stored
    as 32768 in all three channels.
    """
    published_from_world = PUBLISHED_FROM_OPENGL @ world_from_camera[:3, :3].T
    normal = _clean(normal_world) @ published_from_world.T.astype(np.float32)
    return encoded_normal(normal)


def encoded_normal(normal: UnitVectors) -> NDArray[np.uint16]:
    """(H, W, 3) uint16 round((n + 1) 65535 / 2) of normals, clipped; the inverse is v * 2 / 65535 - 1."""
    scaled = (normal + np.float32(1)) * np.float32(65535 / 2)
    return np.asarray(np.clip(np.rint(scaled), 0, 65535), np.uint16)


def _clean(normal: UnitVectors) -> UnitVectors:
    # Replace whatever is not of unit length by zero.
    is_unit = unit_mask(normal)
    return normal if is_unit.all() else np.where(is_unit[..., None], normal, np.float32(0))


def valid_label(hit: HitRecord) -> NDArray[np.uint8]:
    """(H, W) uint8: 255 where something is hit and its geometric normal is of unit length, else 0."""
    return np.where(hit.valid & unit_mask(hit.geo_normal_world), 255, 0).astype(np.uint8)


def nyu40_of_instance(house: House) -> NDArray[np.uint8]:
    """(n_items + 1,) uint8 NYU40 class by instance id, 0 = none; BadHouse outside 0..40."""
    check_instances(house)
    # Entry 0 is "nothing": instance ids count from 1.
    classes = np.array([0, *(item.nyu40 for item in house.items)], np.int64)
    wrong = np.nonzero((classes < 0) | (classes > 40))[0]
    if len(wrong):
        item = house.items[int(wrong[0]) - 1]
        raise BadHouse(house.source.file, f"item {item.id}", f"NYU40 class {item.nyu40}, not 0..40")
    return classes.astype(np.uint8)


def check_instances(house: House) -> None:
    """Raise BadHouse, before rendering, when instance ids do not fit in 16 bits."""
    if len(house.items) > MAX_INSTANCES:
        raise BadHouse(
            house.source.file,
            "items",
            f"{len(house.items)} items, but a 16-bit instance layer holds {MAX_INSTANCES}",
            hint="split the house, or merge parts that need no separate label",
        )


def semantic_label(item: ItemBuffer, house: House) -> NDArray[np.uint8]:
    """(H, W) uint8 NYU40 id of the visible item; 0 = nothing, or an item without a class."""
    return nyu40_of_instance(house)[item]


def instance_label(item: ItemBuffer, house: House) -> NDArray[np.uint16]:
    """(H, W) uint16 instance id, the item's place in house.items from 1; BadHouse beyond 65,535 items."""
    check_instances(house)
    return item.astype(np.uint16)


def layers_from_hit(hit: HitRecord, house: House, camera: Camera) -> dict[str, NDArray[Any]]:
    """The layers that every view has, by name: depth, normal, valid, semantic, instance, boundary.

    hit: one ray through each pixel's centre; all layers come from it, so that they agree in every
    pixel. Arrays are (H, W) or (H, W, 3) as core/layers.py says. Optional layers: optional_layers.
    """
    instance = instance_label(hit.item, house)
    return {
        "depth": depth_mm(hit.depth_z),
        "normal": normal_label(hit.geo_normal_world, camera.world_from_camera),
        "valid": valid_label(hit),
        "semantic": semantic_label(hit.item, house),
        "instance": instance,
        "boundary": instance_boundary(instance),
    }
