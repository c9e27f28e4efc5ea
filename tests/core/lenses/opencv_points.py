"""Points that OpenCV projected, in opencv_points.csv, and how far this package is from them."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.core.lenses import lens_of_opencv


def error_px() -> tuple[float, float]:
    """Largest distance in px from OpenCV's pixels, and of points found again from those pixels."""
    lines = Path(__file__).with_name("opencv_points.csv").read_text().splitlines()
    projecting, returning = 0.0, 0.0
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        lens = lens_of_opencv([float(number) for number in row["distortion"].split()])
        camera = Intrinsics(640, 480, 500.0, 510.0, 320.0, 240.0, lens)
        x, y, u, v = (float(row[name]) for name in "xyuv")
        there = camera.pixels(np.array([[x, y, 1.0]]))[0] - [u, v]
        back = (camera.directions(np.array([[u, v]]))[0, :2] - [x, y]) * [500, 510]
        projecting = max(projecting, float(np.abs(there).max()))
        returning = max(returning, float(np.abs(back).max()))
    return projecting, returning
