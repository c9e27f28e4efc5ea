"""YOLO's metric depth: pictures, a depth map for each, data.yaml. Effects: reads views, writes files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import PICTURES, Convention, ViewForm
from pbrs_farm.export.forms.yolo import pictures_beside, write_yaml

_FIELDS: Final = ["nc: 1", "names:", "  0: depth", "depth_scale: 1000"]


def _depth(view: ChosenView) -> tuple[str, NDArray[Any]]:
    """PNG: uint16, mm along the axis, 0 for nothing or for 65.535 m and more.

    NPY if depth_z is exported and depth is not: float32 metres, 0 = nothing.
    """
    if view.has("depth_z") and not view.has("depth"):
        return ".npy", view.array("depth_z").astype(np.float32)
    return ".png", view.depth_mm


def write_depth_yaml(out: Path, splits: tuple[str, ...], _choice: Choice) -> None:
    """data.yaml of an export with these splits, or none."""
    write_yaml(out, splits, _FIELDS)


FORM = ViewForm(
    "yolo-depth",
    pictures_beside("depth", _depth),
    "`images/<house>__<view>.png`, `depth/<house>__<view>.png` (uint16 mm; with `--layers depth_z` float32 metres in `.npy`), `data.yaml`",
    takes=PICTURES,
    finish=write_depth_yaml,
    lenses=("pinhole", "radtan", "opencv"),
    convention=Convention(None, axes="", depth="mm (`depth_scale: 1000`), along the axis"),
)
