"""Loaders of the forms that training programs read, written from those programs' documentation alone.

Nothing of the package is used here: what a loader gives is held against the stored layers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from PIL import Image


@dataclass
class Example:
    """What a loader gives of one sample."""

    name: str  # of its picture's file
    rgb: np.ndarray  # (H, W, 3) uint8
    target: np.ndarray


def picture(file: Path) -> np.ndarray:
    """A picture as its program opens it; what it must be is asserted by who calls."""
    return np.asarray(Image.open(file))


def pictures_of_yolo(yaml_file: Path, split: str) -> tuple[dict, list[Path]]:
    """data.yaml and the pictures of a split: folders count from `path`, else from the file's own."""
    fields = yaml.safe_load(yaml_file.read_text())
    root = Path(fields.get("path", yaml_file.parent))
    found = sorted((root / fields[split]).iterdir())
    assert found
    return fields, found


def beside(file: Path, folder: str) -> Path:
    """The file of the same place with its last component `images` replaced."""
    parts = list(file.parts)
    at = len(parts) - 1 - parts[::-1].index("images")
    return Path(*parts[:at], folder, *parts[at + 1 :])


def yolo_depth(yaml_file: Path, split: str) -> Iterator[Example]:
    """Metres, 0 and below is invalid: PNG (2D uint16 over depth_scale), else NPY (2D floats)."""
    fields, files = pictures_of_yolo(yaml_file, split)
    assert fields["nc"] == 1
    assert fields["names"] == {0: "depth"}
    for file in files:
        rgb, png = picture(file), beside(file, "depth").with_suffix(".png")
        if png.is_file():
            stored = picture(png)
            assert stored.dtype == np.uint16
            depth = stored / float(fields.get("depth_scale", 1000))
        else:
            depth = np.load(png.with_suffix(".npy"))
            assert np.issubdtype(depth.dtype, np.floating)
        assert depth.shape == rgb.shape[:2]
        yield Example(file.stem, rgb, depth)


def yolo_semantic(yaml_file: Path, split: str) -> Iterator[Example]:
    """Names by pixel, "" where ignored: one channel of numbers of `names`, 255 = ignored."""
    fields, files = pictures_of_yolo(yaml_file, split)
    names = np.array([fields["names"].get(k, "unknown") for k in range(255)] + [""])
    for file in files:
        mask = picture(beside(file, fields["masks_dir"]).with_suffix(".png"))
        assert mask.dtype == np.uint8
        assert mask.ndim == 2
        yield Example(file.stem, picture(file), names[mask])


def marigold(folder: Path, list_file: str) -> Iterator[Example]:
    """Depth in metres from 16-bit PNG of millimetres, or normals from NPY; a line a sample."""
    for line in (folder / list_file).read_text().splitlines():
        rgb_path, path = line.split()
        rgb = picture(folder / rgb_path)
        assert rgb.dtype == np.uint8
        if path.endswith(".npy"):
            yield Example(rgb_path, rgb, np.load(folder / path))
        else:
            stored = picture(folder / path)
            assert stored.dtype == np.uint16
            yield Example(rgb_path, rgb, stored / 1000.0)


def horizonnet(folder: Path) -> Iterator[Example]:
    """Corners (2 N, 2) in pixels of 1024 x 512: odd lines are the ceiling's, even ones the floor's.

    Longitude is ((x + 0.5) / W - 0.5) 2 pi, latitude downwards ((y + 0.5) / H - 0.5) pi.
    """
    for file in sorted((folder / "img").iterdir()):
        rgb = picture(file)
        assert rgb.shape == (512, 1024, 3)
        text = (folder / "label_cor" / f"{file.name[:-4]}.txt").read_text()
        corners = np.array([line.split() for line in text.splitlines() if line.strip()], np.float32)
        assert (corners[0::2, 0] == corners[1::2, 0]).all()
        assert (corners[0::2, 1] < corners[1::2, 1]).all()
        yield Example(file.stem, rgb, corners)
