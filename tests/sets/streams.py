"""A stream of a small set, and the digest of its samples; another process imports these, too."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

import pbrs_farm as pf
from pbrs_farm.sets.stream import Stream
from tests.sets.small_sets import small_set

LAYERS = ("colour", "normal", "albedo")


def digest(sample: dict[str, Any]) -> str:
    """Digest of all entries of a sample."""
    sha = hashlib.sha256()
    for name, value in sorted(sample.items()):
        array = np.asarray(value)
        sha.update(f"{name} {array.dtype} {array.shape}".encode())
        sha.update(array.tobytes() if array.dtype.kind != "U" else str(value).encode())
    return sha.hexdigest()


def streamed(folder: Path, cache: Path, **options: Any) -> Stream:
    """A stream of a set of two small homes with two views each."""
    file = folder / "small.toml"
    if not file.exists():
        small_set(folder)
        file.write_text(file.read_text().partition("[part.panoramas]")[0])
    return pf.stream(file, layers=LAYERS, size=(64, 48), cache=cache, reuse=2, **options)
