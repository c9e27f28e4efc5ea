"""The nine tiles of a view on sheets, as small pictures. Effects: reads picture files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm import images
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LAYER, Layer
from pbrs_farm.formats.output_folder import ViewEntry
from pbrs_farm.gallery import label_colours as colours
from pbrs_farm.regular_files import read_regular

# fmt: off
TILES: Final = tuple(
    LAYER[name]
    for name in (
        "opengl_dl", "opengl_il", "mlt_ol", "mlt_il_ol",
        "depth", "normal", "semantic", "instance", "boundary",
    )
)
# fmt: on
"""The layers of a sheet, one per column."""
NOT_RENDERED: Final = "not rendered"
"""Reason for a missing tile if its file does not exist."""


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """A tile of a view."""

    kind: Layer
    pixels: Srgb8Image | None  # (H, W, 3), None if the layer is missing
    missing: str = ""  # reason why the layer is missing
    note: str = ""  # note for the reader ("0.8 to 5.4 m")
    classes: tuple[tuple[int, float], ...] = ()  # of semantic: (NYU40 id, share), largest first


@dataclass(frozen=True, slots=True, eq=False)
class _Layer:
    # A drawn layer at full size.
    kind: Layer
    pixels: Srgb8Image | None = None
    missing: str = ""
    note: str = ""
    classes: tuple[tuple[int, float], ...] = ()

    def tile(self, max_edge_px: int) -> Tile:
        # Nearest pixel keeps the values of labels; photographs and smooth layers are averaged.
        nearest, pixels = self.kind.shown_as in ("classes", "ids"), self.pixels
        if pixels is not None:
            pixels = images.thumbnail(pixels, max_edge_px=max_edge_px, nearest=nearest)
        return Tile(self.kind, pixels, self.missing, self.note, self.classes)


def tiles_of(view: ViewEntry, max_edge_px: int = 320) -> tuple[Tile, ...]:
    """The view's tiles, uncached, in the order of TILES, at most max_edge_px; bad ones give a reason."""
    (tiles,) = tiles_of_sizes(view, max_edge_px)
    return tiles


def tiles_of_sizes(view: ViewEntry, *max_edges_px: int) -> list[tuple[Tile, ...]]:
    """As tiles_of, a tuple for each size in order, from one reading of the layers."""
    layers = [_shown_layer(view, kind) for kind in TILES]
    return [tuple(layer.tile(edge_px) for layer in layers) for edge_px in max_edges_px]


def _shown_layer(view: ViewEntry, kind: Layer) -> _Layer:
    path = view.file(kind.file)
    if path is None:
        return _Layer(kind, missing=NOT_RENDERED)
    try:
        stored = images.array_from_png(read_regular(path), str(path))
        if kind.is_photo:
            photo = colours.shown_colours(kind, stored)
            dark = "no daylight" if kind.name == "mlt_ol" else "no light"
            return _Layer(kind, photo, note="" if photo.any() else dark)
        pixels = colours.shown_colours(kind, stored)
    except (BadInput, OSError, ValueError, IndexError):
        return _Layer(kind, missing="cannot be read")
    return _Layer(kind, pixels, note=_note(kind, stored), classes=_class_shares(kind, stored))


def _note(kind: Layer, stored: NDArray[Any]) -> str:
    if kind.name == "depth":
        near, far = colours.depth_range_m(stored)
        return f"{near:.1f} to {far:.1f} m"
    if kind.name == "instance":
        return f"{len(np.unique(stored[stored > 0]))} instances"
    return ""


def _class_shares(kind: Layer, stored: NDArray[Any]) -> tuple[tuple[int, float], ...]:
    if kind.name != "semantic":
        return ()
    # Count the pixels of each class, largest first.
    counts = np.bincount(stored.reshape(-1), minlength=len(NYU40_NAMES))[: len(NYU40_NAMES)]
    order = np.argsort(-counts, kind="stable")
    return tuple((int(i), float(counts[i] / stored.size)) for i in order if counts[i])
