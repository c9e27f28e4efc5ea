"""Reconnection: one path's suffix seen from many pixels, for `metropolis`; kernels, no effects.

A path is a prefix, from the eye to its first vertex x1, and a suffix, from its second vertex x2 on.
Where both are rough and see each other, any other prefix x1' that sees x2 makes another path with
the same suffix. In the measure of (film, area at x2, direction out of x2) its contribution is

    K(x1') = B f1(x1' -> x2) cos1' cos2' / |x1' - x2|^2
             V(x1', x2) [ f2(-> lamp) S p2(-> x3) + f2(-> x3) T ]

with B what reaches the eye from x1', V what thin glass between lets through (0 behind a wall), S
the shadow ray's radiance over its pdf, T the light that arrives from x3, p2 the pdf of going
there: the PSSMLT integrand times the pdfs of what the prefix no longer draws. The pixels are parted
into random groups; a chain that stands at a path in proportion to its target function I stands as
well at all prefixes j of its pixel's group, each with weight I_j, the target of K_j, over the
group's sum (a Gibbs step over the prefix, every outcome counted at once: it keeps the distribution
of the chain). So one suffix, hard to find, lights as many pixels as the group has, for one shadow
ray each: the lens mutations of Veach and Guibas 1997, all outcomes at once.

K has no bound where x1' and x2 are close. So a path's light is parted in two: the share

    s(x1', x2) = min(1, MAX_SHARED_PDF / p),   p = p1(x1' -> x2) cos2' / |x1' - x2|^2,

p the pdf by which x1' draws x2 per area, is reconnected, s_j K_j at every prefix j of the group,
times s of the chain's own; the rest, 1 - s, stays with the path's own pixel. Each share keeps its
mean, so no distance is left out, and s K is bounded (Keller's instant radiosity and its bounded
geometry terms, Kollig and Keller 2006, with the rest by paths of the chain).

Rays are guided (guided_rays.py): p2 is the pdf by all techniques, of which only the surface's own
depends on the prefix. A ray that was aimed at a face and met another keeps p2 = 1 and has no T.
Thin glass and cut-outs between x1 and x2 let a suffix through, with the share of the light they let
through. A mirror at x1 or a reflection between the two leave a path to its own pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.transport.kernels.bsdf import Bsdf, evaluate_bsdf
from pbrs_farm.transport.kernels.device_scene import DeviceScene, bend_normal, offset_ray_origin
from pbrs_farm.transport.kernels.packets import colour, point, vector
from pbrs_farm.transport.kernels.path_state import (
    DirectionPdfs,
    EmitterFilter,
    PathState,
    StepResult,
    camera_path,
)
from pbrs_farm.transport.kernels.path_step import advance
from pbrs_farm.transport.kernels.sampler import Sampler, SobolSampler, device_array, stream_key
from pbrs_farm.transport.metropolis.film import (
    ChainContext,
    Chains,
    Film,
    sample_pixel,
    splat,
    target_function,
)
from pbrs_farm.transport.metropolis.split_path import SplitPath

SUFFIX_FLOATS: Final = 36
MAX_SHARED_PDF: Final = 4.0  # 1 / m2; by a matte surface, 0.28 m straight before it
_MIN_DISTANCE2: Final = 1e-10  # m2; nearer, float32 knows no direction
_SUFFIX_PACKETS: Final = SUFFIX_FLOATS // 4
_PREFIX_PACKETS: Final = 7
_PREFIX_FLOATS: Final = 4 * _PREFIX_PACKETS
_LANES_PER_LAUNCH: Final = 1 << 22  # pairs of chain and pixel, against memory
_NO_PIXEL: Final = 0xFFFFFFFF
_PREFIX_SEED: Final = 0x6A09E667  # not the chains'

# Columns of a suffix that are written one by one; record_suffix lists the others.
# At the end _PDFS holds the share of p2 that the surface draws, _GUIDED_PDF the rest of p2.
_PDFS, _ARRIVING, _EMITTER_Z, _OWN_LIGHT, _GUIDED_PDF = 3, 28, 31, 32, 35


class PixelGroups(NamedTuple):
    """The pixels in groups of n; a group's slots are neighbours."""

    slots: Any  # (pixels,) slot of each
    pixels: Any  # (slots,) pixel of each, _NO_PIXEL = none
    n: int


class Prefixes(NamedTuple):
    """Prefixes of every pixel, in sets of one each."""

    rows: Any  # (sets * pixels * 28,) floats
    n_sets: Any  # UInt32, opaque


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
    pixels = np.full(side * side * n_cells, _NO_PIXEL, np.uint32)
    pixels[slots.ravel()] = np.arange(width * height, dtype=np.uint32)
    return PixelGroups(
        device_array(mi.UInt32, slots.ravel().astype(np.uint32)),
        device_array(mi.UInt32, pixels),
        n_cells,
    )


