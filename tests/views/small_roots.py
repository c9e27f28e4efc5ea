"""Finished output roots of small views without rendering: one surface, random colours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from pbrs_farm.images import png_from_array
from pbrs_farm.store import Store

SIZE = (16, 12)  # width, height
MODES = ("opengl_dl", "mlt_il_ol")


def arrays_of_view(seed: int, size: tuple[int, int] = SIZE) -> dict[str, np.ndarray]:
    """The stored arrays of one view, by file: slanted normals, some pixels invalid."""
    width, height = size
    rng = np.random.default_rng(seed)
    n = rng.normal(size=(height, width, 3))
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    valid = rng.random((height, width)) > 0.1
    normal = np.where(valid[..., None], np.rint((n + 1) * 65535 / 2), 32768).astype(np.uint16)
    instance = (rng.integers(0, 3, (height, width)) * 300).astype(np.uint16)
    arrays: dict[str, Any] = {
        "normal.png": normal,
        "valid.png": (valid * 255).astype(np.uint8),
        "depth.png": rng.integers(500, 9000, (height, width)).astype(np.uint16),
        "semantic.png": rng.integers(0, 41, (height, width)).astype(np.uint8),
        "instance.png": instance,
        "boundary.png": (rng.random((height, width)) > 0.8).astype(np.uint8) * np.uint8(255),
    }
    for mode in MODES:
        arrays[f"{mode}.png"] = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
    return arrays


def table_of_view(house: str, view: str, size: tuple[int, int] = SIZE) -> dict[str, object]:
    """view.json's camera."""
    width, height = size
    k = [[0.8 * width, 0, 0.5 * width], [0, 0.8 * width, 0.45 * height], [0, 0, 1]]
    return {
        "house": house, "view": view, "room": view.rpartition("_")[0],
        "width_px": width, "height_px": height, "K": k,
        "world_from_camera_opencv": np.eye(4).tolist(), "instances": [],
    }  # fmt: skip


def fill(store: Store, houses: dict[str, int], size: tuple[int, int] = SIZE) -> None:
    """Put views `0_0_<k>` of each house into store; houses: id -> number of views."""
    for number, (house, n_views) in enumerate(houses.items()):
        for k in range(n_views):
            view = f"0_0_{k}"
            folder = f"houses/{house}/views/{view}"
            for file, array in arrays_of_view(1000 * number + k, size).items():
                store.put(f"{folder}/{file}", png_from_array(array))
            row = table_of_view(house, view, size)
            store.put(f"{folder}/view.json", json.dumps(row).encode())
        plain = {"source": {"attribution": f"home {house}: a person"}}
        store.put(f"houses/{house}/house.json", json.dumps(plain).encode())


def remove(root: Path, name: str) -> None:
    """Remove a file of a root in a folder."""
    (root / name).unlink()
