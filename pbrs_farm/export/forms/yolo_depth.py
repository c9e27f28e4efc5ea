"""YOLO's metric depth: pictures, a depth map for each, data.yaml. Effects: reads views, writes files."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.export.chosen_view import Choice, ChosenView, depth_within_png, require_lens
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.forms.yolo import write_pictures_beside, write_yaml
from pbrs_farm.images import png_from_array

_FIELDS: Final = ["nc: 1", "names:", "  0: depth", "depth_scale: 1000"]


def write_yolo_depth(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """images/<house>__<view>.png and depth/<house>__<view>.png, or .npy.

    PNG: uint16, mm along the axis, 0 for nothing or for 65.535 m and more. NPY if depth_z is exported and
    depth is not: float32 metres, 0 = nothing. Raises BadInput for a lens whose depth runs along the ray.
    """
    write_pictures_beside(views, out, "depth", _depth)


def _depth(view: ChosenView) -> tuple[str, bytes]:
    require_lens(view, "yolo-depth", *FORM.lenses)
    if view.has("depth_z") and not view.has("depth"):
        data = BytesIO()
        np.save(data, view.array("depth_z").astype(np.float32))
        return ".npy", data.getvalue()
    return ".png", png_from_array(depth_within_png(view))


def write_depth_yaml(out: Path, splits: tuple[str, ...], _choice: Choice) -> None:
    """data.yaml of an export with these splits, or none."""
    write_yaml(out, splits, _FIELDS)


FORM = ViewForm(
    "yolo-depth",
    write_yolo_depth,
    "`images/<house>__<view>.png`, `depth/<house>__<view>.png` (uint16 mm; with `--layers depth_z` float32 metres in `.npy`), `data.yaml`",
    finish=write_depth_yaml,
    lenses=("pinhole", "radtan", "opencv"),
    convention=Convention(None, axes="", depth="mm (`depth_scale: 1000`), along the axis"),
)
