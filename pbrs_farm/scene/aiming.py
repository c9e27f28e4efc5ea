"""Sample cameras around placed models, by distance, elevation and visible share. No effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House, Item, Room
from pbrs_farm.core.shown_text import shown
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.truth.coverage import coverage

_TRIES: Final = 200  # maximum number of samples per camera
_CLEAR_M: Final = 0.12  # minimum free radius around the eye, metres
_SMALL: Final = (160, 120)  # size of the image that measures visibility, pixels
_LEAST_PX: Final = 12  # minimum size of an item in that image, pixels


def cameras_around(
    house: House,
    items: Sequence[Item],
    n: int,
    *,
    distance_m: tuple[float, float],
    elevation_deg: tuple[float, float],
    min_visible: float,
    intrinsics: Intrinsics,
    seed: int,
) -> list[Camera]:
    """Sample n cameras, each inside a room, clear of geometry and aimed at one of the items.

    Each sees at least min_visible of its item. Raises BadInput if fewer than n are found.
    """
    rng = np.random.default_rng([seed, 4])
    cameras: list[Camera] = []
    for _ in range(n):
        camera = _one(house, items, distance_m, elevation_deg, min_visible, intrinsics, rng)
        if camera is None:
            names = shown(", ".join(dict.fromkeys(item.name for item in items)))
            text = f"found {len(cameras)} of {n} cameras that see {min_visible:g} of {names}"
            raise BadInput(house.id, "cameras", text, hint="other distances, a lower min_visible")
        cameras.append(camera)
    return cameras


def _one(
    house: House,
    items: Sequence[Item],
    distance_m: tuple[float, float],
    elevation_deg: tuple[float, float],
    min_visible: float,
    intrinsics: Intrinsics,
    rng: np.random.Generator,
) -> Camera | None:
    for _ in range(_TRIES):
        item = items[int(rng.integers(len(items)))]
        target = item.bounds.mean(0)
        azimuth, elevation = rng.uniform(0, 2 * math.pi), math.radians(rng.uniform(*elevation_deg))
        level = math.cos(elevation)
        away = np.array([level * math.cos(azimuth), math.sin(elevation), level * math.sin(azimuth)])
        eye = target + rng.uniform(*distance_m) * away
        # Aim slightly beside the item, so that it is not always centred.
        aim = target + rng.normal(0, 0.15, 3) * np.ptp(item.bounds, axis=0)
        if not _is_clear(house, eye):
            continue
        camera = Camera.look(intrinsics, eye, aim - eye)
        if _visible(house, item, camera) >= min_visible:
            return camera
    return None


def _is_clear(house: House, eye: F64) -> bool:
    """True if the eye is inside a room, with no surface within _CLEAR_M."""
    if not any(_is_in(room, eye) for room in house.rooms):
        return False
    axes = np.concatenate([np.eye(3), -np.eye(3), _DIAGONALS])
    t, _face = _caster_of(house).first_hit(np.broadcast_to(eye, axes.shape), axes)
    return bool((t > _CLEAR_M).all())


_DIAGONALS: Final = np.array(
    [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64
) / math.sqrt(3)


def _is_in(room: Room, point: F64) -> bool:
    x, y, z = point
    is_within = room.floor_y < y < max(room.ceiling_y, room.floor_y + 0.1)
    return is_within and bool(shapely.contains_xy(shapely.Polygon(room.polygon), x, z))


def _visible(house: House, item: Item, camera: Camera) -> float:
    """Visible share of an item: unoccluded pixels over its pixels when alone and not cropped."""
    small = camera.with_size(*_SMALL)
    alone = int(coverage(item, small, _caster_of(house).cut_outs).sum())
    if alone < _LEAST_PX:
        return 0.0
    number = next(k for k, candidate in enumerate(house.items, 1) if candidate is item)
    n_visible = int((_caster_of(house).item_buffer(small) == number).sum())
    return n_visible / alone


def _caster_of(house: House) -> Caster:
    """Ray caster of a finished home, panes included; the last homes are cached."""
    return _caster(_Identity(house))


class _Identity:
    # Compare houses by identity: they are frozen, and the cache keeps them alive.
    def __init__(self, house: House) -> None:
        self.house = house

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Identity) and other.house is self.house

    def __hash__(self) -> int:
        return id(self.house)


@lru_cache(maxsize=2)
def _caster(key: _Identity) -> Caster:
    return Caster.of_house(key.house)
