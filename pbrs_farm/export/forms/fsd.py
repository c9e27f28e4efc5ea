"""Stereo pairs with disparity, as FoundationStereo's data set (NVlabs/FoundationStereo and its script that shows it).

    <house>/dataset/data/{left,right}/rgb/<4 digits>.jpg
    <house>/dataset/data/left/{disparity/<4 digits>.png,intrinsics/<4 digits>.txt}
    index.txt

Effects: reads views, writes files.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import starmap
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Files, Line, numbers, write_files
from pbrs_farm.export.form import REMARKS, Convention, Takes, ViewForm
from pbrs_farm.export.sequences import frames_by_house

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
    write_files(out, starmap(_files, _pairs(views)))
    if any(not left.has("depth_z") for left, _right, _number in _pairs(views)):
        text = f"disparity: steps of 1/{_KITTI_STEPS} px; for 1/{_STEPS_PER_PX} {_HINT}\n"
        (out / REMARKS).write_text(text, "utf-8")


def _pairs(views: list[ChosenView]) -> Iterator[tuple[ChosenView, ChosenView, int]]:
    """The left and the right view of each pair, and its number in its house."""
    for frames in frames_by_house(views).values():
        pairs = [(f.first, right) for f in frames if (right := f.right) is not None]
        yield from ((left, right, number) for number, (left, right) in enumerate(pairs))


def _files(left: ChosenView, right: ChosenView, number: int) -> Files:
    house, name = left.house.id, f"{number:04d}"
    folder = f"{house}/dataset/data"
    baseline_m = float(np.linalg.norm((right.pose - left.pose)[:3, 3]))
    return {
        f"{folder}/left/rgb/{name}.jpg": left.colours,
        f"{folder}/right/rgb/{name}.jpg": right.colours,
        f"{folder}/left/disparity/{name}.png": digits_of_disparity(_disparity(left, baseline_m)),
        f"{folder}/left/intrinsics/{name}.txt": (
            f"{numbers(np.ravel(left.k_of_whole_centres))}\n{baseline_m:.9g}\n"
        ),
        "index.txt": Line(f"{folder} {name} {house} {left.id}"),
    }


def _disparity(view: ChosenView, baseline_m: float) -> F64:
    """(H, W) px from the left picture to the right one, 0 for nothing."""
    if view.has("depth_z"):
        depth = view.depth_m
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
    takes=Takes(
        lambda views: [view for *pair, _number in _pairs(views) for view in pair],
        "has no right view",
        "no view has a right one",
        _HINT,
    ),
    lenses=("pinhole",),
    layers=("depth_z", "disparity"),
    convention=Convention(0, axes="", depth="1000 steps a px of disparity"),
)
