"""List files of pictures, depth and normals, as Marigold and those that follow it train from.

    <house>/rgb_<view>.png  depth_<view>.png  normal_<view>.npy
    filename_list[_<split>].txt          rgb depth
    filename_list_normals[_<split>].txt  rgb normal

Effects: reads views, writes files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    depth_within_png,
    opengl_normals,
    require_lens,
)
from pbrs_farm.export.form import Convention, ViewForm, name_left_out
from pbrs_farm.images import png_from_array

_LISTS: Final = {"depth": "filename_list", "normal": "filename_list_normals"}


def write_marigold(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """The files above; the number of them.

    A line is a sample, its paths count from the list's folder. Depth is uint16 PNG, mm along the
    axis, 0 = nothing or 65.535 m and more. Normals are float32 (H, W, 3), unit, x right, y up,
    z towards the camera, 0 where there is none; a view without `normal` stands in the list of depth
    alone. Views without a picture are named in left_out.txt; BadInput where all are.
    """
    lines: dict[str, list[str]] = {name: [] for name in _LISTS}
    shown = [view for view in views if view.picture is not None]
    if not shown:
        raise BadInput("--to marigold", "", "no view has a picture", hint="run with --modes")
    for view in shown:
        require_lens(view, "marigold", "radtan")
        (out / view.house.id).mkdir(exist_ok=True)
        rgb = f"{view.house.id}/rgb_{view.id}.png"
        (out / rgb).write_bytes(view.data(view.picture or ""))
        depth = f"{view.house.id}/depth_{view.id}.png"
        (out / depth).write_bytes(png_from_array(depth_within_png(view)))
        lines["depth"].append(f"{rgb} {depth}\n")
        if view.has("normal"):
            normal = f"{view.house.id}/normal_{view.id}.npy"
            np.save(out / normal, opengl_normals(view))
            lines["normal"].append(f"{rgb} {normal}\n")
    written = {name: own for name, own in lines.items() if own}
    for name, own in written.items():
        (out / f"{_LISTS[name]}.txt").write_text("".join(own))
    without = [view for view in views if view.picture is None]
    n_files = len(shown) + sum(len(own) for own in lines.values()) + len(written)
    return n_files + name_left_out(out, without, "has no picture")


def name_lists_by_split(out: Path, splits: tuple[str, ...], _choice: Choice) -> int:
    """Give the lists of each split its name, as Marigold's own preparation does; 0 new files."""
    for split in splits:
        for name in _LISTS.values():
            file = out / split / f"{name}.txt"
            if file.is_file():
                file.rename(file.with_name(f"{name}_{split}.txt"))
    return 0


FORM = ViewForm(
    "marigold",
    write_marigold,
    "`<house>/rgb_<view>.png`, `depth_<view>.png` (uint16 mm), `normal_<view>.npy` (float32, x right, y up,"
    " z towards the camera) and lists of them, `filename_list.txt` (`rgb depth`) and"
    " `filename_list_normals.txt` (`rgb normal`); with `--split` `train/filename_list_train.txt` and so on",
    finish=name_lists_by_split,
    convention=Convention(
        None, has_k=False, axes="camera x right, y up, z backward", depth="mm, along the axis"
    ),
)
