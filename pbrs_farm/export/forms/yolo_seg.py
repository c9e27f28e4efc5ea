"""YOLO with polygons of visible items instead of boxes. Effects: reads views, writes files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.forms.yolo import numbered_objects, write_data_yaml, write_pictures_and_labels
from pbrs_farm.export.masks import mask_polygon


def write_yolo_seg(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """As the form yolo; a line is a polygon: class, then x and y of each corner as shares.

    An item has one line, whatever the number of its visible parts, see mask_polygon.
    """
    write_pictures_and_labels(views, out, _polygon_lines)


def _polygon_lines(view: ChosenView) -> Iterable[str]:
    instance = view.array("instance")
    height, width = instance.shape
    for number, row in numbered_objects(view):
        # Crop to the box of the mask.
        x0, y0, x1, y1 = row["box2d"]
        ring = mask_polygon(instance[y0:y1, x0:x1] == row["id"])
        shares = (ring + np.array([x0, y0])) / np.array([width, height])
        yield f"{number} " + " ".join(f"{x:.6f}" for x in shares.ravel()) + "\n"


FORM = ViewForm(
    "yolo-seg",
    write_yolo_seg,
    "as `yolo`; a line has the polygon of an item's mask, with an IoU of 0.97 or more; it goes to"
    " each hole and further part, around it and back",
    has_classes=True,
    finish=write_data_yaml,
    convention=Convention(0.5, axes="shares of the picture, from its corner"),
)
