"""Frames of a ScanNet scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrs_farm.images import jpeg_from_array, png_from_array


def write_scene(scene: Path, camera_file: str, *, label: bool = True) -> None:
    """A frame of ScanNet: a larger picture, depth of a wall 2 m away in mm, NYU40 labels."""
    for name in ("color", "depth", "label", camera_file.rpartition("/")[0]):
        (scene / name).mkdir(parents=True, exist_ok=True)
    picture = np.zeros((968, 1296, 3), np.uint8)
    picture[:, 648:] = 200
    (scene / "color/000100.jpg").write_bytes(jpeg_from_array(picture))
    depth = np.full((480, 640), 2000, np.uint16)
    (scene / "depth/000100.png").write_bytes(png_from_array(depth))
    if label:
        ids = np.full((480, 640), 1, np.uint8)
        ids[:, 320:] = 5
        (scene / "label/000100.png").write_bytes(png_from_array(ids))
    rows = "577.87 0 319.5 0\n0 577.87 239.5 0\n0 0 1 0\n0 0 0 1\n"
    (scene / camera_file).write_text(rows)
