"""unfinished/<step>.<view>.npz: a render under way, arrays `<part>/<name>`, digest, seconds; no effects."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_DIGEST: Final = "digest"
_SPENT: Final = "spent_s"


@dataclass(frozen=True, slots=True, eq=False)
class KeptParts:
    """The parts of a render as they were kept."""

    digest: str  # of the step
    spent_s: float
    parts: Mapping[str, Mapping[str, NDArray[Any]]]  # part -> name -> array


def checkpoint_npz(parts: KeptParts) -> bytes:
    """The file, an uncompressed .npz without pickles: arrays as "<part>/<name>", the digest, seconds spent."""
    rows: dict[str, Any] = {_DIGEST: np.array(parts.digest), _SPENT: np.array(parts.spent_s)}
    for part, arrays in parts.parts.items():
        rows |= {f"{part}/{name}": array for name, array in arrays.items()}
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **rows)
    return buffer.getvalue()


def checkpoint_from_npz(data: bytes) -> KeptParts | None:
    """Inverse of checkpoint_npz, whose `digest` the caller compares; None for damaged data."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        digest, spent_s = str(arrays.pop(_DIGEST)), float(arrays.pop(_SPENT))
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile):
        return None
    parts: dict[str, dict[str, NDArray[Any]]] = {}
    for name, array in arrays.items():
        part, _, inner = name.partition("/")
        parts.setdefault(part, {})[inner] = array
    return KeptParts(digest, spent_s, parts)
