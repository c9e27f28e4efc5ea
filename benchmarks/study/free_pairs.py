"""Photographs with depth that anyone may fetch: a desk of TUM RGB-D, Middlebury's Motorcycle and Aloe.

The desk is in this repository (desk/README.md), the garage in a wheel of scikit-image, the plant in
Debian's opencv-doc. Three rooms are too few for a statistic; they show large effects of a change only.
Effects: pip and apt, ~/.cache.
"""

from __future__ import annotations

import io
import json
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.assets.debian import cache_folder, fetched_deb
from pbrs_farm.core.resampling import resized_by_area
from pbrs_farm.images import array_from_png, decode_photo, png_from_array

FOLDER: Final = cache_folder() / "free_pairs"
_DESK: Final = Path(__file__).with_name("desk")
_WHEEL: Final = (
    "scikit-image==0.16.2",
    "--python-version",
    "38",
    "--platform",
    "manylinux1_x86_64",
)
_DEB: Final = ("opencv-doc", "4.6.0+dfsg-12")
_PLANT: Final = "usr/share/doc/opencv-doc/examples/data/"


def free_pairs() -> Path:
    """The folder of the three rooms, one folder each; fetched the first time (26 and 96 MB, 4 kept)."""
    for name, write in (("desk", _write_desk), ("garage", _write_garage), ("plant", _write_plant)):
        if not (FOLDER / name).is_dir():
            FOLDER.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=FOLDER.parent) as scratch:
                write(Path(scratch))
                shutil.copytree(scratch, FOLDER / name)
    return FOLDER


def _write_desk(out: Path) -> None:
    shutil.copytree(_DESK, out, dirs_exist_ok=True)


def _write_garage(out: Path) -> None:
    """Middlebury 2014 at a quarter of its size (Scharstein et al. 2014)."""
    with tempfile.TemporaryDirectory() as scratch:
        words = ["download", "-q", "--no-deps", "--only-binary", ":all:", *_WHEEL, "-d", scratch]
        subprocess.run([sys.executable, "-m", "pip", *words], check=True)
        with zipfile.ZipFile(next(Path(scratch).glob("*.whl"))) as wheel:
            picture = wheel.read("skimage/data/motorcycle_left.png")
            disparity = np.load(io.BytesIO(wheel.read("skimage/data/motorcycle_disp.npz")))["arr_0"]
    disparity = np.where(np.isfinite(disparity), disparity, 0)
    (out / "motorcycle_rgb.png").write_bytes(picture)
    _write_depth(out / "motorcycle_depth.npy", disparity, 0.193001, 994.978, 31.086)
    _write_camera(out, 994.978, 311.193, 254.877)


def _write_plant(out: Path) -> None:
    """Middlebury 2006 (Scharstein and Pal 2007), halved to the size of the others; disparities begin at 270."""
    files = fetched_deb(*_DEB).members(lambda name: name.startswith(f"{_PLANT}aloe"))
    colour = decode_photo(files[f"{_PLANT}aloeL.jpg"], "aloeL.jpg")
    disparity = array_from_png(files[f"{_PLANT}aloeGT.png"], "aloeGT.png")[::2, ::2]
    height, width = disparity.shape
    (out / "aloe_rgb.png").write_bytes(png_from_array(resized_by_area(colour, width, height)))
    _write_depth(out / "aloe_depth.npy", disparity, 0.16, 3740.0, 270.0)
    _write_camera(out, 3740.0 / 2, width / 2, height / 2)


def _write_depth(
    path: Path, disparity: NDArray[np.generic], baseline_m: float, focal_px: float, offset: float
) -> None:
    """Depth in metres from disparity, 0 where the disparity is unknown."""
    shift = disparity.astype(np.float64)
    depth = np.where(shift > 0, baseline_m * focal_px / (shift + offset), 0)
    np.save(path, depth.astype(np.float32))


def _write_camera(out: Path, focal_px: float, cx: float, cy: float) -> None:
    camera = {"fx": focal_px, "fy": focal_px, "cx": cx, "cy": cy}
    (out / "intrinsics.json").write_text(json.dumps(camera) + "\n")
