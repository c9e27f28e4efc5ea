"""YOLO: pictures, a text file of boxes for each, data.yaml. Effects: reads views, writes files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.classes import CEILING, FLOOR, WALL
from pbrs_farm.core.house_split import SPLITS
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import Convention, ViewForm, name_left_out, views_with_picture

# classes without boxes: they surround the picture
_NO_BOX: Final = (0, WALL, FLOOR, CEILING)


def write_yolo(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """images/<house>__<view>.png and labels/<house>__<view>.txt.

    A line is a box: class (NYU40 id - 1; of a user's table its place among the ids), centre x, y,
    width, height, as shares of the picture. Views without a picture are left out, and named in
    left_out.txt.
    """
    write_pictures_and_labels(views, out, _box_lines)


def write_pictures_and_labels(
    views: list[ChosenView], out: Path, lines_of: Callable[[ChosenView], Iterable[str]]
) -> None:
    """images/ and labels/ with the lines of each picture."""

    def label(view: ChosenView) -> tuple[str, bytes]:
        return ".txt", "".join(lines_of(view)).encode()

    write_pictures_beside(views, out, "labels", label)


def write_pictures_beside(
    views: list[ChosenView],
    out: Path,
    folder: str,
    label_of: Callable[[ChosenView], tuple[str, bytes]],
) -> None:
    """images/<house>__<view>.png and <folder>/<house>__<view><suffix>.

    label_of: the suffix and the bytes of a view's label. Views without a picture are left out, and
    named in left_out.txt.
    """
    shown = views_with_picture(views)
    for name in ("images", folder):
        (out / name).mkdir()
    for view in shown:
        name = f"{view.house.id}__{view.id}"
        suffix, data = label_of(view)
        (out / "images" / f"{name}.png").write_bytes(view.data(view.picture or ""))
        (out / folder / f"{name}{suffix}").write_bytes(data)
    without = [view for view in views if view.picture is None]
    name_left_out(out, without, "has no picture")


def _box_lines(view: ChosenView) -> Iterable[str]:
    width, height = view.facts["width_px"], view.facts["height_px"]
    for number, row in numbered_objects(view):
        x0, y0, x1, y1 = row["box2d"]
        box = ((x0 + x1) / 2 / width, (y0 + y1) / 2 / height, (x1 - x0) / width, (y1 - y0) / height)
        yield f"{number} " + " ".join(f"{share:.6f}" for share in box) + "\n"


def numbered_objects(view: ChosenView) -> Iterable[tuple[int, dict[str, Any]]]:
    """The instances counted as objects, each with its class's number.

    Numbers count classes from 0 in the order of class_names, as YOLO wants, and are not the classes' ids.
    With NYU40's classes, nothing, walls, floors and ceilings are left out.
    """
    numbers = {k: number for number, k in enumerate(view.choice.class_names)}
    # All user-defined classes count: the table selects them.
    none = _NO_BOX if view.choice.classes is None else (0,)
    for row in view.facts["instances"]:
        class_id = view.class_of(row)
        if class_id not in none:
            yield numbers[class_id], row


def write_data_yaml(out: Path, splits: tuple[str, ...], choice: Choice) -> None:
    """data.yaml of an export with these splits, or none, and the names of its classes."""
    write_yaml(out, splits, names_lines(choice))


def names_lines(choice: Choice) -> list[str]:
    """The classes by number, as data.yaml has them."""
    names = choice.class_names.values()
    # A user's name may be anything: JSON's text is YAML's, too.
    class_words = names if choice.classes is None else map(json.dumps, names)
    return ["names:", *(f"  {k}: {name}" for k, name in enumerate(class_words))]


def write_yaml(out: Path, splits: tuple[str, ...], fields: list[str]) -> None:
    """Write data.yaml: the folders of the splits, if any, and lines of other fields.

    Folders are relative to data.yaml. Ultralytics needs train and val: if one has no home, it uses the
    other's folder, and a comment says so.
    """
    folders = {name: f"{name}/images" for name in splits} or {"train": "images", "val": "images"}
    remarks = [] if splits else ["# without --split, train and val are all views"]
    for name, substitute in (("train", "val"), ("val", "train")):
        if name not in folders:
            substitute = substitute if substitute in folders else next(iter(folders))
            folders[name] = folders[substitute]
            remarks.append(f"# the split left {name} empty: it is a copy of {substitute}")
    lines = [*remarks, *(f"{name}: {folders[name]}" for name in SPLITS if name in folders)]
    lines += fields
    (out / "data.yaml").write_text("\n".join(lines) + "\n", "utf-8")


FORM = ViewForm(
    "yolo",
    write_yolo,
    "`images/<house>__<view>.png`, `labels/<house>__<view>.txt` (boxes; class = NYU40 id - 1; none for"
    " wall, floor, ceiling), `data.yaml`, which works from any directory; if `train` or `val` has no home,"
    " both name the same folder, and a comment says so",
    has_classes=True,
    finish=write_data_yaml,
    convention=Convention(0.5, axes="shares of the picture, from its corner"),
)
