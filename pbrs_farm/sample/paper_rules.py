"""The paper's rules for camera positions (section 3.1); no effects."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import Geometry, House, Room
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.geometry.plan_surfaces import room_shape
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.sample.candidates import Candidates, Grid
from pbrs_farm.sample.clearance import near_any_triangle
from pbrs_farm.sample.eye_probes import EnclosureLimits, ItemCounter, enclosed, not_above_floor

_CHUNK = 4096  # candidates per batch, to bound memory


def room_grid(room: Room) -> Grid:
    """The grid over the box of a room's polygon; eye heights count from the floor's surface."""
    (x0, z0), (x1, z1) = room.polygon.min(0), room.polygon.max(0)
    return Grid(float(x0), float(z0), float(x1), float(z1), room.floor_y)


def rejections(
    house: House,
    room: Room,
    fields: CameraFields,
    candidates: Candidates,
    geometry: Geometry,
    counter: ItemCounter,
    limits: EnclosureLimits | None = None,
) -> NDArray[np.uint8]:
    """(N,) verdict of each candidate: the first rule of place that rejects it, or LOWER_SCORE.

    In order: inside the room's polygon, farther than the clearance from every triangle, a floor
    or furniture below rather than a wall or ceiling, not enclosed by one item. Memory is bounded. limits: of
    enclosure_limits, where they are at hand.
    """
    verdict = np.full(len(candidates), Verdict.LOWER_SCORE, np.uint8)
    eye = candidates.eye
    # Sort out by the polygon first, which costs least.
    inside = shapely.contains_xy(room_shape(room), eye[:, 0], eye[:, 2])
    verdict[~inside] = Verdict.OUTSIDE_ROOM

    rules: tuple[tuple[Verdict, Callable[[F64], Bools]], ...] = (
        (Verdict.NEAR_OBSTACLE, lambda p: near_any_triangle(p, geometry, fields.clearance_m)),
        (Verdict.NOT_ABOVE_FLOOR, lambda p: not_above_floor(house, p, counter)),
        (Verdict.ENCLOSED, lambda p: enclosed(house, p, counter, limits)),
    )
    places = np.flatnonzero(inside)
    for start in range(0, len(places), _CHUNK):
        remaining = places[start : start + _CHUNK]
        # Ask each rule about the candidates that all rules before it passed.
        for rule, breaks in rules:
            rejected = breaks(eye[remaining])
            verdict[remaining[rejected]] = rule
            remaining = remaining[~rejected]
    return verdict
