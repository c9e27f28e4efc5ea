"""Rooms -> candidate cameras -> the best of each sector, with every other one's reason; no effects."""

from pbrs_farm.sample.report import CameraReport
from pbrs_farm.sample.sampler import Sampling, cameras, sample_cameras

__all__ = ["CameraReport", "Sampling", "cameras", "sample_cameras"]
