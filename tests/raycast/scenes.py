"""Triangle soups and small rooms for rays, built in code."""

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import Geometry


def geometry(
    triangles: NDArray[np.floating],
    items: NDArray[np.integer] | None = None,
    normals: NDArray[np.floating] | None = None,
) -> Geometry:
    """One triangle per row of (F, 3, 3); item ids count from 1 by default; uv = (x, y)."""
    n = len(triangles)
    positions = np.asarray(triangles, np.float32).reshape(-1, 3)
    ids = np.arange(1, n + 1) if items is None else items
    return Geometry(
        positions=positions,
        normals=np.zeros_like(positions) if normals is None else normals.astype(np.float32),
        uvs=positions[:, :2].copy(),
        faces=np.arange(3 * n, dtype=np.int32).reshape(-1, 3),
        face_item=np.asarray(ids, np.uint32),
        face_material=np.zeros(n, np.int32),
        face_surface=np.zeros(n, np.int32),
    )


def wall(z: float, half: float = 10.0) -> NDArray[np.float64]:
    """Two triangles, a square across the z axis that faces +z."""
    a, b, c, d = (
        np.array([x * half, y * half, z]) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    )
    return np.array([[a, b, c], [a, c, d]])


def soup(n: int, seed: int = 0, size: float = 0.5) -> Geometry:
    """n random triangles around the origin, within 3 m, with random vertex normals."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-3, 3, (n, 1, 3)) + rng.normal(0, size, (n, 3, 3))
    normals = rng.normal(size=(3 * n, 3))
    return geometry(corners, normals=normals / np.linalg.norm(normals, axis=1, keepdims=True))


def camera(
    width: int = 80,
    height: int = 60,
    eye: tuple[float, float, float] = (0.0, 0.0, 0.0),
    towards: tuple[float, float, float] = (0.0, 0.0, -1.0),
) -> Camera:
    """A camera with the published field of view."""
    return Camera.look(
        Intrinsics.from_hfov(width, height), np.array(eye), np.array(towards, np.float64)
    )
