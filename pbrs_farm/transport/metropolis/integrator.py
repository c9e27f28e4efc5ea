"""Primary-sample-space Metropolis light transport over the camera path: `pssmlt-camera`.

Kelemen et al. 2002. A path is a function of a point u of the unit cube: two numbers for the film,
ten for each vertex (step.py). With F(u) its radiance beyond direct light and I(u) the luminance of
F times the importance of its pixel, each of many chains in parallel

    1. proposes u' : with chance p a fresh point (large step), else every number moved a little,
    2. accepts it with chance a = min(1, I(u') / I(u)),
    3. adds a F(u') / I(u') and (1 - a) F(u) / I(u) to the film (expected values),

so that the film converges to b F / I weighted by I / b, with b the mean of I, known from the
bootstrap and from all large steps (chains.py). Chains start at bootstrap paths drawn in proportion
to I. Importance is about 1 / the light expected at a pixel, from paths of its own (Veach's two
stages, 1997): dark corners get their share.

Instead of 3., a path whose first two vertices are rough and see each other is shown, every few
steps, to a thousand other pixels that see its second vertex too (tails.py): the lens mutations of
Veach, all outcomes at once. No effects.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.path_state import (
    EmitterFilter,
    PathContext,
    device_camera,
    device_fields,
)
from pbrs_farm.transport.kernels.sampler import HashedSampler, device_array, stream_key
from pbrs_farm.transport.metropolis.film import Film
from pbrs_farm.transport.metropolis.markov_chains import STORED_DIMS, Chains, draw_paths, mutate
from pbrs_farm.transport.metropolis.reconnection import (
    TAIL_FLOATS,
    deal,
    first_vertices,
    show_tails,
)

_RR_DEPTH: Final = 3
_STEPS_PER_LAUNCH: Final = 16
_MIN_STEPS: Final = 64
_TAIL_SEGMENTS: Final = 3
_LAUNCHES_PER_HEAD: Final = 4
_PATHS_PER_TILE: Final = 256
_FLOOR: Final = 0.05
_BOOTSTRAP: Final = (1 << 14, 1 << 18)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Light beyond direct of one group by Metropolis.

    halves: two (H, W, 3) float32 radiance pictures of independent chains. mean_luminance: of the
    picture. acceptance: of small and large steps together. n_mutations; n_bad: paths not finite.
    """

    halves: tuple[NDArray[np.float32], NDArray[np.float32]]
    mean_luminance: float
    acceptance: float
    n_mutations: int
    n_bad: int


