"""Shared by Metropolis's chains: states, target function, and the film; kernels, no effects."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.transport.kernels.bsdf import luminance
from pbrs_farm.transport.kernels.camera_rays import DeviceCamera, LensCamera
from pbrs_farm.transport.kernels.path_state import PathContext, film_position

ROUND_STEPS: Final = 16  # of a chain, from one reconnection to the next
NO_PIXEL: Final = 0xFFFFFFFF


class Film(NamedTuple):
    """The picture that chains splat on."""

    width: Any  # px, opaque
    height: Any
    splats: Any  # (2 * pixels * 3,) sums of the two halves, by odd and even chains
    importance: Any  # (pixels,) how much a unit of luminance counts for the chains


class ChainContext(NamedTuple):
    """Inputs shared by all chains."""

    paths: PathContext
    camera: DeviceCamera | LensCamera
    film: Film
    min_segments: Any  # of paths whose light counts


class Chains(NamedTuple):
    """Current states of N chains."""

    samples: Any  # (STORED_DIMS * N,) numbers in the unit cube, dimension by dimension
    light: Any  # Color3f
    target: Any  # target function of the light
    pixel: Any  # UInt32
    shared: Any  # share of the light reconnected to other pixels, 0 = all stays with its own pixel
    suffixes: Any  # (SUFFIX_FLOATS * N,), column by column (suffixes.py)


def sample_film(film: Film, u: Any, is_tent: Any) -> tuple[Any, Any, Any]:
    """(pixel index, its corner in pixels, offset spread by the filter) from u in [0, 1)^2 over the picture."""
    x, y = u.x * mi.Float(film.width), u.y * mi.Float(film.height)
    column = dr.minimum(mi.UInt32(x), film.width - 1)
    row = dr.minimum(mi.UInt32(y), film.height - 1)
    inside = mi.Point2f(dr.clip(x - mi.Float(column), 0, 1), dr.clip(y - mi.Float(row), 0, 1))
    corner = mi.Point2f(mi.Float(column), mi.Float(row))
    return row * film.width + column, corner, film_position(inside, is_tent)


def sample_pixel(film: Film, pixel: Any, u: Any, is_tent: Any) -> tuple[Any, Any]:
    """(a pixel's corner in pixels, offset spread by the filter) of two numbers."""
    corner = mi.Point2f(mi.Float(pixel % film.width), mi.Float(pixel // film.width))
    return corner, film_position(u, is_tent)


def target_function(film: Film, pixel: Any, light: Any, active: Any = True) -> Any:
    """Target density of the chains: the luminance of light (Color3f) at a pixel times its importance."""
    return luminance(light) * dr.gather(mi.Float, film.importance, pixel, active)


def splat(film: Film, chain: Any, pixel: Any, value: Any, active: Any) -> None:
    """Add a value to a pixel of the chain's half of the film (even and odd chains), atomically."""
    first = ((chain & 1) * (film.width * film.height) + pixel) * 3
    for c in range(3):
        # In this mode the kernel does not depend on the picture's size.
        dr.scatter_add(film.splats, value[c], first + c, active, mode=dr.ReduceMode.Direct)


class PixelGroups(NamedTuple):
    """The pixels in groups of n; a group's slots are neighbours."""

    slots: NDArray[np.uint32]  # (pixels,) slot of each
    pixels: NDArray[np.uint32]  # (slots,) pixel of each, NO_PIXEL = none
    n: int


def stratified_groups(height: int, width: int, n: int, seed: int) -> PixelGroups:
    """Groups of at most n pixels (of one, where n is 0), each spread over the whole picture.

    The picture is cut into as many square cells as a group may have pixels; every cell gives its
    pixels to different groups, at random, so that neighbours do not share their noise.
    """
    # Find the smallest cells of which there are no more than n.
    side = 1
    while -(-height // side) * -(-width // side) > max(n, 1):
        side += 1
    rows, columns = -(-height // side), -(-width // side)
    n_cells = rows * columns
    # Number the pixels of each cell at random: the number is the group, the cell the place in it.
    rng = np.random.default_rng(seed)
    order = rng.permuted(np.tile(np.arange(side * side), (n_cells, 1)), axis=1)
    y, x = np.mgrid[0:height, 0:width]
    cell = y // side * columns + x // side
    slots = order[cell, y % side * side + x % side] * n_cells + cell
    pixels = np.full(side * side * n_cells, NO_PIXEL, np.uint32)
    pixels[slots.ravel()] = np.arange(width * height, dtype=np.uint32)
    return PixelGroups(slots.ravel().astype(np.uint32), pixels, n_cells)
