"""Blackbody colour: linear sRGB of luminance 1 from a temperature; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import LUMINANCE

_RGB_FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)
_HC_OVER_K = 1.438777e7  # nm K


def rgb_from_kelvin(kelvin: float) -> F64:
    """(3,) linear sRGB, luminance 1, none negative, of Planck's radiator at 1000 to 20000 K."""
    # Weight Planck's law by the matching functions, every 5 nm of the visible spectrum.
    wavelength = np.arange(380.0, 781.0, 5.0)
    power = wavelength**-5 / np.expm1(_HC_OVER_K / (wavelength * kelvin))
    xyz = (_matching(wavelength) * power).sum(1)
    # Clip colours outside the gamut of sRGB and scale to luminance 1.
    rgb = np.maximum(_RGB_FROM_XYZ @ (xyz / xyz[1]), 0.0)
    return np.asarray(rgb / (rgb @ LUMINANCE))


def _matching(wavelength: F64) -> F64:
    """(3, N) CIE 1931 matching functions, the multi-lobe fit of Wyman et al. 2013."""

    def lobe(mean: float, below: float, above: float) -> F64:
        t = (wavelength - mean) * np.where(wavelength < mean, below, above)
        return np.asarray(np.exp(-0.5 * t * t))

    x = (
        0.362 * lobe(442.0, 0.0624, 0.0374)
        + 1.056 * lobe(599.8, 0.0264, 0.0323)
        - 0.065 * lobe(501.1, 0.0490, 0.0382)
    )
    y = 0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322)
    z = 1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725)
    return np.stack([x, y, z])
