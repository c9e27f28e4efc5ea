"""Photographs with depth as a task's pictures and truth, one by one: to judge by and to train on. Effects: reads files.

A folder of pairs in a layout of docs/selection.md, and the camera: intrinsics.json with fx, fy,
cx, cy in pixels (depth_scale: units a metre), or intrinsics.txt with those four numbers or the
nine of K, beside the pictures or in a folder above. The truth of normals is planes fitted to depth.

ScanNet: <scene>/{color,depth,label}/NAME and the depth camera's 4 x 4, where its tools put it; depth
is in mm, label NYU40's ids. SUN RGB-D: <scene>/{image,depth,depth_bfx}, intrinsics.txt, extrinsics;
its depth has rotated bits, its classes are its toolbox's (sun_rgbd_labels.py). TUM RGB-D: <sequence>/{rgb.txt,depth.txt,groundtruth.txt,rgb,depth}; its cameras
are known by the sequence's name.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_any, resized_nearest
from pbrs_farm.curate import tum_frames
from pbrs_farm.curate.photographs import Photo, PhotoFiles, is_same_form, pairs_in, photo_from_pair
from pbrs_farm.images import array_from_png
from pbrs_farm.regular_files import digest_of_regular, read_given, text_given
from pbrs_farm.study import sun_rgbd_labels
from pbrs_farm.study.photographs import camera_of_crop, crop_to_plan, photo_truth
from pbrs_farm.study.tasks.classes_task import classes_of
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.training_plan import TrainingPlan

_FILES: Final = (
    "intrinsics.json", "intrinsics.txt",
    # ScanNet's: of its 25,000 frames, and of what its reader writes of a scan.
    "intrinsics_depth.txt", "intrinsic_depth.txt", "intrinsic/intrinsic_depth.txt",
    "intrinsics/intrinsic_depth.txt",
)  # fmt: skip
_LABELS: Final = "label"  # ScanNet's folder of classes, beside the pictures'
_OF_SUN_RGBD: Final = ("extrinsics", "depth_bfx", "seg.mat")  # beside image/ and intrinsics.txt


@dataclass(frozen=True, slots=True)
class PhotoCamera:
    """The pinhole camera of photographs, pixels of the stored size."""

    K: tuple[float, float, float, float]  # fx, fy, cx, cy
    depth_scale: float | None  # units a metre; None = as the file's type says

    def matrix(self) -> F64:
        """(3, 3)."""
        fx, fy, cx, cy = self.K
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class RealFrame:
    """A photograph cut to a plan's form.

    truth: (H, W, ...) of the same part, at the photograph's own size, in the form of the task's targets.
    """

    id: str  # its path below the folder
    colour: NDArray[np.uint8]  # (h, w, 3) at the plan's size
    truth: Arrays
    digest: str  # of the picture's file: what has trained may not judge
    camera: F32  # (4,) fx, fy, cx, cy at the plan's size


def real_frames(folder: Path, plan: TrainingPlan) -> Iterator[RealFrame]:
    """Every pair below a folder that says something of the plan's task.

    Raises BadInput where none does, and for a pair without intrinsics.
    """
    return (read_frame(pair, folder, plan) for pair in real_pairs(folder, plan))


def real_pairs(folder: Path, plan: TrainingPlan) -> tuple[PhotoFiles, ...]:
    """The pairs below a folder that say something of the plan's task; BadInput where none does.

    Of classes those have something to say that lie in ScanNet's layout, with labels, and those of SUN
    RGB-D of which its toolbox has classes.
    """
    pairs = pairs_in(folder)
    if plan.task == "segmentation":
        pairs = tuple(pair for pair in pairs if has_labels_of(pair))
    if plan.task not in ("normals", "depth", "segmentation") or not pairs:
        text = f"photographs with depth say nothing of {plan.task}: normals and depth alone"
        hint = "NYUv2's .mat holds classes and instances"
        if plan.task == "segmentation":
            hint += f", ScanNet's label/ classes, of SUN RGB-D {sun_rgbd_labels.CLASSES} beside it"
        raise BadInput(folder, "", text, hint=hint)
    return pairs


def read_frame(pair: PhotoFiles, folder: Path, plan: TrainingPlan) -> RealFrame:
    """One of real_pairs, read; BadInput naming the file that is wrong."""
    camera = camera_of(pair.rgb.parent, folder)
    photo = read_pair(pair, camera.depth_scale)
    colour, rows, columns = crop_to_plan(photo.rgb, plan)
    if plan.task == "segmentation":
        truth: Arrays = {"labels": classes_of(nyu40_of(pair, photo), plan)}
    else:
        truth = photo_truth(photo, camera.matrix(), plan)
    cut = {key: array[rows, columns] for key, array in truth.items()}
    own = camera_of_crop(camera.matrix(), rows, columns, plan)
    return RealFrame(pair.id, colour, cut, digest_of_picture(pair), own)


def digest_of_picture(pair: PhotoFiles) -> str:
    """First 16 hex of the sha256 of a pair's picture: what is known of a photograph that has trained."""
    return digest_of_regular(pair.rgb)[:16]


