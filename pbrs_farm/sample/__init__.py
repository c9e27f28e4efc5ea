"""Rooms -> candidate cameras -> the best of each sector, with every other one's reason; no effects."""

from pbrs_farm.sample.camera_file import cameras_from_file_text
from pbrs_farm.sample.camera_report import CameraReport
from pbrs_farm.sample.house_sampler import Sampling, cameras, sample_cameras
from pbrs_farm.sample.object_cameras import object_views
from pbrs_farm.sample.stored_cameras import views_from_cameras

__all__ = [
    "CameraReport",
    "Sampling",
    "cameras",
    "cameras_from_file_text",
    "object_views",
    "sample_cameras",
    "views_from_cameras",
]
