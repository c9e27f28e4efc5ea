"""Pictures against what they were made of: light developed again, edges of labels, histograms.

Effects: reads files. Formulas are written again here from docs/formats/layer_rules.md and the sources named;
only the denoiser is the same program, since nothing else gives its values.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats
from pbrs_farm.check.stored_files import BadFile, stored_object
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.house import ItemKind

MODES = ("mlt_il_ol", "mlt_ol", "opengl_il", "opengl_dl")
_MIN_EDGE_PX = 40  # of boundaries that comparing edges needs
_SHIFT_PX = 3  # by which a picture is moved to see whether it fits better there
_FIT = 0.01  # of correlation: by chance
_MOVES = {
    "right": (0, _SHIFT_PX), "left": (0, -_SHIFT_PX), "bottom": (_SHIFT_PX, 0), "top": (-_SHIFT_PX, 0),
}  # fmt: skip


def check_edges(view: StoredView, arrays: Mapping[str, NDArray[Any]], tally: Tally) -> None:
    """The edges of the OpenGL pictures lie on those of the instances, and nowhere better than as stored.

    Mirrored, turned and shifted copies must not fit better: this finds pictures of another camera,
    not small errors. A view with few edges is a note and not counted.
    """
    outline = _outline(arrays["instance"])
    n = int(outline.sum())
    for mode in ("opengl_dl", "opengl_il"):
        if mode not in arrays:
            continue
        if n < _MIN_EDGE_PX:
            tally.note(f"{view.place}/{mode}.png has too few edges to compare")
            continue
        edges = _steps(arrays[mode])
        others = {
            "mirrored": edges[:, ::-1],
            "upside down": edges[::-1],
            "turned": edges[::-1, ::-1],
        }
        for where, step in _MOVES.items():
            others[f"{_SHIFT_PX} px more to the {where}"] = np.roll(edges, step, (0, 1))
        own = _fit(outline, edges)
        for what, moved in others.items():
            fit = _fit(outline, moved)
            text = f"fits the instances better {what} ({fit:.3f}) than as it is ({own:.3f})"
            tally.expect("opengl edges", f"{view.place}/{mode}.png", fit <= own + _FIT, text)


def _outline(instance: NDArray[Any]) -> NDArray[np.bool_]:
    """(H, W) pixels beside another instance."""
    outline = np.zeros(instance.shape, bool)
    across, down = instance[:, 1:] != instance[:, :-1], instance[1:] != instance[:-1]
    outline[:, 1:] |= across
    outline[:, :-1] |= across
    outline[1:] |= down
    outline[:-1] |= down
    return outline


def _steps(picture: NDArray[Any]) -> Floats:
    """(H, W) how much a picture changes about each pixel, compressed so that no edge outweighs all."""
    grey = picture.astype(float).mean(axis=-1)
    across = np.abs(np.diff(grey, axis=1, prepend=grey[:, :1]))
    down = np.abs(np.diff(grey, axis=0, prepend=grey[:1]))
    return np.asarray(np.sqrt(np.maximum(across, down)))


def _fit(outline: NDArray[np.bool_], edges: Floats) -> float:
    """Correlation of outlines with edges; 0 where either is flat."""
    if outline.all() or not outline.any() or np.ptp(edges) == 0:
        return 0.0
    return float(np.corrcoef(outline.reshape(-1).astype(float), edges.reshape(-1))[0, 1])


def check_histogram(
    view: StoredView, arrays: Mapping[str, NDArray[Any]], house: Mapping[str, Any], tally: Tally
) -> None:
    """Count the view's histograms and quality numbers again, where it has them.

    Each number of the file is expected on its own, so that the certificate names which one differs.
    house: house.json, which knows rooms by name and which textures were missing.
    """
    if not view.has("histogram.json"):
        return
    place = f"{view.place}/histogram.json"
    try:
        stored = stored_object(view.folder / "histogram.json")
        differing = _differing(view, arrays, stored) | _same_home(stored, house)
    except (BadFile, KeyError, TypeError, ValueError, IndexError) as error:
        tally.expect("histogram", place, False, f"cannot be read: {error}")
        return
    for name, same in differing.items():
        tally.expect("histogram", place, same, f"{name} is not that of the pictures")


def _differing(
    view: StoredView, arrays: Mapping[str, NDArray[Any]], stored: dict[str, Any]
) -> dict[str, bool]:
    """Number of histogram.json -> whether it is right."""
    settings, same = stored["settings"], {}
    same["format"] = stored["format"] == "pbrs_farm histogram 1"
    named = stored["house"], stored["view"], stored["room"]
    same["place"] = named == tuple(view.table[k] for k in ("house", "view", "room"))
    sizes = stored["depth"]["size"], {row["size"] for row in stored["colour"].values()}
    same["sizes"] = sizes[0] == settings["depth_bins"] and sizes[1] <= {
        settings["colour_bins"] ** 3
    }
    if view.recipe is not None:
        same["settings"] = settings == view.recipe.histogram.model_dump(mode="json")
    modes = [m for m in MODES if m in arrays]
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
        picture, written = arrays[mode], stored["picture"][mode]
        luma = np.floor(picture[::2, ::2].astype(float) @ [54, 183, 19] / 256)
        median = np.sort(luma.reshape(-1))[(luma.size + 1) // 2 - 1]
        blown = float((picture.max(axis=-1) >= 254).mean())
        same[f"brightness of {mode}"] = abs(written["brightness"] - median / 255) < 1e-4
        same[f"share blown of {mode}"] = abs(written["blown"] - blown) < 1e-4
    return same | _same_scene(view, arrays["depth"], stored["scene"], settings)


def _same_home(stored: dict[str, Any], house: Mapping[str, Any]) -> dict[str, bool]:
    """The room's name, and how many pictures the home lacked."""
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
        rgb = np.stack(
            [y, 128 + (rgb[..., 2] - y) / 1.772, 128 + (rgb[..., 0] - y) / 1.402], axis=-1
        )
        rgb = np.clip(np.rint(rgb), 0, 255)
        slack = int(0.02 * picture[..., 0].size)
    place = np.floor(rgb * n / 256).astype(int)
    index = (place[..., 0] * n + place[..., 1]) * n + place[..., 2]
    counts = np.bincount(index.reshape(-1), minlength=n**3)
    return int(np.abs(_dense(stored) - counts).sum()) <= slack