def truth_at_size(truth: Arrays, plan: TrainingPlan) -> Arrays:
    """What a task trains on of a photograph's truth, by the nearest pixel; lines stay whole.

    Depth stands beside normals to judge them by alone, and is left out.
    """
    return {
        name: _resized(name, array, plan)
        for name, array in truth.items()
        if plan.task == "depth" or name != "depth"
    }


def _resized(name: str, array: NDArray[Any], plan: TrainingPlan) -> NDArray[Any]:
    resized = resized_any if name == "edges" else resized_nearest
    return resized(array, plan.width_px, plan.height_px)


def read_pair(pair: PhotoFiles, depth_scale: float | None) -> Photo:
    """The photograph, its depth in mm as its layout stores it; BadInput naming the file that is wrong.

    depth_scale: units a metre where its camera says so.
    """
    return photo_from_pair(pair, depth_scale=depth_scale, sun_rgbd=_is_of_sun_rgbd(pair))


def has_labels_of(pair: PhotoFiles) -> bool:
    """The photograph has classes where ScanNet has them, or in SUN RGB-D's toolbox."""
    if _label_of(pair).is_file():
        return True
    return _is_of_sun_rgbd(pair) and sun_rgbd_labels.has_classes(pair.rgb.parent.parent)


def _label_of(pair: PhotoFiles) -> Path:
    return pair.rgb.parent.parent / _LABELS / f"{pair.rgb.stem}.png"


def nyu40_of(pair: PhotoFiles, photo: Photo) -> NDArray[np.uint8]:
    """(H, W) NYU40 ids at the photograph's size, 0 = none; BadInput for a file of other labels."""
    file = _label_of(pair)
    if file.is_file():
        stored = array_from_png(read_given(file), str(file))
        if stored.ndim != 2 or int(stored.max(initial=0)) > 40:
            raise BadInput(file, "", "expected one channel of NYU40 ids, 0 to 40")
    else:
        stored = sun_rgbd_labels.classes_of_scene(pair.rgb.parent.parent)
    height, width = photo.rgb.shape[:2]
    if not is_same_form(stored.shape, photo.rgb.shape):
        sizes = f"{stored.shape[1]}x{stored.shape[0]}, of a picture {width}x{height}"
        raise BadInput(pair.rgb, "", f"its labels have another form: {sizes}")
    return resized_nearest(stored.astype(np.uint8), width, height)


def _is_of_sun_rgbd(pair: PhotoFiles) -> bool:
    scene = pair.rgb.parent.parent
    has_camera = (scene / "intrinsics.txt").is_file()
    return (
        has_camera
        and pair.rgb.parent.name == "image"
        and any((scene / name).exists() for name in _OF_SUN_RGBD)
    )


def camera_of(folder: Path, top: Path) -> PhotoCamera:
    """The camera of photographs in a folder: the nearest intrinsics file from it up to top.

    folder: where the pictures lie. Raises BadInput where there is none, or one that cannot be read.
    """
    found = find_camera(folder, top)
    if found is not None:
        return found
    text = "photographs without intrinsics: normals cannot be taken from their depth"
    hint = 'put intrinsics.json there: {"fx": 518.9, "fy": 519.5, "cx": 325.6, "cy": 253.7}'
    raise BadInput(folder, "", text, hint=hint)


def find_camera(folder: Path, top: Path) -> PhotoCamera | None:
    """As camera_of; None where there is no such file."""
    above = [folder, *folder.parents]
    last = above.index(top) if top in above else 0
    for place in above[: last + 1]:
        for name in _FILES:
            if (place / name).is_file():
                return _read_camera(place / name)
        K = tum_frames.camera_of_sequence(place)
        if K is not None:
            return PhotoCamera(K, None)
    return None


def _read_camera(path: Path) -> PhotoCamera:
    text = text_given(path)
    scale: float | None = None
    try:
        if path.suffix == ".json":
            row = json.loads(text)
            values = [float(row[key]) for key in ("fx", "fy", "cx", "cy")]
            scale = float(row["depth_scale"]) if "depth_scale" in row else None
        else:
            values = [float(word) for word in text.replace(",", " ").split()]
            places = {9: (0, 4, 2, 5), 16: (0, 5, 2, 6)}.get(len(values))  # of 3 x 3, of 4 x 4
            values = values if places is None else [values[k] for k in places]
    except (ValueError, KeyError, TypeError):
        values = []
    if len(values) != 4 or not np.isfinite(values).all() or min(values[:2]) <= 0:
        raise BadInput(
            path, "", "expected fx, fy, cx and cy in pixels, or the numbers of K, 3 x 3 or 4 x 4"
        )
    fx, fy, cx, cy = values
    return PhotoCamera((fx, fy, cx, cy), scale)
