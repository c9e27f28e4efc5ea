"""TUM's RGB-D form: pictures, depth and the trajectory by time. Effects: reads views, writes files."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView, require_lens
from pbrs_farm.export.sequences import frames_by_house, pose_opencv, required_picture, tum_row
from pbrs_farm.images import png_from_array

_STEPS_PER_M: Final = 5000  # of TUM's depth


def write_tum(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """<house>/rgb/, depth/, rgb.txt, depth.txt and groundtruth.txt; the number of files.

    groundtruth.txt has rows t x y z qx qy qz qw in the home's world (metres, y up), OpenCV axes:
    what `--trajectory` reads. Depth is 5000 a metre, 0 = nothing or beyond 13.1 m. Frames of a
    sequence alone, left views of pairs; BadInput where there is none.
    """
    n_files = 0
    for house, frames in frames_by_house(views).items():
        timed = [(f.left, f.time_s) for f in frames if f.time_s is not None]
        if not timed:
            continue
        for name in ("rgb", "depth"):
            (out / house / name).mkdir(parents=True)
        rows: dict[str, list[str]] = {"rgb": [], "depth": [], "groundtruth": []}
        for view, time in timed:
            require_lens(view, "tum", "radtan")
            name = f"{time:.6f}.png"
            picture = view.data(required_picture(view, "tum"))
            (out / house / "rgb" / name).write_bytes(picture)
            (out / house / "depth" / name).write_bytes(_depth(view))
            rows["rgb"].append(f"{time:.6f} rgb/{name}")
            rows["depth"].append(f"{time:.6f} depth/{name}")
            rows["groundtruth"].append(tum_row(time, pose_opencv(view)))
        for name, lines in rows.items():
            (out / house / f"{name}.txt").write_text("\n".join(lines) + "\n")
        n_files += 2 * len(timed) + 3
    if not n_files:
        hint = "pbrs-farm run HOME --cameras walk"
        raise BadInput("--to", "tum", "no view is a frame of a sequence", hint=hint)
    return n_files


def _depth(view: ChosenView) -> bytes:
    steps = view.array("depth").astype(np.int64) * _STEPS_PER_M // 1000
    return png_from_array(np.where(steps > 65535, 0, steps).astype(np.uint16))
