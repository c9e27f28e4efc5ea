"""NYUv2's nyu_depth_v2_labeled.mat: pictures with normals, classes, boundaries. Effects: reads files.

Pictures are cut to Eigen's crop. Normals are planes fitted to the filled depth; classes need
classMapping40.mat beside the file (894 names to 40, Gupta et al. 2013), and
splits.mat says which pictures train (795) and which judge (654).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_any, resized_by_area, resized_nearest
from pbrs_farm.curate.photographs import NyuMat, Photo
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.tasks.tasks import classes_of
from pbrs_farm.study.training.training_views import ViewArrays
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.truth.boundary import instance_boundary

# Normals of a depth picture by fitting planes, with a mask of where they can be trusted.
# A plane is linear in inverse depth over pixels, 1/z = a u + b v + c, and inverse depth is what a
# structured-light camera measures with equal noise everywhere: its least squares are the right
# ones.


_STEPS: Final = (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)  # samples, of the radius


@dataclass(frozen=True, slots=True)
class PlaneFit:
    """How planes are fitted, and which are trusted."""

    radius: float = 0.0125  # of the window, as a share of the picture's width: 8 pixels of 640
    same_surface: float = 0.03  # a neighbour counts whose depth differs by less than this share
    least_share: float = 0.6  # of the window's samples that must count
    most_residual: float = 0.01  # mean distance from the plane, as a share of depth
    least_cosine: float = 0.15  # between normal and ray: planes seen edge-on are noise


def normals_of_depth(
    depth_m: NDArray[Any], K: F64, fit: PlaneFit | None = None
) -> tuple[F32, Mask]:
    """(H, W, 3) float32 unit normals, x right, y down, z forward, towards the camera; (H, W) trusted.

    depth_m: (H, W) metres along the axis, 0 = unknown. K: (3, 3) pixels, centres at 0.5. Pixels that
    are not trusted hold 0.
    """
    fit = fit or PlaneFit()
    depth = np.asarray(depth_m, np.float64)
    inverse = np.where(depth > 0, 1 / np.where(depth > 0, depth, 1.0), 0.0)
    sums, n_samples = _sums(inverse, fit)
    a, b, c, is_solved = _solved(sums)
    # Turn the plane of the window (u, v from its middle) into one of the camera's space.
    height, width = depth.shape
    u = (np.arange(width) + 0.5 - K[0, 2])[None, :]
    v = (np.arange(height) + 0.5 - K[1, 2])[:, None]
    normal = -np.stack([a * K[0, 0], b * K[1, 1], c - a * u - b * v], -1)
    length = np.linalg.norm(normal, axis=-1)
    normal /= np.maximum(length, 1e-12)[..., None]
    # Trust what many samples lie near to, and what is not seen edge-on.
    count = sums[0]
    residual = np.sqrt(np.maximum(_residual(sums, a, b, c), 0) / np.maximum(count, 1))
    ray = np.stack(np.broadcast_arrays(u / K[0, 0], v / K[1, 1], 1.0), -1)
    cosine = -(normal * ray).sum(-1) / np.linalg.norm(ray, axis=-1)
    trusted = (
        is_solved & (depth > 0) & (count >= fit.least_share * n_samples)
        & (residual * depth <= fit.most_residual) & (cosine >= fit.least_cosine)
    )  # fmt: skip
    return np.asarray(np.where(trusted[..., None], normal, 0), np.float32), trusted


def _sums(inverse: F64, fit: PlaneFit) -> tuple[F64, int]:
    """(10, H, W): count, and sums of u, v, uu, uv, vv, w, uw, vw, ww over each window's own surface."""
    height, width = inverse.shape
    offsets = sorted({round(step * max(fit.radius * width, 2.0)) for step in _STEPS})
    reach = offsets[-1]
    padded = np.pad(inverse, reach)
    sums = np.zeros((10, height, width))
    for v in offsets:
        for u in offsets:
            w = padded[reach + v : reach + v + height, reach + u : reach + u + width]
            # Take neighbours of about the same depth.
            same = (w > 0) & (np.abs(w - inverse) < fit.same_surface * inverse)
            m, mw = same.astype(np.float64), np.where(same, w, 0.0)
            for k, part in enumerate((1, u, v, u * u, u * v, v * v)):
                if part:
                    sums[k] += part * m
            for k, part in enumerate((1, u, v), 6):
                if part:
                    sums[k] += part * mw
            sums[9] += mw * w
    return sums, len(offsets) ** 2


