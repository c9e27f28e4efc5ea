"""One repeat of a surface before it is painted; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.dress.noise import Shape2, noise
from pbrs_farm.dress.surface_maps import SurfaceMaps, surface_maps


@dataclass(frozen=True, slots=True)
class Canvas:
    """The pixels and metres of one repeat, and the source of its draws."""

    rng: np.random.Generator
    shape: Shape2  # rows, columns
    size_m: tuple[float, float]  # width, height

    @property
    def pixel_m(self) -> float:
        """Width of a pixel, metres."""
        return self.size_m[0] / self.shape[1]

    def noise(
        self,
        *,
        slope: float,
        stretch: tuple[float, float] = (1.0, 1.0),
        band: tuple[float, float] = (1.0, 1e9),
    ) -> F32:
        """(H, W) periodic noise, as of dress/noise.py."""
        return noise(self.rng, self.shape, slope=slope, stretch=stretch, band=band)

    def maps(self, colour: F32, roughness: F32 | float, height_m: F32, gloss: float) -> SurfaceMaps:
        """The painted surface, as `surface_maps` makes it."""
        return surface_maps(colour, roughness, height_m, self.size_m, gloss)
