"""A source of cameras: views from a corner of each room to its middle.

pbrs-farm run builtin --cameras corners,height_m=1.2 --out out/corners
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrs_farm.plugin import (
    Camera,
    CameraRequest,
    CameraSource,
    Intrinsics,
    Record,
    Sampling,
    View,
    option,
    view_id,
)


class Options(Record):
    """Options of `--cameras corners,...`."""

    height_m: float = option(1.5, "height of the eye above the floor", ge=0.1, le=3)


def corners(request: CameraRequest) -> Sampling:
    """A view of each room."""
    views = []
    fields, options = request.fields, request.options
    size = fields.score_width_px, fields.score_height_px
    for room in request.house.rooms:
        middle = np.asarray(room.polygon).mean(0)
        x, z = room.polygon[0] + 0.15 * (middle - room.polygon[0])
        eye = np.array([x, room.floor_y + options.height_m, z])
        target = np.array([middle[0], room.floor_y + 0.8, middle[1]])
        camera = Camera.look(Intrinsics.from_hfov(*size, fields.hfov_rad), eye, target - eye)
        views.append(View(view_id(room.id, 0), room.id, 0, camera))
    return Sampling.of_views(fields, views)


SOURCE: Any = CameraSource(
    name="corners", views=corners, help="a corner of each room", options=Options
)
