"""rig.toml: the cameras of a rig, for --rig and pf.film(rig=). Effects: reads a file.

name = "head"

[[cameras]]
name = "front"

[[cameras]]
name = "left"
translation_m = [-0.2, 0.0, 0.0]
yaw_deg = -60
hfov_deg = 90
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.rig_fields import RigFields
from pbrs_farm.regular_files import toml_given


def rig_from_toml(path: Path) -> RigFields:
    """The rig of a file, called by the file unless named; BadInput names file and key."""
    return rig_from_table(toml_given(path), path)


def rig_from_table(fields: Mapping[str, Any], place: object) -> RigFields:
    """The rig in the tables of such a file; BadInput, naming place and key, for invalid ones."""
    return checked(RigFields, dict(fields), place, hint="docs/cameras.md")
