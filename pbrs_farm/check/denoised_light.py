"""Light of radiance.exr, denoised again by the stages' denoiser where the recipe says; loads the denoiser."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from pbrs_farm.check.cases import Channels
from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.colours import has_channels, rgb_of
from pbrs_farm.check.developing import halved
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F32

Planes = dict[str, F32]  # outdoor, indoor, albedo and normal, each (H, W, 3)


def stored_light(
    view: StoredView, channels: Channels, is_halved: bool, tally: Tally
) -> Planes | None:
    """Light groups (at half size if is_halved), albedo and normal; None if a channel is missing."""
    if not has_channels(channels, view.size, "outdoor indoor albedo", "normal"):
        return None  # reported by the check of radiance
    groups = {"outdoor": "RGB", "indoor": "RGB", "albedo": "RGB", "normal": "XYZ"}
    planes = {g: rgb_of(channels, g, axes).astype(np.float32) for g, axes in groups.items()}
    if is_halved:
        planes = {g: halved(plane) for g, plane in planes.items()}
    return denoised_light(view, planes, tally)


def denoised_light(view: StoredView, planes: Planes, tally: Tally) -> Planes | None:
    """The planes with light denoised where the recipe says; None without a denoiser."""
    if view.recipe is None or not view.recipe.light.denoise:
        return planes
    planes = dict(planes)
    try:
        pyoidn = _pyoidn()
    except ImportError:
        tally.note(f"{view.place}: light was denoised, but pyoidn is not installed to repeat it")
        return None
    # A panorama is denoised across its edge.
    n = min(64, planes["albedo"].shape[1]) if view.recipe.lens.model == "equirect" else 0
    wide = {g: np.pad(a, ((0, 0), (n, n), (0, 0)), mode="wrap") for g, a in planes.items()}
    lit = (wide["outdoor"] + wide["indoor"] > 0) | (wide["albedo"] > 0)
    albedo, normal = (np.ascontiguousarray(wide[g], np.float32) for g in ("albedo", "normal"))
    for group in ("outdoor", "indoor"):
        noisy = np.ascontiguousarray(wide[group], np.float32)
        if (noisy > 0).any():
            clean = pyoidn.denoise(noisy, albedo, normal, hdr=True, clean_aux=True)
            clean = np.maximum(np.nan_to_num(np.asarray(clean, np.float32), posinf=0.0), 0)
            noisy = clean * np.asarray(lit).any(axis=-1, keepdims=True)
        planes[group] = noisy[:, n : noisy.shape[1] - n]
    return planes


def _pyoidn() -> Any:
    """The denoiser's module, imported as if torch were missing: loading torch takes 6 s and is of no use."""
    is_hidden = "torch" not in sys.modules
    if is_hidden:
        sys.modules["torch"] = None  # type: ignore[assignment]  # import takes None for "missing"
    try:
        import pyoidn
    finally:
        if is_hidden:
            del sys.modules["torch"]
    return pyoidn
