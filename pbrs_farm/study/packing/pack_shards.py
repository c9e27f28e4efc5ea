"""`pbrs-farm pack`: finished views as tar shards that webdataset reads too, and dataset.json.

Effects: reads an output root, writes a new folder; it appears whole or not at all.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.form import new_folder
from pbrs_farm.images import jpeg_from_array
from pbrs_farm.regular_files import digest_of_regular
from pbrs_farm.study.packing.data_card import card, croissant_json, described, root_facts
from pbrs_farm.study.packing.packing_plan import FORMS, Packing, ShardPlan, shard_plans
from pbrs_farm.views.dataset_json import DATASET_JSON, Dataset, Shard, dataset_json
from pbrs_farm.views.png_rows import png_of_rows
from pbrs_farm.views.shard_parts import label_parts
from pbrs_farm.views.shard_tar import write_samples
from pbrs_farm.views.stored_layers import Stored, ViewFacts, resized_stored
from pbrs_farm.views.stored_root import StoredRoot
from pbrs_farm.views.view_sample import Size
from pbrs_farm.views.views import ViewRef, Views

# The parts of a view as they are packed: JSON, colour of each mode, labels. Effects: reads the
# view.


def packed_view(root: StoredRoot, ref: ViewRef, packing: Packing) -> dict[str, bytes]:
    """Part name -> bytes of a view, json first; BadInput where a file is missing or damaged."""
    facts = root.facts(ref)
    size = packing.size or facts.size
    labels, pictures = _stored_parts(root, ref, packing, size)
    return {"json": _facts_json(facts, size)} | pictures | label_parts(labels)


def _stored_parts(
    root: StoredRoot, ref: ViewRef, packing: Packing, size: Size
) -> tuple[Stored, dict[str, bytes]]:
    """(arrays of the labels, part name -> bytes of colour in each mode) of a view."""
    pictures = {}
    wanted, *of_colour = packing.requests()
    for request in of_colour:
        colour = resized_stored(root.arrays(ref, request), size)["colour"]
        if packing.colour == "jpeg":
            pictures[f"{request.mode}.jpg"] = jpeg_from_array(colour, packing.quality)
        else:
            pictures[f"{request.mode}.png"] = png_of_rows(colour)
    return resized_stored(root.arrays(ref, wanted), size), pictures


def _facts_json(facts: ViewFacts, size: Size) -> bytes:
    row = {
        "house": facts.house,
        "view": facts.view,
        "room": facts.room,
        "width_px": size[0],
        "height_px": size[1],
        "K": facts.k_at(size).tolist(),
        "world_from_camera_opencv": facts.world_from_camera_opencv,
    }
    return json.dumps(row, separators=(",", ":")).encode()


# Views as Parquet files that Hugging Face's load_dataset reads. Effects: reads views, writes a
# file.


_PICTURE: Final = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
_ROWS_A_GROUP: Final = 20  # 50 MB of labels at 640x480


def write_parquet(source: StoredRoot, plan: ShardPlan, packing: Packing, out: Path) -> Path:
    """data/<split>-<number>-of-<number>.parquet: a row a view.

    Pictures are columns of type Image, labels of type Array2D (normals Array3D) in the type they are
    stored in. camera is JSON: size, K and pose as in docs/formats.md. Raises BadInput where the views
    of a file are not of one size: an array column has one shape.
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
    camera = json.loads(_facts_json(facts, size))
    room = camera["room"]
    for name in ("house", "view", "room"):
        del camera[name]
    row = {"id": ref.id, "house": ref.house, "room": room, "camera": json.dumps(camera)}
    labels, pictures = _stored_parts(source, ref, packing, size)
    for part, data in pictures.items():
        row[part.partition(".")[0]] = {"bytes": data, "path": None}
    return row | labels


def _table(rows: list[dict[str, Any]]) -> pa.Table:
    """A table whose metadata says which columns are pictures and arrays, where `datasets` looks for it."""
    columns: dict[str, pa.Array] = {}
    features: dict[str, dict[str, Any]] = {}
    for name, first in rows[0].items():
        values = [row[name] for row in rows]
        if isinstance(first, str):
            columns[name], features[name] = pa.array(values), {"dtype": "string", "_type": "Value"}
        elif isinstance(first, dict):
            columns[name], features[name] = pa.array(values, _PICTURE), {"_type": "Image"}
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


