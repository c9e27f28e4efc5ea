"""WebDataset: tar shards of samples, equal bytes for equal views. Effects: reads views, writes files."""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.views.shard_tar import write_samples


def write_webdataset(views: list[ChosenView], out: Path, choice: Choice) -> int:
    """shard-<6 digits>.tar of choice.views_per_shard views each; the number of files.

    A sample's key is <house>__<view>; its parts are json (view.json) and every layer that is
    exported, by name: "mlt_il_ol.png", "depth.png". No clock, no owner.
    """
    starts = range(0, len(views), choice.views_per_shard)
    for number, start in enumerate(starts):
        own = views[start : start + choice.views_per_shard]
        samples = ((f"{view.house.id}__{view.id}", _sample_parts(view)) for view in own)
        write_samples(out / f"shard-{number:06d}.tar", samples)
    return len(starts)


def _sample_parts(view: ChosenView) -> dict[str, bytes]:
    files = {f"{layer.name}{Path(layer.file).suffix}": layer.name for layer in view.layers}
    return {"json": view.facts_json} | {part: view.data(name) for part, name in files.items()}


FORM = ViewForm(
    "webdataset",
    write_webdataset,
    "`shard-<6 digits>.tar`, 500 views each (`--shard-size`); key `<house>__<view>`, parts `json` and"
    " `<layer>.png` / `.exr`; equal views give equal bytes",
    has_classes=True,
    convention=Convention(0.5, has_k=True, axes="as view.json", depth="as view.json"),
)
