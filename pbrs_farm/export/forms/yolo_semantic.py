"""YOLO's semantic segmentation: pictures, a mask of class numbers for each, data.yaml.

Effects: reads views, writes files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import PICTURES, Convention, ViewForm
from pbrs_farm.export.forms.yolo import names_lines, pictures_beside, write_yaml

_IGNORED: Final = 255  # mask value without loss or metric


def write_yolo_semantic(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """images/<house>__<view>.png and masks/<house>__<view>.png.

    A mask is uint8: the class's number in data.yaml (NYU40 id - 1; for a user's table its index among the
    ids), 255 for pixels without a surface or class. Raises BadInput for more than 255 classes.
    """
    if len(choice.class_names) > _IGNORED:
        problem = f"{len(choice.class_names)} classes: a mask holds {_IGNORED}"
        raise BadInput("--to yolo-semantic", "", problem, hint="fewer classes in --classes")
    number = np.full(max(choice.class_names) + 1, _IGNORED, np.uint8)
    number[list(choice.class_names)] = np.arange(len(choice.class_names))

    def mask(view: ChosenView) -> tuple[str, NDArray[np.uint8]]:
        return ".png", number[view.array("semantic")]

    pictures_beside("masks", mask)(views, out, choice)


def write_semantic_yaml(out: Path, splits: tuple[str, ...], choice: Choice) -> None:
    """data.yaml of an export with these splits, or none."""
    write_yaml(out, splits, ["masks_dir: masks", *names_lines(choice)])


FORM = ViewForm(
    "yolo-semantic",
    write_yolo_semantic,
    "`images/<house>__<view>.png`, `masks/<house>__<view>.png` (NYU40 id - 1; 255 = no class), `data.yaml` with `masks_dir`",
    takes=PICTURES,
    has_classes=True,
    finish=write_semantic_yaml,
    convention=Convention(None, axes=""),
)
