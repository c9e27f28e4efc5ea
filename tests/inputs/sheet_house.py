"""A house of an output root with views of plain colours."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from pbrs_farm import images


def write_view(
    folder: Path, *, without: tuple[str, ...] = (), size: tuple[int, int] = (60, 80)
) -> None:
    rng = np.random.default_rng(3)
    folder.mkdir(parents=True)
    h, w = size
    rows = np.arange(h)[:, None] + np.zeros((1, w), int)
    layers = {
        "depth": (1000 + 40 * rows).astype(np.uint16),
        "normal": np.full((h, w, 3), 40000, np.uint16),
        "semantic": np.where(rows < h // 2, 1, 2).astype(np.uint8),
        "instance": np.where(rows < h // 2, 7, 300).astype(np.uint16),
        "boundary": np.where(rows == h // 2, 255, 0).astype(np.uint8),
    }
    for mode in ("opengl_dl", "opengl_il", "mlt_ol", "mlt_il_ol"):
        layers[mode] = rng.integers(0, 255, (h, w, 3), np.uint8)
    for name, pixels in layers.items():
        if name not in without:
            (folder / f"{name}.png").write_bytes(images.png_from_array(pixels))
    (folder / "view.json").write_text(json.dumps({"room": folder.name.rpartition("_")[0]}))


def write_house(root: Path, house: str, views: tuple[str, ...], attribution: str = "") -> Path:
    folder = root / "houses" / house
    folder.mkdir(parents=True)
    rooms = [{"id": "0_0", "name": "Kitchen & <bar>"}, {"id": "0_1", "name": ""}]
    facts = {"name": f"Home {house}", "rooms": rooms, "source": {"attribution": attribution}}
    (folder / "house.json").write_text(json.dumps(facts))
    for view in views:
        write_view(folder / "views" / view)
    return folder
