"""Normal maps of waves, and rooms with another material."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from pbrs_farm.core.house import House, Item, Surface

Picture = np.ndarray


def waves(slope: float, n: int = 64, periods: int = 2) -> Picture:
    """A normal map of waves along u and v with a given largest slope."""
    phase = 2 * np.pi * periods * (np.arange(n) + 0.5) / n
    y, x = np.meshgrid(slope * np.cos(phase), slope * np.sin(phase), indexing="ij")
    normals = np.stack([x, y, np.ones_like(x)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.round((normals + 1) * 127.5).astype(np.uint8)


def spread(surface: Surface, per_m: float = 0.4) -> Surface:
    """The surface with texture coordinates that span each face."""
    p = surface.positions
    uvs = per_m * np.stack([p[:, 0] + 0.6 * p[:, 1], p[:, 2] + 0.3 * p[:, 1]], -1)
    return replace(surface, uvs=uvs.astype(np.float32))


def with_material(house: House, **changes: object) -> House:
    """The house with changes to its first material, and texture coordinates on every surface."""
    items: Iterable[Item] = (
        replace(item, surfaces=tuple(spread(s) for s in item.surfaces)) for item in house.items
    )
    first = replace(house.materials[0], **changes)
    return replace(house.with_items(items), materials=(first, *house.materials[1:]))
