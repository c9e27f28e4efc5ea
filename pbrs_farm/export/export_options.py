"""What of the views is exported: the options of `export`, and of a form in a set's file; no effects."""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.core.record import Record
from pbrs_farm.run.request import option


class ExportOptions(Record):
    """Which layers and modes, at which size, in whose classes."""

    layers: tuple[str, ...] = option(
        (), "labels by name (`pbrs-farm layers`), default all there are but radiance",
        metavar="LAYER", many_words=True,
    )  # fmt: skip
    modes: tuple[str, ...] = option(
        (), "opengl_dl opengl_il mlt_ol mlt_il_ol (default all there are)",
        metavar="MODE", many_words=True,
    )  # fmt: skip
    size: str | None = option(None, "resize to, e.g. 320x240 (default as rendered)", metavar="WxH")
    classes: Path | None = option(
        None,
        "classes of your own: CSV with columns from,id,name (default NYU40)",
        metavar="FILE.csv",
    )
    shard_size: int = option(500, "views a tar (webdataset)", metavar="N", least=1)
    lidar: str = option(
        "vlp16", "whose scans the form lidar has (default vlp16; docs/formats/lidar.md has them all)",
        metavar="SCANNER",
    )  # fmt: skip
