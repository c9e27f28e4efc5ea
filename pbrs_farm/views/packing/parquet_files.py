"""Views as Parquet files that Hugging Face's load_dataset reads. Effects: reads views, writes a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.views.packing.packed_view import facts_json, stored_parts
from pbrs_farm.views.packing.packing_plan import Packing, ShardPlan
from pbrs_farm.views.stored_layers import ViewFacts
from pbrs_farm.views.stored_root import StoredRoot
from pbrs_farm.views.view_sample import Size
from pbrs_farm.views.views import ViewRef

PICTURE: Final = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
_ROWS_A_GROUP: Final = 20  # 50 MB of labels at 640x480


def write_parquet(source: StoredRoot, plan: ShardPlan, packing: Packing, out: Path) -> Path:
    """Write data/<split>-<number>-of-<number>.parquet, a row a view.

    Pictures are columns of type Image, labels of type Array2D (normals Array3D) in their stored type.
    camera is JSON: size, K and pose as in docs/formats/view_json.md. Raises BadInput if the views of a
    file differ in size: an array column has one shape.
    """
    file = out / "data" / f"{plan.split}-{plan.number:05d}-of-{plan.n_shards:05d}.parquet"
    file.parent.mkdir(exist_ok=True)
    writer: pq.ParquetWriter | None = None
    size: Size | None = None
    try:
        for start in range(0, len(plan.refs), _ROWS_A_GROUP):
            rows = []
            for ref in plan.refs[start : start + _ROWS_A_GROUP]:
                facts = source.facts(ref)
                size = size or packing.size or facts.size
                if (packing.size or facts.size) != size:
                    raise _two_sizes(ref, size, facts.size)
                rows.append(_parquet_row(source, ref, facts, packing))
            table = _table(rows)
            if writer is None:
                writer = pq.ParquetWriter(file, table.schema, compression="zstd")
            writer.write_table(table, row_group_size=_ROWS_A_GROUP)
    finally:
        if writer is not None:
            writer.close()
    return file


def _two_sizes(ref: ViewRef, one: Size, other: Size) -> BadInput:
    sizes = " and ".join(f"{w}x{h}" for w, h in (one, other))
    hint = "--size WIDTHxHEIGHT makes them one size"
    return BadInput(ref.id, "", f"views of {sizes} cannot be rows of one table", hint=hint)


def _parquet_row(
    source: StoredRoot, ref: ViewRef, facts: ViewFacts, packing: Packing
) -> dict[str, Any]:
    """Column -> text, {"bytes", "path"} of a picture, or a label's array."""
    size = packing.size or facts.size
    camera = json.loads(facts_json(facts, size))
    room = camera["room"]
    for name in ("house", "view", "room"):
        del camera[name]
    row = {"id": ref.id, "house": ref.house, "room": room, "camera": json.dumps(camera)}
    labels, pictures = stored_parts(source, ref, packing, size)
    for part, data in pictures.items():
        row[part.partition(".")[0]] = {"bytes": data, "path": None}
    return row | labels


def _table(rows: list[dict[str, Any]]) -> pa.Table:
    """A table with metadata for `datasets`: the columns of pictures and arrays."""
    columns: dict[str, pa.Array] = {}
    features: dict[str, dict[str, Any]] = {}
    for name, first in rows[0].items():
        values = [row[name] for row in rows]
        if isinstance(first, str):
            columns[name], features[name] = pa.array(values), {"dtype": "string", "_type": "Value"}
        elif isinstance(first, dict):
            columns[name], features[name] = pa.array(values, PICTURE), {"_type": "Image"}
        else:
            columns[name] = _array_column(np.stack(values))
            shape, dtype = list(first.shape), str(first.dtype)
            kind = f"Array{len(shape)}D"
            features[name] = {"shape": shape, "dtype": dtype, "_type": kind}
    table = pa.table(columns)
    return table.replace_schema_metadata(
        {"huggingface": json.dumps({"info": {"features": features}})}
    )


def _array_column(stack: NDArray[Any]) -> pa.Array:
    """(N, ...) values as N nested lists."""
    column = pa.array(stack.reshape(-1))
    for axis in range(stack.ndim - 1, 0, -1):
        n_lists = int(np.prod(stack.shape[:axis]))
        offsets = np.arange(n_lists + 1, dtype=np.int32) * stack.shape[axis]
        column = pa.ListArray.from_arrays(pa.array(offsets), column)
    return column


def croissant_kind(column: pa.DataType) -> str:
    """The Croissant data type of a column."""
    if column == PICTURE:
        return "sc:ImageObject"
    return "sc:Integer" if pa.types.is_list(column) else "sc:Text"
