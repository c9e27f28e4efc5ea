"""Ground truth: one hit record at pixel centres -> every label layer; pure functions, no effects."""

from pbrs_farm.truth.basic import (
    depth_mm,
    instance_png,
    layers_from_hit,
    normal_png,
    nyu40_of_instance,
    semantic_png,
    valid_png,
)
from pbrs_farm.truth.boundary import instance_boundary
from pbrs_farm.truth.table import PixelsAlone, camera_table, is_truncated, view_table

__all__ = [
    "PixelsAlone",
    "camera_table",
    "depth_mm",
    "instance_boundary",
    "instance_png",
    "is_truncated",
    "layers_from_hit",
    "normal_png",
    "nyu40_of_instance",
    "semantic_png",
    "valid_png",
    "view_table",
]
