"""TUM's RGB-D form: pictures, depth and the trajectory by time. Effects: reads views, writes files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import starmap
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Files, Line, numbers, write_files
from pbrs_farm.export.form import Convention, Takes, ViewForm
from pbrs_farm.export.sequences import frames_by_house

_STEPS_PER_M: Final = 5000  # steps per metre of TUM's depth


def write_tum(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """<house>/rgb/, depth/, rgb.txt, depth.txt and groundtruth.txt.

    groundtruth.txt has rows t x y z qx qy qz qw in the home's world (metres, y up), OpenCV axes, as
    `--trajectory` reads them. Depth is 5000 a metre, 0 = nothing or beyond 13.1 m. Other cameras of a rig
    have the five with `_<camera>` behind their names, `_right` of a stereo pair. Frames of a sequence
    alone: other views are named in left_out.txt; BadInput if there are no frames.
    """
    write_files(out, starmap(_files, _timed(views)))


def _timed(views: Sequence[ChosenView]) -> Iterator[tuple[ChosenView, float]]:
    """The views of sequences, of all cameras of a rig, and their time."""
    for frames in frames_by_house(views).values():
        for frame in frames:
            if frame.time_s is not None:
                yield from ((view, frame.time_s) for view in (frame.first, *frame.others.values()))


def _files(view: ChosenView, time: float) -> Files:
    side = view.shot.eye and f"_{view.shot.eye}"
    names = {kind: f"{kind}{side}/{time:.6f}.png" for kind in ("rgb", "depth")}
    steps = view.array("depth").astype(np.int64) * _STEPS_PER_M // 1000
    depth = np.where(steps > 65535, 0, steps).astype(np.uint16)
    lines = {kind: f"{time:.6f} {name}" for kind, name in names.items()}
    lines["groundtruth"] = f"{time:.6f} {numbers(view.place_and_quaternion)}"
    house = view.house.id
    return {
        f"{house}/{names['rgb']}": view.shown,
        f"{house}/{names['depth']}": depth,
        **{f"{house}/{kind}{side}.txt": Line(line) for kind, line in lines.items()},
    }


FORM = ViewForm(
    "tum",
    write_tum,
    "`rgb.txt`, `depth.txt`, `groundtruth.txt`; depth 5000 a metre; the right views of pairs in"
    " `rgb_right.txt`, `depth_right.txt`, `groundtruth_right.txt`, other cameras of a rig likewise",
    takes=Takes(
        lambda views: [view for view, _time in _timed(views)],
        "has no frame of an exported sequence",
        "no view is a frame of a sequence",
        "pbrs-farm run HOME --cameras walk",
    ),
    lenses=("pinhole", "radtan", "opencv"),
    is_of_frames=True,
    convention=Convention(
        None, axes="OpenCV's; world y up, m", depth="5000 steps a metre, along the axis"
    ),
)
