"""`pbrs-farm pack`: finished views as tar shards that webdataset reads too, and dataset.json.

Effects: reads an output root, writes a new folder; it appears whole or not at all.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import new_folder
from pbrs_farm.images import jpeg_from_array
from pbrs_farm.study.packing.data_card import card, croissant_json, described, root_facts
from pbrs_farm.study.packing.packing_plan import FORMS, Packing, ShardPlan, shard_plans
from pbrs_farm.study.reading.dataset_json import DATASET_JSON, Dataset, Shard, dataset_json
from pbrs_farm.study.reading.png_rows import png_of_rows
from pbrs_farm.study.reading.shard_set import label_parts, tar_end, tar_member
from pbrs_farm.study.reading.stored_layers import ViewFacts, resized_stored
from pbrs_farm.study.reading.stored_root import StoredRoot
from pbrs_farm.study.reading.view_sample import Size
from pbrs_farm.study.reading.views import ViewRef, Views

# The parts of a view as they are packed: JSON, colour of each mode, labels. Effects: reads the
# view.


def packed_view(root: StoredRoot, ref: ViewRef, packing: Packing) -> dict[str, bytes]:
    """Part name -> bytes of a view, json first; BadInput where a file is missing or damaged."""
    facts = root.facts(ref)
    size = packing.size or facts.size
    parts = {"json": _facts_json(facts, size)}
    labels, *pictures = packing.requests()
    for request in pictures:
        colour = resized_stored(root.arrays(ref, request), size)["colour"]
        if packing.colour == "jpeg":
            parts[f"{request.mode}.jpg"] = jpeg_from_array(colour, packing.quality)
        else:
            parts[f"{request.mode}.png"] = png_of_rows(colour)
    return parts | label_parts(resized_stored(root.arrays(ref, labels), size))


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
    name = f"{plan.split}-{plan.number:06d}.tar"
    digest, n_bytes = hashlib.sha256(), 0
    with (out / name).open("wb") as tar:
        for ref in plan.refs:
            # A dot would end webdataset's key.
            key = f"{ref.house}__{ref.view}".replace(".", "_")
            parts = packed_view(source, ref, packing).items()
            data = b"".join(tar_member(f"{key}.{part}", content) for part, content in parts)
            n_bytes += tar.write(data)
            digest.update(data)
        n_bytes += tar.write(tar_end())
        digest.update(tar_end())
    return Shard(name, plan.split, len(plan.refs), n_bytes, digest.hexdigest())


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
    columns = {field.name: field.type == _PICTURE for field in pq.read_schema(files[0])}
    (out / "croissant.json").write_bytes(croissant_json(files, columns, facts))
    return len(files) + 2
