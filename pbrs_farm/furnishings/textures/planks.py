"""Wood floors and furniture wood: which plank a pixel belongs to, and what wood it shows; no effects.

Strips and boards run along u. Herringbone is laid along u and v: rooms turn it by 45 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.dress.noise import coverage, halved, noise, sampled, smoothstep
from pbrs_farm.dress.style import Rgb, Wood, mix, shade
from pbrs_farm.dress.surface_maps import SurfaceMaps, ramp
from pbrs_farm.furnishings.textures.canvas import Canvas
from pbrs_farm.furnishings.textures.wood_sheet import wood_sheet

_INTS = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class BoardLayout:
    """Planks that tile the texture; all arrays (H, W)."""

    plank: _INTS  # number of the plank
    along: _INTS  # pixels along its grain, from its start
    across: _INTS  # pixels across it
    edge_m: F32  # metres to the plank's nearest edge
    n_planks: int


def rows_of_planks(c: Canvas, n_rows: int, per_row: int) -> BoardLayout:
    """Rows along u with per_row planks each, ends staggered between neighbours."""
    rows, columns = c.shape
    bounds = np.rint(np.linspace(0, rows, n_rows + 1)).astype(np.int64)
    row_of = np.repeat(np.arange(n_rows), np.diff(bounds))
    # Keep each row's first joint away from its neighbour's.
    step = columns / per_row
    offsets = np.empty(n_rows)
    for r in range(n_rows):
        near = [offsets[r - 1]] if r else []
        near += [offsets[0]] if r == n_rows - 1 and r else []
        tries = c.rng.random(12) * step
        gaps = [
            min(min(abs(t - o) % step, step - abs(t - o) % step) for o in near) if near else 0
            for t in tries
        ]
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
    edge_m = np.minimum(end_px, side_px).astype(np.float32) * np.float32(c.pixel_m)
    return BoardLayout(plank, along, across, edge_m, n_rows * per_row)


def herringbone(c: Canvas, ratio: int, periods: int) -> BoardLayout:
    """Blocks of 1 to ratio, alternately along u and v; periods: how often the pattern repeats."""
    cells = 2 * ratio * periods
    rows, columns = c.shape
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
        edge_m=np.asarray(edge * c.size_m[0] / cells, np.float32),
        n_planks=cells * cells,
    )


def chevron(c: Canvas, n_columns: int, n_rows: int) -> BoardLayout:
    """Columns of planks at 45 degrees that meet in points; n_columns must be even."""
    rows, columns = c.shape
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
        edge_m=np.asarray(np.minimum(side, end) * c.pixel_m, np.float32),
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
    c: Canvas, wood: Wood, layout: BoardLayout, look: PlankLook, darkness: float = 0.0
) -> SurfaceMaps:
    """Wood cut into the layout's planks. darkness: -1 bleached .. 1 stained."""
    sheet = wood_sheet(c.rng, wood, (512, c.shape[1]), c.pixel_m)
    n = layout.n_planks
    # Cut each plank from a different place, half of them turned round.
    rows = _start_of_planks(c.rng, layout.across, layout.plank, n, sheet.shape[0])
    columns = _start_of_planks(c.rng, layout.along, layout.plank, n, sheet.shape[1])
    tone = sampled(sheet.tone, rows, columns)
    # Vary the brightness and warmth of each plank.
    light, dark = _stained(wood, darkness)
    colour = ramp(tone, dark, light)
    bright = 1.0 + np.clip(
        c.rng.normal(0, look.variation, n), -2 * look.variation, 2 * look.variation
    )
    warm = np.clip(c.rng.normal(0, 0.2 * look.variation, n), -0.03, 0.03)
    tint = np.stack([bright * (1 + warm), bright, bright * (1 - 1.3 * warm)], -1)
    colour *= tint.astype(np.float32)[layout.plank]
    # Darken the joints and the edge beside them.
    joint = coverage(layout.edge_m, look.joint_m / 2, c.pixel_m)
    beside = smoothstep(max(look.bevel_m, 0.003), 0.0, layout.edge_m)
    colour *= (1.0 - 0.62 * joint - 0.06 * beside)[..., None]
    height = 0.00006 * tone - 0.0008 * joint
    if look.bevel_m:
        height = height - look.bevel_m * 0.35 * beside
    rough = look.roughness + 0.10 * (0.62 - tone) + 0.3 * joint
    # Let the varnish be smudged; its map is half as fine.
    rough = halved(np.asarray(rough, np.float32))
    smudge = noise(c.rng, (rough.shape[0], rough.shape[1]), slope=2.5)
    rough = rough + 0.015 * np.clip(smudge, -2, 2)
    return c.maps(colour, rough, height, look.gloss)


def _start_of_planks(
    rng: np.random.Generator, pixels: _INTS, plank: _INTS, n: int, most: int
) -> NDArray[np.int32]:
    # Pixels of each plank from a different start, forwards or backwards.
    turn, start = rng.choice([-1, 1], n).astype(np.int32), rng.integers(0, most, n, np.int32)
    return np.asarray(pixels.astype(np.int32) * turn[plank] + start[plank], np.int32)


def grain_maps(c: Canvas, wood: Wood) -> SurfaceMaps:
    """Veneer without joints, the grain along u, for furniture.

    The sheet is laid narrower than it is drawn: rings of veneer are half as wide as those of planks.
    """
    sheet = wood_sheet(c.rng, wood, (c.shape[1], c.shape[1]), c.pixel_m)
    colour = ramp(sheet.tone, wood.dark, wood.light)
    return c.maps(colour, 0.4 + 0.12 * (0.62 - sheet.tone), 0.00005 * sheet.tone, 0.5)


def _stained(wood: Wood, darkness: float) -> tuple[Rgb, Rgb]:
    if darkness >= 0:
        return shade(wood.light, 1 - 0.35 * darkness), shade(wood.dark, 1 - 0.4 * darkness)
    pale = (0.86, 0.83, 0.78)
    return mix(wood.light, pale, -0.5 * darkness), mix(wood.dark, pale, -0.5 * darkness)
