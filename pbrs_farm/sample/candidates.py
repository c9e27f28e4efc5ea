"""Candidate viewpoints of a room: one per grid cell and sector; no effects.

Randomness is hashed from (seed, house, room, sector, cell), so that no candidate depends on how
many others there are or on the order they are made in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, I32
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.mesh import unit_vectors
from pbrs_farm.core.recipe import CameraFields


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """N candidate viewpoints of a room as arrays, by sector, then z, then x; `cameras` makes some."""

    eye: F64  # (N, 3) metres
    towards: F64  # (N, 3) unit
    sector: I32  # (N,)
    cell: I32  # (N, 2) column along x, row along z
    zoom: F64  # (N,) times the focal length
    roll: F64  # (N,) radians about the optical axis, clockwise as the photographer turns

    def __len__(self) -> int:
        return len(self.sector)

    def cameras(self, which: NDArray[np.intp], intrinsics: Intrinsics) -> list[Camera]:
        """The candidates which (M,), in that order, as cameras; intrinsics: those of zoom 1."""
        plain = cameras_looking(
            intrinsics, self.eye[which], self.towards[which], roll=self.roll[which]
        )
        lenses = {zoom: intrinsics.zoomed(zoom) for zoom in set(self.zoom[which].tolist())}
        zooms = self.zoom[which].tolist()
        return [
            Camera(lenses[zoom], c.world_from_camera) for zoom, c in zip(zooms, plain, strict=True)
        ]


def cameras_looking(
    intrinsics: Intrinsics,
    eyes: F64,
    towards: F64,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    *,
    roll: F64 | None = None,
) -> list[Camera]:
    """Camera.look for many: eyes, towards (N, 3), neither parallel to up; roll: (N,) radians clockwise."""
    # Build OpenGL axes: x right, y up, z back.
    back = -unit_vectors(towards)
    right = unit_vectors(np.cross(np.array(up), back))
    above = np.cross(back, right)
    if roll is not None and roll.any():
        cos, sin = np.cos(roll)[:, None], np.sin(roll)[:, None]
        right, above = cos * right - sin * above, cos * above + sin * right
    poses = np.zeros((len(eyes), 4, 4))
    poses[:, :3, 0], poses[:, :3, 1], poses[:, :3, 2] = right, above, back
    poses[:, :3, 3], poses[:, 3, 3] = eyes, 1.0
    return [Camera(intrinsics, pose) for pose in poses]


@dataclass(frozen=True, slots=True)
class Grid:
    """Where a room is sampled: bounds in plan, metres."""

    x_min: float
    z_min: float
    x_max: float
    z_max: float
    base_y: float  # eye heights count from here


def grid_candidates(grid: Grid, fields: CameraFields, names: tuple[str | int, ...]) -> Candidates:
    """One random viewpoint in each cell for each sector (paper section 3.1).

    Position uniform in the cell, azimuth uniform in the sector (measured from +x towards +z),
    height uniform between the fields' bounds above the grid's base, a fixed tilt downwards (or a
    normal one about it, held to two standard deviations, when tilt_sd_deg is above 0), a roll
    likewise about 0. The focal length takes one of five values within hfov_spread of the fields'.
    names: what the randomness is hashed from besides sector and cell.
    """
    n_x, n_z = n_cells(grid, fields.cell_m)
    row, column = np.divmod(np.arange(n_x * n_z, dtype=np.int64), n_x)
    cell = np.stack([column, row], axis=1).astype(np.int32)
    step = 2 * np.pi / fields.n_sectors
    eyes, directions, zooms, rolls = [], [], [], []
    for sector in range(fields.n_sectors):
        # Draw nine numbers per cell: x, z, azimuth, height, two for the tilt, the lens, two for the roll.
        u = uniforms(int(keys.digest(*names, sector)[:16], 16), cell, 9)
        x = grid.x_min + (column + u[:, 0]) * fields.cell_m
        z = grid.z_min + (row + u[:, 1]) * fields.cell_m
        height = fields.height_min_m + u[:, 3] * (fields.height_max_m - fields.height_min_m)
        azimuth = (sector + u[:, 2]) * step
        tilt = np.deg2rad(fields.tilt_deg + fields.tilt_sd_deg * _normal_numbers(u[:, 4], u[:, 5]))
        # Few focal lengths: pictures of one are traced together.
        zooms.append(1 + fields.hfov_spread * (np.floor(5 * u[:, 6]) - 2) / 2)
        rolls.append(np.deg2rad(fields.roll_sd_deg * _normal_numbers(u[:, 7], u[:, 8])))
        eyes.append(np.stack([x, grid.base_y + height, z], axis=1))
        # Look along the azimuth, tilted down.
        directions.append(
            np.stack(
                [np.cos(azimuth) * np.cos(tilt), -np.sin(tilt), np.sin(azimuth) * np.cos(tilt)],
                axis=1,
            )
        )
    return Candidates(
        eye=np.concatenate(eyes),
        towards=np.concatenate(directions),
        sector=np.repeat(np.arange(fields.n_sectors, dtype=np.int32), len(cell)),
        cell=np.tile(cell, (fields.n_sectors, 1)),
        zoom=np.concatenate(zooms),
        roll=np.concatenate(rolls),
    )


def n_cells(grid: Grid, cell_m: float) -> tuple[int, int]:
    """Cells along x and z that cover the grid, at least one each."""
    return (
        max(1, int(np.ceil((grid.x_max - grid.x_min) / cell_m - 1e-9))),
        max(1, int(np.ceil((grid.z_max - grid.z_min) / cell_m - 1e-9))),
    )


def uniforms(key: int, cell: I32, n: int) -> F64:
    """(len(cell), n) in [0, 1) by SplitMix64's finalizer (Steele et al. 2014) over key, cell and number."""
    # Mix key, column and row into one state, then a number per index.
    state = np.full(len(cell), key % 2**64, np.uint64)
    for part in (cell[:, 0], cell[:, 1]):
        state = _splitmix64(state ^ part.astype(np.int64).astype(np.uint64))
    numbers = [_splitmix64(state ^ np.uint64(k)) for k in range(n)]
    # Keep 53 bits, as many as a float64 holds.
    return np.stack([(x >> np.uint64(11)).astype(np.float64) * 2.0**-53 for x in numbers], axis=1)


def _normal_numbers(u: F64, v: F64) -> F64:
    """Standard normal numbers from two uniform ones (Box and Muller 1958), held to -2..2."""
    return np.asarray(np.clip(np.sqrt(-2 * np.log1p(-u)) * np.cos(2 * np.pi * v), -2.0, 2.0))


def _splitmix64(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    x = x + np.uint64(0x9E3779B97F4A7C15)  # SplitMix64 (Steele et al. 2014)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
