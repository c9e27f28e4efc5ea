"""`pbrs-farm pack`: finished views as tar shards that webdataset reads too, and dataset.json.

Effects: reads an output root, writes a new folder; it appears whole or not at all.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.new_folder import new_folder
from pbrs_farm.study.packing.dataset_card import card, described
from pbrs_farm.study.packing.pack_parquet import write_parquet
from pbrs_farm.study.packing.packed_view import packed_view
from pbrs_farm.study.packing.packing_plan import Packing, ShardPlan, shard_plans
from pbrs_farm.study.reading.dataset_json import DATASET_JSON, Dataset, Shard, dataset_json
from pbrs_farm.study.reading.stored_root import StoredRoot
from pbrs_farm.study.reading.tar_members import tar_end, tar_member
from pbrs_farm.study.reading.views import Views

FORMS = ("shards", "parquet")


@dataclass(frozen=True, slots=True)
class Packed:
    """What was packed."""

    n_views: dict[str, int]  # split -> views
    n_files: int
    n_bytes: int
    left_out: dict[str, str]  # id of a view -> why


def pack(
    views: Views,
    out: Path,
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
    write = _write_shards if form == "shards" else _write_parquet_files
    with new_folder(out) as scratch:
        n_files = write(views, source, packing, scratch, tell)
        n_bytes = sum(file.stat().st_size for file in scratch.rglob("*") if file.is_file())
    n_views: dict[str, int] = {}
    for plan in shard_plans(views.refs, packing):
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
    credits = source.credits(views.homes)
    (out / DATASET_JSON).write_bytes(dataset_json(dataset, described(packing, credits)))
    (out / "README.md").write_text(card(views, packing, credits, form="shards"), encoding="utf-8")
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
    n_files = 0
    for plan in shard_plans(views.refs, packing):
        file = write_parquet(source, plan, packing, out)
        tell(f"{file.name}: {len(plan.refs)} views, {file.stat().st_size / 1e6:.1f} MB")
        n_files += 1
    credits = source.credits(views.homes)
    (out / "README.md").write_text(card(views, packing, credits, form="parquet"), encoding="utf-8")
    return n_files + 1
