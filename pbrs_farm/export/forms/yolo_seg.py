"""YOLO with polygons of visible items instead of boxes. Effects: reads views, writes files."""

from __future__ import annotations

import numpy as np

from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.export.form import PICTURES, Convention, ViewForm
from pbrs_farm.export.forms.yolo import (
    numbered_objects,
    object_line,
    pictures_beside,
    write_data_yaml,
)
from pbrs_farm.export.masks import mask_polygon


def _polygon_lines(view: ChosenView) -> tuple[str, str]:
    """As the form yolo; a line is a polygon: class, then x and y of each corner as shares.

    An item has one line, whatever the number of its visible parts, see mask_polygon.
    """
    instance, lines = view.array("instance"), []
    height, width = instance.shape
    for number, row in numbered_objects(view):
        # Crop to the box of the mask.
        x0, y0, x1, y1 = row["box2d"]
        ring = mask_polygon(instance[y0:y1, x0:x1] == row["id"])
        shares = (ring + np.array([x0, y0])) / np.array([width, height])
        lines.append(object_line(number, shares.ravel()))
    return ".txt", "".join(lines)


FORM = ViewForm(
    "yolo-seg",
    pictures_beside("labels", _polygon_lines),
    "as `yolo`; a line has the polygon of an item's mask, with an IoU of 0.97 or more; it goes to"
    " each hole and further part, around it and back",
    takes=PICTURES,
    has_classes=True,
    finish=write_data_yaml,
    convention=Convention(0.5, axes="shares of the picture, from its corner"),
)
