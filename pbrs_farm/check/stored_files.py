"""Bytes, digests and JSON of stored files, which may be a stranger's; every fault is a BadFile. Reads files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pbrs_farm.regular_files import digest_of_regular, fault_of, read_regular

MAX_BYTES = 2 * 2**30  # of a house's geometry; every other stored file is smaller


class BadFile(ValueError):
    """A stored file cannot be read; the text gives the reason."""


def stored_bytes(file: Path) -> bytes:
    """The file's bytes; raises BadFile if it is missing, no regular file, or above MAX_BYTES."""
    try:
        return read_regular(file, MAX_BYTES)
    except OSError as error:
        raise BadFile(fault_of(error)) from None


def stored_digest(file: Path) -> str:
    """Hex sha256 of a file of any size; raises BadFile if it is no regular file or cannot be read."""
    try:
        return digest_of_regular(file)
    except OSError as error:
        raise BadFile(fault_of(error)) from None


def stored_object(file: Path) -> dict[str, Any]:
    """The JSON object in the file; raises BadFile if it cannot be read or holds another value."""
    return object_from_json(stored_bytes(file))


def object_from_json(data: bytes | str) -> dict[str, Any]:
    """The JSON object in data; raises BadFile."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        raise BadFile("is not valid JSON, or is cut short") from None
    if not isinstance(value, dict):
        raise BadFile("is not a JSON object")
    return value