def _solved(sums: F64) -> tuple[F64, F64, F64, Mask]:
    """a, b, c of 1/z = a u + b v + c by Cramer's rule, and where there is one plane."""
    n, u, v, uu, uv, vv, w, uw, vw, _ = sums
    det = uu * (vv * n - v * v) - uv * (uv * n - v * u) + u * (uv * v - vv * u)
    is_solved = det > 1e-6 * np.maximum(n, 1) ** 3
    det = np.where(is_solved, det, 1.0)
    a = (uw * (vv * n - v * v) - uv * (vw * n - v * w) + u * (vw * v - vv * w)) / det
    b = (uu * (vw * n - w * v) - uw * (uv * n - v * u) + u * (uv * w - vw * u)) / det
    c = (uu * (vv * w - v * vw) - uv * (uv * w - vw * u) + uw * (uv * v - vv * u)) / det
    return a, b, c, is_solved


def _residual(sums: F64, a: F64, b: F64, c: F64) -> F64:
    """Sum of squared distances of 1/z from the plane, at its least: ww - a uw - b vw - c w."""
    _, _, _, _, _, _, w, uw, vw, ww = sums
    return np.asarray(ww - a * uw - b * vw - c * w)


# Normals of a photograph's depth, and photographs cut to a plan's form.


PLANE_TRUTH: Final = (
    "planes fitted to depth in windows of 1/40 of the width; mask: at least 60 % of the window on"
    " one surface, within 1 % of its depth, not seen edge-on"
)


DEPTH_TRUTH: Final = "the photograph's own depth along the axis, where it has one"


def photo_truth(photo: Photo, K: F64, plan: TrainingPlan) -> Arrays:
    """What a photograph's depth says, at its own size, in the form of the task's targets."""
    depth_m = photo.depth_mm / np.float64(1000)
    if plan.task == "depth":
        return {"depth": depth_m.astype(np.float32)}
    normal, valid = normals_of_depth(depth_m, K)
    return {"normal": np.rint(normal * 32767).astype(np.int16), "valid": valid}


def framed(rgb: NDArray[np.uint8], plan: TrainingPlan) -> tuple[NDArray[np.uint8], slice, slice]:
    """The middle of a photograph in the plan's form, at the plan's size; the rows and columns taken."""
    height, width = rgb.shape[:2]
    share = plan.width_px / plan.height_px
    new_width = min(width, round(height * share))
    new_height = min(height, round(width / share))
    top, left = (height - new_height) // 2, (width - new_width) // 2
    rows, columns = slice(top, top + new_height), slice(left, left + new_width)
    return resized_by_area(rgb[rows, columns], plan.width_px, plan.height_px), rows, columns


# NYUv2's nyu_depth_v2_labeled.mat.


# Of the colour camera, as the data set's toolbox has it.
_K: Final = np.array([[518.85790, 0, 325.58245], [0, 519.46961, 253.73617], [0, 0, 1]], np.float64)
_CROP: Final = (slice(44, 471), slice(40, 601))  # Eigen's rows and columns
NYU_TRUTHS: Final = {
    "normals": PLANE_TRUTH,
    "depth": DEPTH_TRUTH,
    "segmentation": "classes by classMapping40.mat, where labelled",
    "boundaries": "lines where the instance changes; matched within 0.011 of the diagonal",
}


@dataclass(frozen=True, slots=True, eq=False)
class NyuPicture:
    """A photograph cut to Eigen's crop and a plan's form."""

    id: str  # its number in the file, four digits
    colour: NDArray[np.uint8]  # at the plan's size
    truth: Arrays  # at the photograph's own size, in the form of the task's targets


