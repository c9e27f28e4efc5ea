"""A room with a window whose frame is apart from its wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.house import House, Item, ItemKind, Opening
from pbrs_farm.geometry.solids import box
from tests.repair.wall_rooms import WALL, covers, house, room, walls_around

RECT = (0.0, 0.0, 4.0, 3.0)


def with_window(depth_m: float, *, hole_m: float = 0.5) -> House:
    """A room with a window of 1.2 x 1.2 m in its wall w0 (0.2 m thick, below z = 0)."""
    r = room("0_0", RECT)
    centre = np.array([2.0, 1.4, -0.1])
    frame = box("frame", centre, np.array([0.6, 0.6, depth_m / 2]), WALL)
    item = Item("window", "window", ItemKind.WINDOW, "0", (frame,), nyu40=9)
    cutter = box("cutter", centre, np.array([hole_m, hole_m, 0.3]), 0)
    h = hole_m
    quad = centre + np.array([[-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0]])
    opening = Opening("o", "0", "window", True, cutter, quad, np.array([0, 0, 1.0]))
    source = house([*walls_around(RECT), *covers(r), item], [r])
    return replace(source, openings=(opening,))
