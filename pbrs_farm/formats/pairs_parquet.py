"""pairs.parquet: how much each pair of views of a room has in common, written and read; no effects."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from pbrs_farm.core.errors import BadInput

FILE: Final = "pairs.parquet"
COLUMNS: Final = {
    "room": pa.string(),
    "view_a": pa.string(),
    "view_b": pa.string(),
    "a_in_b": pa.float32(),
    "b_in_a": pa.float32(),
    "common": pa.float32(),
    "baseline_m": pa.float32(),
    "angle_deg": pa.float32(),
}


def pairs_parquet(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """The file of the step `pairs`; rows have the keys of COLUMNS, missing ones become null."""
    table = pa.Table.from_pylist([dict(row) for row in rows], pa.schema(list(COLUMNS.items())))
    buffer = io.BytesIO()
    pq.write_table(table, buffer)
    return buffer.getvalue()


def pairs_from_parquet(data: bytes, place: str) -> list[dict[str, Any]]:
    """Inverse of pairs_parquet, all in memory, unknown columns ignored; BadInput names place."""
    try:
        table = pq.read_table(io.BytesIO(data))
        rows: list[dict[str, Any]] = table.select(list(COLUMNS)).to_pylist()
    except (pa.ArrowException, KeyError, OSError) as error:
        raise BadInput(place, "", f"not a pairs.parquet: {error}") from None
    return rows