def trace_prefixes(context: ChainContext, n_pixels: int, sets: range, seed: int) -> Prefixes:
    """Sets of prefixes, those of a pixel through places spread over it.

    sets: numbers of the sets, in the order of a run. Invalid where a pixel does not see a rough
    surface first.
    """
    row, in_set = dr.arange(mi.UInt32, n_pixels * len(sets)), dr.opaque(mi.UInt32, n_pixels)
    pixel, number = row % in_set, row // in_set + dr.opaque(mi.UInt32, sets.start)
    key = stream_key(pixel, dr.opaque(mi.UInt32, (seed ^ _PREFIX_SEED) & 0xFFFFFFFF))
    sampler = SobolSampler(key, number)
    prefix = _trace_prefix(context, sampler, pixel)
    kd, f0, tau, wi = prefix.kd, prefix.f0, prefix.tau, prefix.wi
    values = (
        *_xyz(prefix.p), dr.select(prefix.is_valid, mi.Float(1), 0),
        *_xyz(prefix.n), prefix.alpha,
        *_xyz(prefix.ng), wi.x,
        *_rgb(kd), wi.y,
        *_rgb(f0), wi.z,
        *_rgb(tau), mi.Float(0),
        *_rgb(prefix.beta), mi.Float(0),
    )  # fmt: skip
    rows = dr.empty(mi.Float, n_pixels * len(sets) * len(values))
    for k, value in enumerate(values):
        dr.scatter(rows, value, row * len(values) + k)
    dr.eval(rows)
    return Prefixes(rows, dr.opaque(mi.UInt32, len(sets)))


