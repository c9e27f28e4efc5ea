"""Stored radiance to the pictures of the light modes: groups summed, denoised, tone-mapped; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import RadianceImage, Srgb8Image, UnitVectors
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.lighting import GROUPS_OF_MODE, Group
from pbrs_farm.core.recipe import ToneFields
from pbrs_farm.transport.develop.denoiser import denoise_radiance
from pbrs_farm.transport.develop.tone_mapping import exposure_of, tone


@dataclass(frozen=True, slots=True, eq=False)
class LinearAovs:
    """What a picture is developed from. outdoor, indoor: (H, W, 3) raw radiance, W m-2 sr-1.

    albedo: (H, W, 3) in 0..1 and normal: (H, W, 3) unit or 0, both noise-free, for the denoiser.
    """

    outdoor: RadianceImage
    indoor: RadianceImage
    albedo: RadianceImage
    normal: UnitVectors


@dataclass(frozen=True, slots=True, eq=False)
class ToneMappedImage:
    """A developed picture: rgb_srgb8 = tone(radiance * gains * exposure).

    gains: (3,) of the white balance. exposure: what radiance was multiplied by before the curve.
    """

    rgb_srgb8: Srgb8Image
    gains: NDArray[np.float32]
    exposure: float

    def facts(self) -> dict[str, Any]:
        """For view.json."""
        return {"gains": [round(float(g), 6) for g in self.gains], "exposure": self.exposure}


def develop(
    aovs: LinearAovs,
    fields: ToneFields,
    *,
    denoise: bool,
    indoor: float = 1.0,
    outdoor: float = 1.0,
) -> dict[str, ToneMappedImage]:
    """Mode name -> picture of every mode that is a sum of light groups.

    Each group is denoised by itself, so that the modes stay sums. indoor, outdoor: factors.
    """
    groups = {
        Group.OUTDOOR: aovs.outdoor * np.float32(outdoor),
        Group.INDOOR: aovs.indoor * np.float32(indoor),
    }
    if denoise:
        # What sees nothing stays black: the denoiser would smear light over it.
        light = aovs.outdoor + aovs.indoor
        seen = np.any(light > 0, -1, keepdims=True) | np.any(aovs.albedo > 0, -1, keepdims=True)
        groups = {
            name: denoise_radiance(radiance, aovs.albedo, aovs.normal) * seen
            for name, radiance in groups.items()
        }
    images = {}
    for mode, names in GROUPS_OF_MODE.items():
        if names:
            total = sum((groups[name] for name in names), np.zeros_like(aovs.outdoor))
            gains = white_balance(total, aovs.albedo, fields.white_balance)
            exposure = exposure_of(total * gains, fields)
            rgb = tone(total * gains, fields, exposure=exposure)
            images[mode.value] = ToneMappedImage(rgb, gains, exposure)
    return images


def white_balance(
    radiance: RadianceImage, albedo: RadianceImage, strength: float
) -> NDArray[np.float32]:
    """(3,) factors that turn the picture's light towards white, as a camera's would; mean 1.

    The light's colour is radiance over albedo, which is known here: the median of their
    logarithms over pixels that are neither dark nor blown. strength: 0 leaves the colour,
    1 makes the light neutral. Ones when there is nothing to go by.
    """
    level = radiance @ LUMINANCE
    usable = (level > 0) & np.all(albedo > 0.02, -1) & np.all(radiance > 0, -1)
    if strength == 0 or usable.sum() < 16:
        return np.ones(3, np.float32)
    low, high = np.percentile(level[usable], [10, 90])
    usable &= (level >= low) & (level <= high)
    light = np.exp(np.median(np.log(radiance[usable] / albedo[usable]), axis=0))
    gains = (light / (light @ LUMINANCE)) ** -strength
    return np.asarray(gains / (gains @ LUMINANCE), np.float32)
