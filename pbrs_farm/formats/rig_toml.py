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

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.file_kinds import other_kind, wrong_kind
from pbrs_farm.core.rig_fields import RigFields
from pbrs_farm.regular_files import fault_of, read_regular, text_from_bytes

_MAX_BYTES: Final = 2**20


def rig_from_toml(path: Path) -> RigFields:
    """The rig of a file, called by the file unless named; BadInput names file and key."""
    try:
        data = read_regular(path, _MAX_BYTES)
    except OSError as error:
        raise BadInput(path, "", fault_of(error)) from None
    if other_kind(data, path) is not None:
        text, hint = wrong_kind(data, path)
        raise BadInput(path, "", text, hint=hint)
    try:
        fields = tomllib.loads(text_from_bytes(data))
    # ValueError: not UTF-8, no TOML, or an integer of thousands of digits.
    except (ValueError, RecursionError) as error:
        raise BadInput(path, "", f"is not valid TOML: {error}") from None
    return rig_from_table(fields, path)


def rig_from_table(fields: Mapping[str, Any], place: object) -> RigFields:
    """The rig in the tables of such a file; BadInput, naming place and key, for invalid ones."""
    return checked(RigFields, dict(fields), place, hint="docs/cameras.md")
