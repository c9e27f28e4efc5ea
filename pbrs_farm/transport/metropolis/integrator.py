"""Primary-sample-space Metropolis light transport over the camera path: `pssmlt-camera`; no effects.

Kelemen et al. 2002. A path is a function of a point u of the unit cube: two numbers for the film,
ten for each vertex (path_step.py). With F(u) its radiance beyond direct light and I(u), the target
function, the luminance of F times the importance of its pixel, each of many chains in parallel

    1. proposes u' : with chance p a fresh point (large step), else every number moved a little,
    2. accepts it with chance a = min(1, I(u') / I(u)),
    3. adds a F(u') / I(u') and (1 - a) F(u) / I(u) to the film (expected values),

so that the film converges to F, times I / b, with b the mean of I, known from the bootstrap and
from all large steps (markov_chains.py). Chains start at bootstrap paths drawn in proportion to I.
The importance is about 1 / the light expected at a pixel, from separate paths (Veach's two stages,
1997): dark corners get their share.

Instead of 3., a path whose first two vertices are rough and mutually visible is reconnected, every few
steps, to a thousand other pixels that see its second vertex too (reconnection.py); light between two
close vertices mostly stays with 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import F32
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
from pbrs_farm.transport.kernels.sampler import device_array
from pbrs_farm.transport.metropolis.chain_start import bootstrap_chains, flat_film, with_importance
from pbrs_farm.transport.metropolis.film import ROUND_STEPS, ChainContext, Chains, stratified_groups
from pbrs_farm.transport.metropolis.markov_chains import ChainSums, Mutations, mutate
from pbrs_farm.transport.metropolis.prefixes import Prefixes, prefix_schedule, trace_prefixes
from pbrs_farm.transport.metropolis.reconnection import Rounds, reconnect
from pbrs_farm.transport.metropolis.suffixes import no_records
from pbrs_farm.transport.render_checkpoint import Arrays
from pbrs_farm.transport.sample_passes import SampledView

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
        self, view: SampledView, context: ChainContext, min_segments: int, started: _StartedChains
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
        """Make n_steps more of every chain (whole rounds, or the last ones), and share their suffixes."""
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
        prefixes = self._prefixes
        if prefixes is None or sets.start < prefixes.sets.start or sets.stop > prefixes.sets.stop:
            # A set of a large picture is a gigabyte: never keep both.
            self._prefixes = prefixes = None
            prefixes = trace_prefixes(self._context, self._n_pixels, sets, self._seed)
        self._prefixes = prefixes
        return prefixes

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
        """State from which chain_run resumes: film, importance, chains and sums."""
        film, t = self._context.film, self._totals
        sums = np.array([t.target, t.n_paths, t.n_accepted, t.n_bad, t.n_steps], np.float64)
        chains = {name: getattr(self._chains, name).numpy() for name in Chains._fields}
        return chains | {
            "splats": film.splats.numpy(),
            "importance": film.importance.numpy(),
            "sums": sums,
        }


_StartedChains = tuple[Chains, _Totals]


def chain_run(
    view: SampledView, group: Group, *, min_segments: int = 3, kept: Arrays | None = None
) -> ChainRun | None:
    """The chains of one group, from kept if given, for paths of min_segments or more; None where all is dark."""
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
    n_wanted = _wanted(view)
    n_chains = n_chains_of(n_wanted, view.fields)
    n_paths = int(np.clip(n_wanted, _MIN_BOOTSTRAP, _MAX_BOOTSTRAP))
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


def _restored(context: ChainContext, stored: Arrays) -> tuple[ChainContext, _StartedChains]:
    """A run's context and chains as ChainRun.state gave them."""
    film = context.film._replace(
        splats=device_array(mi.Float, stored["splats"]),
        importance=device_array(mi.Float, stored["importance"]),
    )
    floats = {
        name: device_array(mi.Float, stored[name])
        for name in ("samples", "target", "shared", "suffixes")
    }
    chains = Chains(
        **floats,
        light=mi.Color3f(*(device_array(mi.Float, row) for row in stored["light"])),
        pixel=device_array(mi.UInt32, stored["pixel"]),
    )
    dr.eval(*chains)
    target, n_paths, n_accepted, n_bad, n_steps = (float(v) for v in stored["sums"])
    totals = _Totals(target, n_paths, n_accepted, int(n_bad), int(n_steps))
    return context._replace(film=film), (chains, totals)


def _path_context(
    scene: DeviceScene, emitters: Emitters, group: Group, fields: LightFields
) -> PathContext:
    """Paths that see one group, with late roulette: an ended path's neighbours are lost to the chain.

    There is none at the first two vertices, so that a suffix does not depend on its prefix.
    """
    sees_all = dr.opaque(mi.Int32, ALL_EMITTERS)
    is_indoor = group is Group.INDOOR
    emitter_filter = EmitterFilter(sees_all, None) if is_indoor else EmitterFilter(None, sees_all)
    late = fields.model_copy(update={"rr_depth": max(fields.rr_depth, _MIN_RR_DEPTH)})
    return PathContext(scene, emitters, device_fields(late), emitter_filter)