@dr.syntax
def _trace_prefix(context: ChainContext, sampler: Sampler, pixel: Any) -> _Prefix:
    """Follow mirrors and glass to the first rough surface; no emitter counts."""
    paths = context.paths._replace(emitter_filter=EmitterFilter(None, None))
    u = sampler.get_2d(mi.UInt32(0))
    corner, at = sample_pixel(context.film, pixel, u, paths.fields.is_tent)
    path = camera_path(context.camera, corner, at)
    prefix = _Prefix(
        mi.Point3f(0), mi.Vector3f(0), mi.Vector3f(0), mi.Vector3f(0), mi.Color3f(0),
        mi.Color3f(0), mi.Color3f(0), mi.Float(0), mi.Color3f(0), mi.Bool(False),
    )  # fmt: skip
    active = mi.Bool(True)
    while active:
        beta, d = mi.Color3f(path.beta), mi.Vector3f(path.d)
        path, result, alive = advance(paths, sampler, path, active)
        si, bsdf = result.si, result.si.bsdf
        found = _Prefix(
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
        prefix = dr.select(active & result.is_rough & (path.depth == 1), found, prefix)
        active = active & alive & (path.depth == 0)
    return prefix


def record_suffix(
    suffix: Any,
    result: StepResult,
    path: PathState,
    reach: tuple[DirectionPdfs, Any],
    emitter_filter: EmitterFilter,
    active: Any,
) -> Any:
    """Record, in local memory, the second vertex of a path just after it was made.

    The share of its light to reconnect. path: as it was when it set out from the first vertex, or
    from the last sheet of glass on the way; reach: how the first vertex was left, and the
    probability of having passed those sheets.
    """
    si, bsdf, d = result.si, result.si.bsdf, result.scattered_d
    direct = result.outdoor_sample if emitter_filter.indoor is None else result.indoor_sample
    # Convert to K's measure: by the pdf of x2 by all techniques, and the probability of the glass
    # between. That of leaving x2 is known only where the ray ends.
    left, passed = reach
    cos = dr.abs(dr.dot(si.ng, path.d))
    distance2 = dr.squared_norm(si.p - path.reference.p)
    measure = cos / distance2
    pdfs = left.techniques / dr.maximum(result.guided_weight, 1e-30) * measure * passed
    values = (
        *_xyz(si.p), pdfs,
        *_xyz(si.n_interpolated), bsdf.alpha,
        *_xyz(si.ng), d.x,
        *_rgb(bsdf.kd), d.y,
        *_rgb(bsdf.f0), d.z,
        *_rgb(bsdf.tau), direct.d.x,
        *_rgb(direct.incident), direct.d.y,
    )  # fmt: skip
    for k, value in enumerate(values):
        suffix.write(value, mi.UInt32(k), active)
    suffix.write(direct.d.z, mi.UInt32(_EMITTER_Z), active)
    return _shared_share(left.bsdf * measure)


def _shared_share(area_pdf: Any) -> Any:
    """Share of the light between two vertices that is reconnected: little where they are close."""
    return MAX_SHARED_PDF / dr.maximum(area_pdf, MAX_SHARED_PDF)


def finish_suffix(suffix: Any, light: Any, split: SplitPath, active: Any) -> None:
    """Add what is known at a path's end: its light, what arrived at x2 from x3 (T), p2's parts."""
    # Find the pdf of leaving x2: share * bsdf + guided; of a ray that missed its target, 1.
    second, weight = split.second, split.suffix_weight
    is_known = weight > 0
    pdf = dr.select(is_known, second.techniques / dr.maximum(weight, 1e-30), 1)
    share = dr.select(is_known, second.share, 0)
    guided = dr.maximum(pdf - share * second.bsdf, 0)
    arriving = dr.select(is_known, split.suffix_light, 0)
    own = light * (suffix.read(mi.UInt32(_PDFS), active) * pdf)
    for c in range(3):
        suffix.write(arriving[c], mi.UInt32(_ARRIVING + c), active)
        suffix.write(own[c], mi.UInt32(_OWN_LIGHT + c), active)
    suffix.write(share, mi.UInt32(_PDFS), active)
    suffix.write(guided, mi.UInt32(_GUIDED_PDF), active)


def reconnect(
    scene: DeviceScene,
    film: Film,
    prefixes: Prefixes,
    groups: PixelGroups,
    chains: Chains,
    weight: Any,
) -> None:
    """Splat the shared light of every chain at all prefixes of its pixel's group.

    weight: what each chain has to splat.
    """
    # Choose the chains whose suffix can be seen from elsewhere.
    chosen = dr.compress(chains.shared > 0)
    n_chains = dr.width(chosen)
    # Transpose: a row a suffix.
    n = dr.width(chains.pixel)
    index = dr.arange(mi.UInt32, SUFFIX_FLOATS * n)
    source = index % SUFFIX_FLOATS * n + index // SUFFIX_FLOATS
    suffixes = dr.gather(mi.Float, chains.suffixes, source)
    dr.eval(suffixes)
    per_launch = max(_LANES_PER_LAUNCH // groups.n, 1)
    for first in range(0, n_chains, per_launch):
        some = dr.arange(mi.UInt32, min(per_launch, n_chains - first))
        chain = dr.gather(mi.UInt32, chosen, some + dr.opaque(mi.UInt32, first))
        dr.eval(chain)
        _reconnect_some(scene, film, prefixes, groups, suffixes, chains, chain, weight)


def _reconnect_some(
    scene: DeviceScene,
    film: Film,
    prefixes: Prefixes,
    groups: PixelGroups,
    suffixes: Any,
    states: Chains,
    chosen: Any,
    weight: Any,
) -> None:
    """Splat the suffixes of some chains, a lane a pair of chain and pixel."""
    # Pair each chain with the pixels of its own pixel's group.
    n = dr.opaque(mi.UInt32, groups.n)
    lane = dr.arange(mi.UInt32, dr.width(chosen) * groups.n)
    row, k = lane // n, lane % n
    chain = dr.gather(mi.UInt32, chosen, row)
    own_pixel = dr.gather(mi.UInt32, states.pixel, chain)
    slot = dr.gather(mi.UInt32, groups.slots, own_pixel)
    pixel = dr.gather(mi.UInt32, groups.pixels, slot - slot % n + k)
    is_pixel = pixel != _NO_PIXEL
    # Let neighbouring chains take different sets: they are even in number, so that the film's
    # halves, of even and of odd chains, share no prefix.
    prefix = chain % prefixes.n_sets * (film.width * film.height) + pixel
    x1 = _packets(prefixes.rows, prefix, _PREFIX_PACKETS, is_pixel)
    x2 = _packets(suffixes, chain, _SUFFIX_PACKETS, True)
    is_own, shared = pixel == own_pixel, dr.gather(mi.Float, states.shared, chain)
    others = _shared_light(scene, x1, x2, is_pixel & ~is_own)
    value = dr.select(is_own, colour(x2[8]) * shared, others)
    # Weigh each by its target function over the group's sum.
    target = target_function(film, pixel, value, is_pixel)
    good = (target > 0) & dr.isfinite(target)
    total = dr.zeros(mi.Float, dr.width(chosen))
    dr.scatter_add(total, target, row, good)
    dr.eval(total, value, good, pixel, chain, row)
    value *= weight * shared / dr.maximum(dr.gather(mi.Float, total, row), 1e-37)
    splat(film, chain, pixel, value, good)
    dr.eval(film.splats)


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
    return dr.select(valid, value * _shared_share(pdf1 * cos2 / distance2), 0)


def _scattered_suffix(x2: list[Any], ng: Any, d: Any) -> tuple[Any, Any]:
    """(light that a suffix scatters back along d, pdf of its own direction at x2)."""
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


def _packets(rows: Any, index: Any, n: int, active: Any) -> list[Any]:
    return [dr.gather(mi.Vector4f, rows, index * n + k, active) for k in range(n)]


def _bsdf(row: list[Any]) -> Bsdf:
    """The material of a prefix or suffix: both keep it in the same columns."""
    return Bsdf(colour(row[3]), colour(row[4]), colour(row[5]), row[1][3], mi.UInt32(0))


def _xyz(v: Any) -> tuple[Any, Any, Any]:
    return v.x, v.y, v.z


def _rgb(c: Any) -> tuple[Any, Any, Any]:
    return c[0], c[1], c[2]
