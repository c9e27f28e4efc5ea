"""Views as Parquet files that Hugging Face's load_dataset reads, and croissant.json, their description for MLCommons' readers.

Effects: reads views, writes a file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.views.packing.data_card import TITLE, RootFacts
from pbrs_farm.views.packing.packed_view import facts_json, stored_parts
from pbrs_farm.views.packing.packing_plan import Packing, ShardPlan
from pbrs_farm.views.stored_layers import ViewFacts
from pbrs_farm.views.stored_root import StoredRoot
from pbrs_farm.views.view_sample import Size
from pbrs_farm.views.views import ViewRef

PICTURE: Final = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
_ROWS_A_GROUP: Final = 20  # 50 MB of labels at 640x480

# fmt: off
_CONTEXT: Final[dict[str, Any]] = {
    "@language": "en", "@vocab": "https://schema.org/", "citeAs": "cr:citeAs",
    "column": "cr:column", "conformsTo": "dct:conformsTo", "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"}, "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"}, "extract": "cr:extract",
    "field": "cr:field", "fileObject": "cr:fileObject", "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet", "format": "cr:format", "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset", "jsonPath": "cr:jsonPath", "key": "cr:key",
    "md5": "cr:md5", "parentField": "cr:parentField", "path": "cr:path",
    "rai": "http://mlcommons.org/croissant/RAI/", "recordSet": "cr:recordSet",
    "references": "cr:references", "regex": "cr:regex", "repeated": "cr:repeated",
    "replace": "cr:replace", "samplingRate": "cr:samplingRate", "sc": "https://schema.org/", "separator": "cr:separator",
    "source": "cr:source", "subField": "cr:subField", "transform": "cr:transform",
}
# fmt: on
_PARQUET: Final = "application/x-parquet"


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


def croissant_json(files: Sequence[Path], columns: Mapping[str, str], facts: RootFacts) -> bytes:
    """Croissant 1.0: the Parquet files with their digests, and a record set for each split.

    columns: name -> data type. Labels are nested lists of integers.
    """
    splits = dict.fromkeys(file.name.partition("-")[0] for file in files)
    licences = sorted({home.licence for home in facts.homes if home.licence})
    row = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": "rendered-rooms",
        "description": f"{TITLE}: {sum(h.n_views for h in facts.homes)} views of"
        f" {len(facts.homes)} homes, rendered by pbrs_farm. README.md describes it.",
        "version": "1.0.0",
        **({"license": licences} if licences else {}),
        **({"creditText": "\n".join(facts.credits)} if facts.credits else {}),
        "distribution": [*map(_file_object, files), *map(_file_set, splits)],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": split,
                "name": split,
                "field": [_field(split, name, kind) for name, kind in columns.items()],
            }
            for split in splits
        ],
    }
    return (json.dumps(row, indent=1, ensure_ascii=False) + "\n").encode()


def _file_object(file: Path) -> dict[str, Any]:
    with file.open("rb") as data:
        digest = hashlib.file_digest(data, "sha256").hexdigest()
    return {
        "@type": "cr:FileObject",
        "@id": file.name,
        "name": file.name,
        "contentUrl": f"data/{file.name}",
        "contentSize": f"{file.stat().st_size} B",
        "encodingFormat": _PARQUET,
        "sha256": digest,
    }


def _file_set(split: str) -> dict[str, Any]:
    name = f"{split}-files"
    return {
        "@type": "cr:FileSet",
        "@id": name,
        "name": name,
        "encodingFormat": _PARQUET,
        "includes": f"data/{split}-*.parquet",
    }


def _field(split: str, name: str, kind: str) -> dict[str, Any]:
    source: dict[str, Any] = {"fileSet": {"@id": f"{split}-files"}, "extract": {"column": name}}
    if kind == "sc:ImageObject":
        source["transform"] = {"jsonPath": "bytes"}
    return {
        "@type": "cr:Field",
        "@id": f"{split}/{name}",
        "name": name,
        "source": source,
        "dataType": kind,
        **({"repeated": True} if kind == "sc:Integer" else {}),
    }
