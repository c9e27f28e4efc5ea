"""Markov chains of light paths: what one is made of, and how it moves; kernels, no effects.

The three steps of Metropolis sampling are `mutate`; the estimator they serve is metropolis.py's.

A proposal is never stored: every number is mutated by a hash of (chain, step, dimension) when the
path asks for it, and again when it is accepted. Sampler beyond STORED_DIMS are fresh in every
proposal, which is a large step in those dimensions. A chain's numbers stay in local memory while
a launch runs; a lane starts its next mutation as soon as its path ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.transport.kernels.bsdf import luminance
from pbrs_farm.transport.kernels.path_state import DeviceCamera, PathContext, PathState, camera_path
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
from pbrs_farm.transport.metropolis.film import Film, film_point, level_of, splat
from pbrs_farm.transport.metropolis.reconnection import (
    NEAR_M,
    TAIL_FLOATS,
    close_tail,
    passing_chance,
    write_tail,
)

STORED_DIMS: Final = CAMERA_DIMS + VERTEX_DIMS * 7
_SMALLEST, _LARGEST = 1 / 1024, 1 / 64
_FILM_STEP: Final = 2.0


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

        # Kelemen's step: between the smallest and the largest, small ones more often.
        up = fresh < 0.5
        v = dr.select(up, 2 * fresh, 2 * fresh - 1)
        reach = dr.select(dim < CAMERA_DIMS, _FILM_STEP, 1.0)
        step = reach * _LARGEST * dr.exp2(v * float(np.log2(_SMALLEST / _LARGEST)))
        moved = old + dr.select(up, step, -step)
        moved = moved - dr.floor(moved)
        return dr.minimum(dr.select(self._is_large | ~stored, fresh, moved), 1 - 2**-24)

    def get_2d(self, dim: Any) -> Any:
        """Point2f of dimensions dim and dim + 1."""
        return mi.Point2f(self.get_1d(dim), self.get_1d(mi.UInt32(dim) + 1))


class Chains(NamedTuple):
    """Where every chain stands. numbers: (STORED_DIMS * N,), dimension by dimension.

    is_shared: whether its tail can be shown from other pixels; tails: (TAIL_FLOATS * N,),
    number by number.
    """

    numbers: Any
    light: Any
    level: Any
    pixel: Any
    is_shared: Any
    tails: Any


@dataclass
class Trial:
    """A path under way, in two parts: up to its second vertex, and beyond.

    walk: beyond the second vertex with a throughput of its own. light: of the first part; head:
    throughput up to the second vertex; tail: light from beyond, head not counted. is_straight:
    the first vertex is rough and nothing but glass and cut-outs was met since, passed with chance
    `passes`; is_shared: see tails.py.
    """

    path: PathState
    light: mi.Color3f
    head: mi.Color3f
    tail: mi.Color3f
    is_straight: mi.Bool
    passes: mi.Float
    is_shared: mi.Bool


@dr.syntax
def mutate(
    context: PathContext,
    film: Film,
    chains: Chains,
    steps: tuple[Any, Any],
    p_large: Any,
    seed: Any,
    shares: Any,
) -> tuple[Chains, tuple[Any, ...]]:
    """Steps [first, last) of every chain, splatted where a path is its own pixel's alone.

    p_large: chance of a fresh path. shares: whether tails are shown to other pixels afterwards.
    Returns (chains, (sum of I and number of fresh paths, accepted steps, paths not finite)), the
    sums per chain.
    """
    n_chains = dr.width(chains.level)
    lane = dr.arange(mi.UInt32, n_chains)
    numbers = dr.alloc_local(mi.Float, STORED_DIMS)
    x_tail = dr.alloc_local(mi.Float, TAIL_FLOATS)
    y_tail = dr.alloc_local(mi.Float, TAIL_FLOATS)
    dim = mi.UInt32(0)
    while dim < STORED_DIMS:
        numbers.write(dr.gather(mi.Float, chains.numbers, dim * n_chains + lane), dim)
        dim += 1
    dim = mi.UInt32(0)
    while dim < TAIL_FLOATS:
        x_tail.write(dr.gather(mi.Float, chains.tails, dim * n_chains + lane), dim)
        dim += 1

    # x is where a chain stands, y what it proposes.
    x_light, x_level, x_pixel = chains.light, chains.level, chains.pixel
    x_shared = mi.Bool(chains.is_shared)
    x_weight = mi.Float(0)
    large_sum, large_count = mi.Float(0), mi.Float(0)
    n_accepted, n_bad = mi.Float(0), mi.UInt32(0)
    step = mi.UInt32(steps[0])
    chain_key = stream_key(lane, seed)
    y = _trial(context.camera, mi.Float(0) * mi.Float(lane), mi.Float(0))
    fresh = mi.Bool(True)
    active = step < steps[1]

    while active:
        # 1. Propose; the path's first ray leaves through the film position of dimensions 0 and 1.
        key = hash32(chain_key ^ hash32(step + 0x9E3779B9))
        is_large = unit_float(hash32(key ^ 0x51ED270B)) < p_large
        proposal = MutatedSampler(numbers, key, is_large)
        y_pixel, at = film_point(film, proposal.get_2d(mi.UInt32(0)), context.fields.is_tent)
        y = dr.select(fresh, _trial(context.camera, at.x, at.y), y)
        y, alive = _onward(context, proposal, y, y_tail, active)
        done = active & ~alive

        # 2. Accept or stay.
        y_light = y.light + y.head * y.tail
        good = dr.isfinite(luminance(y_light))
        n_bad += dr.select(done & ~good, mi.UInt32(1), 0)
        y_light = dr.select(good, y_light, 0)
        y_level = level_of(film, y_pixel, y_light)
        y_shared = y.is_shared & shares
        a = dr.select(x_level > 0, dr.minimum(y_level / x_level, 1), 1)
        accept = done & (unit_float(hash32(key ^ 0x2545F491)) < a)
        n_accepted += dr.select(accept, mi.Float(1), 0)
        large_sum += dr.select(done & is_large, y_level, 0)
        large_count += dr.select(done & is_large, mi.Float(1), 0)

        # 3. Splat what is left behind: the old point with all it has gathered, or the refused one.
        #    What is shared waits for the launch's end (tails.py).
        x_weight += dr.select(done, 1 - a, 0)
        splat(
            film,
            lane,
            dr.select(accept, x_pixel, y_pixel),
            dr.select(accept, x_light, y_light),
            dr.select(accept, x_level, y_level),
            dr.select(accept, x_weight, a),
            done & ~dr.select(accept, x_shared, y_shared),
        )
        close_tail(y_tail, y_light, y.tail, accept & y_shared)
        x_pixel = dr.select(accept, y_pixel, x_pixel)
        x_light = dr.select(accept, y_light, x_light)
        x_level = dr.select(accept, y_level, x_level)
        x_shared = dr.select(accept, y_shared, x_shared)
        x_weight = dr.select(accept, a, x_weight)
        dim = mi.UInt32(0)
        updating = mi.Bool(accept)
        while updating:
            numbers.write(proposal.get_1d(dim), dim)
            dim += 1
            updating = updating & (dim < STORED_DIMS)
        dim = mi.UInt32(0)
        updating = accept & y_shared
        while updating:
            x_tail.write(y_tail.read(dim), dim)
            dim += 1
            updating = updating & (dim < TAIL_FLOATS)

        step += dr.select(done, mi.UInt32(1), 0)
        fresh = mi.Bool(done)
        active = step < steps[1]

    splat(film, lane, x_pixel, x_light, x_level, x_weight, ~x_shared)
    kept = dr.empty(mi.Float, STORED_DIMS * n_chains)
    dim = mi.UInt32(0)
    while dim < STORED_DIMS:
        dr.scatter(kept, numbers.read(dim), dim * n_chains + lane)
        dim += 1
    kept_tails = dr.empty(mi.Float, TAIL_FLOATS * n_chains)
    dim = mi.UInt32(0)
    while dim < TAIL_FLOATS:
        dr.scatter(kept_tails, x_tail.read(dim), dim * n_chains + lane)
        dim += 1
    sums = large_sum, large_count, n_accepted, n_bad
    return Chains(kept, x_light, x_level, x_pixel, x_shared, kept_tails), sums


@dr.syntax
def draw_paths(context: PathContext, film: Film, numbers: HashedSampler) -> Chains:
    """One path per lane, as where a chain stands; its numbers are not kept."""
    pixel, at = film_point(film, numbers.get_2d(mi.UInt32(0)), context.fields.is_tent)
    tail = dr.alloc_local(mi.Float, TAIL_FLOATS)
    y = _trial(context.camera, at.x, at.y)
    active = mi.Bool(True)
    while active:
        y, alive = _onward(context, numbers, y, tail, active)
        active = active & alive
    light = y.light + y.head * y.tail
    level = level_of(film, pixel, light)
    level = dr.select(dr.isfinite(level), level, 0)
    close_tail(tail, light, y.tail, y.is_shared)
    lane = dr.arange(mi.UInt32, dr.width(pixel))
    rows = dr.empty(mi.Float, TAIL_FLOATS * dr.width(pixel))
    dim = mi.UInt32(0)
    while dim < TAIL_FLOATS:
        dr.scatter(rows, tail.read(dim), dim * dr.width(pixel) + lane)
        dim += 1
    return Chains(mi.Float(0), light, level, pixel, y.is_shared, rows)


def _trial(camera: DeviceCamera, x: Any, y: Any) -> Trial:
    """The path that leaves the camera through film position (x, y), in pixels."""
    none, one = mi.Color3f(0), mi.Color3f(1)
    no = mi.Bool(False)
    return Trial(camera_path(camera, x, y), none, one, mi.Color3f(0), no, mi.Float(1), mi.Bool(no))


def _onward(
    context: PathContext, numbers: Sampler, trial: Trial, tail: Any, active: Any
) -> tuple[Trial, Any]:
    """(the path one vertex on, whether it goes on); its tail is kept in local memory."""
    path = trial.path
    before = path.depth
    may_reconnect = trial.is_straight & (before == 1)
    following, result, alive = advance(
        context.scene,
        context.emitters,
        context.fields,
        numbers,
        path,
        context.emitter_filter,
        active,
        may_reconnect,
    )
    met = dr.select(
        before + 1 >= context.segments, result.emitted_outdoor + result.emitted_indoor, 0
    )
    lit = dr.select(
        following.depth + 1 >= context.segments, result.direct_outdoor + result.direct_indoor, 0
    )
    is_beyond = before >= 2
    is_second = active & (before < 2) & (following.depth == 2)
    write_tail(
        tail,
        result,
        path,
        trial.passes,
        context.emitter_filter,
        is_second & result.is_view_independent,
    )
    head = dr.select(is_second, following.beta, trial.head)
    following.beta = dr.select(is_second, 1, following.beta)
    is_far = dr.squared_norm(result.si.p - path.reference.p) > NEAR_M**2
    # What reflects, glass too, forgets the pdf of the direction.
    goes_on = trial.is_straight & (following.bsdf_pdf > 0)
    is_straight = dr.select(before == 0, result.is_rough, goes_on)
    can_share = result.is_view_independent & (result.pdf > 0) & is_far
    return (
        Trial(
            following,
            trial.light + dr.select(is_beyond, 0, met + lit),
            head,
            trial.tail + dr.select(is_beyond, met + lit, 0),
            is_straight,
            trial.passes * dr.select(before == 1, passing_chance(result.si, path.d), 1),
            dr.select(is_second, can_share, trial.is_shared),
        ),
        alive,
    )
