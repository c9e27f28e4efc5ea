"""YOLO detection: pictures, a text file of boxes for each, data.yaml. Effects: reads views, writes files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from pbrs_farm.core.classes import CEILING, FLOOR, NYU40_NAMES, WALL
from pbrs_farm.export.chosen_view import Choice, ChosenView

# What surrounds the whole picture is no object: it has no boxes.
_NO_BOX: Final = (0, WALL, FLOOR, CEILING)


def write_yolo(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """images/<house>__<view>.png and labels/<house>__<view>.txt; the number of files.

    A line is a box: class (NYU40 id - 1), centre x, y, width, height, as shares of the picture.
    Views without a picture are left out.
    """
    n_files = 0
    for folder in ("images", "labels"):
        (out / folder).mkdir()
    for view in views:
        if view.picture is None:
            continue
        name = f"{view.house.id}__{view.id}"
        (out / "images" / f"{name}.png").write_bytes(view.data(view.picture))
        (out / "labels" / f"{name}.txt").write_text("".join(_lines(view)))
        n_files += 2
    return n_files


def _lines(view: ChosenView) -> Iterable[str]:
    width, height = view.facts["width_px"], view.facts["height_px"]
    for row in view.facts["instances"]:
        if row["nyu40"] in _NO_BOX:
            continue
        x0, y0, x1, y1 = row["box2d"]
        box = ((x0 + x1) / 2 / width, (y0 + y1) / 2 / height, (x1 - x0) / width, (y1 - y0) / height)
        yield f"{row['nyu40'] - 1} " + " ".join(f"{share:.6f}" for share in box) + "\n"


def write_data_yaml(out: Path, splits: tuple[str, ...]) -> int:
    """data.yaml of an export with these splits, or none; the number of files, 1."""
    folders = [(name, f"{name}/images") for name in splits]
    # Ultralytics wants train and val: without a split both are all views.
    folders = folders or [("train", "images"), ("val", "images")]
    lines = ["path: .", *(f"{name}: {folder}" for name, folder in folders), "names:"]
    lines += [f"  {k}: {name}" for k, name in enumerate(NYU40_NAMES[1:])]
    (out / "data.yaml").write_text("\n".join(lines) + "\n")
    return 1
