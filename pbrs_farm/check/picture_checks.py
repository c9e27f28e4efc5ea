"""Edges of OpenGL pictures against those of labels, and histograms, by docs/formats/layer_rules.md; reads files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.stored_files import BadFile, stored_object
from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.house import ItemKind

_MODES = ("mlt_il_ol", "mlt_ol", "opengl_il", "opengl_dl")
_MIN_EDGE_PX = 40  # of boundaries that comparing edges needs
_SHIFT_PX = 3  # by which a picture is moved to see whether it fits better
_RUN_PX = 4  # of an outline: pixels of a straight edge say the same
_MOVES = {
    "right": (0, _SHIFT_PX), "left": (0, -_SHIFT_PX), "bottom": (_SHIFT_PX, 0), "top": (-_SHIFT_PX, 0),
}  # fmt: skip


def check_edges(case: ViewCase) -> None:
    """The edges of OpenGL pictures fit the instances better than any mirrored, turned or shifted copy does."""
    outline = _outline(case.arrays["instance"])
    for mode in ("opengl_dl", "opengl_il"):
        if mode not in case.arrays:
            continue
        n_edge = int(outline.sum())
        if n_edge < _MIN_EDGE_PX:
            case.tally.note(f"{case.place}/{mode}.png has too few edges to compare")
            continue
        edges = _steps(case.arrays[mode])
        copies = moved_copies(edges)
        for side, step in _MOVES.items():
            copies[f"{_SHIFT_PX} px more to the {side}"] = np.roll(edges, step, (0, 1))
        as_stored = _fit(outline, edges)
        # The standard error of a correlation of so many independent edges.
        by_chance = (_RUN_PX / n_edge) ** 0.5
        for name, copy in copies.items():
            fit = _fit(outline, copy)
            fault = f"fits the instances better {name} ({fit:.3f}) than as stored ({as_stored:.3f})"
            case.expect("opengl edges", f"{mode}.png")(fit <= as_stored + by_chance, fault)


def moved_copies(picture: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """A picture mirrored, upside down and turned, by these names."""
    return {
        "mirrored": picture[:, ::-1],
        "upside down": picture[::-1],
        "turned": picture[::-1, ::-1],
    }


def _outline(instance: NDArray[Any]) -> Bools:
    """(H, W) pixels beside another instance."""
    cross = ndimage.generate_binary_structure(2, 1)
    most, least = (
        f(instance, footprint=cross) for f in (ndimage.maximum_filter, ndimage.minimum_filter)
    )
    return np.asarray(most != least, bool)


def _steps(picture: NDArray[Any]) -> F64:
    """(H, W) change of a picture around each pixel, compressed so that no edge outweighs the others."""
    grey = picture.astype(float).mean(axis=-1)
    across = np.abs(np.diff(grey, axis=1, prepend=grey[:, :1]))
    down = np.abs(np.diff(grey, axis=0, prepend=grey[:1]))
    return np.asarray(np.sqrt(np.maximum(across, down)))


def _fit(outline: Bools, edges: F64) -> float:
    """Correlation of outlines with edges; 0 if either is flat."""
    if outline.all() or not outline.any() or np.ptp(edges) == 0:
        return 0.0
    return float(np.corrcoef(outline.reshape(-1).astype(float), edges.reshape(-1))[0, 1])


def check_histogram(case: ViewCase) -> None:
    """Count the view's histograms and quality numbers again, each expected separately."""
    place = f"{case.place}/histogram.json"
    try:
        stored = stored_object(case.view.folder / "histogram.json")
        numbers = _compare(case, stored) | _compare_home(case, stored)
    except (BadFile, KeyError, TypeError, ValueError, IndexError) as error:
        case.tally.expect("histogram", place, False, f"cannot be read: {error}")
        return
    for name, same in numbers.items():
        case.tally.expect("histogram", place, same, f"{name} is not that of the pictures")


