"""Large JSON of strangers -> a value, whose size in memory is bounded before it is parsed; no effects."""

from __future__ import annotations

from typing import Any, Final

from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse

MAX_JSON_BYTES: Final = 192_000_000
"""Of a house's file: furnished houses have a tenth of it."""

# A list or an object takes some 60 bytes and more, a number 32: together they stay below 2 GB.
_MOST_GROUPS: Final = 4_000_000
_MOST_VALUES: Final = 24_000_000


def bounded_json(data: bytes, file: str) -> Any:
    """Parse JSON; BadHouse for invalid text, or (by counting brackets and commas first) for too many values."""
    n_groups = data.count(b"{") + data.count(b"[")
    n_values = data.count(b",")
    if n_groups > _MOST_GROUPS or n_values > _MOST_VALUES:
        text = f"has {n_groups} objects and lists and {n_values} values, more than any house"
        raise BadHouse(file, "", text)
    return json_from_bytes(data, file)
