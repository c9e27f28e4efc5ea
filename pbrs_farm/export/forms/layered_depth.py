"""Depth in layers behind clear surfaces, as LayeredDepth's benchmark counts them (princeton-vl/LayeredDepth).

    <i>.png  <i>_<layer>.png  index.csv

Effects: reads views, writes files.
"""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, Line, write_files
from pbrs_farm.export.form import Convention, ViewForm, with_parts

_LAYERS: Final = ("depth_layers", "depth_layers_instance", "depth_layers_clear")
_NUMBERS: Final = (1, 3, 5, 7)  # its layers of fronts; the even ones are backs


def write_layered_depth(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the files above: a picture, and 16-bit depth of its layers 1, 3, 5 and 7 in mm along the axis, 0 for none.

    A layer is the front of what the straight ray meets: of a clear solid its front and back are two layers, of a
    single sheet of glass too, and the first surface that is not clear is the last. index.csv has the view of each
    number. left_out.txt names views without a picture or the layers; BadInput if none has them.
    """
    heads = {"index.csv": Line("number,house,view")}
    write_files(out, map(_files, count(), views), heads)


def _files(number: int, view: ChosenView) -> Files:
    depth, instance, clear = (view.array(name) for name in _LAYERS)
    fronts = zip(_NUMBERS, front_depths(depth, instance, clear > 0), strict=True)
    files: dict[str, Content] = {f"{number}_{layer}.png": front for layer, front in fronts}
    row = Line(f"{number},{view.house.id},{view.id}")
    return files | {f"{number}.png": view.shown, "index.csv": row}


def front_depths(
    depth: NDArray[np.uint16], instance: NDArray[np.uint16], clear: NDArray[np.bool_]
) -> NDArray[np.uint16]:
    """(4, H, W) uint16 depth of the layers 1, 3, 5 and 7 of surfaces (H, W, K) along the ray.

    Two clear surfaces of one instance in a row are a front and its back; another single one is a sheet.
    """
    shape = depth.shape[:2]
    fronts = np.zeros((len(_NUMBERS), *shape), np.uint16)
    place, before = np.zeros(shape, int), np.zeros(shape, np.uint16)  # next layer less 1; instance
    is_open = np.ones(shape, bool)
    for k in range(depth.shape[2]):
        is_met = is_open & (depth[..., k] > 0) & (depth[..., k] < np.iinfo(np.uint16).max)
        is_back = (place % 2 == 1) & clear[..., k] & (instance[..., k] == before)
        place += is_met & (place % 2 == 1) & ~is_back
        for number in range(len(_NUMBERS)):
            fronts[number] = np.where(is_met & (place == 2 * number), depth[..., k], fronts[number])
        place += is_met
        before = np.where(is_met, instance[..., k], before)
        is_open &= ~(is_met & ~clear[..., k])
    return fronts


FORM = ViewForm(
    "layered-depth",
    write_layered_depth,
    "LayeredDepth: `<i>.png`, `<i>_1.png`, `_3`, `_5`, `_7`, `index.csv`",
    takes=with_parts("layers", *_LAYERS, hint=f"run with --layers {' '.join(_LAYERS)}"),
    lenses=("pinhole",),
    layers=("depth_layers",),
    convention=Convention(None, axes="", depth="mm, along the axis"),
)
