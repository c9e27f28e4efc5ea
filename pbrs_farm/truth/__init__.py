"""Ground truth: one hit record at pixel centres -> every label layer; no effects."""

from pbrs_farm.truth.articulation import articulation_table as articulation_table
from pbrs_farm.truth.articulation import motion_table as motion_table
from pbrs_farm.truth.boundary import typed_boundaries as typed_boundaries
from pbrs_farm.truth.coverage import coverage as coverage
from pbrs_farm.truth.depth_sensor import sensor_depth as sensor_depth
from pbrs_farm.truth.optional_layers import OPTIONAL_NAMES as OPTIONAL_NAMES
from pbrs_farm.truth.optional_layers import LabelInputs as LabelInputs
from pbrs_farm.truth.optional_layers import optional_layers as optional_layers
from pbrs_farm.truth.optional_layers import optional_tables as optional_tables
from pbrs_farm.truth.room_layout import layout_table as layout_table
from pbrs_farm.truth.standard_layers import depth_mm as depth_mm
from pbrs_farm.truth.standard_layers import instance_label as instance_label
from pbrs_farm.truth.standard_layers import layers_from_hit as layers_from_hit
from pbrs_farm.truth.standard_layers import normal_label as normal_label
from pbrs_farm.truth.view_table import is_truncated as is_truncated
from pbrs_farm.truth.view_table import view_table as view_table
