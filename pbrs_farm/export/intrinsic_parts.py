"""Linear light, albedo, shading and residual of a view for other tools. Effects: reads the view."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F32, Bools
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.lighting import GROUPS_OF_MODE, Group, Mode
from pbrs_farm.core.resampling import resized_by_area
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.formats.radiance_exr import FILE as RADIANCE_EXR
from pbrs_farm.formats.radiance_exr import radiance_from_exr
from pbrs_farm.regular_files import MAX_SCENE_BYTES, read_regular
from pbrs_farm.run.relight import linear_aovs
from pbrs_farm.transport.develop.mode_pictures import denoise_aovs


def picture_radiance(view: ChosenView) -> F32 | None:
    """(H, W, 3) linear radiance of the picture's light, denoised like it; None without radiance.exr."""
    file = view.entry.file(RADIANCE_EXR)
    if file is None:
        return None
    aovs = linear_aovs(radiance_from_exr(read_regular(file, MAX_SCENE_BYTES), str(file)))
    develop = view.facts.get("modes", {}).get("develop", {})
    if develop.get("denoised", False):
        aovs = denoise_aovs(aovs)
    groups = GROUPS_OF_MODE[Mode(view.picture)] if view.picture else ()
    total = np.zeros_like(aovs.outdoor)
    for group in groups or (Group.OUTDOOR, Group.INDOOR):
        total = total + (aovs.outdoor if group is Group.OUTDOOR else aovs.indoor)
    if view.choice.size is not None:
        total = resized_by_area(total, *view.choice.size)
    return np.asarray(total, np.float32)


def intrinsic_layers(view: ChosenView) -> tuple[F32, F32, F32] | None:
    """(albedo, shading, residual) of the picture's light, (H, W, 3) float32 linear; None without the layers.

    The radiance is albedo x shading + residual; the residual may be negative.
    """
    groups = GROUPS_OF_MODE[Mode(view.picture)] if view.picture else ()
    ending = "_outdoor" if groups == (Group.OUTDOOR,) else ""
    names = "albedo", f"shading{ending}", f"residual{ending}"
    if not all(view.has(name) for name in names):
        return None
    albedo = linear_from_srgb(view.array(names[0]) / 255).astype(np.float32)
    shading, residual = (np.asarray(view.array(name), np.float32) for name in names[1:])
    return albedo, shading, residual


def material_planes(view: ChosenView) -> dict[str, F32]:
    """Channel -> (H, W): R roughness, G metallic, B 0, as in InteriorVerse."""
    rough, metallic = (np.float32(1 / 255) * view.array(n) for n in ("roughness", "metallic"))
    return {"R": rough, "G": metallic, "B": np.zeros_like(rough)}


def opaque_pixels(view: ChosenView) -> Bools:
    """(H, W) pixels with a surface, without glass and mirrors where the view has these layers."""
    counts = np.asarray(view.array("valid") > 0)
    for clear in ("glass", "mirror"):
        if view.has(clear):
            counts &= view.array(clear) == 0
    return counts


def parts_without_negatives(view: ChosenView) -> tuple[F32, F32, F32] | None:
    """The layers of `intrinsic_layers` with the same sum, none of them negative.

    If albedo x shading alone would exceed the radiance (a coat at a slant, an edge within the pixel),
    shading is reduced: Marigold's preparation of Hypersim refuses frames with a negative residual.
    """
    layers = intrinsic_layers(view)
    if layers is None:
        return None
    albedo, shading, residual = layers
    over = np.divide(residual, albedo, out=np.zeros_like(residual), where=albedo > 0)
    return albedo, np.maximum(shading + np.minimum(over, 0), 0), np.maximum(residual, 0)
