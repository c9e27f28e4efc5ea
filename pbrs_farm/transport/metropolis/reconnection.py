"""Reconnection: one path's suffix connected to many pixels, for `metropolis`; kernels, no effects.

A path is a prefix, from the eye to its first vertex x1, and a suffix, from its second vertex x2 on.
If both are rough and mutually visible, any other prefix x1' that sees x2 makes another path with
the same suffix. In the measure of (film, area at x2, direction out of x2) its contribution is

    K(x1') = B f1(x1' -> x2) cos1' cos2' / |x1' - x2|^2
             V(x1', x2) [ f2(-> lamp) S p2(-> x3) + f2(-> x3) T ]

with B the throughput from x1' to the eye, V the transmittance of thin glass between (0 behind a
wall), S the shadow ray's radiance over its pdf, T the radiance from x3, p2 the pdf of sampling x3:
the PSSMLT integrand times the pdfs that the prefix no longer samples. The pixels are partitioned
into random groups; a chain at a path, distributed by its target function I, is equally at all
prefixes j of its pixel's group, each with weight I_j, the target of K_j, over the group's sum (a
Gibbs step over the prefix with all outcomes counted, which preserves the chain's distribution). So
one suffix, hard to find, lights all pixels of the group, for one shadow ray each: the lens mutations
of Veach and Guibas 1997, with all outcomes.

K is unbounded for close x1' and x2. So a path's light is split: the share

    s(x1', x2) = min(1, MAX_SHARED_PDF / p),   p = p1(x1' -> x2) cos2' / |x1' - x2|^2,

p the pdf by which x1' samples x2 per area, is reconnected, s_j K_j at every prefix j of the group,
times s of the chain's own; the rest, 1 - s, stays with the path's own pixel. Each share keeps its
mean, so no distance is omitted, and s K is bounded (Keller's instant radiosity and its bounded
geometry terms, Kollig and Keller 2006, with the rest by paths of the chain).

Rays are guided (guided_rays.py): p2 is the pdf by all techniques, of which only the surface's own
depends on the prefix. A ray aimed at one face that hit another has p2 = 1 and no T. Thin glass and
cut-outs between x1 and x2 transmit a suffix with their transmittance. With a mirror at x1 or a
reflection between the two, a path stays with its own pixel.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.raycast.host_memory import with_slack
from pbrs_farm.transport.kernels.bsdf import Bsdf, evaluate_bsdf
from pbrs_farm.transport.kernels.device_scene import DeviceScene, bend_normal, offset_ray_origin
from pbrs_farm.transport.kernels.packets import colour, gather_packets, point, vector
from pbrs_farm.transport.metropolis.film import (
    NO_PIXEL,
    ROUND_STEPS,
    Film,
    PixelGroups,
    splat,
    target_function,
)
from pbrs_farm.transport.metropolis.prefixes import PREFIX_PACKETS, Prefixes, PrefixSchedule
from pbrs_farm.transport.metropolis.suffixes import SUFFIX_PACKETS, SuffixRecords, shared_share

_MIN_DISTANCE2: Final = 1e-10  # m2; nearer, float32 has no direction between them


class Rounds(NamedTuple):
    """The rounds of the chains that a launch reconnects."""

    numbers: range  # in the order of a run
    n_steps: int  # of all together; the last round may have less than ROUND_STEPS
    max_n: int  # pixels of a group at most, whatever the picture's size: the kernel depends on it
    schedule: PrefixSchedule


class _Launch(NamedTuple):
    """Inputs shared by the lanes of a launch."""

    scene: DeviceScene
    film: Film
    prefix_rows: Any
    group_pixels: Any  # (rounds * slots,) pixel of each slot, NO_PIXEL = none
    n: Any  # pixels of a group


class _Lane(NamedTuple):
    """A suffix that a chain had at a round's end, and where it is shown."""

    x2: list[Any]  # its packets
    chain: Any
    own_pixel: Any
    shared: Any
    weight: Any  # steps of the round
    first_slot: Any  # of its own pixel's group in that round
    first_prefix: Any  # of its set


