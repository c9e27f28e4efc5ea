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
steps, to a thousand other pixels that see its second vertex too (reconnection.py); what two close
vertices send each other stays mostly with 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.kernels.camera_rays import device_camera
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.path_state import (
    ALL_EMITTERS,
    EmitterFilter,
    PathContext,
    device_fields,
)
from pbrs_farm.transport.kernels.sampler import HashedSampler, device_array, stream_key
from pbrs_farm.transport.light_result import Arrays
from pbrs_farm.transport.metropolis.film import (
    ROUND_STEPS,
    ChainContext,
    Chains,
    Film,
    stratified_groups,
)
from pbrs_farm.transport.metropolis.markov_chains import (
    STORED_DIMS,
    ChainSums,
    Mutations,
    draw_paths,
    mutate,
)
from pbrs_farm.transport.metropolis.reconnection import (
    Prefixes,
    Rounds,
    prefix_schedule,
    reconnect,
    trace_prefixes,
)
from pbrs_farm.transport.metropolis.suffixes import SUFFIX_FLOATS, no_records
from pbrs_farm.transport.sample_passes import SampledView

# How the chains of `metropolis` begin: independent paths, their importance, a draw of them.


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


def bootstrap_chains(
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
    n, n_paths = dr.opaque(mi.UInt32, n_chains), dr.opaque(mi.UInt32, n_bootstrap)
    index = dr.arange(mi.UInt32, STORED_DIMS * n_chains)
    keys = dr.gather(mi.UInt32, key, dr.gather(mi.UInt32, at, index % n))
    column = dr.arange(mi.UInt32, SUFFIX_FLOATS * n_chains)
    source = column // n * n_paths + dr.gather(mi.UInt32, at, column % n)
    chains = Chains(
        samples=HashedSampler(keys, mi.UInt32(0)).get_1d(index // n),
        light=dr.gather(mi.Color3f, paths.light, at),
        target=dr.gather(mi.Float, paths.target, at),
        pixel=dr.gather(mi.UInt32, paths.pixel, at),
        shared=dr.gather(mi.Float, paths.shared, at),
        suffixes=dr.gather(mi.Float, paths.suffixes, source),
    )
    dr.eval(*chains)
    return chains, float(targets.sum())


# Primary-sample-space Metropolis light transport over the camera path.


MIN_STEPS: Final = 64  # of a chain
_MIN_RR_DEPTH: Final = 3
_MIN_RECONNECT_SEGMENTS: Final = 3
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


class ChainRun:
    """The chains of one light group under way, and the film they have splatted on.

    The same chains go on from the same state to the same picture (its splats are added in parallel:
    to 1e-5); `state` gives it, `chain_run` takes it.
    """

    def __init__(
        self, view: SampledView, context: ChainContext, min_segments: int, started: _Started
    ) -> None:
        i, fields = view.camera.intrinsics, view.fields
        self._shape, self._n_pixels = (i.height_px, i.width_px), i.height_px * i.width_px
        self._context = context
        self._chains, self._totals = started
        self._seed = view.seed
        self._n_shared = fields.tail_pixels if min_segments >= _MIN_RECONNECT_SEGMENTS else 0
        self._p_large = dr.opaque(mi.Float, fields.large_step)
        self._prefixes: Prefixes | None = None
        self.n_chains = int(dr.width(self._chains.target))
        self.n_wanted = -(-_wanted(view) // self.n_chains)  # steps of each chain

    @property
    def n_steps(self) -> int:
        """Steps of each chain so far."""
        return self._totals.n_steps

    def advance(self, n_steps: int) -> None:
        """Make n_steps more of every chain, in one launch, and share their suffixes in another.

        Suffixes are shared once in ROUND_STEPS: n_steps is whole rounds, or the last steps of all.
        """
        first = self.n_steps
        n_rounds = -(-n_steps // ROUND_STEPS) if self._n_shared > 0 else 0
        records = no_records(max(n_rounds, 1), self.n_chains)
        how = Mutations(
            first=dr.opaque(mi.UInt32, first),
            last=dr.opaque(mi.UInt32, first + n_steps),
            p_large=self._p_large,
            seed=dr.opaque(mi.UInt32, (self._seed ^ 0x3C6EF372) & 0xFFFFFFFF),  # no bootstrap's
            reconnects=dr.opaque(mi.Bool, n_rounds > 0),
            records=records,
        )
        self._chains, sums = mutate(self._context, self._chains, how)
        film = self._context.film
        dr.eval(*self._chains, sums, film.splats, records)
        if n_rounds > 0:
            start = first // ROUND_STEPS
            schedule = prefix_schedule(self.n_chains, self._n_pixels)
            numbers = range(start, start + n_rounds)
            rounds = Rounds(numbers, n_steps, self._n_shared, schedule)
            groups = [
                stratified_groups(*self._shape, self._n_shared, self._seed + r * ROUND_STEPS)
                for r in numbers
            ]
            prefixes = self._prefixes_of(schedule.sets_of(numbers))
            scene = self._context.paths.scene
            reconnect(scene, film, prefixes, groups, records, rounds)
        self._totals.add(sums, n_steps)

    def _prefixes_of(self, sets: range) -> Prefixes:
        """These sets of prefixes, traced unless the last launch had them all."""
        held = self._prefixes
        if held is None or sets.start < held.sets.start or sets.stop > held.sets.stop:
            self._prefixes = held = None  # a set of a large picture is a gigabyte: never keep both
            held = trace_prefixes(self._context, self._n_pixels, sets, self._seed)
        self._prefixes = held
        return held

    def estimate(self) -> Estimate:
        """The light so far, scaled to the mean of the target function."""
        totals, film = self._totals, self._context.film
        n_mutations = totals.n_steps * self.n_chains
        scale = np.float32(totals.target / totals.n_paths * self._n_pixels / (n_mutations / 2))
        splats = film.splats.numpy().reshape(2, *self._shape, 3)
        halves = splats[0] * scale, splats[1] * scale
        mean = float(np.mean((halves[0] + halves[1]) @ LUMINANCE) / 2)
        return Estimate(halves, mean, totals.n_accepted / n_mutations, n_mutations, totals.n_bad)

    def state(self) -> Arrays:
        """What chain_run goes on from: film, importance, chains and sums."""
        film, t = self._context.film, self._totals
        sums = np.array([t.target, t.n_paths, t.n_accepted, t.n_bad, t.n_steps], np.float64)
        chains = {name: getattr(self._chains, name).numpy() for name in Chains._fields}
        return chains | {
            "splats": film.splats.numpy(),
            "importance": film.importance.numpy(),
            "sums": sums,
        }


_Started = tuple[Chains, _Totals]


def chain_run(
    view: SampledView, group: Group, *, min_segments: int = 3, kept: Arrays | None = None
) -> ChainRun | None:
    """The chains of one group that sample paths of min_segments or more (3: all but direct light).

    None where no path brings light. kept: the state of a run of the same arguments, to go on from.
    """
    if not view.emitters.has_group(group):
        return None
    i = view.camera.intrinsics
    paths = _path_context(view.scene, view.emitters, group, view.fields)
    least = dr.opaque(mi.UInt32, min_segments)
    shape = (i.height_px, i.width_px)
    context = ChainContext(paths, device_camera(view.camera), flat_film(shape), least)
    if kept:
        context, started = _restored(context, kept)
        return ChainRun(view, context, min_segments, started)
    # Bootstrap the importance, then the chains.
    wanted = _wanted(view)
    n_chains = n_chains_of(wanted, view.fields)
    n_paths = int(np.clip(wanted, _MIN_BOOTSTRAP, _MAX_BOOTSTRAP))
    context = with_importance(context, shape, n_paths // 4, view.seed ^ 0x5BD1E995)
    chains, target = bootstrap_chains(context, n_paths, n_chains, view.seed)
    if chains is None:
        return None
    return ChainRun(view, context, min_segments, (chains, _Totals(target, n_paths)))


def n_chains_of(n_mutations: int, fields: LightFields) -> int:
    """Chains that make as many mutations together, an even number."""
    return int(np.clip(n_mutations // MIN_STEPS, 16, fields.chains)) & ~1


def _wanted(view: SampledView) -> int:
    """Mutations of a whole picture."""
    i = view.camera.intrinsics
    return view.fields.mutations_per_pixel * i.width_px * i.height_px


def _restored(context: ChainContext, kept: Arrays) -> tuple[ChainContext, _Started]:
    """A run's context and chains as ChainRun.state gave them."""
    film = context.film._replace(
        splats=device_array(mi.Float, kept["splats"]),
        importance=device_array(mi.Float, kept["importance"]),
    )
    floats = {
        name: device_array(mi.Float, kept[name])
        for name in ("samples", "target", "shared", "suffixes")
    }
    chains = Chains(
        **floats,
        light=mi.Color3f(*(device_array(mi.Float, row) for row in kept["light"])),
        pixel=device_array(mi.UInt32, kept["pixel"]),
    )
    dr.eval(*chains)
    target, n_paths, n_accepted, n_bad, n_steps = (float(v) for v in kept["sums"])
    totals = _Totals(target, n_paths, n_accepted, int(n_bad), int(n_steps))
    return context._replace(film=film), (chains, totals)


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
