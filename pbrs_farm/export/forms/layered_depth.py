"""Depth in layers behind clear surfaces, as LayeredDepth's benchmark counts them (princeton-vl/LayeredDepth).

    <i>.png  <i>_<layer>.png  index.csv

Effects: reads views, writes files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView, require_lens
from pbrs_farm.export.form import Convention, ViewForm, name_left_out
from pbrs_farm.images import png_from_array

_LAYERS: Final = ("depth_layers", "depth_layers_instance", "depth_layers_clear")
_NUMBERS: Final = (1, 3, 5, 7)  # its layers of fronts; the even ones are backs


def write_layered_depth(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the files above: a picture, and 16-bit depth of its layers 1, 3, 5 and 7 in mm along the axis, 0 for none.

    A layer is the front of what the straight ray meets: of a clear solid its front and back are two layers, of a
    single sheet of glass too, and the first surface that is not clear is the last. index.csv has the view of each
    number. left_out.txt names views without a picture or the layers; BadInput if none has them.
    """
    chosen = [view for view in views if view.picture is not None and all(map(view.has, _LAYERS))]
    if not chosen:
        hint = f"run with --layers {' '.join(_LAYERS)}"
        raise BadInput("--to", "layered-depth", "no view has a picture and layers", hint=hint)
    rows = ["number,house,view\n"]
    for number, view in enumerate(chosen):
        require_lens(view, "layered-depth", *FORM.lenses)
        (out / f"{number}.png").write_bytes(view.data(view.picture or ""))
        depth, instance, clear = (view.array(name) for name in _LAYERS)
        for layer, front in zip(_NUMBERS, front_depths(depth, instance, clear > 0), strict=True):
            (out / f"{number}_{layer}.png").write_bytes(png_from_array(front))
        rows.append(f"{number},{view.house.id},{view.id}\n")
    (out / "index.csv").write_text("".join(rows), "utf-8")
    name_left_out(out, [v for v in views if v not in chosen], "has no picture or no layers")


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
    lenses=("pinhole",),
    layers=("depth_layers",),
    convention=Convention(None, axes="", depth="mm, along the axis"),
)
