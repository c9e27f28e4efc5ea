"""The pictures of the light modes: linear AOVs, denoised by light group, summed, balanced and tone-mapped; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from dataclasses import fields as fields_of
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F32, RadianceImage, Srgb8Image, UnitVectors
from pbrs_farm.core.lighting import GROUPS_OF_MODE, Group
from pbrs_farm.core.recipe import ToneFields
from pbrs_farm.transport.develop.camera_sensor import Exposure, SensorShot, take_by_sensor
from pbrs_farm.transport.develop.denoiser import denoise_radiance
from pbrs_farm.transport.develop.tone_mapping import add_glare, exposure_of, tone
from pbrs_farm.transport.develop.white_balance import all_channels, white_balance

# Of a light group: of all, or of R, G and B.
Factor = float | tuple[float, float, float]
_WRAPPED_PX: Final = 64  # beyond a panorama's edges, more than a denoiser looks


@dataclass(frozen=True, slots=True, eq=False)
class LinearAovs:
    """The linear AOVs of radiance.exr, (H, W, 3) float32; albedo and normal guide the denoiser."""

    outdoor: RadianceImage  # raw radiance of each light group, W m-2 sr-1
    indoor: RadianceImage
    albedo: RadianceImage  # 0..1; it and normal are free of noise: the denoiser's guides
    normal: UnitVectors  # unit, or 0 where nothing is hit


@dataclass(frozen=True, slots=True, eq=False)
class ToneMappedImage:
    """A tone-mapped image: rgb_srgb8 = tone(radiance * gains * exposure)."""

    rgb_srgb8: Srgb8Image
    gains: F32  # (3,) factors of the white balance
    exposure: float  # factor before the tone curve
    taken: Exposure | None = None  # by a sensor

    def facts(self) -> dict[str, Any]:
        """Entries for view.json."""
        facts = {"gains": [round(float(g), 6) for g in self.gains], "exposure": self.exposure}
        return facts | (self.taken.facts() if self.taken else {})


def develop(
    aovs: LinearAovs,
    fields: ToneFields,
    *,
    denoise: bool,
    indoor: Factor = 1.0,
    outdoor: Factor = 1.0,
    shot: SensorShot | None = None,
    wraps: bool = False,
) -> dict[str, ToneMappedImage]:
    """Mode name -> image, for every mode that is a sum of light groups.

    Each group is denoised separately, so that the modes stay sums. indoor, outdoor: factors, one or for R,
    G and B, applied after denoising, so that every picture is linear in them. shot: the sensor, None for
    an ideal one. wraps: see denoise_aovs.
    """
    clean = denoise_aovs(aovs, wraps=wraps) if denoise else aovs
    groups = {
        Group.OUTDOOR: clean.outdoor * np.asarray(outdoor, np.float32),
        Group.INDOOR: clean.indoor * np.asarray(indoor, np.float32),
    }
    # Sum the groups of each mode, balance white, expose, and apply the tone curve.
    images = {}
    for mode, names in GROUPS_OF_MODE.items():
        if names:
            total = sum((groups[name] for name in names), np.zeros_like(aovs.outdoor))
            total = add_glare(total, fields.glare)
            gains = white_balance(total, aovs.albedo, fields)
            balanced = total * gains
            exposure = exposure_of(balanced, fields)
            if shot is not None:
                taken = shot.exposure(mode.value, exposure)
                rgb = take_by_sensor(total, gains, taken, shot.fields, fields, seed=shot.seed)
                images[mode.value] = ToneMappedImage(rgb, gains, taken.factor, taken)
                continue
            rgb = tone(balanced, fields, exposure=exposure)
            images[mode.value] = ToneMappedImage(rgb, gains, exposure)
    return images


def wanted_exposures(
    aovs: LinearAovs, fields: ToneFields, *, denoise: bool, wraps: bool = False
) -> dict[str, float]:
    """Mode -> the exposure factor of its picture; denoise, wraps: as of the picture, since noise brightens."""
    images = develop(aovs, fields, denoise=denoise, wraps=wraps)
    return {mode: image.exposure for mode, image in images.items()}


def denoise_aovs(aovs: LinearAovs, *, wraps: bool = False) -> LinearAovs:
    """Denoise each light group; pixels without a hit stay black. wraps: a panorama, whose edges adjoin."""
    if wraps:
        # Extend the picture by the other edge on both sides.
        n = min(_WRAPPED_PX, aovs.outdoor.shape[1])
        wide = {
            f.name: np.pad(getattr(aovs, f.name), ((0, 0), (n, n), (0, 0)), mode="wrap")
            for f in fields_of(LinearAovs)
        }
        clean = denoise_aovs(LinearAovs(**wide))
        return replace(aovs, outdoor=clean.outdoor[:, n:-n], indoor=clean.indoor[:, n:-n])
    # The denoiser would smear light over pixels without a surface.
    light = aovs.outdoor + aovs.indoor
    is_hit = ~all_channels(~((light > 0) | (aovs.albedo > 0)))[..., None]
    outdoor, indoor = (
        denoise_radiance(radiance, aovs.albedo, aovs.normal) * is_hit
        for radiance in (aovs.outdoor, aovs.indoor)
    )
    return replace(aovs, outdoor=outdoor, indoor=indoor)
