"""The visible items of a rasterized picture."""

from dataclasses import replace

import numpy as np

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House, Material
from pbrs_farm.raster import Rasterizer


def items_drawn(home: House, view: Camera) -> np.ndarray:
    """(H, W) the instance id of most samples of a pixel, decoded from pictures.

    Each picture paints every item red, green or blue, by one digit of its number in base three.
    """
    paints = tuple(Material(f"paint {k}", diffuse=tuple(np.eye(3)[k])) for k in range(3))
    drawn = np.zeros((view.intrinsics.height_px, view.intrinsics.width_px), np.int64)
    for digit in range(1 + int(np.log(len(home.items)) / np.log(3))):
        items = tuple(
            replace(i, surfaces=tuple(replace(s, material=k // 3**digit % 3) for s in i.surfaces))
            for k, i in enumerate(home.items, start=1)
        )
        with Rasterizer(replace(home, items=items, materials=paints), {}) as raster:
            drawn += 3**digit * raster.render_dl(view).argmax(axis=2)
    return drawn
