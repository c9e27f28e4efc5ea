"""YOLO: pictures, a text file of boxes for each, data.yaml. Effects: reads views, writes files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.classes import CEILING, FLOOR, WALL
from pbrs_farm.core.house_split import SPLITS
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, each_view
from pbrs_farm.export.form import PICTURES, Convention, ViewForm, WriteViews

# classes without boxes: they surround the picture
_NO_BOX: Final = (0, WALL, FLOOR, CEILING)


def pictures_beside(
    folder: str, label_of: Callable[[ChosenView], tuple[str, Content]]
) -> WriteViews:
    """The writer of images/<house>__<view>.png and <folder>/<house>__<view><suffix>.

    label_of: the suffix and the content of a view's label. Views without a picture are left out, and
    named in left_out.txt.
    """

    def files_of(view: ChosenView) -> Files:
        name = f"{view.house.id}__{view.id}"
        suffix, label = label_of(view)
        return {f"images/{name}.png": view.shown, f"{folder}/{name}{suffix}": label}

    return each_view(files_of)


def box_lines(view: ChosenView) -> tuple[str, str]:
    """labels/<house>__<view>.txt: a line a box.

    A line has the class (NYU40 id - 1; of a user's table its place among the ids), and centre x, y,
    width, height, as shares of the picture.
    """
    (width, height), lines = view.size, []
    for number, row in numbered_objects(view):
        x0, y0, x1, y1 = row["box2d"]
        box = ((x0 + x1) / 2 / width, (y0 + y1) / 2 / height, (x1 - x0) / width, (y1 - y0) / height)
        lines.append(object_line(number, box))
    return ".txt", "".join(lines)


def object_line(number: int, shares: Iterable[float]) -> str:
    """A line of a label: an object's class and shares of the picture."""
    return f"{number} " + " ".join(f"{share:.6f}" for share in shares) + "\n"


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
    pictures_beside("labels", box_lines),
    "`images/<house>__<view>.png`, `labels/<house>__<view>.txt` (boxes; class = NYU40 id - 1; none for"
    " wall, floor, ceiling), `data.yaml`, which works from any directory; if `train` or `val` has no home,"
    " both name the same folder, and a comment says so",
    takes=PICTURES,
    has_classes=True,
    finish=write_data_yaml,
    convention=Convention(0.5, axes="shares of the picture, from its corner"),
)
