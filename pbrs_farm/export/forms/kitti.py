"""KITTI 2015's layout of stereo and flow. Effects: reads views, writes files."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView, k_of_whole_centres, require_lens
from pbrs_farm.export.form import Convention, ViewForm, write_file
from pbrs_farm.export.sequences import SequenceFrame, frames_by_house, required_picture
from pbrs_farm.images import png_from_array

_SEEN: Final = 0  # of the layers of occlusion


def write_kitti(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """image_2/ (the left, or a rig's first camera) and image_3/ (right), disp_*_0/, flow_*/, calib/.

    <6 digits>_10.png is a frame, <6 digits>_11.png the next one of its sequence. `occ` has every surface,
    `noc` only those visible in the other picture. index.txt: number, house, view. Files without data are
    omitted; BadInput if no view has flow or disparity.
    """
    rows: list[str] = []
    for house, frames in frames_by_house(views).items():
        for k, frame in enumerate(frames):
            files = _labels(frame.first)
            if not files:
                continue
            number = f"{len(rows):06d}"
            following = frames[k + 1] if k + 1 < len(frames) else None
            files |= _pictures(frame, "10") | (_pictures(following, "11") if following else {})
            files["calib/{}.txt"] = _calibration(frame).encode()
            for name, data in files.items():
                write_file(out / name.format(number), data)
            rows.append(f"{number} {house} {frame.first.id}")
    if not rows:
        hint = "run with --stereo 0.065 --layers disparity occlusion_stereo flow_forward"
        raise BadInput("--to", "kitti", "no view has flow or disparity", hint=hint)
    (out / "index.txt").write_text("\n".join(rows) + "\n", "utf-8")


def _pictures(frame: SequenceFrame, which: str) -> dict[str, bytes]:
    files = {f"image_2/{{}}_{which}.png": frame.first.data(required_picture(frame.first, "kitti"))}
    if frame.right is not None:
        picture = required_picture(frame.right, "kitti")
        files[f"image_3/{{}}_{which}.png"] = frame.right.data(picture)
    return files


def _labels(view: ChosenView) -> dict[str, bytes]:
    files = {}
    if view.has("disparity"):
        disparity = view.array("disparity")
        files["disp_occ_0/{}_10.png"] = png_from_array(disparity)
        if view.has("occlusion_stereo"):
            shown = view.array("occlusion_stereo") == _SEEN
            files["disp_noc_0/{}_10.png"] = png_from_array(np.where(shown, disparity, np.uint16(0)))
    if view.has("flow_forward"):
        flow, has_depth = view.array("flow_forward"), view.array("depth") > 0
        files["flow_occ/{}_10.png"] = png_from_array(kitti_flow(flow, has_depth))
        if view.has("occlusion_forward"):
            shown = view.array("occlusion_forward") == _SEEN
            files["flow_noc/{}_10.png"] = png_from_array(kitti_flow(flow, shown))
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
    require_lens(frame.first, "kitti", *FORM.lenses)
    k = np.array(k_of_whole_centres(frame.first.facts["K"]), np.float64)
    lines = [_projection("P2", k, 0.0)]
    if frame.right is not None:
        eyes = [
            np.array(v.facts["world_from_camera_opencv"])[:3, 3] for v in (frame.first, frame.right)
        ]
        lines.append(_projection("P3", k, float(np.linalg.norm(eyes[1] - eyes[0]))))
    return "".join(lines)


def _projection(name: str, k: NDArray[np.float64], baseline_m: float) -> str:
    column = k @ np.array([[-baseline_m], [0.0], [0.0]])
    return f"{name}: " + " ".join(f"{v:.9e}" for v in np.hstack([k, column]).ravel()) + "\n"


FORM = ViewForm(
    "kitti",
    write_kitti,
    "KITTI 2015: `image_2`, `image_3`, `disp_occ_0`, `disp_noc_0`, `flow_occ`, `flow_noc`, `calib`",
    lenses=("pinhole",),
    layers=("disparity", "flow_forward"),
    convention=Convention(
        0, axes="OpenCV's of the left camera, m", depth="256 steps a px of disparity"
    ),
)
