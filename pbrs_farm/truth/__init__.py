"""Ground truth: one hit record at pixel centres -> every label layer; no effects, no effects."""

from pbrs_farm.truth.articulation import articulation_table, motion_table
from pbrs_farm.truth.boundary import typed_boundaries
from pbrs_farm.truth.coverage import coverage
from pbrs_farm.truth.depth_sensor import sensor_depth
from pbrs_farm.truth.optional_layers import (
    OPTIONAL_NAMES,
    LabelInputs,
    optional_layers,
    optional_tables,
)
from pbrs_farm.truth.room_layout import layout_table
from pbrs_farm.truth.standard_layers import depth_mm, instance_label, layers_from_hit, normal_label
from pbrs_farm.truth.view_table import is_truncated, view_table

__all__ = [
    "OPTIONAL_NAMES",
    "LabelInputs",
    "articulation_table",
    "coverage",
    "depth_mm",
    "instance_label",
    "is_truncated",
    "layers_from_hit",
    "layout_table",
    "motion_table",
    "normal_label",
    "optional_layers",
    "optional_tables",
    "sensor_depth",
    "typed_boundaries",
    "view_table",
]
