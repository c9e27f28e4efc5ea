"""Stereo pairs with disparity, as FoundationStereo's data set (NVlabs/FoundationStereo and its script that shows it).

    <house>/dataset/data/{left,right}/rgb/<4 digits>.jpg
    <house>/dataset/data/left/{disparity/<4 digits>.png,intrinsics/<4 digits>.txt}
    index.txt

Effects: reads views, writes files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    depth_metres,
    k_of_whole_centres,
    require_lens,
)
from pbrs_farm.export.form import REMARKS, Convention, ViewForm, name_left_out, write_file
from pbrs_farm.export.sequences import frames_by_house, picture_of, pose_opencv
from pbrs_farm.images import jpeg_from_array, png_from_array

_QUALITY: Final = 95  # of JPEG
_BASE: Final = 255  # of the three digits of a disparity, the red one first
_STEPS_PER_PX: Final = 1000
_KITTI_STEPS: Final = 256  # a px in the layer `disparity`
_HINT: Final = "run with --stereo 0.065 --layers depth_z"


def write_fsd(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the files above, of every view with a right one.

    A disparity is (255 x 255 R + 255 G + B) / 1000 px, 0 for nothing: focal length times baseline over `depth_z`,
    or the layer `disparity`, whose steps of 1/256 px remarks.txt mentions. intrinsics: nine numbers of K, then the
    baseline in metres. index.txt: folder, number, house and view of each pair. BadInput without a pair.
    """
    rows: list[str] = []
    written: set[tuple[str, str]] = set()
    is_coarse = False
    for house, frames in frames_by_house(views).items():
        folder = out / house / "dataset/data"
        pairs = [(frame.first, frame.right) for frame in frames if frame.right is not None]
        for number, (left, right) in enumerate(pairs):
            require_lens(left, "fsd", *FORM.lenses)
            name = f"{number:04d}"
            for side, view in (("left", left), ("right", right)):
                picture = picture_of(view, "fsd")
                write_file(folder / side / f"rgb/{name}.jpg", jpeg_from_array(picture, _QUALITY))
                written.add((house, view.id))
            baseline_m = float(np.linalg.norm((pose_opencv(right) - pose_opencv(left))[:3, 3]))
            is_coarse |= not left.has("depth_z")
            png = png_from_array(digits_of_disparity(_disparity(left, baseline_m)))
            write_file(folder / f"left/disparity/{name}.png", png)
            k = " ".join(f"{v:.9g}" for row in k_of_whole_centres(left.facts["K"]) for v in row)
            write_file(folder / f"left/intrinsics/{name}.txt", f"{k}\n{baseline_m:.9g}\n".encode())
            rows.append(f"{house}/dataset/data {name} {house} {left.id}\n")
    if not rows:
        raise BadInput("--to", "fsd", "no view has a right one", hint=_HINT)
    (out / "index.txt").write_text("".join(rows), "utf-8")
    if is_coarse:
        text = f"disparity: steps of 1/{_KITTI_STEPS} px; for 1/{_STEPS_PER_PX} {_HINT}\n"
        (out / REMARKS).write_text(text, "utf-8")
    single = [view for view in views if (view.house.id, view.id) not in written]
    name_left_out(out, single, "has no right view")


def _disparity(view: ChosenView, baseline_m: float) -> F64:
    """(H, W) px from the left picture to the right one, 0 for nothing."""
    if view.has("depth_z"):
        depth = depth_metres(view)
        reach = float(view.facts["K"][0][0]) * baseline_m
        return np.divide(reach, depth, out=np.zeros_like(depth), where=depth > 0)
    if not view.has("disparity"):
        text = "needs the layer depth_z or disparity"
        raise BadInput(f"{view.house.id}/{view.id}", "", text, hint=_HINT)
    return view.array("disparity") / _KITTI_STEPS


def digits_of_disparity(disparity: F64) -> NDArray[np.uint8]:
    """(H, W, 3) the three digits of a disparity in thousandths of a px.

    >>> digits_of_disparity(np.array([[65.28]])).tolist()
    [[[1, 1, 0]]]
    """
    steps = np.rint(disparity * _STEPS_PER_PX).astype(np.int64)
    steps = np.clip(steps, 0, _BASE**3 + _BASE**2 + _BASE)
    red = np.minimum(steps // _BASE**2, _BASE)
    green, blue = np.divmod(steps - red * _BASE**2, _BASE)
    return np.stack([red, green, blue], axis=-1).astype(np.uint8)


FORM = ViewForm(
    "fsd",
    write_fsd,
    "FoundationStereo's pairs: `<house>/dataset/data/left/rgb`, `right/rgb`, `left/disparity`, `left/intrinsics`, `index.txt`",
    lenses=("pinhole",),
    layers=("depth_z", "disparity"),
    convention=Convention(0, axes="", depth="1000 steps a px of disparity"),
)
