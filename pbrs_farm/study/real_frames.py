"""Photographs with depth as pictures and truth of a task, for training and tests. Effects: reads files.

A folder has pairs in a layout of docs/selection.md and the camera: intrinsics.json with fx, fy, cx,
cy in pixels (depth_scale: units per metre), or intrinsics.txt with those four numbers or the nine of
K, beside the pictures or in a folder above. rooms.json joins folders or pictures of one room.
Normals are planes fitted to depth.

ScanNet: <scene>/{color,depth,label}/NAME and the 4 x 4 matrix of the depth camera as written by its
tools; depth in mm, labels in NYU40 ids. SUN RGB-D: <scene>/{image,depth,depth_bfx}, intrinsics.txt,
extrinsics; its depth has rotated bits, its classes are in its toolbox (sun_rgbd_labels.py). TUM
RGB-D: <sequence>/{rgb.txt,depth.txt,groundtruth.txt,rgb,depth}; the name of the sequence gives the
camera.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.core.shown_text import did_you_mean
from pbrs_farm.curate import tum_frames
from pbrs_farm.curate.photographs import Photo, PhotoFiles, is_same_form, pairs_in, photo_from_pair
from pbrs_farm.images import array_from_png
from pbrs_farm.regular_files import digest_of_regular, read_given, text_given
from pbrs_farm.study import sun_rgbd_labels
from pbrs_farm.study.photographs import RealFrame, cropped_frame, photo_truth
from pbrs_farm.study.tasks.classes_task import classes_of
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.training_plan import TrainingPlan

_FILES: Final = (
    "intrinsics.json",
    "intrinsics.txt",
    # ScanNet's 25,000 frames, and the output of its reader.
    "intrinsics_depth.txt",
    "intrinsic_depth.txt",
    "intrinsic/intrinsic_depth.txt",
    "intrinsics/intrinsic_depth.txt",
)
_LABELS: Final = "label"  # ScanNet's folder of classes, beside the pictures
_SCAN: Final = re.compile(r"(scene\d{4})_\d\d\b.*")  # of ScanNet
_FRAME: Final = re.compile(r"_rgbf\d+.*")  # of SUN RGB-D's videos
_OF_SUN_RGBD: Final = ("extrinsics", "depth_bfx", "seg.mat")  # beside image/ and intrinsics.txt


@dataclass(frozen=True, slots=True)
class PhotoCamera:
    """The pinhole camera of photographs, pixels of the stored size."""

    K: tuple[float, float, float, float]  # fx, fy, cx, cy
    depth_scale: float | None  # units per metre; None = by the type of the file

    def matrix(self) -> F64:
        """(3, 3)."""
        fx, fy, cx, cy = self.K
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], np.float64)


def real_pairs(folder: Path, plan: TrainingPlan) -> tuple[PhotoFiles, ...]:
    """Pairs with truth of the plan's task (classes: ScanNet's labels, SUN RGB-D's toolbox); BadInput."""
    pairs = pairs_in(folder, raw=True)
    _check_rooms(folder, pairs)
    if plan.task == "segmentation":
        pairs = tuple(pair for pair in pairs if has_labels_of(pair))
    if plan.task not in ("normals", "depth", "segmentation") or not pairs:
        text = f"photographs with depth have only normals and depth, not {plan.task}"
        hint = "NYUv2's .mat has classes and instances"
        if plan.task == "segmentation":
            hint += f", ScanNet's label/ classes, of SUN RGB-D {sun_rgbd_labels.CLASSES} beside it"
        raise BadInput(folder, "", text, hint=hint)
    return pairs


def read_frame(pair: PhotoFiles, folder: Path, plan: TrainingPlan) -> RealFrame:
    """Read one of real_pairs; BadInput names a damaged file."""
    camera = camera_of(pair.rgb.parent, folder)
    photo = read_pair(pair, camera.depth_scale)
    if plan.task == "segmentation":
        truth: Arrays = {"labels": classes_of(nyu40_of(pair, photo), plan)}
    else:
        truth = photo_truth(photo, camera.matrix(), plan)
    K, digest = camera.matrix(), digest_of_picture(pair)
    return cropped_frame(pair.id, photo.rgb, truth, K, plan, digest, room_of(pair, folder))


