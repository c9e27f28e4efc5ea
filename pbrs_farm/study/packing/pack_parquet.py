"""Views as Parquet files that Hugging Face's load_dataset reads. Effects: reads views, writes a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from pbrs_farm.study.packing.packed_view import packed_view
from pbrs_farm.study.packing.packing_plan import Packing, ShardPlan
from pbrs_farm.study.reading.stored_root import StoredRoot

_TEXTS: Final = ("id", "house", "room", "camera")
_PICTURE: Final = pa.struct([("bytes", pa.binary()), ("path", pa.string())])


def write_parquet(source: StoredRoot, plan: ShardPlan, packing: Packing, out: Path) -> Path:
    """data/<split>-<number>-of-<number>.parquet: a row a view.

    Pictures and labels of 8 bits are columns of type Image; labels of 16 bits are .npz bytes, since
    an Image would make 8 bits of them. camera is JSON: size, K and pose as in docs/formats.md.
    """
    rows = []
    for ref in plan.refs:
        parts = packed_view(source, ref, packing)
        facts = json.loads(parts.pop("json"))
        camera = {k: v for k, v in facts.items() if k not in ("house", "view", "room")}
        row: dict[str, Any] = {
            "id": ref.id, "house": ref.house, "room": facts["room"], "camera": json.dumps(camera),
        }  # fmt: skip
        for part, data in parts.items():
            name, _, ending = part.partition(".")
            row[name] = data if ending == "npz" else {"bytes": data, "path": None}
        rows.append(row)
    file = out / "data" / f"{plan.split}-{plan.number:05d}-of-{plan.n_shards:05d}.parquet"
    file.parent.mkdir(exist_ok=True)
    pq.write_table(pa.Table.from_pylist(rows, _schema(rows[0])), file, row_group_size=50)
    return file


def _schema(row: dict[str, Any]) -> pa.Schema:
    # Say which columns are pictures where `datasets` looks for it.
    types = {
        name: pa.string()
        if name in _TEXTS
        else pa.binary()
        if isinstance(value, bytes)
        else _PICTURE
        for name, value in row.items()
    }
    features = {
        name: {"_type": "Image"} if kind == _PICTURE else {"dtype": str(kind), "_type": "Value"}
        for name, kind in types.items()
    }
    said = json.dumps({"info": {"features": features}})
    return pa.schema(list(types.items()), metadata={"huggingface": said})
