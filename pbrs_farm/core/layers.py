"""The table of a view's files: name, channels, dtype, unit, nodata, and the step that writes each.

Effect: reads layers.csv. The table of docs/formats/layers.md is printed from it (`python -m pbrs_farm.core.layers`).
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.plugins import plugins

# How pages and films draw a layer. "picture": unchanged. "classes": NYU40's colours. "ids": a
# colour per id. "mask": light on dark. "depth": a ramp of depth in mm, "depth_m" in metres,
# "disparity" the inverse. "flow", "flow_kitti": hue by direction. "high_byte": of 16 bits per
# channel. "range": each channel scaled to its range in the picture. "": not a picture.
# fmt: off
ShownAs: TypeAlias = Literal[
    "", "picture", "classes", "ids", "mask", "depth", "depth_m", "disparity", "flow", "flow_kitti",
    "high_byte", "range",
]
# fmt: on

# How an export changes its size: by the nearest pixel, by area, lines kept whole, and what measures
# pixels of the picture itself in those of the new size.
Resized: TypeAlias = Literal["nearest", "area", "lines", "pixels"]


@dataclass(frozen=True, slots=True)
class Layer:
    """One file of a view: a row of layers.csv, the only list of layers, which all code reads."""

    name: str
    file: str  # below the view's folder
    channels: str
    dtype: str
    unit: str
    nodata: str  # what a pixel holds that sees nothing
    step: str  # the step of run/plan.py that writes it
    optional: bool = False  # only when --layers names it, a plugin's picture tone.pictures
    # "next", "previous" or "stereo": the view without which there is no such file.
    partner: str = ""
    # Required of the lens: "planar depth" along its axis, "rows" that correspond in a pair.
    needs: str = ""
    shown_as: ShownAs = ""
    resized: Resized = "nearest"
    title: str = ""  # in menus and above tiles; "" = the name's words
    # Raised when its pixels change while the step's version stays: views that have it are made anew.
    version: int = 1
    # Its pixels show the albedo, which the recipe's materials hold to a limit.
    shows_albedo: bool = False
    # Layers written with it, without which it is useless.
    beside: tuple[str, ...] = ()

    @property
    def is_label(self) -> bool:
        """True for classes, ids and masks, which are scaled by the nearest pixel, never averaged."""
        return self.shown_as in ("classes", "ids", "mask")

    @property
    def n_stacked(self) -> int:
        """Number of pictures below one another in its PNG: 1, or that of the surfaces of depth_layers."""
        return len(self.channels.split()) if self.file.endswith(".png") else 1

    @property
    def is_photo(self) -> bool:
        """Whether it is a picture in a light, shown as its own file."""
        return self.shown_as == "picture" and self.step != "truth"

    @property
    def shown_title(self) -> str:
        """Its name in menus."""
        return self.title or self.name.replace("_", " ").capitalize()


MOST_VARIANTS: Final = 8
"""Of a view's further pictures of `mlt_il_ol`, by other cameras (recipe: tone.variants)."""


def _picture_layer(name: str, step: str, title: str = "", *, optional: bool = False) -> Layer:
    return Layer(
        name,
        f"{name}.png",
        "RGB",
        "uint8",
        "sRGB",
        "-",
        step,
        optional,
        shown_as="picture",
        resized="area",
        title=title,
    )


def optional_layer(
    name: str,
    channels: str,
    dtype: str,
    unit: str,
    nodata: str = "0",
    file: str = "",
    needs: str = "",
    *,
    shown_as: ShownAs = "",
    resized: Resized = "nearest",
) -> Layer:
    """A label that the step `truth` writes when --layers names it, a plugin's too.

    shown_as: "" is "picture" for uint8 and "range" for all else.

        >>> optional_layer("height", "Y", "uint16", "mm above the lowest floor").file
        'height.png'
    """
    shown_as = shown_as or ("picture" if dtype == "uint8" else "range")
    return Layer(
        name,
        file or f"{name}.png",
        channels,
        dtype,
        unit,
        nodata,
        "truth",
        optional=True,
        needs=needs,
        shown_as=shown_as,
        resized=resized,
    )


