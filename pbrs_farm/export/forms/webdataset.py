"""WebDataset: tar shards of samples, with equal bytes for equal views. Effects: reads views, writes files."""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.core.options import option
from pbrs_farm.core.record import Record
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.views.shard_tar import write_samples


class WebDatasetOptions(Record):
    """The options of the form."""

    shard_size: int = option(500, "views per tar (default 500)", metavar="N", least=1)


def write_webdataset(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """Write shard-<6 digits>.tar.

    A sample's key is <house>__<view>; its parts are json (view.json) and every exported layer by name:
    "mlt_il_ol.png", "depth.png". No clock, no owner.
    """
    size = choice.of(WebDatasetOptions).shard_size
    for number, start in enumerate(range(0, len(views), size)):
        shard = views[start : start + size]
        samples = ((f"{view.house.id}__{view.id}", _sample_parts(view)) for view in shard)
        write_samples(out / f"shard-{number:06d}.tar", samples)


def _sample_parts(view: ChosenView) -> dict[str, bytes]:
    files = {f"{layer.name}{Path(layer.file).suffix}": layer.name for layer in view.layers}
    return {"json": view.facts_json} | {part: view.data(name) for part, name in files.items()}


FORM = ViewForm(
    "webdataset",
    write_webdataset,
    "`shard-<6 digits>.tar`, 500 views each (`--shard-size`); key `<house>__<view>`, parts `json` and"
    " `<layer>.png` / `.exr`; equal views give equal bytes",
    options=WebDatasetOptions,
    has_classes=True,
    convention=Convention(0.5, axes="as view.json", depth="as view.json"),
)