def room_of(pair: PhotoFiles, folder: Path) -> str:
    """Room of a pair: by rooms.json, else its folder; scans of a ScanNet scene and frames of a SUN RGB-D video are one."""
    rooms = _rooms_of(folder)
    place = pair.id.rpartition("/")[0]
    for name in (pair.id, place):
        if name in rooms:
            return rooms[name]
    if _is_of_sun_rgbd(pair):
        # A folder has one picture; those of a video differ by the frame's number, Sun3D's by their folder.
        return place if "sun3ddata" in place.split("/") else _FRAME.sub("", pair.id)
    return _SCAN.sub(r"\1", place)


def _rooms_of(folder: Path) -> dict[str, str]:
    """Content of rooms.json: room by picture or folder; BadInput for another form."""
    path = folder / "rooms.json"
    if not path.is_file():
        return {}
    try:
        rows = json.loads(text_given(path))
    except ValueError:
        rows = None
    if not isinstance(rows, dict) or not all(isinstance(room, str) for room in rows.values()):
        hint = '{"kitchen_morning": "kitchen", "kitchen_evening": "kitchen"}'
        raise BadInput(path, "", "expected the room of each folder", hint=hint)
    return rows


def _check_rooms(folder: Path, pairs: Sequence[PhotoFiles]) -> None:
    """Raise BadInput for a name in rooms.json without pictures."""
    names = {name for pair in pairs for name in (pair.id, pair.id.rpartition("/")[0])}
    for name in _rooms_of(folder):
        if name not in names:
            text, hint = "no folder of pictures and no picture", did_you_mean(name, names)
            raise BadInput(folder / "rooms.json", name, text, hint=hint)


def depths_of_pairs(pairs: Iterable[PhotoFiles]) -> list[str]:
    """Kinds of depth among pairs: "raw", or "filled" for SUN RGB-D's depth_bfx."""
    folders = {pair.depth.parent.name for pair in pairs}
    return sorted({"filled" if name == "depth_bfx" else "raw" for name in folders})


def digest_of_picture(pair: PhotoFiles) -> str:
    """First 16 hex digits of the sha256 of a pair's picture."""
    return digest_of_regular(pair.rgb)[:16]


def read_pair(pair: PhotoFiles, depth_scale: float | None) -> Photo:
    """The photograph with depth in mm (depth_scale: units per metre, None = its layout's); BadInput."""
    return photo_from_pair(pair, depth_scale=depth_scale, sun_rgbd=_is_of_sun_rgbd(pair))


def has_labels_of(pair: PhotoFiles) -> bool:
    """True if the photograph has classes, in ScanNet's folder or in SUN RGB-D's toolbox."""
    if _label_of(pair).is_file():
        return True
    return _is_of_sun_rgbd(pair) and sun_rgbd_labels.has_classes(pair.rgb.parent.parent)


def _label_of(pair: PhotoFiles) -> Path:
    return pair.rgb.parent.parent / _LABELS / f"{pair.rgb.stem}.png"


def nyu40_of(pair: PhotoFiles, photo: Photo) -> NDArray[np.uint8]:
    """(H, W) NYU40 ids at the photograph's size, 0 = none; BadInput for other labels."""
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
    """The camera of the nearest intrinsics file from a folder up to top; BadInput without a sound one."""
    camera = find_camera(folder, top)
    if camera is not None:
        return camera
    text = "photographs without intrinsics: normals cannot be computed from depth"
    hint = 'put intrinsics.json there: {"fx": 518.9, "fy": 519.5, "cx": 325.6, "cy": 253.7}'
    raise BadInput(folder, "", text, hint=hint)


def find_camera(folder: Path, top: Path) -> PhotoCamera | None:
    """As camera_of; None without such a file."""
    folders = [folder, *folder.parents]
    last = folders.index(top) if top in folders else 0
    for parent in folders[: last + 1]:
        for name in _FILES:
            if (parent / name).is_file():
                return _read_camera(parent / name)
        K = tum_frames.camera_of_sequence(parent)
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
            # Indices of fx, fy, cx, cy in a matrix of 3 x 3 or 4 x 4.
            indices = {9: (0, 4, 2, 5), 16: (0, 5, 2, 6)}.get(len(values))
            values = values if indices is None else [values[k] for k in indices]
    except (ValueError, KeyError, TypeError):
        values = []
    if len(values) != 4 or not np.isfinite(values).all() or min(values[:2]) <= 0:
        raise BadInput(
            path, "", "expected fx, fy, cx and cy in pixels, or the numbers of K, 3 x 3 or 4 x 4"
        )
    fx, fy, cx, cy = values
    return PhotoCamera((fx, fy, cx, cy), scale)
