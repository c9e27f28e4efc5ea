"""Prefixes of paths: the first rough vertex that a pixel sees, for suffixes (reconnection.py); kernels, no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.kernels.packets import rgb, xyz
from pbrs_farm.transport.kernels.path_state import EmitterFilter, camera_path
from pbrs_farm.transport.kernels.path_step import advance
from pbrs_farm.transport.kernels.sampler import Sampler, SobolSampler, stream_key
from pbrs_farm.transport.metropolis.film import ROUND_STEPS, ChainContext, sample_pixel

PREFIX_PACKETS: Final = 7  # of four floats
_MUTATIONS_PER_PREFIX: Final = 4  # of a pixel; a prefix costs a tenth of one
_PREFIX_SEED: Final = 0x6A09E667  # not the chains'


class Prefixes(NamedTuple):
    """Prefixes of every pixel, in sets of one each."""

    rows: Any  # (sets * pixels * 28,) floats
    sets: range  # their numbers, in the order of a run


@dataclass
class _Prefix:
    """The first rough vertex that a pixel sees."""

    p: mi.Point3f
    n: mi.Vector3f  # shading normal
    ng: mi.Vector3f  # face normal
    wi: mi.Vector3f  # world direction back along the ray
    kd: mi.Color3f
    f0: mi.Color3f
    tau: mi.Color3f
    alpha: mi.Float
    beta: mi.Color3f  # throughput from the eye
    is_valid: mi.Bool


class PrefixSchedule(NamedTuple):
    """Which sets of prefixes the rounds of a run have."""

    n_sets: int  # of a round, even
    every: int  # rounds that have the same ones

    def sets_of(self, rounds: range) -> range:
        """The numbers of all sets of these rounds."""
        first, last = (r // self.every for r in (rounds.start, rounds.stop - 1))
        return range(first * self.n_sets, (last + 1) * self.n_sets)


def prefix_schedule(n_chains: int, n_pixels: int) -> PrefixSchedule:
    """A set for every _MUTATIONS_PER_PREFIX mutations of a pixel, about."""
    # Chain c takes set c modulo n_sets, and its parity is its half of the film: with an odd number
    # the halves share prefixes, whose noise their difference does not show.
    due = n_chains * ROUND_STEPS / (n_pixels * _MUTATIONS_PER_PREFIX)
    n_sets = 2 * max(round(due / 2), 1)
    return PrefixSchedule(n_sets, max(round(n_sets / due), 1))


def trace_prefixes(context: ChainContext, n_pixels: int, sets: range, seed: int) -> Prefixes:
    """Sets of prefixes by number; invalid where a pixel does not see a rough surface first."""
    row, in_set = dr.arange(mi.UInt32, n_pixels * len(sets)), dr.opaque(mi.UInt32, n_pixels)
    pixel, number = row % in_set, row // in_set + dr.opaque(mi.UInt32, sets.start)
    key = stream_key(pixel, dr.opaque(mi.UInt32, (seed ^ _PREFIX_SEED) & 0xFFFFFFFF))
    sampler = SobolSampler(key, number)
    prefix = _trace_prefix(context, sampler, pixel)
    kd, f0, tau, wi = prefix.kd, prefix.f0, prefix.tau, prefix.wi
    values = (
        *xyz(prefix.p),
        dr.select(prefix.is_valid, mi.Float(1), 0),
        *xyz(prefix.n),
        prefix.alpha,
        *xyz(prefix.ng),
        wi.x,
        *rgb(kd),
        wi.y,
        *rgb(f0),
        wi.z,
        *rgb(tau),
        mi.Float(0),
        *rgb(prefix.beta),
        mi.Float(0),
    )
    rows = _prefix_rows(values)
    dr.eval(rows)
    return Prefixes(rows, sets)


@dr.syntax
def _prefix_rows(values: tuple[Any, ...]) -> Any:
    """Lane by lane the values, one after the other."""
    n = len(values)
    local, lane = dr.alloc_local(mi.Float, n), dr.arange(mi.UInt32, dr.width(values[0]))
    for column, value in enumerate(values):
        local.write(value, mi.UInt32(column))
    # Write them in a loop: each scatter outside of one would trace all paths anew.
    rows, k = dr.empty(mi.Float, n * dr.width(lane)), dr.opaque(mi.UInt32, 0)
    while k < n:
        dr.scatter(rows, local.read(k), lane * n + k)
        k += 1
    return rows


@dr.syntax
def _trace_prefix(context: ChainContext, sampler: Sampler, pixel: Any) -> _Prefix:
    """Follow mirrors and glass to the first rough surface; no emitter counts."""
    paths = context.paths._replace(emitter_filter=EmitterFilter(None, None))
    u = sampler.get_2d(mi.UInt32(0))
    corner, sample = sample_pixel(context.film, pixel, u, paths.fields.is_tent)
    path = camera_path(context.camera, corner, sample)
    prefix = _Prefix(
        mi.Point3f(0),
        mi.Vector3f(0),
        mi.Vector3f(0),
        mi.Vector3f(0),
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Float(0),
        mi.Color3f(0),
        mi.Bool(False),
    )
    active = mi.Bool(True)
    while active:
        beta, d = mi.Color3f(path.beta), mi.Vector3f(path.d)
        path, result, alive = advance(paths, sampler, path, active)
        si, bsdf = result.si, result.si.bsdf
        traced = _Prefix(
            mi.Point3f(si.p),
            si.n,
            si.ng,
            -d,
            bsdf.kd,
            bsdf.f0,
            bsdf.tau,
            bsdf.alpha,
            beta,
            mi.Bool(True),
        )
        prefix = dr.select(active & result.is_rough & (path.depth == 1), traced, prefix)
        active = active & alive & (path.depth == 0)
    return prefix
