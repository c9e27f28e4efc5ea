"""Wood floors and furniture wood: which plank a pixel belongs to, and what wood it shows; no effects.

Strips and boards run along u. Herringbone is laid along u and v: rooms turn it by 45 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.dress.style import Rgb, Wood, mix, shade
from pbrs_farm.dress.textures.maps import (
    Shape2,
    SurfaceMaps,
    coverage,
    halved,
    noise,
    ramp,
    sampled,
    smoothstep,
    surface_maps,
)

# Wood as a sheet to cut planks from: rings, fibres, pores and knots.
# A board shows a section through a trunk's rings. Far from the pith they are parallel lines;
# where the cut runs along a ring they close to the long arches of flat-sawn wood. Here the rings
# are the levels of a field that grows across the sheet and is bent by noise drawn out along the
# grain.


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
    # Fade rings that are finer than the pixels show.
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


# Wood floors and furniture wood.


_INTS = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class BoardLayout:
    """Planks that tile the texture; all arrays (H, W)."""

    plank: _INTS  # number of the plank
    along: _INTS  # pixels along its grain, from its start
    across: _INTS  # pixels across it
    edge_m: F32  # metres to the plank's nearest edge
    n_planks: int


def rows_of_planks(
    rng: np.random.Generator, shape: Shape2, size_m: tuple[float, float], n_rows: int, per_row: int
) -> BoardLayout:
    """Rows along u with per_row planks each, ends staggered between neighbours."""
    rows, columns = shape
    pixel_m = size_m[0] / columns
    bounds = np.rint(np.linspace(0, rows, n_rows + 1)).astype(np.int64)
    row_of = np.repeat(np.arange(n_rows), np.diff(bounds))
    # Keep each row's first joint away from its neighbour's.
    step = columns / per_row
    offsets = np.empty(n_rows)
    for r in range(n_rows):
        near = [offsets[r - 1]] if r else []
        near += [offsets[0]] if r == n_rows - 1 and r else []
        tries = rng.random(12) * step
        gaps = [min(min(abs(t - o) % step, step - abs(t - o) % step) for o in near) if near else 0 for t in tries]  # fmt: skip
        offsets[r] = tries[int(np.argmax(np.array(gaps) > 0.2 * step))]
    offsets = np.rint(offsets)
    # Number planks along each row, through the seam.
    x = np.arange(columns)[None] - offsets[:, None]
    turn = np.floor_divide(x, step).astype(np.int64) % per_row
    start_px = x - np.floor_divide(x, step) * step
    plank = (turn + per_row * np.arange(n_rows)[:, None])[row_of]
    along = start_px.astype(np.int64)[row_of]
    across = np.arange(rows)[:, None] - bounds[row_of][:, None] + np.zeros((1, columns), np.int64)
    end_px = np.minimum(start_px + 0.5, step - start_px - 0.5)[row_of]
    height_px = np.diff(bounds)[row_of][:, None]
    side_px = np.minimum(across + 0.5, height_px - across - 0.5)
    edge_m = np.minimum(end_px, side_px).astype(np.float32) * np.float32(pixel_m)
    return BoardLayout(plank, along, across, edge_m, n_rows * per_row)


def herringbone(
    shape: Shape2, size_m: tuple[float, float], ratio: int, periods: int
) -> BoardLayout:
    """Blocks of 1 to ratio, alternately along u and v; periods: how often the pattern repeats."""
    cells = 2 * ratio * periods
    rows, columns = shape
    y = (np.arange(rows) + 0.5) * cells / rows
    x = (np.arange(columns) + 0.5) * cells / columns
    j, i = np.floor(y).astype(np.int64)[:, None], np.floor(x).astype(np.int64)[None]
    m = (i - j) % (2 * ratio)
    lies = m < ratio
    # Find the cell each block starts in, and where the pixel is from there.
    i0 = np.where(lies, i - m, i) % cells
    j0 = np.where(lies, j, j - (2 * ratio - 1 - m)) % cells
    from_x = (x[None] - i0) % cells
    from_y = (y[:, None] - j0) % cells
    long, short = np.where(lies, from_x, from_y), np.where(lies, from_y, from_x)
    cell_px = columns / cells
    edge = np.minimum(np.minimum(long, ratio - long), np.minimum(short, 1 - short))
    return BoardLayout(
        plank=i0 + cells * j0,
        along=(long * cell_px).astype(np.int64),
        across=(short * cell_px).astype(np.int64),
        edge_m=np.asarray(edge * size_m[0] / cells, np.float32),
        n_planks=cells * cells,
    )


def chevron(shape: Shape2, size_m: tuple[float, float], n_columns: int, n_rows: int) -> BoardLayout:
    """Columns of planks at 45 degrees that meet in points; n_columns must be even."""
    rows, columns = shape
    pixel_m = size_m[0] / columns
    width_px, height_px = columns / n_columns, rows / n_rows
    x = np.arange(columns)[None] + 0.5
    column = np.floor(x / width_px).astype(np.int64)
    in_column = x - column * width_px
    # Shear the rows up in one column and down in the next.
    rise = np.where(column % 2 == 0, in_column, width_px - in_column)
    y = (np.arange(rows)[:, None] + 0.5 + rise) % rows
    row = np.floor(y / height_px).astype(np.int64)
    in_row = y - row * height_px
    along = in_column * np.sqrt(2.0) + np.zeros_like(y)
    side = np.minimum(in_row, height_px - in_row) / np.sqrt(2.0)
    end = np.minimum(in_column, width_px - in_column)
    return BoardLayout(
        plank=row + n_rows * column,
        along=along.astype(np.int64),
        across=((in_row - 0.3 * rise) / np.sqrt(2.0)).astype(np.int64),
        edge_m=np.asarray(np.minimum(side, end) * pixel_m, np.float32),
        n_planks=n_rows * n_columns,
    )


@dataclass(frozen=True, slots=True)
class PlankLook:
    """How planks are cut and finished."""

    joint_m: float = 0.001
    bevel_m: float = 0.0
    variation: float = 0.06  # of brightness from plank to plank
    roughness: float = 0.38
    gloss: float = 0.5


def plank_maps(
    rng: np.random.Generator, wood: Wood, layout: BoardLayout, size_m: tuple[float, float],
    look: PlankLook, darkness: float = 0.0, sheet: WoodSheet | None = None,
) -> SurfaceMaps:  # fmt: skip
    """Wood cut into the layout's planks. darkness: -1 bleached .. 1 stained."""
    shape = (layout.plank.shape[0], layout.plank.shape[1])
    pixel_m = size_m[0] / shape[1]
    sheet = wood_sheet(rng, wood, (512, shape[1]), pixel_m) if sheet is None else sheet
    n = layout.n_planks
    # Cut each plank from a place of its own, one half of them turned round.
    rows = _placed(rng, layout.across, layout.plank, n, sheet.shape[0])
    columns = _placed(rng, layout.along, layout.plank, n, sheet.shape[1])
    tone = sampled(sheet.tone, rows, columns)
    # Give each plank a brightness and a warmth of its own.
    light, dark = _stained(wood, darkness)
    colour = ramp(tone, dark, light)
    bright = 1.0 + np.clip(rng.normal(0, look.variation, n), -2 * look.variation, 2 * look.variation)  # fmt: skip
    warm = np.clip(rng.normal(0, 0.2 * look.variation, n), -0.03, 0.03)
    tint = np.stack([bright * (1 + warm), bright, bright * (1 - 1.3 * warm)], -1)
    colour *= tint.astype(np.float32)[layout.plank]
    # Darken the joints and the edge beside them.
    joint = coverage(layout.edge_m, look.joint_m / 2, pixel_m)
    beside = smoothstep(max(look.bevel_m, 0.003), 0.0, layout.edge_m)
    colour *= (1.0 - 0.62 * joint - 0.06 * beside)[..., None]
    height = 0.00006 * tone - 0.0008 * joint
    if look.bevel_m:
        height = height - look.bevel_m * 0.35 * beside
    rough = look.roughness + 0.10 * (0.62 - tone) + 0.3 * joint
    # Let the varnish be smudged; its map is half as fine.
    rough = halved(np.asarray(rough, np.float32))
    smudge = noise(rng, (rough.shape[0], rough.shape[1]), slope=2.5)
    rough = rough + 0.015 * np.clip(smudge, -2, 2)
    return surface_maps(colour, rough, height, size_m, look.gloss)


