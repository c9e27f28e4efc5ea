"""Wood as a sheet to cut planks from: rings, fibres, pores and knots; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.dress.noise import Shape2, noise, smoothstep
from pbrs_farm.dress.style import Wood

# Ring width in metres, bend of the rings, strength of pores, knots per square metre.
_SPECIES: dict[str, tuple[float, float, float, float]] = {
    "oak": (0.007, 1.0, 0.9, 0.0),
    "ash": (0.009, 1.2, 0.8, 0.0),
    "pine": (0.010, 1.3, 0.15, 1.5),
    "birch": (0.010, 0.9, 0.2, 0.0),
    "beech": (0.008, 0.7, 0.45, 0.0),
    "maple": (0.010, 0.8, 0.15, 0.0),
    "cherry": (0.008, 1.0, 0.3, 0.0),
    "walnut": (0.009, 1.2, 0.6, 0.0),
    "teak": (0.009, 1.0, 0.7, 0.0),
    "mahogany": (0.009, 0.6, 0.7, 0.0),
    "wenge": (0.006, 0.5, 0.9, 0.0),
}


@dataclass(frozen=True, slots=True, eq=False)
class WoodSheet:
    """A periodic sheet of wood, the grain along its rows."""

    tone: F32  # (H, W), 0 = late wood and pores, 1 = early wood, around 0.6
    pixel_m: float

    @property
    def shape(self) -> Shape2:
        """Rows, columns."""
        return (self.tone.shape[0], self.tone.shape[1])


def wood_sheet(
    rng: np.random.Generator, wood: Wood, shape: Shape2 = (512, 1024), pixel_m: float = 2 / 1024
) -> WoodSheet:
    """A sheet of that species; pixel_m: metres a pixel."""
    ring_m, bend, pores, knots = _SPECIES.get(wood.name.split()[-1], _SPECIES["oak"])
    rows, columns = shape
    across_m, along_m = rows * pixel_m, columns * pixel_m
    # Let the rings grow across the sheet, a whole number of them, bent along the grain.
    n_rings = max(1, round(across_m / ring_m))
    phase = (np.arange(rows, dtype=np.float32) * np.float32(n_rings / rows))[:, None]
    waves = across_m / 0.22
    arches = noise(rng, shape, slope=2.5, stretch=(1.0, 9.0), band=(1.0, waves * 2))
    wander = noise(rng, shape, slope=2.0, stretch=(1.0, 5.0), band=(waves, waves * 8))
    phase = phase + np.float32(bend * 0.055 * n_rings / across_m) * arches + 0.35 * wander
    knot_dark = np.zeros(shape, np.float32)
    for _ in range(round(knots * across_m * along_m)):
        phase, knot_dark = _with_knot(rng, phase, knot_dark, pixel_m)
    # Fade rings finer than a pixel.
    slope = np.abs(np.roll(phase, -1, 0) - phase)
    slope = np.minimum(slope, np.abs(slope - n_rings))  # across the sheet's edge
    visible = np.exp(-((slope / 0.3) ** 2))
    # Shape a ring: early wood darkens towards the late wood, then begins anew.
    f = phase - np.floor(phase)
    late = f**3 * (1.0 - smoothstep(0.88, 1.0, f))
    late = (late - 0.2) * visible
    # Add fibres, broad stripes of colour, and pores as short dark strokes.
    fibres = noise(rng, shape, slope=0.6, stretch=(1.0, 45.0), band=(across_m * 25, 1e9))
    broad = noise(rng, shape, slope=2.0, stretch=(1.0, 12.0), band=(1.0, across_m * 25))
    strokes = noise(rng, shape, slope=0.0, stretch=(1.0, 12.0), band=(across_m * 60, 1e9))
    stroke = np.maximum(strokes - 1.0, 0.0) * (0.6 + 0.8 * (f > 0.6) * visible)
    contrast = 0.35 + wood.figure
    tone = 0.62 - contrast * (0.75 * late + 0.05 * fibres + 0.07 * broad) - 0.16 * pores * stroke
    return WoodSheet(np.asarray(tone - 0.9 * knot_dark, np.float32), pixel_m)


def _with_knot(rng: np.random.Generator, phase: F32, dark: F32, pixel_m: float) -> tuple[F32, F32]:
    # Push the rings aside around a knot, and darken its heart.
    rows, columns = phase.shape
    y0, x0 = rng.random(2) * (rows, columns)
    radius_px = rng.uniform(0.006, 0.014) / pixel_m
    dy = (np.arange(rows, dtype=np.float32) - y0 + rows / 2) % rows - rows / 2
    dx = (np.arange(columns, dtype=np.float32) - x0 + columns / 2) % columns - columns / 2
    near = np.hypot(dy[:, None], dx[None] * 0.75) / radius_px
    wide = np.hypot(dy[:, None] / 1.4, dx[None] / 4.0) / radius_px
    side = np.sign(dy)[:, None] * np.exp(-wide) * np.minimum(np.abs(dy)[:, None] / radius_px, 1)
    phase = phase + np.float32(2.2) * side.astype(np.float32)
    heart = smoothstep(1.15, 0.75, near.astype(np.float32))
    rings = 0.5 + 0.5 * np.sin(near * 9.0)
    return phase, np.maximum(dark, (heart * (0.5 + 0.25 * rings)).astype(np.float32))
