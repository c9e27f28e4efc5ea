"""Markov chains of light paths: their state, and the steps of a chain; kernels, no effects.

`mutate` makes the three steps of Metropolis sampling (propose, accept, splat); integrator.py
describes the estimator. A proposal is never stored: every number is mutated by a hash of (chain,
step, dimension) when the path asks for it, and again when it is accepted. Numbers beyond
STORED_DIMS are fresh in every proposal, which is a large step in those dimensions. A chain's
numbers stay in local memory while a launch runs; a lane starts its next mutation as soon as its
path ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.transport.kernels.bsdf import luminance
from pbrs_farm.transport.kernels.camera_rays import DeviceCamera, LensCamera
from pbrs_farm.transport.kernels.path_state import camera_path
from pbrs_farm.transport.kernels.path_step import advance
from pbrs_farm.transport.kernels.sampler import (
    CAMERA_DIMS,
    VERTEX_DIMS,
    HashedSampler,
    Sampler,
    hash32,
    stream_key,
    unit_float,
)
from pbrs_farm.transport.metropolis.film import (
    ROUND_STEPS,
    ChainContext,
    Chains,
    Film,
    sample_film,
    splat,
    target_function,
)
from pbrs_farm.transport.metropolis.suffixes import (
    SUFFIX_FLOATS,
    SplitPath,
    SuffixRecords,
    finish_suffix,
    no_direction,
    record_suffix,
)

STORED_DIMS: Final = CAMERA_DIMS + VERTEX_DIMS * 7
_MIN_STEP, _MAX_STEP = 1 / 1024, 1 / 64  # of a small mutation
_FILM_STEP: Final = 2.0  # times as far on the film


class MutatedSampler:
    """The numbers of a proposal: the chain's own, each moved a little, or all fresh."""

    def __init__(self, chain: Any, key: Any, is_large: Any) -> None:
        self._chain, self._key, self._is_large = chain, key, is_large

    def get_1d(self, dim: Any) -> Any:
        """Float of one dimension."""
        dim = mi.UInt32(dim)
        fresh = unit_float(hash32(self._key ^ hash32(dim + 0x85EBCA6B)))
        stored = dim < STORED_DIMS
        old = self._chain.read(dr.minimum(dim, STORED_DIMS - 1))

        # Move by Kelemen's step: between the least and the largest, small ones more often.
        up = fresh < 0.5
        v = dr.select(up, 2 * fresh, 2 * fresh - 1)
        reach = dr.select(dim < CAMERA_DIMS, _FILM_STEP, 1.0)
        step = reach * _MAX_STEP * dr.exp2(v * float(np.log2(_MIN_STEP / _MAX_STEP)))
        moved = old + dr.select(up, step, -step)
        moved = moved - dr.floor(moved)
        return dr.minimum(dr.select(self._is_large | ~stored, fresh, moved), 1 - 2**-24)

    def get_2d(self, dim: Any) -> Any:
        """Point2f of dimensions dim and dim + 1."""
        return mi.Point2f(self.get_1d(dim), self.get_1d(mi.UInt32(dim) + 1))


@dataclass
class _State:
    """The current path of a chain (x in the loop) or its proposal (y)."""

    light: Any
    target: Any
    pixel: Any
    shared: Any
    weight: Any  # expected number of steps spent here, to splat


@dataclass
class ChainSums:
    """Sums over the steps of a chain."""

    target: mi.Float  # of large steps, which are independent paths
    n_large: mi.Float
    n_accepted: mi.Float
    n_bad: mi.UInt32  # paths that were not finite

    def add(self, target: Any, is_large: Any, accept: Any, bad: Any) -> None:
        """Add a step; the arguments are false for a lane whose path has not ended."""
        self.n_bad += dr.select(bad, mi.UInt32(1), 0)
        self.n_accepted += dr.select(accept, mi.Float(1), 0)
        self.target += dr.select(is_large, target, 0)
        self.n_large += dr.select(is_large, mi.Float(1), 0)


