"""The layout of the Hypersim data set (Roberts et al. 2021): names of its files, cameras, HDF5, tone.

Effects: read_dataset reads a file. The writer of the layout is
export/forms/hypersim.py, the reader views/hypersim_folder.py.

Its world has z up, its camera's axes are x right, y up, z backward. (u, v) go over the picture from
-1 to 1, v upwards: M_cam_from_uv (u, v, 1) is a ray in camera axes.
"""

from __future__ import annotations

import csv
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import Z_UP_FROM_Y_UP
from pbrs_farm.installation import need

SPLIT_CSV: Final = "metadata_images_split_scene_v1.csv"
CAMERAS_CSV: Final = "metadata_camera_parameters.csv"
WIDTH_PX: Final = 1024
HEIGHT_PX: Final = 768
FOCAL_PX: Final = 886.8100134752651
"""Default of readers that ignore CAMERAS_CSV: 60 degrees across 1024 pixels."""

Z_UP: Final[F64] = Z_UP_FROM_Y_UP[:3, :3]
"""Its world from ours."""

_NEAR, _FAR = 1.0, 1000.0  # of M_proj
_GAMMA: Final = 1 / 2.2  # of its preview
_PERCENTILE: Final = 90  # of brightness, which its preview shows as ...
_SHOWN: Final = 0.8


def frame_file(camera: str, frame: int, folder: str, name: str) -> str:
    """A file of a frame: `images/scene_cam_00_<folder>/frame.0000.<name>`, name with suffix."""
    return f"images/scene_{camera}_{folder}/frame.{frame:04d}.{name}"


def cam_from_uv(i: Intrinsics) -> F64:
    """(3, 3) from (u, v, 1) to a ray of depth 1 in camera axes, of a pin-hole."""
    w, h = i.width_px / 2, i.height_px / 2
    return np.array(
        [[w / i.fx, 0, (w - i.cx) / i.fx], [0, h / i.fy, -(h - i.cy) / i.fy], [0, 0, -1]],
        np.float64,
    )


def projection(i: Intrinsics) -> F64:
    """(4, 4) OpenGL's projection of a pin-hole, columns of camera axes."""
    deep = _FAR - _NEAR
    return np.array(
        [
            [2 * i.fx / i.width_px, 0, 1 - 2 * i.cx / i.width_px, 0],
            [0, 2 * i.fy / i.height_px, 2 * i.cy / i.height_px - 1, 0],
            [0, 0, -(_FAR + _NEAR) / deep, -2 * _FAR * _NEAR / deep],
            [0, 0, -1, 0],
        ],
        np.float64,
    )


def intrinsics_of_uv(matrix: F64, width_px: int, height_px: int) -> Intrinsics | None:
    """The pin-hole of M_cam_from_uv (3, 3) and a size; None of a tilted or sheared projection."""
    m = matrix / -matrix[2, 2]
    off = [m[0, 1], m[1, 0], m[2, 0], m[2, 1]]
    if not np.isfinite(m).all() or np.abs(off).max() > 1e-6 or min(m[0, 0], m[1, 1]) <= 0:
        return None
    w, h = width_px / 2, height_px / 2
    fx, fy = float(w / m[0, 0]), float(h / m[1, 1])
    return Intrinsics(width_px, height_px, fx, fy, float(w - m[0, 2] * fx), float(h + m[1, 2] * fy))


def usual_intrinsics(width_px: int, height_px: int) -> Intrinsics:
    """The camera that readers assume: 60 degrees across, square pixels, the middle."""
    return Intrinsics.from_hfov(width_px, height_px, np.pi / 3)


def ray_lengths(i: Intrinsics) -> F64:
    """(H, W) the length of each pixel's ray of depth 1: depth along the ray over planar depth."""
    x = (np.arange(i.width_px) + 0.5 - i.cx) / i.fx
    y = (np.arange(i.height_px) + 0.5 - i.cy) / i.fy
    return np.asarray(np.sqrt(1 + x[None, :] ** 2 + y[:, None] ** 2))


def signed_ids(ids: NDArray[Any]) -> NDArray[Any]:
    """Ids with -1 for 0, as int16 if all fit and as int32 otherwise.

    >>> signed_ids(np.array([0, 40000], np.uint16))
    array([   -1, 40000], dtype=int32)
    """
    dtype = np.int16 if int(ids.max(initial=0)) <= np.iinfo(np.int16).max else np.int32
    return np.where(ids > 0, ids.astype(dtype), dtype(-1))


def preview(colour: F32, has_surface: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 by Hypersim's tone mapping: a tenth of the pixels with a surface above 0.8."""
    brightness = (colour @ np.array([0.3, 0.59, 0.11], np.float32))[has_surface]
    scale, now = 1.0, float(np.percentile(brightness, _PERCENTILE)) if brightness.size else 0.0
    if brightness.size:
        scale = _SHOWN ** (1 / _GAMMA) / now if now >= 1e-4 else 0.0
    shown = np.clip(np.maximum(scale * colour.astype(np.float64), 0) ** _GAMMA, 0, 1)
    return np.rint(255 * shown).astype(np.uint8)


def table_rows(file: Path) -> list[dict[str, str]]:
    """The rows of one of its tables; [] without the file."""
    if not file.is_file():
        return []
    with file.open(encoding="utf-8", newline="") as opened:
        return list(csv.DictReader(opened))


def dataset_bytes(array: NDArray[Any]) -> bytes:
    """An HDF5 file of one compressed data set, `dataset`. Raises MachineFailed without h5py."""
    data = BytesIO()
    need("h5py")
    import h5py

    with h5py.File(data, "w") as opened:
        opened.create_dataset("dataset", data=array, compression="gzip")
    return data.getvalue()


def read_dataset(file: Path) -> NDArray[Any]:
    """The array of an HDF5 file's `dataset`; BadInput without one, MachineFailed without h5py."""
    need("h5py")
    import h5py

    try:
        with h5py.File(file, "r") as opened:
            return np.asarray(opened["dataset"][...])
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise BadInput(file, "dataset", f"is not a data set of HDF5: {error}"[:200]) from None