def nyu_pictures(path: Path, plan: TrainingPlan, split: str) -> Iterator[NyuPicture]:
    """The pictures of a split of splits.mat ("train", "test"), or "all", one by one.

    Raises BadInput for a file that is none, or lacks what the plan's task needs.
    """
    chosen = None if split == "all" else _numbers_of_split(path, split)
    mapping = path.parent / "classMapping40.mat"
    classes = _class_map(mapping) if plan.task == "segmentation" else np.zeros(0, np.uint8)
    n_found = 0
    with NyuMat(path) as mat:
        for photo in mat.photos(chosen):
            n_found += 1
            truth = _truth(path, int(photo.id) - 1, photo, plan, classes)
            colour, rows, columns = framed(photo.rgb[_CROP], plan)
            cut = {key: array[_CROP][rows, columns] for key, array in truth.items()}
            yield NyuPicture(photo.id, colour, cut)
    if not n_found:
        raise BadInput(path, "", f"no {split} picture: splits.mat is of another file")


def has_splits(path: Path) -> bool:
    """splits.mat, which says what trains and what judges, lies beside the .mat."""
    return _splits_of(path).is_file()


def _splits_of(path: Path) -> Path:
    return path.parent / "splits.mat"


def _numbers_of_split(path: Path, split: str) -> set[int]:
    if not has_splits(path):
        hint = "it comes with NYUv2's data set"
        raise BadInput(
            _splits_of(path), "", "needed beside the .mat: it says which train", hint=hint
        )
    # Numbers below 1 are none.
    return {n for n in _numbers(_splits_of(path), f"{split}Ndxs").tolist() if n > 0}


def _truth(
    path: Path, at: int, photo: Photo, plan: TrainingPlan, classes: NDArray[np.uint8]
) -> Arrays:
    """A whole picture's truth in the form of the task's targets."""
    if plan.task in ("normals", "depth"):
        return photo_truth(photo, _K, plan)
    labels = _row(path, "labels", at)
    if plan.task == "segmentation":
        if int(labels.max(initial=0)) >= len(classes):
            raise BadInput(path, f"image {at + 1}", f"label {labels.max()} is beyond the class map")
        return {"labels": classes_of(classes[labels], plan)}
    # An instance is a number within its class.
    instance = labels.astype(np.int64) * 1000 + _row(path, "instances", at)
    return {"edges": instance_boundary(instance) > 0}


def _row(path: Path, table: str, at: int) -> NDArray[Any]:
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return np.asarray(file[table][at]).T
    except (OSError, KeyError, ValueError, RuntimeError):
        raise BadInput(
            path, table, "missing or damaged; is this nyu_depth_v2_labeled.mat?"
        ) from None


def _class_map(path: Path) -> NDArray[np.uint8]:
    """(895,) class 0..40 of each of NYUv2's labels, 0 first."""
    if not path.is_file():
        hint = "from the code of Gupta et al. 2013"
        raise BadInput(path, "", "needed beside the .mat for classes", hint=hint)
    classes = _numbers(path, "mapClass")
    return np.concatenate([[0], classes]).astype(np.uint8)


def _numbers(path: Path, name: str) -> NDArray[np.int64]:
    """A table of whole numbers of a MATLAB 5 file."""
    from scipy.io import loadmat

    try:
        return np.asarray(loadmat(path)[name], np.int64).ravel()
    except Exception:  # noqa: BLE001  scipy raises of many kinds for a file that is none
        raise BadInput(path, name, "not the MATLAB 5 file that was expected") from None


# NYUv2's pictures in memory at a plan's size, to tune on. Effects: reads the .mat.


NYU_HOME = "NYUv2"  # what stands for a home in the ids of its pictures


def nyu_arrays(path: Path, plan: TrainingPlan, split: str) -> ViewArrays:
    """The pictures of a split ("train", "test"), truth by the nearest pixel, lines kept whole.

    Raises BadInput for a file that is none, or has no splits.mat beside it.
    """
    ids, rows = [], []
    for picture in nyu_pictures(path, plan, split):
        ids.append(f"{NYU_HOME}/{picture.id}")
        truth = {name: _resized(name, array, plan) for name, array in picture.truth.items()}
        rows.append({"colour": picture.colour, **truth})
    arrays = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    return ViewArrays(tuple(ids), arrays.pop("colour"), arrays)


def _resized(name: str, array: NDArray[Any], plan: TrainingPlan) -> NDArray[Any]:
    resized = resized_any if name == "edges" else resized_nearest
    return resized(array, plan.width_px, plan.height_px)
