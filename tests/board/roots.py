"""Output roots for the board, built in code: pictures, labels, light and facts of a few views."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.layer_file import layer_bytes
from pbrs_farm.formats.radiance_exr import radiance_exr
from pbrs_farm.formats.serialise import json_bytes

WIDTH, HEIGHT = 48, 36


def write_root(folder: Path, houses: dict[str, tuple[str, ...]], **facts: Any) -> Path:
    """A root of houses with their views; facts go into every house.json."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recipe.json").write_bytes(json_bytes(recipe_from_name("preview")))
    for house, views in houses.items():
        write_house(folder, house, views, **facts)
    return folder


def write_house(root: Path, house: str, views: tuple[str, ...], **facts: Any) -> None:
    """A house with two rooms, 0_0 Kitchen and 0_1 Bath."""
    folder = root / "houses" / house
    folder.mkdir(parents=True)
    rooms = [{"id": "0_0", "name": "Kitchen", "types": ["kitchen"]}, {"id": "0_1", "name": "Bath"}]
    described = {"name": f"Home {house}", "rooms": rooms, "source": {"attribution": "by A. Person"}}
    (folder / "house.json").write_text(json.dumps(described | facts))
    for view in views:
        write_view(folder / "views" / view)
    (folder / "done").mkdir()


def write_view(folder: Path, *, lamps: int = 2, **facts: Any) -> None:
    """A view: four modes, labels, light of two groups and of each lamp, view.json."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(len(folder.name))
    for name, pixels in label_arrays().items():
        (folder / f"{name}.png").write_bytes(layer_bytes(name, pixels))
    for mode in ("opengl_dl", "opengl_il", "mlt_ol", "mlt_il_ol"):
        noise = rng.integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
        (folder / f"{mode}.png").write_bytes(layer_bytes(mode, noise))
    (folder / "radiance.exr").write_bytes(radiance_exr(light_images(lamps)))
    place = {"house": folder.parents[1].name, "view": folder.name}
    (folder / "view.json").write_text(json.dumps(view_facts(folder.name, lamps) | place | facts))


def label_arrays() -> dict[str, np.ndarray]:
    """The labels of a wall above a chair: instance 7 over 300."""
    rows = np.arange(HEIGHT)[:, None] + np.zeros((1, WIDTH), int)
    is_above = rows < HEIGHT // 2
    return {
        "depth": (1000 + 10 * rows).astype(np.uint16),
        "normal": np.full((HEIGHT, WIDTH, 3), (32768, 0, 32768), np.uint16),
        "semantic": np.where(is_above, 1, 5).astype(np.uint8),
        "instance": np.where(is_above, 7, 300).astype(np.uint16),
        "boundary": np.where(rows == HEIGHT // 2, 255, 0).astype(np.uint8),
        "valid": np.full((HEIGHT, WIDTH), 255, np.uint8),
    }


def light_images(lamps: int) -> dict[str, np.ndarray]:
    """The images of a radiance.exr: smooth light with bright spots; indoor is the lamps' sum."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32) / HEIGHT
    white = np.ones(3, np.float32)
    outdoor = (0.4 + 0.3 * y)[..., None] * np.float32([0.8, 0.95, 1.2])
    images = {
        f"lamp{k + 1}": (0.02 + np.exp(-20 * ((x - 0.3 * k - 0.2) ** 2 + (y - 0.3) ** 2)))[
            ..., None
        ]
        * np.float32([9.0, 6.0, 3.0])
        for k in range(lamps)
    }
    indoor = sum(images.values(), np.zeros((HEIGHT, WIDTH, 3), np.float32))
    albedo = (0.3 + 0.4 * x)[..., None].clip(0, 1) * white
    normal = np.zeros((HEIGHT, WIDTH, 3), np.float32) + np.float32([0, 1, 0])
    return {"outdoor": outdoor, "indoor": indoor, "albedo": albedo, "normal": normal, **images}


def view_facts(view: str, lamps: int) -> dict[str, Any]:
    """Content of view.json."""
    rows = [
        {"number": k + 1, "item": f"piece_{k}", "name": f"lamp {k}", "room": "0_0", "lm": 800.0,
         "share": 1 / lamps, "layer": f"lamp{k + 1}", "instance": k + 1}
        for k in range(lamps)
    ]  # fmt: skip
    return {
        "room": view.rpartition("_")[0],
        "sector": 0,
        "width_px": WIDTH,
        "height_px": HEIGHT,
        "instances": [
            {"id": 7, "name": "Wall", "class": "wall", "nyu40": 1, "fraction": 0.5,
             "visible_fraction": 0.9, "truncated": True, "box2d": [0, 0, WIDTH, HEIGHT // 2]},
            {"id": 300, "name": "Chair", "class": "chair", "nyu40": 5, "fraction": 0.5,
             "visible_fraction": 1.0, "truncated": False,
             "box2d": [0, HEIGHT // 2, WIDTH, HEIGHT]},
        ],
        "warnings": [],
        "modes": {"light": {"lamps": rows, "spp": 4}, "develop": {"denoised": False}},
    }  # fmt: skip