# `pbrs-farm pack`.


@dataclass(frozen=True, slots=True)
class Packed:
    """What was packed."""

    n_views: dict[str, int]  # split -> views
    n_files: int
    n_bytes: int
    left_out: dict[str, str]  # id of a view -> why


def pack(
    views: Views,
    out: str | Path,
    packing: Packing,
    *,
    form: str = "shards",
    tell: Callable[[str], None] = lambda _line: None,
) -> Packed:
    """Write the views of an output root that have all that packing asks for to the new folder out.

    tell: called with a line as each shard is written. Raises BadInput for a root that cannot be
    packed, a view that is damaged, or an out that holds something.
    """
    if form not in FORMS:
        raise BadInput("--to", form, "no such form", hint=f"of {', '.join(FORMS)}")
    source, left_out = views.source, dict(views.left_out)
    if not isinstance(source, StoredRoot):
        raise BadInput(source.url, "", "is packed already", hint="pack the output folder itself")
    # Leave out what lacks any of the pictures or labels.
    for request in packing.requests():
        views = views.only(request=request)
        left_out |= views.left_out
    views = replace(views, left_out=left_out)
    write = _write_shards if form == "shards" else _write_parquet_files
    with new_folder(Path(out)) as scratch:
        n_files = write(views, source, packing, scratch, tell)
        n_bytes = sum(file.stat().st_size for file in scratch.rglob("*") if file.is_file())
    n_views: dict[str, int] = {}
    for plan in shard_plans(views.refs, packing, form):
        n_views[plan.split] = n_views.get(plan.split, 0) + len(plan.refs)
    return Packed(n_views, n_files, n_bytes, left_out)


def _write_shards(
    views: Views, source: StoredRoot, packing: Packing, out: Path, tell: Callable[[str], None]
) -> int:
    shards = []
    for plan in shard_plans(views.refs, packing):
        shards.append(_write_shard(source, plan, packing, out))
        tell(f"{shards[-1].file}: {len(plan.refs)} views, {shards[-1].n_bytes / 1e6:.1f} MB")
    dataset = Dataset(
        packing.size, packing.modes if "colour" in packing.layers else (), packing.layers,
        tuple(shards), packing.shares, NYU40_NAMES,
    )  # fmt: skip
    facts = root_facts(views, source)
    (out / DATASET_JSON).write_bytes(dataset_json(dataset, described(packing, facts.credits)))
    (out / "README.md").write_text(card(views, packing, facts, form="shards"), encoding="utf-8")
    return len(shards) + 2


def _write_shard(source: StoredRoot, plan: ShardPlan, packing: Packing, out: Path) -> Shard:
    path = out / f"{plan.split}-{plan.number:06d}.tar"
    samples = ((f"{ref.house}__{ref.view}", packed_view(source, ref, packing)) for ref in plan.refs)
    write_samples(path, samples)
    n_bytes = path.stat().st_size
    return Shard(path.name, plan.split, len(plan.refs), n_bytes, digest_of_regular(path))


def _write_parquet_files(
    views: Views, source: StoredRoot, packing: Packing, out: Path, tell: Callable[[str], None]
) -> int:
    files = []
    for plan in shard_plans(views.refs, packing, "parquet"):
        file = write_parquet(source, plan, packing, out)
        tell(f"{file.name}: {len(plan.refs)} views, {file.stat().st_size / 1e6:.1f} MB")
        files.append(file)
    facts = root_facts(views, source)
    (out / "README.md").write_text(card(views, packing, facts, form="parquet"), encoding="utf-8")
    columns = {field.name: _kind(field.type) for field in pq.read_schema(files[0])}
    (out / "croissant.json").write_bytes(croissant_json(files, columns, facts))
    return len(files) + 2


def _kind(column: pa.DataType) -> str:
    """What a column holds, in Croissant's words."""
    if column == _PICTURE:
        return "sc:ImageObject"
    return "sc:Integer" if pa.types.is_list(column) else "sc:Text"
