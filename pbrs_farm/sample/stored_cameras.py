"""Views from cameras that someone placed: kept in the source, or given in a file; no effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.house import House, Room
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.core.shot import view_id
from pbrs_farm.geometry.plan_surfaces import room_shape
from pbrs_farm.sample.eye_probes import ItemCounter, count_items
from pbrs_farm.sample.view_score import object_columns

OUTSIDE = "out"  # room id in the views of cameras outside all rooms


def stored_views(
    house: House, fields: CameraFields, counter: ItemCounter
) -> tuple[tuple[View, ...], tuple[str, ...]]:
    """The source's cameras as views, with their field of view and no rule, and notes on omitted ones."""
    cameras, notes = [], []
    for stored in house.cameras:
        # Skip poses with non-finite numbers, no direction, or too wide a field of view.
        numbers = np.concatenate([stored.eye, stored.towards, [stored.hfov_rad]])
        usable = np.isfinite(numbers).all() and np.linalg.norm(stored.towards) > 0
        if not usable or not 0 < stored.hfov_rad < math.pi:
            notes.append(f"stored camera {stored.name!r} has no usable pose and was left out")
            continue
        # Take another up vector for a camera that looks straight up or down.
        size = (fields.score_width_px, fields.score_height_px)
        intrinsics = Intrinsics.from_hfov(*size, stored.hfov_rad)
        towards = stored.towards / np.linalg.norm(stored.towards)
        up = (0.0, 0.0, 1.0) if abs(towards[1]) > 0.9999 else (0.0, 1.0, 0.0)
        cameras.append((Camera.look(intrinsics, stored.eye, towards, up), None))
    if not house.cameras:
        notes.append("the source keeps no camera")
    return views_from_cameras(house, cameras, fields, counter, origin="stored"), tuple(notes)


def views_from_cameras(
    house: House,
    cameras: Sequence[tuple[Camera, str | None]],
    fields: CameraFields,
    counter: ItemCounter,
    *,
    origin: str,
) -> tuple[View, ...]:
    """Each camera as a view of its room, scored like a sampled one.

    cameras: each with the id of the room in its name, as for published ones; if that is None or unknown,
    the room at the camera's position. Ids are `<room>_<sector>_<k>`, k counting the cameras of a room and
    sector; the room is "out" for a camera outside all rooms.
    """
    columns = object_columns(house)
    views: list[View] = []
    used: dict[tuple[str, int], int] = {}
    room_by_id = {room.id: room for room in house.rooms}
    for camera, room_id in cameras:
        room = room_by_id.get(room_id or "") or room_of(house, camera)
        place = (OUTSIDE if room is None else room.id, sector_of(camera, fields.n_sectors))
        k = used[place] = used.get(place, -1) + 1
        views.append(View(view_id(*place, k), *place, camera, origin))
    # Count what each sees, as the sampler does.
    for part, rows in count_items(counter, [v.camera for v in views], len(house.items)):
        score = rows[:, columns].sum(1)
        for row, number in enumerate(range(part.start, part.stop)):
            objects = {int(i): int(rows[row, i]) for i in columns if rows[row, i]}
            views[number] = replace(views[number], score=float(score[row]), objects=objects)
    return tuple(views)


def room_of(house: House, camera: Camera) -> Room | None:
    """The room around the eye with the nearest floor below, up to half a metre above its ceiling; or None."""
    x, y, z = camera.eye
    # Allow for a floor drawn a little high and an eye just above the ceiling.
    holding = [
        room
        for room in house.rooms
        if room.floor_y - 0.1 <= y <= max(room.ceiling_y, room.floor_y) + 0.5
        and shapely.contains_xy(room_shape(room), x, z)
    ]
    return max(holding, key=lambda room: room.floor_y, default=None)


def sector_of(camera: Camera, n_sectors: int) -> int:
    """Number of the sector the camera looks into; azimuth counts from +x towards +z, 0 for up and down."""
    x, _y, z = camera.towards
    azimuth = math.atan2(z, x) % (2 * math.pi)
    return min(int(azimuth / (2 * math.pi) * n_sectors), n_sectors - 1)
