"""manifest.jsonl: a line per stored object of a house, and of all houses of a root; no effects."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Iterator
from itertools import groupby

from pbrs_farm.core import keys
from pbrs_farm.formats.marker import Marker


def manifest_from_markers(markers: Iterable[Marker], attribution: str) -> bytes:
    """The manifest of a house's markers, by key, a line each: bytes, sha256, step, digest, credit."""
    credit = {"attribution": attribution} if attribution else {}
    rows: list[dict[str, str | int]] = [
        {
            "key": file.key,
            "bytes": file.n_bytes,
            "sha256": file.sha256,
            "step": marker.step,
            "digest": marker.digest,
            **credit,
        }
        for marker in markers
        for file in marker.files
    ]
    rows.sort(key=lambda row: str(row["key"]))
    return "".join(keys.canonical_json(row) + "\n" for row in rows).encode()


def sha256_by_key(manifest: bytes) -> dict[str, str]:
    """Key -> sha256 of every line; ValueError, KeyError or TypeError for a damaged one."""
    rows = [json.loads(line) for line in manifest.splitlines()]
    return {row["key"]: row["sha256"] for row in rows}


def lines_by_house(manifest: bytes) -> Iterator[tuple[str, bytes]]:
    """House -> its lines, as bytes with their ends, of a manifest sorted by house."""
    lines = io.BytesIO(manifest)  # shares the bytes, does not copy them
    for house, group in groupby(lines, key=_house_of_line):
        yield house, b"".join(group)


def _house_of_line(line: bytes) -> str:
    parts = keys.parse_house_key(json.loads(line)["key"])
    return parts.house if parts is not None else ""
