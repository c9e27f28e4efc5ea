"""WebDataset: tar shards of samples, equal bytes for equal views.

Effects: reads views, writes files.
"""

from __future__ import annotations

import io
import tarfile
from pathlib import Path
from typing import Final

from pbrs_farm.core.layers import LAYERS
from pbrs_farm.formats.output_folder import ViewEntry
from pbrs_farm.regular_files import read_regular

VIEWS_PER_SHARD: Final = 500


def write_webdataset(views: list[ViewEntry], out: Path) -> int:
    """shard-<6 digits>.tar of VIEWS_PER_SHARD views each; the number of files.

    A sample's key is <house>__<view>; its parts are json (view.json) and every layer the view has,
    by name: "mlt_il_ol.png", "depth.png", "radiance.exr". No clock, no owner.
    """
    n_shards = 0
    for start in range(0, len(views), VIEWS_PER_SHARD):
        shard = out / f"shard-{n_shards:06d}.tar"
        with tarfile.open(shard, "w", format=tarfile.USTAR_FORMAT) as tar:
            for view in views[start : start + VIEWS_PER_SHARD]:
                _add_sample(tar, view)
        n_shards += 1
    return n_shards


def _add_sample(tar: tarfile.TarFile, view: ViewEntry) -> None:
    # A dot would end the key.
    key = f"{view.house.id}__{view.id}".replace(".", "_")
    parts = {"json": view.folder / "view.json"}
    for layer in LAYERS:
        file = view.file(layer.file)
        if file is not None:
            parts[f"{layer.name}{file.suffix}"] = file
    for part, file in parts.items():
        data = read_regular(file)
        # TarInfo's own defaults: time 0, no owner.
        member = tarfile.TarInfo(f"{key}.{part}")
        member.size = len(data)
        tar.addfile(member, io.BytesIO(data))