class Mutations(NamedTuple):
    """Which steps of the chains a launch makes, and how; all opaque."""

    first: Any  # step
    last: Any  # one more than the last step
    p_large: Any  # probability of a fresh path
    seed: Any
    reconnects: Any  # Bool: suffixes are reconnected after the launch
    records: SuffixRecords  # where they are left


@dr.syntax
def mutate(context: ChainContext, chains: Chains, how: Mutations) -> tuple[Chains, ChainSums]:
    """Advance every chain; splat paths that only concern their own pixel."""
    film, lane = context.film, dr.arange(mi.UInt32, dr.width(chains.target))
    x_samples = _load(chains.samples, STORED_DIMS, lane)
    x_suffix = _load(chains.suffixes, SUFFIX_FLOATS, lane)
    y_suffix = dr.alloc_local(mi.Float, SUFFIX_FLOATS)
    # Bootstrap paths have a shared part even if there are no pixels to share it with.
    shared = dr.select(how.reconnects, chains.shared, 0)
    x = _State(chains.light, chains.target, chains.pixel, mi.Float(shared), mi.Float(0))
    corner = mi.Point2f(mi.Float(0) * mi.Float(lane), 0)
    y = _camera_split_path(context.camera, corner, mi.Point2f(0))
    sums = ChainSums(mi.Float(0), mi.Float(0), mi.Float(0), mi.UInt32(0))
    chain_key = stream_key(lane, how.seed)
    step = mi.UInt32(how.first)
    fresh = mi.Bool(True)  # whether y has yet to start
    active = step < how.last

    while active:
        # 1. Propose; the path's first ray leaves through the film position of dimensions 0 and 1.
        key = hash32(chain_key ^ hash32(step + 0x9E3779B9))
        is_large = unit_float(hash32(key ^ 0x51ED270B)) < how.p_large
        proposal = MutatedSampler(x_samples, key, is_large)
        u = proposal.get_2d(mi.UInt32(0))
        pixel, corner, sample = sample_film(film, u, context.paths.fields.is_tent)
        y = dr.select(fresh, _camera_split_path(context.camera, corner, sample), y)
        y, alive = _extend(context, proposal, y, y_suffix, active)
        done = active & ~alive

        # 2. Accept or stay.
        proposed, good = _proposed_state(film, y, pixel, how.reconnects)
        a = dr.select(x.target > 0, dr.minimum(proposed.target / x.target, 1), 1)
        accept = done & (unit_float(hash32(key ^ 0x2545F491)) < a)
        sums.add(proposed.target, done & is_large, accept, done & ~good)

        # 3. Splat the replaced or rejected path; move, or stay.
        keeps_suffix = accept & (proposed.shared > 0)
        finish_suffix(y_suffix, proposed.light, y, keeps_suffix)
        x = _move(film, lane, x, proposed, a, accept, done)
        x_samples = _accept_samples(x_samples, proposal, accept)
        x_suffix = _copy(y_suffix, x_suffix, SUFFIX_FLOATS, keeps_suffix)

        step += dr.select(done, mi.UInt32(1), 0)
        fresh = mi.Bool(done)
        active = step < how.last
        _record_round(how, lane, step, x, x_suffix, done)

    _splat_state(film, lane, x, True)
    samples, suffixes = (
        _store_chains(x_samples, STORED_DIMS, lane),
        _store_chains(x_suffix, SUFFIX_FLOATS, lane),
    )
    return Chains(samples, x.light, x.target, x.pixel, x.shared, suffixes), sums


