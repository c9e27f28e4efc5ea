"""What a light render gives, and its noise; pure numpy, no effects."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.arrays import RadianceImage, UnitVectors
from pbrs_farm.frames import LUMINANCE
from pbrs_farm.lighting import GROUPS_OF_MODE, Group, Mode


@dataclass(frozen=True, slots=True, eq=False)
class LightResult:
    """The light of one view by groups, W m-2 sr-1, raw (not denoised).

    outdoor, indoor: (H, W, 3) float32, finite, >= 0. albedo: (H, W, 3) in 0..1 and normal:
    (H, W, 3) world, of the first surface that is neither mirror nor glass: for the denoiser.
    noise: relative error of each group and of their sum, estimated from two half buffers.
    spp: samples (or mutations) per pixel. n_nonfinite: contributions replaced by nothing.
    facts: for view.json: integrator, weights of lamps, seed.
    """

    outdoor: RadianceImage
    indoor: RadianceImage
    albedo: RadianceImage
    normal: UnitVectors
    noise: dict[str, float]
    spp: int
    n_nonfinite: int
    facts: dict[str, Any] = field(default_factory=dict)

    def group(self, group: Group) -> RadianceImage:
        """The picture of one light group."""
        return self.outdoor if group is Group.OUTDOOR else self.indoor

    def mode(self, mode: Mode) -> RadianceImage:
        """The sum of the groups that make a lighting mode; ValueError for an OpenGL mode."""
        groups = GROUPS_OF_MODE[mode]
        if not groups:
            raise ValueError(f"{mode} is no sum of light groups")
        total = self.group(groups[0])
        for group in groups[1:]:
            total = total + self.group(group)
        return total


def relative_noise(half_a: NDArray[np.floating], half_b: NDArray[np.floating]) -> float:
    """Relative error of the mean of two independent halves, (H, W, 3) each; 0 for black pictures.

    The root mean square over pixels of |a - b| / 2 against the pixel's luminance, brought towards
    the picture's mean by a tenth so that black pixels do not rule; the largest 0.1 % of pixels
    are left out, as fireflies would make the estimate itself noise.
    """
    a, b = half_a @ LUMINANCE, half_b @ LUMINANCE
    mean = 0.5 * (a + b)
    level = float(mean.mean())
    if level <= 0:
        return 0.0
    error = np.sort(((0.5 * (a - b)) / (mean + 0.1 * level)).ravel() ** 2)
    kept = error[: max(int(len(error) * 0.999), 1)]
    return float(np.sqrt(kept.mean()))
