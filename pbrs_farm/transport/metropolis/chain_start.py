"""How the chains of `metropolis` begin: independent paths, their importance, a draw of them; no effects."""

from __future__ import annotations

from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.raycast.host_memory import with_slack
from pbrs_farm.transport.kernels.sampler import HashedSampler, device_array, stream_key
from pbrs_farm.transport.metropolis.film import ChainContext, Chains, Film
from pbrs_farm.transport.metropolis.markov_chains import STORED_DIMS, draw_paths
from pbrs_farm.transport.metropolis.suffixes import SUFFIX_FLOATS

_PATHS_PER_TILE: Final = 256  # of the importance
_MIN_RELATIVE_LIGHT: Final = 0.05  # of the mean, in the importance


def flat_film(shape: tuple[int, int]) -> Film:
    """A black film of even importance."""
    height, width = shape
    flat = device_array(mi.Float, np.ones(height * width, np.float32))
    splats = dr.zeros(mi.Float, 2 * height * width * 3)
    return Film(dr.opaque(mi.UInt32, width), dr.opaque(mi.UInt32, height), splats, flat)


def with_importance(
    context: ChainContext, shape: tuple[int, int], n_paths: int, seed: int
) -> ChainContext:
    """The context with the film's importance, estimated by n_paths paths: chains visit dark parts, too."""
    pilot = _draw_paths(context, n_paths, seed)
    importance = pixel_importance(shape, pilot.pixel.numpy(), pilot.target.numpy())
    on_device = device_array(mi.Float, importance.ravel())
    return context._replace(film=context.film._replace(importance=on_device))


def pixel_importance(shape: tuple[int, int], pixels: NDArray[np.uint32], luminances: F32) -> F32:
    """(H, W) what a unit of luminance counts: about 1 / the light expected at a pixel.

    Without it chains go where the picture is bright; with it every pixel gets its share (Veach's
    two stages, 1997). From N paths, their pixels and luminances: means over tiles of about
    _PATHS_PER_TILE, blended between tiles, held above a part of the mean. Any positive ones are unbiased.
    """
    height, width = shape
    side = max(int(np.sqrt(_PATHS_PER_TILE * height * width / len(pixels))), 1)
    rows, columns = -(-height // side), -(-width // side)
    tile = (pixels // width // side) * columns + pixels % width // side
    count = np.bincount(tile, minlength=rows * columns)
    total = np.bincount(tile, luminances.astype(np.float64), rows * columns)
    grid = (total / np.maximum(count, 1)).reshape(rows, columns)
    mean = grid.mean()
    if not mean > 0:
        return np.ones(shape, np.float32)
    y, x = (_blend_tiles(n, side, m) for n, m in ((height, rows), (width, columns)))
    light = y @ grid @ x.T
    return np.asarray(mean / (light + _MIN_RELATIVE_LIGHT * mean), np.float32)


def _blend_tiles(n: int, side: int, n_tiles: int) -> F64:
    """(n, n_tiles) linear weights of tiles of `side` pixels at each of n pixels."""
    tile = np.clip((np.arange(n) + 0.5) / side - 0.5, 0, n_tiles - 1)
    return np.asarray(np.maximum(1 - np.abs(tile[:, None] - np.arange(n_tiles)[None]), 0))


def _path_keys(n: int, seed: int) -> Any:
    return stream_key(dr.arange(mi.UInt32, n), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))


def _draw_paths(context: ChainContext, n: int, seed: int) -> Chains:
    """n independent paths."""
    paths = draw_paths(context, HashedSampler(_path_keys(n, seed), mi.UInt32(0)), n)
    dr.eval(*paths)
    return paths


def bootstrap_chains(
    context: ChainContext, n_bootstrap: int, n_chains: int, seed: int
) -> tuple[Chains | None, float]:
    """(chains at paths drawn in proportion to I, None where no path brings light; sum of I over all paths)."""
    paths = _draw_paths(context, n_bootstrap, seed)
    key = _path_keys(n_bootstrap, seed)
    targets = paths.target.numpy().astype(np.float64)
    if targets.sum() <= 0:
        return None, 0.0
    # Choose by equidistant quantiles from a random offset, in random order.
    quantiles = (np.arange(n_chains) + np.random.default_rng(seed).random()) / n_chains
    chosen = np.searchsorted(np.cumsum(targets) / targets.sum(), quantiles)
    chosen = np.random.default_rng(seed + 1).permutation(np.minimum(chosen, n_bootstrap - 1))
    rows = mi.UInt32(with_slack(chosen.astype(np.uint32)))

    # Draw the numbers of the chosen paths again; copy what the paths are.
    n, n_paths = dr.opaque(mi.UInt32, n_chains), dr.opaque(mi.UInt32, n_bootstrap)
    index = dr.arange(mi.UInt32, STORED_DIMS * n_chains)
    keys = dr.gather(mi.UInt32, key, dr.gather(mi.UInt32, rows, index % n))
    column = dr.arange(mi.UInt32, SUFFIX_FLOATS * n_chains)
    source = column // n * n_paths + dr.gather(mi.UInt32, rows, column % n)
    chains = Chains(
        samples=HashedSampler(keys, mi.UInt32(0)).get_1d(index // n),
        light=dr.gather(mi.Color3f, paths.light, rows),
        target=dr.gather(mi.Float, paths.target, rows),
        pixel=dr.gather(mi.UInt32, paths.pixel, rows),
        shared=dr.gather(mi.Float, paths.shared, rows),
        suffixes=dr.gather(mi.Float, paths.suffixes, source),
    )
    dr.eval(*chains)
    return chains, float(targets.sum())