def reconnect(
    scene: DeviceScene,
    film: Film,
    prefixes: Prefixes,
    groups: list[PixelGroups],
    records: SuffixRecords,
    rounds: Rounds,
) -> None:
    """Splat the shared light of every record at all prefixes of its pixel's group, in one launch.

    groups: of each round.
    """
    # Choose the records whose suffix can be seen from elsewhere.
    chosen = dr.compress(records.is_shared)
    if dr.width(chosen) == 0:
        return
    pixels = mi.UInt32(with_slack(np.concatenate([g.pixels for g in groups])))
    slots = mi.UInt32(with_slack(np.concatenate([g.slots for g in groups])))
    # Use the limit as a literal: Dr.Jit 1.5 caches kernels by their code, which does not contain the size
    # of local memory, and would take a kernel with less of it.
    n = dr.minimum(dr.opaque(mi.UInt32, groups[0].n), mi.UInt32(rounds.max_n))
    launch = _Launch(scene, film, prefixes.rows, pixels, n)
    n_slots = dr.opaque(mi.UInt32, len(groups[0].pixels))
    lane = _lane_of(launch, (slots, n_slots), prefixes, records, rounds, chosen)
    _splat_seen(launch, lane, *_light_of_pixels(launch, lane, rounds.max_n))
    dr.eval(film.splats)


def _lane_of(
    launch: _Launch,
    slots: tuple[Any, Any],
    prefixes: Prefixes,
    records: SuffixRecords,
    rounds: Rounds,
    record: Any,
) -> _Lane:
    """The lane of a record. slots: those of all pixels, round by round, and their number in a round."""
    slot_of_pixel, n_slots = slots
    n_pixels = launch.film.width * launch.film.height
    number, chain = record // records.n_chains, record % records.n_chains
    own_pixel = dr.gather(mi.UInt32, records.pixel, record)
    # Find the pixels of its own group in that round.
    slot = dr.gather(mi.UInt32, slot_of_pixel, number * n_pixels + own_pixel)
    first_slot = number * n_slots + slot - slot % launch.n
    # Let neighbouring chains take different sets: they are even in number, so that the film's
    # halves, of even and of odd chains, share no prefix.
    n_sets, period = (dr.opaque(mi.UInt32, v) for v in rounds.schedule)
    block = (dr.opaque(mi.UInt32, rounds.numbers.start) + number) // period
    in_run = block * n_sets + chain % n_sets
    n_left = dr.opaque(mi.UInt32, rounds.n_steps) - number * ROUND_STEPS
    return _Lane(
        x2=gather_packets(records.rows, record, SUFFIX_PACKETS),
        chain=chain,
        own_pixel=own_pixel,
        shared=dr.gather(mi.Float, records.shared, record),
        weight=mi.Float(dr.minimum(n_left, ROUND_STEPS)),
        first_slot=first_slot,
        first_prefix=(in_run - dr.opaque(mi.UInt32, prefixes.sets.start)) * n_pixels,
    )


@dr.syntax
def _light_of_pixels(launch: _Launch, lane: _Lane, max_n: int) -> tuple[Any, Any]:
    """(what each pixel of the group sees of the suffix, in local memory; the sum of their targets)."""
    values, total = dr.alloc_local(mi.Float, 3 * max_n), mi.Float(0)
    k = dr.opaque(mi.UInt32, 0)
    while k < launch.n:
        pixel = dr.gather(mi.UInt32, launch.group_pixels, lane.first_slot + k)
        is_pixel, is_own = pixel != NO_PIXEL, pixel == lane.own_pixel
        row = lane.first_prefix + pixel
        x1 = gather_packets(launch.prefix_rows, row, PREFIX_PACKETS, is_pixel)
        light = _shared_light(launch.scene, x1, lane.x2, is_pixel & ~is_own)
        value = dr.select(is_own, colour(lane.x2[8]) * lane.shared, light)
        # Skip non-finite values.
        target = target_function(launch.film, pixel, value, is_pixel)
        good = (target > 0) & dr.isfinite(target)
        total += dr.select(good, target, 0)
        for c in range(3):
            values.write(dr.select(good, value[c], 0), 3 * k + c)
        k += 1
    return values, total