def _dense(stored: dict[str, Any]) -> NDArray[np.int64]:
    counts = np.zeros(int(stored["size"]), np.int64)
    counts[np.array(stored["bins"], np.int64)] = stored["counts"]
    return counts


def _same_scene(
    view: StoredView, depth: NDArray[Any], scene: dict[str, Any], settings: dict[str, Any]
) -> dict[str, bool]:
    rows = view.table["instances"]
    shares = [float(row["fraction"]) for row in rows]
    things = [r for r in rows if not ItemKind(r["kind"]).is_structure]
    n_objects = sum(r["fraction"] >= settings["object_fraction"] for r in things)
    near = float(((depth > 0) & (depth < settings["near_m"] * 1000)).mean())
    classes: dict[str, float] = {}
    for row in rows:
        if row["nyu40"] > 0:
            key = str(row["nyu40"])
            classes[key] = classes.get(key, 0.0) + float(row["fraction"])
    written = scene["classes"]
    noise = view.table.get("modes", {}).get("light", {}).get("noise")
    noise = noise.get("sum") if isinstance(noise, dict) else noise
    return {
        "surface": abs(scene["surface"] - max(shares, default=0.0)) < 1e-4,
        "near": abs(scene["near"] - near) < 1e-4,
        "n_objects": scene["n_objects"] == n_objects,
        "classes": written.keys() == classes.keys()
        and all(abs(written[k] - v) < 1e-3 for k, v in classes.items()),
        "noise": (noise is None) == (scene["noise"] is None)
        and (noise is None or abs(scene["noise"] - noise) < 1e-4),
    }
