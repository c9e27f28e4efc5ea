"""WebDataset: tar shards of samples, equal bytes for equal views. Effects: reads views, writes files."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import ViewForm


def write_webdataset(views: list[ChosenView], out: Path, choice: Choice) -> int:
    """shard-<6 digits>.tar of choice.views_per_shard views each; the number of files.

    A sample's key is <house>__<view>; its parts are json (view.json) and every layer that is
    exported, by name: "mlt_il_ol.png", "depth.png". No clock, no owner.
    """
    n_shards = 0
    for start in range(0, len(views), choice.views_per_shard):
        shard = out / f"shard-{n_shards:06d}.tar"
        with tarfile.open(shard, "w", format=tarfile.USTAR_FORMAT) as tar:
            for view in views[start : start + choice.views_per_shard]:
                _add_sample(tar, view)
        n_shards += 1
    return n_shards


def _add_sample(tar: tarfile.TarFile, view: ChosenView) -> None:
    # A dot would end the key.
    key = f"{view.house.id}__{view.id}".replace(".", "_")
    parts = {"json": view.facts_json}
    for layer in view.layers:
        parts[f"{layer.name}{Path(layer.file).suffix}"] = view.data(layer.name)
    for part, data in parts.items():
        # TarInfo's own defaults: time 0, no owner.
        member = tarfile.TarInfo(f"{key}.{part}")
        member.size = len(data)
        tar.addfile(member, io.BytesIO(data))


FORM = ViewForm(
    "webdataset",
    write_webdataset,
    "`shard-<6 digits>.tar`, 500 views each (`--shard-size`); key `<house>__<view>`, parts `json` and"
    " `<layer>.png` / `.exr`; equal views give equal bytes",
    has_classes=True,
)