@dr.syntax
def _splat_seen(launch: _Launch, lane: _Lane, values: Any, total: Any) -> None:
    """Weigh what each pixel sees by its target function over the group's sum, and splat it."""
    scale = lane.weight * lane.shared / dr.maximum(total, 1e-37)
    k = dr.opaque(mi.UInt32, 0)
    while k < launch.n:
        pixel = dr.gather(mi.UInt32, launch.group_pixels, lane.first_slot + k)
        value = mi.Color3f(values.read(3 * k), values.read(3 * k + 1), values.read(3 * k + 2))
        splat(launch.film, lane.chain, pixel, value * scale, dr.max(value) > 0)
        k += 1


def _shared_light(scene: DeviceScene, x1: list[Any], x2: list[Any], active: Any) -> Any:
    """s K of a suffix at a prefix, from the packets of both; 0 behind a wall."""
    p1, p2 = point(x1[0]), point(x2[0])
    ng1, ng2 = vector(x1[2]), vector(x2[2])
    wi1 = mi.Vector3f(x1[2][3], x1[3][3], x1[4][3])
    way = p2 - p1
    distance2 = dr.squared_norm(way)
    d = way * dr.rsqrt(distance2)

    # From x1 to x2: f1 and the geometry term of the two.
    frame1 = mi.Frame3f(vector(x1[1]))
    local = frame1.to_local(wi1)
    local.z = dr.maximum(local.z, 1e-4)
    out = frame1.to_local(d)
    value1, pdf1 = evaluate_bsdf(_bsdf(x1), local, out)
    side, cos2 = dr.dot(ng1, d), -dr.dot(ng2, d)
    valid = active & (x1[0][3] > 0) & (distance2 > _MIN_DISTANCE2)
    valid &= side * out.z > 0
    valid &= (pdf1 > 0) & (dr.max(value1) > 0) & (cos2 > 0)

    # At x2: towards the emitter, and along the suffix.
    inner, pdf2 = _scattered_suffix(x2, ng2, d)
    valid &= (pdf2 > 0) & (dr.max(inner) > 0)

    # Trace the shadow ray between the two.
    begin = offset_ray_origin(p1, dr.select(side > 0, ng1, -ng1))
    to = p2 - begin
    reach = dr.norm(to)
    clear = scene.transmittance(begin, to / reach, reach * (1 - 1e-4), valid)
    value = colour(x1[6]) * value1 * inner * clear * (cos2 / distance2)
    return dr.select(valid, value * shared_share(pdf1 * cos2 / distance2), 0)


def _scattered_suffix(x2: list[Any], ng: Any, d: Any) -> tuple[Any, Any]:
    """(light scattered back by a suffix along d, pdf of its own direction at x2)."""
    bsdf, frame = _bsdf(x2), mi.Frame3f(bend_normal(vector(x2[1]), d))
    wi = frame.to_local(-d)
    wi.z = dr.maximum(wi.z, 1e-4)
    to_emitter = mi.Vector3f(x2[5][3], x2[6][3], x2[7][3])
    to_x3 = mi.Vector3f(x2[2][3], x2[3][3], x2[4][3])
    from_emitter, _pdf = _evaluate_consistent(bsdf, frame, ng, wi, to_emitter)
    from_x3, pdf = _evaluate_consistent(bsdf, frame, ng, wi, to_x3)
    p2 = x2[0][3] * pdf + x2[8][3]
    return from_emitter * colour(x2[6]) * p2 + from_x3 * colour(x2[7]), pdf


def _evaluate_consistent(bsdf: Bsdf, frame: Any, ng: Any, wi: Any, d: Any) -> tuple[Any, Any]:
    """(f |cos|, pdf) of going on in direction d; nothing where d leaves through the face."""
    wo = frame.to_local(d)
    value, pdf = evaluate_bsdf(bsdf, wi, wo)
    is_consistent = dr.dot(ng, d) * wo.z > 0
    return dr.select(is_consistent, value, 0), dr.select(is_consistent, pdf, 0)


def _bsdf(row: list[Any]) -> Bsdf:
    """The material of a prefix or suffix: both keep it in the same columns."""
    return Bsdf(colour(row[3]), colour(row[4]), colour(row[5]), row[1][3], mi.UInt32(0))
