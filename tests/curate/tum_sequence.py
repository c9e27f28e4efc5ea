"""A sequence in the layout of the TUM RGB-D benchmark, as its tools write it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pbrs_farm.images import png_from_array

HEADS = ("# color images", "# file: 'rgbd_dataset_freiburg1_xyz.bag'", "# timestamp filename")


def write_sequence(
    folder: Path, rgb_s: Sequence[float], depth_s: Sequence[float], *, poses: Sequence[str] = (),
    size: tuple[int, int] = (90, 60), depth_m: float = 2.0,
) -> Path:  # fmt: skip
    """Write pictures at these seconds, depth of a wall straight ahead, and lines of groundtruth.txt."""
    width, height = size
    for name, times in (("rgb", rgb_s), ("depth", depth_s)):
        (folder / name).mkdir(parents=True, exist_ok=True)
        lines = list(HEADS)
        for k, seconds in enumerate(times):
            file = f"{name}/{seconds:.6f}.png"
            if name == "rgb":
                pixels = np.random.default_rng(k).integers(0, 256, (height, width, 3))
                array = pixels.astype(np.uint8)
            else:
                array = np.full((height, width), round(depth_m * 5000) + k, np.uint16)
            (folder / file).write_bytes(png_from_array(array))
            lines.append(f"{seconds:.6f} {file}")
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    if poses:
        heading = "# ground truth trajectory\ntimestamp tx ty tz qx qy qz qw\n"
        (folder / "groundtruth.txt").write_text(heading + "\n".join(poses) + "\n")
    return folder
