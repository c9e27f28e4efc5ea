"""Primary-sample-space Metropolis light transport over the camera path: `pssmlt-camera`; no effects.

Kelemen et al. 2002. A path is a function of a point u of the unit cube: two numbers for the film,
ten for each vertex (path_step.py). With F(u) its radiance beyond direct light and I(u), the target
function, the luminance of F times the importance of its pixel, each of many chains in parallel

    1. proposes u' : with chance p a fresh point (large step), else every number moved a little,
    2. accepts it with chance a = min(1, I(u') / I(u)),
    3. adds a F(u') / I(u') and (1 - a) F(u) / I(u) to the film (expected values),

so that the film converges to F, times I / b, with b the mean of I, known from the bootstrap and
from all large steps (markov_chains.py). Chains start at bootstrap paths drawn in proportion to I.
The importance is about 1 / the light expected at a pixel, from paths of its own (Veach's two
stages, 1997): dark corners get their share.

Instead of 3., a path whose first two vertices are rough and see each other is shown, every few
steps, to a thousand other pixels that see its second vertex too (reconnection.py).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.path_state import (
    ALL_EMITTERS,
    EmitterFilter,
    PathContext,
    device_camera,
    device_fields,
)
from pbrs_farm.transport.kernels.sampler import HashedSampler, device_array, stream_key
from pbrs_farm.transport.metropolis.film import ChainContext, Chains, Film
from pbrs_farm.transport.metropolis.markov_chains import (
    STORED_DIMS,
    ChainSums,
    Mutations,
    draw_paths,
    mutate,
)
from pbrs_farm.transport.metropolis.reconnection import (
    SUFFIX_FLOATS,
    reconnect,
    stratified_groups,
    trace_prefixes,
)

_MIN_RR_DEPTH: Final = 3
_STEPS_PER_LAUNCH: Final = 16
_MIN_STEPS: Final = 64  # of a chain
_MIN_RECONNECT_SEGMENTS: Final = 3
_STEPS_PER_PREFIX: Final = 4 * _STEPS_PER_LAUNCH
_PATHS_PER_TILE: Final = 256  # of the importance
_MIN_RELATIVE_LIGHT: Final = 0.05  # of the mean, in the importance
_MIN_BOOTSTRAP, _MAX_BOOTSTRAP = 1 << 14, 1 << 18  # paths


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Light beyond direct of one group by Metropolis."""

    halves: tuple[F32, F32]  # (H, W, 3) of independent chains
    mean_luminance: float  # of the picture
    acceptance: float  # of small and large steps together
    n_mutations: int
    n_bad: int  # paths that were not finite


@dataclass(slots=True)
class _Totals:
    """Sums over all chains and launches."""

    target: float  # over independent paths
    n_paths: float  # their number
    n_accepted: float = 0.0
    n_bad: int = 0
    n_steps: int = 0  # of each chain

    def add(self, sums: ChainSums, n_steps: int) -> None:
        """Add the sums of one launch."""
        self.target += float(np.sum(sums.target.numpy(), dtype=np.float64))
        self.n_paths += float(np.sum(sums.n_large.numpy(), dtype=np.float64))
        self.n_accepted += float(np.sum(sums.n_accepted.numpy(), dtype=np.float64))
        self.n_bad += int(np.sum(sums.n_bad.numpy(), dtype=np.int64))
        self.n_steps += n_steps