@dr.syntax
def draw_paths(context: ChainContext, sampler: HashedSampler, n: int) -> Chains:
    """n independent paths, one per lane, as chain states; their random numbers are not kept."""
    film = context.film
    is_tent = context.paths.fields.is_tent
    pixel, corner, sample = sample_film(film, sampler.get_2d(mi.UInt32(0)), is_tent)
    suffix = dr.alloc_local(mi.Float, SUFFIX_FLOATS)
    y = _camera_split_path(context.camera, corner, sample)
    # Extend each lane's path until it ends; the loop is recorded, ended lanes are masked.
    active = mi.Bool(True)
    while active:
        y, alive = _extend(context, sampler, y, suffix, active)
        active = active & alive
    # The suffix's light was gathered without the prefix's throughput.
    light: Any = _path_light(y)
    target = target_function(film, pixel, light)
    target = dr.select(dr.isfinite(target), target, 0)
    finish_suffix(suffix, light, y, y.shared > 0)
    suffixes = _store_chains(suffix, SUFFIX_FLOATS, dr.arange(mi.UInt32, n))
    return Chains(mi.Float(0), light, target, pixel, y.shared, suffixes)


def _camera_split_path(camera: DeviceCamera | LensCamera, corner: Any, offset: Any) -> SplitPath:
    """The path that leaves the camera through the film at a pixel's corner plus an offset, px."""
    return SplitPath(
        path=camera_path(camera, corner, offset),
        light=mi.Color3f(0),
        prefix_beta=mi.Color3f(1),
        suffix_light=mi.Color3f(0),
        is_straight=mi.Bool(False),
        passed=mi.Float(1),
        first=no_direction(),
        second=no_direction(),
        suffix_weight=mi.Float(1),
        shared=mi.Float(0),
    )


def _extend(
    context: ChainContext, sampler: Sampler, split: SplitPath, suffix: Any, active: Any
) -> tuple[SplitPath, Any]:
    """(the path one vertex on, whether it goes on); its suffix is recorded in local memory."""
    path, least = split.path, context.min_segments
    before = path.depth
    may_reconnect = split.is_straight & (before == 1)
    following, result, alive = advance(context.paths, sampler, path, active, may_reconnect)

    # Apply the weight of guided rays; that of the suffix's first ray depends on its prefix.
    is_first = before == 2
    weight = dr.select(is_first, 1, result.guided_weight)
    following.beta *= weight
    alive &= result.guided_weight > 0

    # Count the light of sufficiently long paths.
    emitted = result.emitted_outdoor + result.emitted_indoor
    direct = result.direct_outdoor + result.direct_indoor
    emitted = dr.select(before + 1 >= least, emitted * weight, 0)
    direct = dr.select(following.depth + 1 >= least, direct * weight, 0)

    # Split the path where it makes its second vertex.
    is_beyond = before >= 2
    is_second = active & (before < 2) & (following.depth == 2)
    is_independent, emitter_filter = result.is_view_independent, context.paths.emitter_filter
    reach = split.first, split.passed
    bounded = record_suffix(suffix, result, path, reach, emitter_filter, is_second & is_independent)
    prefix_beta = dr.select(is_second, following.beta, split.prefix_beta)
    following.beta = dr.select(is_second, 1, following.beta)

    # Share only what joins rough vertices; what reflects, glass too, forgets the direction's pdf.
    stays_straight = split.is_straight & (following.bsdf_pdf > 0)
    can_reconnect = is_independent & (result.pdfs.bsdf > 0) & (weight > 0)
    first_weight = dr.select(is_first, result.guided_weight, 1)
    return SplitPath(
        path=following,
        light=split.light + dr.select(is_beyond, 0, emitted + direct),
        prefix_beta=prefix_beta,
        suffix_light=split.suffix_light + dr.select(is_beyond, emitted + direct, 0),
        is_straight=dr.select(before == 0, result.is_rough, stays_straight),
        passed=split.passed * dr.select(before == 1, result.pass_probability, 1),
        first=dr.select(before == 0, result.pdfs, split.first),
        second=dr.select(is_second, result.pdfs, split.second),
        suffix_weight=split.suffix_weight * first_weight,
        shared=dr.select(is_second, dr.select(can_reconnect, bounded, 0), split.shared),
    ), alive


def _path_light(y: SplitPath) -> Any:
    """The light of a path that has ended."""
    suffix_beta: Any = y.prefix_beta
    return y.light + suffix_beta * y.suffix_weight * y.suffix_light


