"""A room with any number of triangles and lamps, for the cost of light; no effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.house import House, Item, Surface
from pbrs_farm.repair.lamps.bulbs import icosphere
from pbrs_farm.transport.validation import known_rooms as rooms

BULB_TRIANGLES: Final = 320
_BULB_M: Final = 0.03
_LUMEN: Final = 4000.0  # of all bulbs together


def waves_room(n_triangles: int, n_lamps: int) -> House:
    """A closed room of 6x6x3 m with a window, a waved table and bulbs below the ceiling.

    Table and bulbs have n_triangles together, and the light is the same for any number of bulbs.
    """
    surfaces = rooms.shell((6.0, 3.0, 6.0), 0, front=False)
    surfaces += rooms.panel((0, 0, -0.1), (6.0, 3.0, 0.0), (2.0, 1.0, 4.0, 2.0), 0)
    surfaces.append(_waves(n_triangles - BULB_TRIANGLES * n_lamps))
    materials = [rooms.matte("wall", 0.7), rooms.matte("table", 0.4, 0.3, 0.2), rooms.BULB]
    return rooms.house(surfaces, materials, lamps=_bulbs(n_lamps))


def _bulbs(n: int) -> list[Item]:
    """n bulbs of repair's kind in a square grid."""
    side = int(np.ceil(np.sqrt(n)))
    step = 5.0 / side
    bulbs = []
    for k in range(n):
        x, z = 0.5 + (k % side + 0.5) * step, 0.5 + (k // side + 0.5) * step
        surfaces = (icosphere("bulb", np.array([x, 2.7, z]), _BULB_M, 2),)
        lamp = rooms.bulb((x, 2.7, z), 2, _LUMEN / n, radius=_BULB_M)
        bulbs.append(replace(lamp, surfaces=surfaces))
    return bulbs


def _waves(n_triangles: int) -> Surface:
    """A square of 4x4 m at 0.8 m, waved like cloth."""
    n = int(np.sqrt(n_triangles / 2))
    x, z = np.meshgrid(np.linspace(1, 5, n + 1), np.linspace(1, 5, n + 1))
    y = 0.8 + 0.05 * np.sin(9 * x) * np.cos(7 * z)
    points = np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = corner, corner + 1, corner + n + 1, corner + n + 2
    faces = np.concatenate([np.stack([a, c, b], -1), np.stack([b, c, d], -1)]).astype(np.int32)
    return Surface("waves", points, faces, 1)