def _placed(
    rng: np.random.Generator, pixels: _INTS, plank: _INTS, n: int, most: int
) -> NDArray[np.int32]:
    # Pixels of each plank from a start of its own, forwards or backwards.
    turn, start = rng.choice([-1, 1], n).astype(np.int32), rng.integers(0, most, n, np.int32)
    return np.asarray(pixels.astype(np.int32) * turn[plank] + start[plank], np.int32)


def grain_maps(
    rng: np.random.Generator, wood: Wood, size_m: float = 1.0, edge_px: int = 512,
    roughness: float = 0.4,
) -> SurfaceMaps:  # fmt: skip
    """Veneer without joints, the grain along u, for furniture."""
    shape = (edge_px, edge_px)
    sheet = wood_sheet(rng, wood, shape, size_m / edge_px)
    colour = ramp(sheet.tone, wood.dark, wood.light)
    return surface_maps(
        colour, roughness + 0.12 * (0.62 - sheet.tone), 0.00005 * sheet.tone, (size_m, size_m), 0.5
    )


def _stained(wood: Wood, darkness: float) -> tuple[Rgb, Rgb]:
    if darkness >= 0:
        return shade(wood.light, 1 - 0.35 * darkness), shade(wood.dark, 1 - 0.4 * darkness)
    pale = (0.86, 0.83, 0.78)
    return mix(wood.light, pale, -0.5 * darkness), mix(wood.dark, pale, -0.5 * darkness)
