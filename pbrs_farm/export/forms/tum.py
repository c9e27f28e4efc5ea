"""TUM's RGB-D form: pictures, depth and the trajectory by time. Effects: reads views, writes files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView, require_lens
from pbrs_farm.export.form import Convention, ViewForm, name_left_out
from pbrs_farm.export.sequences import frames_by_house, pose_opencv, required_picture
from pbrs_farm.images import png_from_array

_STEPS_PER_M: Final = 5000  # steps per metre of TUM's depth


def write_tum(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """<house>/rgb/, depth/, rgb.txt, depth.txt and groundtruth.txt.

    groundtruth.txt has rows t x y z qx qy qz qw in the home's world (metres, y up), OpenCV axes, as
    `--trajectory` reads them. Depth is 5000 a metre, 0 = nothing or beyond 13.1 m. Other cameras of a rig
    have the five with `_<camera>` behind their names, `_right` of a stereo pair. Frames of a sequence
    alone: other views are named in left_out.txt; BadInput if there are no frames.
    """
    written = set[tuple[str, str]]()
    for house, frames in frames_by_house(views).items():
        timed = [(f, f.time_s) for f in frames if f.time_s is not None]
        by_eye: dict[str, list[tuple[ChosenView, float]]] = {}
        for frame, time in timed:
            for eye, view in {"": frame.first, **frame.others}.items():
                by_eye.setdefault(eye, []).append((view, time))
        for eye, moments in by_eye.items():
            _write_trajectory(out / house, eye and f"_{eye}", moments)
            written |= {(house, view.id) for view, _time in moments}
    if not written:
        hint = "pbrs-farm run HOME --cameras walk"
        raise BadInput("--to", "tum", "no view is a frame of a sequence", hint=hint)
    left_out = [view for view in views if (view.house.id, view.id) not in written]
    name_left_out(out, left_out, "has no frame of an exported sequence")


def _write_trajectory(folder: Path, side: str, timed: Sequence[tuple[ChosenView, float]]) -> None:
    """Write the pictures, depth and lists of one moving camera."""
    rows: dict[str, list[str]] = {"rgb": [], "depth": [], "groundtruth": []}
    for name in ("rgb", "depth"):
        (folder / f"{name}{side}").mkdir(parents=True)
    for view, time in timed:
        require_lens(view, "tum", *FORM.lenses)
        files = {"rgb": view.data(required_picture(view, "tum")), "depth": _depth(view)}
        for name, data in files.items():
            file = f"{name}{side}/{time:.6f}.png"
            (folder / file).write_bytes(data)
            rows[name].append(f"{time:.6f} {file}")
        rows["groundtruth"].append(_trajectory_row(time, pose_opencv(view)))
    for name, lines in rows.items():
        (folder / f"{name}{side}.txt").write_text("\n".join(lines) + "\n", "utf-8")


def _depth(view: ChosenView) -> bytes:
    steps = view.array("depth").astype(np.int64) * _STEPS_PER_M // 1000
    return png_from_array(np.where(steps > 65535, 0, steps).astype(np.uint16))


def _trajectory_row(time_s: float, world_from_camera: F64) -> str:
    """`t x y z qx qy qz qw` of an OpenCV pose, w not negative."""
    quaternion = Rotation.from_matrix(world_from_camera[:3, :3]).as_quat(canonical=True)
    numbers = [*world_from_camera[:3, 3], *quaternion]
    return f"{time_s:.6f} " + " ".join(f"{v:.9g}" for v in numbers)


FORM = ViewForm(
    "tum",
    write_tum,
    "`rgb.txt`, `depth.txt`, `groundtruth.txt`; depth 5000 a metre; the right views of pairs in"
    " `rgb_right.txt`, `depth_right.txt`, `groundtruth_right.txt`, other cameras of a rig likewise",
    lenses=("pinhole", "radtan", "opencv"),
    is_of_frames=True,
    convention=Convention(
        None, axes="OpenCV's; world y up, m", depth="5000 steps a metre, along the axis"
    ),
)