def metropolis(
    scene: DeviceScene,
    emitters: Emitters,
    camera: Camera,
    group: Group,
    fields: LightFields,
    seed: int,
    *,
    min_segments: int = 3,
    deadline: float | None = None,
) -> Estimate:
    """Light of paths of min_segments or more (3: all but direct light) of one group.

    deadline: mutate until this time.monotonic(), instead of fields.mutations_per_pixel times.
    """
    shape = (camera.intrinsics.height_px, camera.intrinsics.width_px)
    black = np.zeros((*shape, 3), np.float32)
    nothing = Estimate((black, black), 0.0, 0.0, 0, 0)
    if not emitters.has_group(group):
        return nothing
    n_pixels = shape[0] * shape[1]
    wanted = fields.mutations_per_pixel * n_pixels
    n_chains = int(np.clip(wanted // _MIN_STEPS, 16, fields.chains)) & ~1
    n_bootstrap = int(np.clip(wanted, _MIN_BOOTSTRAP, _MAX_BOOTSTRAP))

    # Bootstrap the importance, then the chains.
    paths = _path_context(scene, emitters, group, fields)
    context = ChainContext(
        paths, device_camera(camera), _flat_film(shape), dr.opaque(mi.UInt32, min_segments)
    )
    context = _with_importance(context, shape, n_bootstrap // 4, seed ^ 0x5BD1E995)
    chains, target = _bootstrap_chains(context, n_bootstrap, n_chains, seed)
    if chains is None:
        return nothing

    # Run the chains.
    totals = _Totals(target, n_bootstrap)
    n_steps = -(-wanted // n_chains) if deadline is None else 1 << 31
    n_shared = fields.tail_pixels if min_segments >= _MIN_RECONNECT_SEGMENTS else 0
    _run(context, chains, totals, fields.large_step, n_steps, deadline, shape, n_shared, seed)

    # Scale the film to the mean of the target function.
    n_mutations = totals.n_steps * n_chains
    scale = np.float32(totals.target / totals.n_paths * n_pixels / (n_mutations / 2))
    splats = context.film.splats.numpy().reshape(2, *shape, 3)
    halves = splats[0] * scale, splats[1] * scale
    mean = float(np.mean((halves[0] + halves[1]) @ LUMINANCE) / 2)
    return Estimate(halves, mean, totals.n_accepted / n_mutations, n_mutations, totals.n_bad)


def _path_context(
    scene: DeviceScene, emitters: Emitters, group: Group, fields: LightFields
) -> PathContext:
    """Paths that see one group.

    Roulette is late: where it ends a path early, the path's neighbours are lost to the chain, too;
    and never at the first two vertices, so that a suffix does not depend on its prefix.
    """
    every = dr.opaque(mi.Int32, ALL_EMITTERS)
    is_indoor = group is Group.INDOOR
    emitter_filter = EmitterFilter(every, None) if is_indoor else EmitterFilter(None, every)
    late = fields.model_copy(update={"rr_depth": max(fields.rr_depth, _MIN_RR_DEPTH)})
    return PathContext(scene, emitters, device_fields(late), emitter_filter)


def _run(
    context: ChainContext,
    chains: Chains,
    totals: _Totals,
    large_step: float,
    n_steps: int,
    deadline: float | None,
    shape: tuple[int, int],
    n_shared: int,
    seed: int,
) -> None:
    """Launch after launch up to n_steps or the deadline, at least one; n_shared: 0 or pixels that
    share a suffix."""
    reconnects = dr.opaque(mi.Bool, n_shared > 0)
    p_large = dr.opaque(mi.Float, large_step)
    mutation_seed = dr.opaque(mi.UInt32, (seed ^ 0x3C6EF372) & 0xFFFFFFFF)  # not the bootstrap's
    prefixes: Any = None
    while totals.n_steps < n_steps and (
        deadline is None or totals.n_steps == 0 or time.monotonic() < deadline
    ):
        first = totals.n_steps
        n = min(_STEPS_PER_LAUNCH, n_steps - first)
        steps = dr.opaque(mi.UInt32, first), dr.opaque(mi.UInt32, first + n)
        how = Mutations(*steps, p_large, mutation_seed, reconnects)
        chains, sums = mutate(context, chains, how)
        dr.eval(*chains, sums, context.film.splats)
        if n_shared > 0:
            if first % _STEPS_PER_PREFIX == 0:
                prefixes = trace_prefixes(context, shape[0] * shape[1], seed + first)
            groups = stratified_groups(*shape, n_shared, seed + first)
            weight = dr.opaque(mi.Float, n)
            reconnect(context.paths.scene, context.film, prefixes, groups, chains, weight)
        totals.add(sums, n)


def _flat_film(shape: tuple[int, int]) -> Film:
    """A black film of even importance."""
    height, width = shape
    flat = device_array(mi.Float, np.ones(height * width, np.float32))
    splats = dr.zeros(mi.Float, 2 * height * width * 3)
    return Film(dr.opaque(mi.UInt32, width), dr.opaque(mi.UInt32, height), splats, flat)


def _with_importance(
    context: ChainContext, shape: tuple[int, int], n_paths: int, seed: int
) -> ChainContext:
    """The context with the film's importance as n_paths independent paths tell it."""
    pilot = _draw(context, n_paths, seed)
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
    y, x = (_between(n, side, m) for n, m in ((height, rows), (width, columns)))
    light = y @ grid @ x.T
    return np.asarray(mean / (light + _MIN_RELATIVE_LIGHT * mean), np.float32)


def _between(n: int, side: int, n_tiles: int) -> F64:
    """(n, n_tiles) linear weights of tiles of `side` pixels at each of n pixels."""
    at = np.clip((np.arange(n) + 0.5) / side - 0.5, 0, n_tiles - 1)
    return np.asarray(np.maximum(1 - np.abs(at[:, None] - np.arange(n_tiles)[None]), 0))


def _path_keys(n: int, seed: int) -> Any:
    return stream_key(dr.arange(mi.UInt32, n), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))


def _draw(context: ChainContext, n: int, seed: int) -> Chains:
    """n independent paths."""
    paths = draw_paths(context, HashedSampler(_path_keys(n, seed), mi.UInt32(0)), n)
    dr.eval(*paths)
    return paths


def _bootstrap_chains(
    context: ChainContext, n_bootstrap: int, n_chains: int, seed: int
) -> tuple[Chains | None, float]:
    """(chains at independent paths, drawn in proportion to I; sum of I over n_bootstrap paths).

    None where no path brings light.
    """
    paths = _draw(context, n_bootstrap, seed)
    key = _path_keys(n_bootstrap, seed)
    targets = paths.target.numpy().astype(np.float64)
    if targets.sum() <= 0:
        return None, 0.0
    # Choose by equidistant quantiles from a random offset, in random order.
    quantiles = (np.arange(n_chains) + np.random.default_rng(seed).random()) / n_chains
    chosen = np.searchsorted(np.cumsum(targets) / targets.sum(), quantiles)
    chosen = np.random.default_rng(seed + 1).permutation(np.minimum(chosen, n_bootstrap - 1))
    at = mi.UInt32(chosen.astype(np.uint32))

    # Draw the numbers of the chosen paths again; copy what the paths are.
    index = dr.arange(mi.UInt32, STORED_DIMS * n_chains)
    keys = dr.gather(mi.UInt32, key, dr.gather(mi.UInt32, at, index % n_chains))
    column = dr.arange(mi.UInt32, SUFFIX_FLOATS * n_chains)
    source = column // n_chains * n_bootstrap + dr.gather(mi.UInt32, at, column % n_chains)
    chains = Chains(
        samples=HashedSampler(keys, mi.UInt32(0)).get_1d(index // n_chains),
        light=dr.gather(mi.Color3f, paths.light, at),
        target=dr.gather(mi.Float, paths.target, at),
        pixel=dr.gather(mi.UInt32, paths.pixel, at),
        is_reconnectable=dr.gather(mi.Bool, paths.is_reconnectable, at),
        suffixes=dr.gather(mi.Float, paths.suffixes, source),
    )
    dr.eval(*chains)
    return chains, float(targets.sum())