@dataclass(slots=True)
class _Tally:
    """What the launches add up to: sum and number of I over independent paths, counts."""

    level: float
    n_paths: float
    n_accepted: float = 0.0
    n_bad: int = 0
    n_steps: int = 0

    def add(self, sums: tuple[Any, ...], n_steps: int) -> None:
        """Add the sums of one launch, per chain."""
        self.level += float(np.sum(sums[0].numpy(), dtype=np.float64))
        self.n_paths += float(np.sum(sums[1].numpy(), dtype=np.float64))
        self.n_accepted += float(np.sum(sums[2].numpy(), dtype=np.float64))
        self.n_bad += int(np.sum(sums[3].numpy(), dtype=np.int64))
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

    fields.mutations_per_pixel counts unless deadline (time.monotonic()) is given: then mutations
    go on until it has passed.
    """
    i = camera.intrinsics
    shape = (i.height_px, i.width_px)
    black = np.zeros((*shape, 3), np.float32)
    nothing = Estimate((black, black), 0.0, 0.0, 0, 0)
    if not emitters.has_group(group):
        return nothing
    n_pixels = i.width_px * i.height_px
    wanted = fields.mutations_per_pixel * n_pixels
    n_chains = int(np.clip(wanted // _MIN_STEPS, 16, fields.chains)) & ~1
    on = dr.opaque(mi.Int32, -1)
    emitter_filter = EmitterFilter(on, None) if group is Group.INDOOR else EmitterFilter(None, on)
    # Roulette late: where it ends a path early, the path's neighbours are lost to the chain too;
    # and never at the first two vertices, so that a tail does not depend on its head.
    late = fields.model_copy(update={"rr_depth": max(fields.rr_depth, _RR_DEPTH)})
    segments = dr.opaque(mi.UInt32, min_segments)
    context = PathContext(
        scene, emitters, device_camera(camera), device_fields(late), emitter_filter, segments
    )

    n_bootstrap = int(np.clip(wanted, *_BOOTSTRAP))
    film = _film(context, shape, n_bootstrap // 4, seed ^ 0x5BD1E995)
    chains, total = _started(context, film, n_bootstrap, n_chains, seed)
    if chains is None:
        return nothing

    n_tail_pixels = fields.tail_pixels if min_segments >= _TAIL_SEGMENTS else 0
    shares = dr.opaque(mi.Bool, n_tail_pixels > 0)
    p_large = dr.opaque(mi.Float, fields.large_step)
    tally = _Tally(total, n_bootstrap)
    n_steps = -(-wanted // n_chains) if deadline is None else 1 << 31
    heads: Any = None
    while tally.n_steps < n_steps and (
        deadline is None or tally.n_steps == 0 or time.monotonic() < deadline
    ):
        first = tally.n_steps
        n = min(_STEPS_PER_LAUNCH, n_steps - first)
        steps = dr.opaque(mi.UInt32, first), dr.opaque(mi.UInt32, first + n)
        chains, sums = mutate(context, film, chains, steps, p_large, _mutation_seed(seed), shares)
        dr.eval(*chains, sums, film.splats)
        if n_tail_pixels > 0:
            if first % (_LAUNCHES_PER_HEAD * _STEPS_PER_LAUNCH) == 0:
                heads = first_vertices(context, film, n_pixels, seed + first)
            groups = deal(*shape, n_tail_pixels, seed + first)
            show_tails(scene, film, heads, groups, chains, dr.opaque(mi.Float, n))
        tally.add(sums, n)

    n_mutations = tally.n_steps * n_chains
    scale = np.float32(tally.level / tally.n_paths * n_pixels / (n_mutations / 2))
    splats = film.splats.numpy().reshape(2, *shape, 3)
    halves = splats[0] * scale, splats[1] * scale
    mean = float(np.mean((halves[0] + halves[1]) @ LUMINANCE) / 2)
    return Estimate(halves, mean, tally.n_accepted / n_mutations, n_mutations, tally.n_bad)


def _film(context: PathContext, shape: tuple[int, int], n_paths: int, seed: int) -> Film:
    """A black film whose importance is known from n_paths independent paths."""
    height, width = shape
    flat = device_array(mi.Float, np.ones(height * width, np.float32))
    splats = dr.zeros(mi.Float, 2 * height * width * 3)
    film = Film(dr.opaque(mi.UInt32, width), dr.opaque(mi.UInt32, height), splats, flat)
    pilot = _drawn(context, film, n_paths, seed)
    importance = importance_of(shape, pilot.pixel.numpy(), pilot.level.numpy())
    return film._replace(importance=device_array(mi.Float, importance.ravel()))


def importance_of(
    shape: tuple[int, int], pixels: NDArray[np.uint32], levels: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(H, W) what a unit of luminance counts: about 1 / the light expected at a pixel.

    Without it chains go where the picture is bright; with it every pixel gets its share (Veach's
    two stages, 1997). From N paths, their pixels and luminances: means over tiles of about
    PATHS_PER_TILE, blended between tiles, held above FLOOR of the mean. Any positive values are
    unbiased.
    """
    height, width = shape
    side = max(int(np.sqrt(_PATHS_PER_TILE * height * width / len(pixels))), 1)
    rows, columns = -(-height // side), -(-width // side)
    tile = (pixels // width // side) * columns + pixels % width // side
    count = np.bincount(tile, minlength=rows * columns)
    total = np.bincount(tile, levels.astype(np.float64), rows * columns)
    grid = (total / np.maximum(count, 1)).reshape(rows, columns)
    mean = grid.mean()
    if not mean > 0:
        return np.ones(shape, np.float32)
    y, x = (_between(n, side, m) for n, m in ((height, rows), (width, columns)))
    light = y @ grid @ x.T
    return np.asarray(mean / (light + _FLOOR * mean), np.float32)


def _between(n: int, side: int, n_tiles: int) -> NDArray[np.float64]:
    """(n, n_tiles) linear weights of tiles of `side` pixels at each of n pixels."""
    at = np.clip((np.arange(n) + 0.5) / side - 0.5, 0, n_tiles - 1)
    return np.asarray(np.maximum(1 - np.abs(at[:, None] - np.arange(n_tiles)[None]), 0))


def _path_keys(n: int, seed: int) -> Any:
    return stream_key(dr.arange(mi.UInt32, n), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))


def _drawn(context: PathContext, film: Film, n: int, seed: int) -> Chains:
    """n independent paths."""
    found = draw_paths(context, film, HashedSampler(_path_keys(n, seed), mi.UInt32(0)))
    dr.eval(*found)
    return found


def _started(
    context: PathContext, film: Film, n_bootstrap: int, n_chains: int, seed: int
) -> tuple[Chains | None, float]:
    """(chains at independent paths, drawn in proportion to I; sum of I over n_bootstrap paths).

    None where no path brings light.
    """
    found = _drawn(context, film, n_bootstrap, seed)
    key = _path_keys(n_bootstrap, seed)
    levels = found.level.numpy().astype(np.float64)
    if levels.sum() <= 0:
        return None, 0.0
    offsets = (np.arange(n_chains) + np.random.default_rng(seed).random()) / n_chains
    chosen = np.searchsorted(np.cumsum(levels) / levels.sum(), offsets)
    chosen = np.random.default_rng(seed + 1).permutation(np.minimum(chosen, n_bootstrap - 1))
    at = mi.UInt32(chosen.astype(np.uint32))
    index = dr.arange(mi.UInt32, STORED_DIMS * n_chains)
    keys = dr.gather(mi.UInt32, key, dr.gather(mi.UInt32, at, index % n_chains))
    index_tail = dr.arange(mi.UInt32, TAIL_FLOATS * n_chains)
    source = index_tail // n_chains * n_bootstrap + dr.gather(mi.UInt32, at, index_tail % n_chains)
    chains = Chains(
        HashedSampler(keys, mi.UInt32(0)).get_1d(index // n_chains),
        dr.gather(mi.Color3f, found.light, at),
        dr.gather(mi.Float, found.level, at),
        dr.gather(mi.UInt32, found.pixel, at),
        dr.gather(mi.Bool, found.is_shared, at),
        dr.gather(mi.Float, found.tails, source),
    )
    dr.eval(*chains)
    return chains, float(levels.sum())


def _mutation_seed(seed: int) -> Any:
    """The seed of the mutations, apart from the bootstrap's."""
    return dr.opaque(mi.UInt32, (seed ^ 0x3C6EF372) & 0xFFFFFFFF)