def _compare(case: ViewCase, stored: dict[str, Any]) -> dict[str, bool]:
    """Number of histogram.json -> it is right."""
    view, arrays = case.view, case.arrays
    settings, same = stored["settings"], {}
    same["format"] = stored["format"] == "pbrs_farm histogram 1"
    place = stored["house"], stored["view"], stored["room"]
    same["place"] = place == tuple(view.table[k] for k in ("house", "view", "room"))
    sizes = {row["size"] for row in stored["colour"].values()}
    same["sizes"] = stored["depth"]["size"] == settings["depth_bins"]
    same["sizes"] &= sizes <= {settings["colour_bins"] ** 3}
    if view.recipe is not None:
        same["settings"] = settings == view.recipe.histogram.model_dump(mode="json")
    modes = [m for m in _MODES if m in arrays]
    counted = ["mlt_il_ol"] if "mlt_il_ol" in modes else modes
    same["modes"] = set(stored["picture"]) == set(modes) and set(stored["colour"]) == set(counted)
    for mode in counted:
        same[f"colour of {mode}"] = _same_colours(arrays[mode], stored["colour"][mode], settings)
    # Depth: equal bins between the ends, unknown left out.
    mm = arrays["depth"][arrays["depth"] > 0].astype(float)
    low, high, n = (settings[k] for k in ("depth_min_m", "depth_max_m", "depth_bins"))
    bins = np.clip(np.floor((mm - low * 1000) * (n / (high * 1000 - low * 1000))), 0, n - 1)
    counts = np.bincount(bins.astype(int), minlength=n)
    same["depth"] = bool((_dense(stored["depth"]) == counts).all())
    for mode in modes:
        picture, numbers = arrays[mode], stored["picture"][mode]
        luma = np.floor(picture[::2, ::2].astype(float) @ [54, 183, 19] / 256)
        median = np.sort(luma.reshape(-1))[(luma.size + 1) // 2 - 1]
        blown = float((picture.max(axis=-1) >= 254).mean())
        same[f"brightness of {mode}"] = abs(numbers["brightness"] - median / 255) < 1e-4
        same[f"share blown of {mode}"] = abs(numbers["blown"] - blown) < 1e-4
    return same | _compare_scene(case, stored["scene"], settings)


def _compare_home(case: ViewCase, stored: dict[str, Any]) -> dict[str, bool]:
    """The room's name, and the number of the home's missing pictures."""
    house = case.house.house
    if not house:
        return {}
    names = {room["id"]: room["name"] for room in house["rooms"]}
    lacking = sum(n["kind"] in ("missing-texture", "unreadable-texture") for n in house["notes"])
    return {
        "room_type": stored["room_type"] == names.get(stored["room"], ""),
        "missing_textures": stored["scene"]["missing_textures"] == lacking,
    }


def _same_colours(picture: NDArray[Any], stored: dict[str, Any], settings: dict[str, Any]) -> bool:
    n = int(settings["colour_bins"])
    rgb = picture.astype(float)
    slack = 0
    if settings["colour_space"] == "ycbcr":
        # BT.601 of full range; its rounding puts a few pixels into the next bin.
        y = rgb @ [0.299, 0.587, 0.114]
        chroma = [128 + (rgb[..., 2] - y) / 1.772, 128 + (rgb[..., 0] - y) / 1.402]
        rgb = np.clip(np.rint(np.stack([y, *chroma], axis=-1)), 0, 255)
        slack = int(0.02 * picture[..., 0].size)
    cell = np.floor(rgb * n / 256).astype(int)
    index = (cell[..., 0] * n + cell[..., 1]) * n + cell[..., 2]
    counts = np.bincount(index.reshape(-1), minlength=n**3)
    return int(np.abs(_dense(stored) - counts).sum()) <= slack


def _dense(stored: dict[str, Any]) -> I64:
    counts = np.zeros(int(stored["size"]), np.int64)
    counts[np.array(stored["bins"], np.int64)] = stored["counts"]
    return counts


def _compare_scene(
    case: ViewCase, scene: dict[str, Any], settings: Mapping[str, Any]
) -> dict[str, bool]:
    """Number of the histogram's "scene" -> it is right."""
    rows, depth = case.view.table["instances"], case.arrays["depth"]
    objects = [r for r in rows if not ItemKind(r["kind"]).is_structure]
    near = float(((depth > 0) & (depth < settings["near_m"] * 1000)).mean())
    surface = max((float(row["fraction"]) for row in rows), default=0.0)
    n_objects = sum(r["fraction"] >= settings["object_fraction"] for r in objects)
    classes: dict[str, float] = {}
    for row in rows:
        if row["nyu40"] > 0:
            key = str(row["nyu40"])
            classes[key] = classes.get(key, 0.0) + float(row["fraction"])
    noise = case.view.table.get("modes", {}).get("light", {}).get("noise")
    noise = noise.get("sum") if isinstance(noise, dict) else noise
    same_classes = scene["classes"].keys() == classes.keys()
    return {
        "surface": abs(scene["surface"] - surface) < 1e-4,
        "near": abs(scene["near"] - near) < 1e-4,
        "n_objects": scene["n_objects"] == n_objects,
        "classes": same_classes
        and all(abs(scene["classes"][k] - v) < 1e-3 for k, v in classes.items()),
        "noise": (noise is None) == (scene["noise"] is None)
        and (noise is None or abs(scene["noise"] - noise) < 1e-4),
    }


CHECKS = (
    Check("opengl edges", "view", check_edges, 60, ("opengl_dl", "opengl_il")),
    Check("histogram", "view", check_histogram, 70, ("histogram.json",)),
)
