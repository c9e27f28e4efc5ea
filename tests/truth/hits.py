"""Hand-written hit records, and a matching small house."""

import numpy as np

from pbrs_farm.core.arrays import HitRecord, SurfacePoints
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import House, Item, ItemKind, Level, Material, Source, Surface


def camera(width: int = 8, height: int = 6) -> Camera:
    """A camera at the origin, looking along -z, 90 degrees wide."""
    intrinsics = Intrinsics.from_hfov(width, height, np.pi / 2)
    return Camera.look(intrinsics, np.zeros(3), np.array([0.0, 0.0, -1.0]))


def hit(item: object, depth_z: object, normal: object = (0.0, 0.0, 1.0)) -> HitRecord:
    """A hit record from ids (H, W), depths (or one depth) and normals (or one normal)."""
    items = np.array(item, np.uint32)
    valid = items > 0
    depths = np.where(valid, np.broadcast_to(np.array(depth_z, np.float32), items.shape), 0)
    normals = np.broadcast_to(np.array(normal, np.float32), (*items.shape, 3))
    normals = np.where(valid[..., None], normals, 0).astype(np.float32)
    zeros = np.zeros((*items.shape, 3), np.float32)
    face = np.where(valid, items.astype(np.int32) - 1, -1).astype(np.int32)
    points = SurfacePoints(zeros, normals, zeros[..., :2].copy())
    return HitRecord(face, items, depths.astype(np.float32), normals, lambda: points)


def square(z: float, half: float) -> Surface:
    """A square across the view axis."""
    points = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    points[:, 2] = z
    return Surface("s", points, np.array([[0, 1, 2], [0, 2, 3]], np.int32), 0)


def house(*classes: int, z: float = -2.0, half: float = 0.5) -> House:
    """A house with one square per class."""
    items = tuple(
        Item(f"item{k}", f"thing {k}", ItemKind.OBJECT, "0", (square(z, half),), nyu40=c)
        for k, c in enumerate(classes)
    )
    source = Source("builtin", "test.file", "0" * 64)
    level = Level("0", "0", 0.0, 2.5)
    return House("test", "test", source, (level,), (), items, (Material("m"),), {})
