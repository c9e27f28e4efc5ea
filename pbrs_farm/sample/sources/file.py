"""Cameras of a user's file, JSON or a published room_camera.txt; no effects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.sample.camera_source import CameraRequest, CameraSource, Sampling

if TYPE_CHECKING:
    from pbrs_farm.core.camera import Camera


def _parse(text: str, fields: CameraFields) -> list[tuple[Camera, str | None]]:
    from pbrs_farm.sample.camera_file import cameras_from_file_text

    size = fields.score_width_px, fields.score_height_px
    return cameras_from_file_text(text, fields.file, *size)


def _views(request: CameraRequest) -> Sampling:
    from pbrs_farm.sample.stored_cameras import views_from_cameras

    fields, count = request.fields, request.caster.item_counts
    views = views_from_cameras(request.house, request.content, fields, count, origin="file")
    return Sampling.of_views(fields, views)


SOURCE = CameraSource(
    name="file", views=_views, help="cameras from a file", use="`--camera-file FILE`", parse=_parse
)
