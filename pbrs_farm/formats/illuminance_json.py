"""illuminance.json of the step `illuminance`: the light on every room's floor, for people; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pbrs_farm.formats.serialise import json_bytes


def illuminance_json(record: Mapping[str, Any], sky: Mapping[str, Any]) -> bytes:
    """The file. record: of transport.illuminance.illuminance_record; sky: the sky's facts."""
    return json_bytes({**record, "sky": sky})
