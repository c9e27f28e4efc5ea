"""The options of `pack`, and of shards and parquet in a set's file. No effects."""

from __future__ import annotations

from pbrs_farm.core.options import option
from pbrs_farm.core.record import Record


class PackOptions(Record):
    """Layers, modes, size and encoding of packed views."""

    layers: tuple[str, ...] = option(
        (),
        "layers: colour normal depth class40 instance boundary (default all)",
        metavar="LAYER",
        many_words=True,
    )
    modes: tuple[str, ...] = option(
        (),
        "lighting modes: opengl_dl opengl_il mlt_ol mlt_il_ol (default: all stored ones)",
        metavar="MODE",
        many_words=True,
    )
    size: str | None = option(
        None, "picture size, e.g. 320x240 (default as rendered)", metavar="WxH"
    )
    shard_size: int = option(200, "views per shard (default 200)", metavar="N", least=1)
    colour: str = option(
        "png", "png (default) is lossless; jpeg:95 is lossy and a quarter as large", metavar="FORM"
    )