def _proposed_state(film: Film, y: SplitPath, pixel: Any, reconnects: Any) -> tuple[_State, Any]:
    """(the state of a path that has ended, whether its light is finite; black where not)."""
    light = _path_light(y)
    good = dr.isfinite(luminance(light))
    light = dr.select(good, light, 0)
    target = target_function(film, pixel, light)
    return _State(light, target, pixel, dr.select(reconnects, y.shared, 0), mi.Float(0)), good


def _move(
    film: Film, chain: Any, x: _State, proposed: _State, a: Any, accept: Any, done: Any
) -> _State:
    """State of a chain after a step accepted with probability a.

    Splats the replaced path with its accumulated weight, or the rejected one. The shared part waits for the
    end of the round (reconnection.py).
    """
    x.weight += dr.select(done, 1 - a, 0)
    proposed.weight = a
    rest = dr.select(accept, x, proposed)
    _splat_state(film, chain, rest, done)
    return dr.select(accept, proposed, x)


def _splat_state(film: Film, chain: Any, state: _State, active: Any) -> None:
    """Splat the unshared part of a state to its own pixel, scaled from its target function to its weight."""
    active = active & (state.target > 0) & (state.weight > 0) & (state.shared < 1)
    scale = state.weight * (1 - state.shared) / dr.select(state.target > 0, state.target, 1)
    splat(film, chain, state.pixel, state.light * scale, active)


@dr.syntax
def _load(rows: Any, n: int, chain: Any) -> Any:
    """Local memory with n numbers of each chain."""
    local, n_chains = dr.alloc_local(mi.Float, n), dr.opaque(mi.UInt32, dr.width(chain))
    k = mi.UInt32(0)
    while k < n:
        local.write(dr.gather(mi.Float, rows, k * n_chains + chain), k)
        k += 1
    return local


@dr.syntax
def _store_chains(local: Any, n: int, chain: Any) -> Any:
    """(n * N,) numbers of all chains, from local memory."""
    rows, n_chains = dr.empty(mi.Float, n * dr.width(chain)), dr.opaque(mi.UInt32, dr.width(chain))
    k = mi.UInt32(0)
    while k < n:
        dr.scatter(rows, local.read(k), k * n_chains + chain)
        k += 1
    return rows


@dr.syntax
def _copy(source: Any, target: Any, n: int, active: Any) -> Any:
    """The target in local memory with n numbers of the source, where active."""
    k = mi.UInt32(0)
    updating = mi.Bool(active)
    while updating:
        target.write(source.read(k), k)
        k += 1
        updating = updating & (k < n)
    return target


@dr.syntax
def _record_round(how: Mutations, chain: Any, step: Any, x: _State, suffix: Any, done: Any) -> None:
    """Record a chain's state for reconnection if a round's last step is done; step: the next one."""
    records = how.records
    is_end = ((step - how.first) % ROUND_STEPS == 0) | (step == how.last)
    row = (step - 1 - how.first) // ROUND_STEPS * records.n_chains + chain
    k = mi.UInt32(0)
    writing = mi.Bool(done & how.reconnects & is_end)
    # All within the loop, which steps that end no round leave out.
    while writing:
        is_first = writing & (k == 0)
        dr.scatter(records.pixel, x.pixel, row, is_first)
        dr.scatter(records.shared, x.shared, row, is_first)
        dr.scatter(records.is_shared, x.shared > 0, row, is_first)
        dr.scatter(records.rows, suffix.read(k), row * SUFFIX_FLOATS + k, writing)
        k += 1
        writing = writing & (k < SUFFIX_FLOATS)


@dr.syntax
def _accept_samples(samples: Any, proposal: MutatedSampler, active: Any) -> Any:
    """A chain's numbers in local memory, each replaced by the proposal's, where active."""
    dim = mi.UInt32(0)
    updating = mi.Bool(active)
    while updating:
        samples.write(proposal.get_1d(dim), dim)
        dim += 1
        updating = updating & (dim < STORED_DIMS)
    return samples
