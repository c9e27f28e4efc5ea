"""An output root of very many views, cheaply: every file is a link to one of a few. Effects: files."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.images import png_from_array

VIEWS_PER_HOUSE: Final = 17  # 779,342 views of 45,622 houses
_MAX_LINKS: Final = 20_000  # of one file; file systems allow 65,000
_ROOMS: Final = ("Kitchen", "Living room", "Bedroom", "Bathroom", "Hall")
_LAYERS: Final = ("opengl_dl", "mlt_ol", "mlt_il_ol")
_N_KINDS: Final = 40  # view.json files that differ


def write_many_views(root: Path, n_views: int) -> int:
    """Write houses of 17 views each until there are n_views; how many houses that took."""
    sources = _Sources(root / ".sources")
    rooms = [{"id": f"0_{k}", "name": name} for k, name in enumerate(_ROOMS)]
    n_houses = -(-n_views // VIEWS_PER_HOUSE)
    for h in range(n_houses):
        house = root / "houses" / f"home-{h:06}"
        (house / "done").mkdir(parents=True)
        (house / "house.json").write_text(json.dumps({"name": f"Home {h}", "rooms": rooms}))
        for v in range(min(VIEWS_PER_HOUSE, n_views - h * VIEWS_PER_HOUSE)):
            folder = house / "views" / f"0_{v % 5}_{v}"
            folder.mkdir(parents=True)
            sources.link(f"{(7 * h + v) % _N_KINDS}.json", folder / "view.json")
            for layer in _LAYERS:
                sources.link("picture.png", folder / f"{layer}.png")
    return n_houses


class _Sources:
    """The files that are linked, written anew before one has too many links."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True)
        self._folder = folder
        self._links: dict[str, int] = {}
        rng = np.random.default_rng(0)
        y, x = np.mgrid[0:480, 0:640]
        smooth = np.stack([x / 640, y / 480, (x + y) / 1120], -1) * 200
        noisy = smooth + rng.normal(0, 3, smooth.shape)
        self._bytes = {"picture.png": png_from_array(noisy.clip(0, 255).astype(np.uint8))}
        for k in range(_N_KINDS):
            self._bytes[f"{k}.json"] = json.dumps(_facts(rng, k)).encode()

    def link(self, name: str, path: Path) -> None:
        """path as another name of a source file."""
        n = self._links.get(name, 0)
        source = self._folder / f"{n // _MAX_LINKS}-{name}"
        if n % _MAX_LINKS == 0:
            source.write_bytes(self._bytes[name])
        os.link(source, path)
        self._links[name] = n + 1


def _facts(rng: np.random.Generator, k: int) -> dict[str, object]:
    """A view.json of 20 to 30 things, one in ten with a warning."""
    classes = rng.integers(1, 41, 25).tolist()
    rows = [
        {"id": i + 1, "nyu40": c, "fraction": 0.04, "box2d": [0, 0, 9, 9], "name": f"thing {i}"}
        for i, c in enumerate(classes)
    ]
    warnings = ["indoor: 3 lx, expected 30 to 1000"] if k % 10 == 0 else []
    return {"instances": rows, "warnings": warnings}
