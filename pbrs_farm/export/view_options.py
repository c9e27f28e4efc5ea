"""The options of `export` that all forms of views have; a form's own are in its module. No effects."""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.core.options import option
from pbrs_farm.core.record import Record


class ViewOptions(Record):
    """Layers, modes, size and classes of exported views."""

    layers: tuple[str, ...] = option(
        (),
        "layers to export; `layers` lists them (default: all stored ones except radiance)",
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
    classes: Path | None = option(
        None, "custom classes: CSV with columns from,id,name (default NYU40)", metavar="FILE.csv"
    )
