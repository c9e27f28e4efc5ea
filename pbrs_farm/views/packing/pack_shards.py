"""`pbrs-farm pack`: finished views as tar shards that webdataset reads too, and dataset.json.

Effects: reads an output root, writes a new folder; it appears whole or not at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pyarrow.parquet as pq

from pbrs_farm.core.checked_calls import checked_call
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.shown_text import hint_of_choice
from pbrs_farm.regular_files import digest_of_regular, files_below, new_folder
from pbrs_farm.views.dataset_json import DATASET_JSON, Dataset, Shard, dataset_json
from pbrs_farm.views.packing.data_card import dataset_description, root_facts
from pbrs_farm.views.packing.packed_view import packed_view
from pbrs_farm.views.packing.packing_plan import FORMS, Packing, ShardPlan, shard_plans
from pbrs_farm.views.packing.parquet_files import croissant_json, croissant_kind, write_parquet
from pbrs_farm.views.packing.readme_card import card
from pbrs_farm.views.shard_tar import write_samples
from pbrs_farm.views.stored_root import StoredRoot
from pbrs_farm.views.views import Views


@dataclass(frozen=True, slots=True)
class Packed:
    """The result of packing."""

    n_views: dict[str, int]  # split -> views
    n_files: int
    n_bytes: int
    left_out: dict[str, str]  # id of a view -> reason


@checked_call
def pack(
    views: Views,
    out: str | Path,
    packing: Packing,
    *,
    form: str = "shards",
    tell: Callable[[str], None] = lambda _line: None,
) -> Packed:
    """Write the views of an output root that have all requested layers to the new folder out.

    tell: called with a line as each shard is written. Raises BadInput if the root cannot be packed, a
    view is damaged, or out is not empty.

    >>> frame.save("out/batch")
    >>> packing = pf.Packing(layers=("colour", "depth"), modes=("opengl_dl",))
    >>> pf.pack(pf.open("out/batch"), "out/shards", packing).n_views
    {'all': 1}
    """
    if form not in FORMS:
        raise BadInput("--to", form, "no such format", hint=hint_of_choice(form, FORMS))
    source, left_out = views.source, dict(views.left_out)
    if not isinstance(source, StoredRoot):
        raise BadInput(source.url, "", "is packed already", hint="pack the output folder itself")
    # Leave out views without all pictures and labels.
    for request in packing.requests():
        views = views.only(request=request)
        left_out |= views.left_out
    views = replace(views, left_out=left_out)
    write = _write_shards if form == "shards" else _write_parquet_files
    with new_folder(Path(out)) as scratch:
        write(views, source, packing, scratch, tell)
        files = files_below(scratch)
        n_bytes = sum(file.stat().st_size for file in files)
    n_views: dict[str, int] = {}
    for plan in shard_plans(views.refs, packing, form):
        n_views[plan.split] = n_views.get(plan.split, 0) + len(plan.refs)
    return Packed(n_views, len(files), n_bytes, left_out)


def _write_shards(
    views: Views, source: StoredRoot, packing: Packing, out: Path, tell: Callable[[str], None]
) -> None:
    shards = []
    for plan in shard_plans(views.refs, packing):
        shards.append(_write_shard(source, plan, packing, out))
        tell(f"{shards[-1].file}: {len(plan.refs)} views, {shards[-1].n_bytes / 1e6:.1f} MB")
    dataset = Dataset(
        packing.size,
        packing.modes if "colour" in packing.layers else (),
        packing.layers,
        tuple(shards),
        packing.shares,
        NYU40_NAMES,
    )
    facts = root_facts(views, source)
    (out / DATASET_JSON).write_bytes(
        dataset_json(dataset, dataset_description(packing, facts.credits))
    )
    (out / "README.md").write_text(card(views, packing, facts, form="shards"), encoding="utf-8")


def _write_shard(source: StoredRoot, plan: ShardPlan, packing: Packing, out: Path) -> Shard:
    path = out / f"{plan.split}-{plan.number:06d}.tar"
    samples = ((f"{ref.house}__{ref.view}", packed_view(source, ref, packing)) for ref in plan.refs)
    write_samples(path, samples)
    n_bytes = path.stat().st_size
    return Shard(path.name, plan.split, len(plan.refs), n_bytes, digest_of_regular(path))


def _write_parquet_files(
    views: Views, source: StoredRoot, packing: Packing, out: Path, tell: Callable[[str], None]
) -> None:
    files = []
    for plan in shard_plans(views.refs, packing, "parquet"):
        file = write_parquet(source, plan, packing, out)
        tell(f"{file.name}: {len(plan.refs)} views, {file.stat().st_size / 1e6:.1f} MB")
        files.append(file)
    facts = root_facts(views, source)
    (out / "README.md").write_text(card(views, packing, facts, form="parquet"), encoding="utf-8")
    columns = {field.name: croissant_kind(field.type) for field in pq.read_schema(files[0])}
    (out / "croissant.json").write_bytes(croissant_json(files, columns, facts))
