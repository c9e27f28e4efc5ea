"""Cameras of one's own: one in each room, in a corner, looking at the middle.

pbrs-farm run builtin --set cameras.preset=corners --out out/corners
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrs_farm.plugin import Camera, Intrinsics, View, view_id


def corners(house: Any, fields: Any, _seed: int, _caster: Any) -> list[View]:
    """The views. house: finished. fields: the recipe's group cameras."""
    views = []
    size = fields.score_width_px, fields.score_height_px
    for room in house.rooms:
        middle = np.asarray(room.polygon).mean(0)
        x, z = room.polygon[0] + 0.15 * (middle - room.polygon[0])
        eye = np.array([x, room.floor_y + 1.5, z])
        target = np.array([middle[0], room.floor_y + 0.8, middle[1]])
        camera = Camera.look(Intrinsics.from_hfov(*size, fields.hfov_rad), eye, target - eye)
        views.append(View(view_id(room.id, 0), room.id, 0, camera))
    return views
