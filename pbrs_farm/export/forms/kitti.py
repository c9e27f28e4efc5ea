"""KITTI 2015's layout of stereo and flow. Effects: reads views, writes files."""

from __future__ import annotations

from itertools import count, zip_longest
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, Line, write_files
from pbrs_farm.export.form import Convention, Takes, ViewForm
from pbrs_farm.export.sequences import SequenceFrame, frames_by_house

_SEEN: Final = 0  # of the layers of occlusion


def write_kitti(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """image_2/ (the left, or a rig's first camera) and image_3/ (right), disp_*_0/, flow_*/, calib/.

    <6 digits>_10.png is a frame, <6 digits>_11.png the next one of its sequence. `occ` has every surface,
    `noc` only those visible in the other picture. index.txt: number, house, view. Files without data are
    omitted; BadInput if no view has flow or disparity.
    """
    write_files(out, map(_files, count(), _moments(views)))


def _moments(views: list[ChosenView]) -> list[tuple[SequenceFrame, SequenceFrame | None]]:
    """Frames with flow or disparity, each with the next one of its sequence."""
    return [
        (frame, following if following and "frame" in following.first.facts else None)
        for frames in frames_by_house(views).values()
        for frame, following in zip_longest(frames, frames[1:])
        if frame.first.has("disparity") or frame.first.has("flow_forward")
    ]


def _pictured(views: list[ChosenView]) -> list[ChosenView]:
    """The views in the pictures of moments."""
    frames = [frame for moment in _moments(views) for frame in moment if frame is not None]
    used = {id(view) for frame in frames for view in (frame.first, frame.right)}
    return [view for view in views if id(view) in used]


def _files(number: int, moment: tuple[SequenceFrame, SequenceFrame | None]) -> Files:
    frame, following = moment
    view, name = frame.first, f"{number:06d}"
    files = _pictures(frame, f"{name}_10") | _labels(view, f"{name}_10.png")
    if following is not None:
        files |= _pictures(following, f"{name}_11")
    row = Line(f"{name} {view.house.id} {view.id}")
    return files | {f"calib/{name}.txt": _calibration(frame), "index.txt": row}


def _pictures(frame: SequenceFrame, name: str) -> dict[str, Content]:
    files: dict[str, Content] = {f"image_2/{name}.png": frame.first.shown}
    if frame.right is not None:
        files[f"image_3/{name}.png"] = frame.right.shown
    return files


def _labels(view: ChosenView, name: str) -> dict[str, Content]:
    files: dict[str, Content] = {}
    if view.has("disparity"):
        disparity = files[f"disp_occ_0/{name}"] = view.array("disparity")
        if view.has("occlusion_stereo"):
            shown = view.array("occlusion_stereo") == _SEEN
            files[f"disp_noc_0/{name}"] = np.where(shown, disparity, np.uint16(0))
    if view.has("flow_forward"):
        flow = view.array("flow_forward")
        files[f"flow_occ/{name}"] = kitti_flow(flow, view.array("depth") > 0)
        if view.has("occlusion_forward"):
            shown = view.array("occlusion_forward") == _SEEN
            files[f"flow_noc/{name}"] = kitti_flow(flow, shown)
    return files


def kitti_flow(flow: NDArray[np.float32], valid: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """(H, W, 3) uint16: 64 x + 2**15, 64 y + 2**15, 1; 0 in all three where not valid (H, W).

    flow is (H, W, 2) px, x right and y down, from the first picture to the second. Flow beyond the range
    of 16 bits (512 px) is marked as not valid. The order of channels is that of KITTI's files, read as
    RGB.
    """
    steps = np.rint(flow.astype(np.float64) * 64) + 2**15
    valid = valid & ((steps >= 0) & (steps <= 65535)).all(-1)
    png = np.concatenate([steps.clip(0, 65535), np.ones((*valid.shape, 1))], axis=-1)
    return np.where(valid[..., None], png, 0).astype(np.uint16)


def _calibration(frame: SequenceFrame) -> str:
    """P2 and P3: (3, 4) projections of both pictures in the left camera's frame, metres.

    Pixels count from the centre of the first one, as in KITTI's own tools (drawBox3D.m adds 1 for
    MATLAB, whose first pixel's centre is (1, 1)).
    """
    k = np.array(frame.first.k_of_whole_centres, np.float64)
    lines = [_projection("P2", k, 0.0)]
    if frame.right is not None:
        lines.append(
            _projection(
                "P3", k, float(np.linalg.norm((frame.right.pose - frame.first.pose)[:3, 3]))
            )
        )
    return "".join(lines)


def _projection(name: str, k: NDArray[np.float64], baseline_m: float) -> str:
    column = k @ np.array([[-baseline_m], [0.0], [0.0]])
    return f"{name}: " + " ".join(f"{v:.9e}" for v in np.hstack([k, column]).ravel()) + "\n"


FORM = ViewForm(
    "kitti",
    write_kitti,
    "KITTI 2015: `image_2`, `image_3`, `disp_occ_0`, `disp_noc_0`, `flow_occ`, `flow_noc`, `calib`",
    takes=Takes(
        _pictured,
        "",
        "no view has flow or disparity",
        "run with --stereo 0.065 --layers disparity occlusion_stereo flow_forward",
    ),
    lenses=("pinhole",),
    layers=("disparity", "flow_forward"),
    convention=Convention(
        0, axes="OpenCV's of the left camera, m", depth="256 steps a px of disparity"
    ),
)
