"""From an exception or a dead renderer to a class of fault and a fingerprint; pure."""

from __future__ import annotations

import re
import traceback
from typing import Final

from pbrs_farm.core.errors import (
    BadInput,
    BadRecipe,
    MachineFailed,
    StoreFailed,
    StoreRefused,
    Transient,
)
from workers.ledger.task_ledger import FaultClass

# Hex addresses, digests and ids; then numbers, alone, before a unit or behind a name (wall w3). Digits
# inside a word are part of it: broken.sh3d, Sweet Home 3D, 2BedroomApartment.
_NUMBERS: Final = re.compile(
    r"0x[0-9a-f]+|\b(?=[a-f]*\d)[0-9a-f]{8,}\b"
    r"|(?<![A-Za-z0-9])\d+(\.\d+)?(?=(?:mm|cm|m|km|ms|s|kB|MB|GB|px|lx)?(?![A-Za-z0-9]))"
    r"|(?<=[A-Za-z])\d+(?![A-Za-z0-9])"
)
_PATHS: Final = re.compile(r"(/[\w.\-+]+)+/?")


def class_of(error: BaseException) -> FaultClass:
    """By the error's type: data (no other try), storage (uncounted), machine, resource (the worker's) ..."""
    # In order: nobody's fault, the input's, the machine's, ours.
    if isinstance(error, StoreRefused | Transient):
        return "storage"
    if isinstance(error, BadInput | BadRecipe):
        return "data"
    if isinstance(error, MemoryError):
        return "resource"
    if isinstance(error, MachineFailed):
        return "machine"
    return "bug"


def fingerprint(error: BaseException) -> str:
    """Identifier of similar faults on all machines: type, innermost place in our code, text without numbers."""
    # The innermost frame in our own code; library frames differ by version.
    place = ""
    for frame in traceback.extract_tb(error.__traceback__):
        if "pbrs_farm" in frame.filename or "workers" in frame.filename:
            place = f" in {frame.filename.rpartition('/')[2]}:{frame.name}"
    return f"{type(error).__name__}{place}: {without_numbers(str(error))}"


def without_numbers(text: str) -> str:
    """text on one line with numbers, ids and paths replaced, at most 160 characters."""
    return _NUMBERS.sub("#", _PATHS.sub("PATH", " ".join(text.split())))[:160]


def one_line(error: BaseException) -> str:
    """The error, after its type unless it is a sentence for people, in at most 500 characters."""
    text = " ".join(str(error).split()) or "no message"
    name = "" if isinstance(error, BadInput | StoreFailed) else f"{type(error).__name__}: "
    return f"{name}{text}"[:500]
