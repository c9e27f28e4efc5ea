"""Diffuse light of first surfaces by light group, and shading and residual made of it; no effects.

Of a pixel whose first surface scatters light: kd E / pi, with E the irradiance of its visible side and
kd its diffuse colour. Over the mean of kd it is the shading, what a white matte surface would send.
Emission, highlights, what mirrors and glass show and what shines through a surface are the residual.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, Bools, RadianceImage
from pbrs_farm.core.lighting import Group
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, denoise_aovs
from pbrs_farm.transport.lamp_layers import layer_name
from pbrs_farm.transport.light_result import LightResult

if TYPE_CHECKING:
    from pbrs_farm.transport.path_tracer import SampleSums

ALBEDO: Final = (
    "diffuse_albedo"  # mean of kd, which counts as 0.002 at least (kernels/path_state.py)
)
IMAGE_OF_GROUP: Final = {Group.OUTDOOR: "diffuse_outdoor", Group.INDOOR: "diffuse_indoor"}
_GUIDE_GREY: Final = 0.5  # guide albedo for pixels without one
_MOST_HALF: Final = 65504.0  # of a half float


def add_diffuse_images(
    result: LightResult, sums: SampleSums, spp: int, scatters: Bools
) -> LightResult:
    """The result with the images of this module, by their names in radiance.exr.

    sums: of a render that splits diffuse light, over spp samples. Those of lamps are of the lamps
    that have a layer. scatters: (H, W) False where a pixel's centre shows glass or a mirror, whose edge
    would else have light of its frame.
    """
    assert sums.diffuse_albedo is not None
    totals = {ALBEDO: sums.diffuse_albedo}
    for group, name in IMAGE_OF_GROUP.items():
        totals[name] = getattr(sums, f"diffuse_{group.value}")
    for number in result.lamps:
        assert sums.diffuse_lamps is not None
        totals[f"diffuse_{layer_name(number)}"] = sums.diffuse_lamps[:, number - 1]
    shape = result.outdoor.shape
    images = {
        name: np.ascontiguousarray((total / np.float32(spp)).reshape(shape) * scatters[..., None])
        for name, total in totals.items()
    }
    return replace(result, diffuse=images)


def shading_by_group(
    aovs: LinearAovs, diffuse: Mapping[str, F32], *, denoise: bool, wraps: bool = False
) -> dict[Group, RadianceImage]:
    """Light group -> (H, W, 3) float32 irradiance over pi, 0 where no first surface scatters light."""
    albedo = diffuse[ALBEDO]
    shading = {
        group: np.divide(diffuse[name], albedo, out=np.zeros_like(albedo), where=albedo > 0)
        for group, name in IMAGE_OF_GROUP.items()
    }
    if not denoise:
        return shading
    # Divide first, and guide by normals alone: no pattern of a surface is left in its shading.
    grey = np.where(albedo > 0, np.float32(_GUIDE_GREY), np.float32(0))
    noisy = LinearAovs(shading[Group.OUTDOOR], shading[Group.INDOOR], grey, aovs.normal)
    clean = denoise_aovs(noisy, wraps=wraps)
    return {Group.OUTDOOR: clean.outdoor, Group.INDOOR: clean.indoor}


def intrinsic_parts(
    radiance: RadianceImage, albedo: F32, shading: RadianceImage
) -> tuple[NDArray[np.float16], NDArray[np.float16]]:
    """(shading, residual) in half floats: albedo x shading + residual is radiance to half a step; residual may be < 0."""
    stored = np.clip(shading, 0, _MOST_HALF).astype(np.float16)
    residual = radiance - albedo * stored.astype(np.float32)
    return stored, np.asarray(np.clip(residual, -_MOST_HALF, _MOST_HALF), np.float16)