def _layer_of_row(row: dict[str, str]) -> Layer:
    # An empty cell takes the field's default.
    values: dict[str, Any] = {name: cell for name, cell in row.items() if cell}
    values.update(
        (name, values[name] == "true") for name in ("optional", "shows_albedo") if name in values
    )
    if "version" in values:
        values["version"] = int(values["version"])
    if "beside" in values:
        values["beside"] = tuple(values["beside"].split("|"))
    return Layer(**values)


def _read_layers() -> tuple[Layer, ...]:
    # Without core/record.py, which needs pydantic: packed shards are read where numpy alone is installed.
    lines = Path(__file__).with_name("layers.csv").read_text("utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return tuple(_layer_of_row(row) for row in rows)


OWN_LAYERS: Final = _read_layers()
"""The layers of the package; optional ones are written when --layers names them."""


def _of_plugins() -> tuple[Layer, ...]:
    """The layers of installed plugins, by name: optional, written by the step `truth`."""
    layers = []
    for name, plugin in plugins("layers").items():
        layer = plugin.load().layer
        if layer.name != name or layer.step != "truth" or not layer.optional:
            raise MachineFailed(
                f"plugin {plugin.mark}: its layer must be optional, of the step truth, called {name}"
            )
        layers.append(layer)
    return tuple(layers)


def _pictures_of_plugins() -> tuple[Layer, ...]:
    """The pictures of installed plugins, by name: written by the step `develop` when asked for."""
    return tuple(_picture_layer(name, "develop", optional=True) for name in plugins("pictures"))


LAYERS: Final[tuple[Layer, ...]] = (*OWN_LAYERS, *_of_plugins(), *_pictures_of_plugins())
"""All layers: the package's and those of plugins."""

LAYER: Final = {layer.name: layer for layer in LAYERS}

_VARIANTS: Final = {LAYER[f"mlt_il_ol.{n}"].file for n in range(1, MOST_VARIANTS + 1)}

LIGHT_LAYERS: Final = tuple(
    name + ending for ending in ("", "_outdoor", "_indoor") for name in ("shading", "residual")
)
"""The names of --layers that are made of traced light."""

OPTIONAL: Final = tuple(
    x.name for x in LAYERS if x.optional and (x.step == "truth" or x.name in LIGHT_LAYERS)
)
"""The names that --layers takes."""


def layers_in_digest(names: Iterable[str], max_albedo: float) -> list[str]:
    """Inputs of these layers (of versions above 1, of max_albedo) for the digest of the step `truth`."""
    named_layers = [layer for layer in LAYERS if layer.name in set(names)]
    shown = [f"{layer.name} {max_albedo}" for layer in named_layers if layer.shows_albedo]
    return [
        *shown,
        *(f"{layer.name} {layer.version}" for layer in named_layers if layer.version > 1),
    ]


def layer_table() -> str:
    """The layers as a Markdown table; further pictures by other cameras share a row."""
    rows = ["| file | channels | type | unit | nothing |", "|---|---|---|---|---|"]
    first, last = (LAYER[f"mlt_il_ol.{n}"] for n in (1, MOST_VARIANTS))
    for x in LAYERS:
        if x.file in _VARIANTS and x is not first:
            continue
        file = f"`{first.file}` to `{last.file}`" if x is first else f"`{x.file}`"
        channels = f"{x.n_stacked} x Y" if x.n_stacked > 1 else x.channels
        rows.append(f"| {file} | {channels} | {x.dtype} | {x.unit} | {x.nodata} |")
    return "\n".join(rows)


def text_table(width: int) -> str:
    """The layers in columns for a terminal so wide; what does not fit is cut with an ellipsis."""
    heads = ("--layers", "file", "type", "unit")
    rows = [
        (x.name if x.optional else "-", x.file, f"{x.dtype} {x.channels.split()[0][:12]}", x.unit)
        for x in LAYERS
    ]
    widths = [max(len(row[k]) for row in (heads, *rows)) for k in range(3)]
    unit_width = max(width - sum(widths) - 6, 16)
    lines = []
    for row in (heads, *rows):
        cells = [cell.ljust(n) for cell, n in zip(row[:3], widths, strict=True)]
        unit = row[3] if len(row[3]) <= unit_width else row[3][: unit_width - 1] + "\u2026"
        lines.append("  ".join([*cells, unit]).rstrip())
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(layer_table() + "\n")
