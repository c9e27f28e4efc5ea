"""Tiny houses for the tests of raster: upright squares that face a camera at the origin."""

import numpy as np

from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import House, Item, ItemKind, Level, LightPart, Material, Source, Surface


def camera(width: int = 32, height: int = 24) -> Camera:
    """A camera at the origin, looking along -z, 90 degrees wide."""
    intrinsics = Intrinsics.from_hfov(width, height, np.pi / 2)
    return Camera.look(intrinsics, np.zeros(3), np.array([0.0, 0.0, -1.0]))


def square(z: float, material: int, half: float = 20.0, *, turned: bool = False) -> Surface:
    """A square across the view axis at z; turned: with clockwise winding, seen from behind."""
    points = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    points[:, 2] = z
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return Surface(f"square {z}", points, faces[:, ::-1] if turned else faces, material, uvs)


def item(
    *surfaces: Surface, kind: ItemKind = ItemKind.OBJECT, lights: tuple[LightPart, ...] = ()
) -> Item:
    """An item with these surfaces."""
    return Item(f"i{id(surfaces)}", "thing", kind, "0", surfaces, nyu40=40, lights=lights)


def house(items: tuple[Item, ...], materials: tuple[Material, ...]) -> House:
    """A house of only these items and materials."""
    source = Source("builtin", "test", "0" * 64)
    return House("test", "test", source, (Level("0", "0", 0.0, 2.5),), (), items, materials, {})
