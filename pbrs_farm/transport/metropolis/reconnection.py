"""One path's tail seen from many pixels: the lens mutations of `metropolis`; kernels, no effects.

A path is a head, from the eye to its first vertex x1, and a tail, from its second vertex x2 on.
Where both are rough and see each other, any other head x1' that sees x2 makes another path with
the same tail. In the measure of (film, area at x2, direction out of x2) its contribution is

    K(x1') = B f1(x1' -> x2) cos1' cos2' / |x1' - x2|^2
             V(x1', x2) [ f2(-> lamp) S p2(-> x3) + f2(-> x3) T ]

with B what reaches the eye from x1', V what thin glass between lets through (0 behind a wall), S
the shadow ray's radiance over its pdf, T the light that arrives from x3, p2 the pdf of
going there: the PSSMLT integrand times the pdfs of what the head no longer draws. The pixels are dealt into random groups; a chain that stands at a
path in proportion to its luminance I is equally well shown at all heads j of its pixel's group,
each with weight I_j = luminance of K_j over the group's sum (a Gibbs step over the head, every
outcome counted at once: it keeps the distribution of the chain). So one tail, dear to find, lights
as many pixels as the group has, for one shadow ray each.

Thin glass and cut-outs between x1 and x2 let a tail through, with the share of the light they let
through. A mirror at x1, a reflection between the two, or less than NEAR_M between them leave a path
to its own pixel.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.transport.kernels.bsdf import Bsdf, evaluate_bsdf, thin_glass_reflectance
from pbrs_farm.transport.kernels.device_scene import (
    DeviceScene,
    SurfaceInteraction,
    bend_normal,
    offset_ray_origin,
)
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.path_state import (
    DeviceCamera,
    DeviceFields,
    EmitterFilter,
    PathContext,
    PathState,
    StepResult,
    camera_path,
)
from pbrs_farm.transport.kernels.path_step import advance
from pbrs_farm.transport.kernels.sampler import HashedSampler, device_array, stream_key
from pbrs_farm.transport.metropolis.film import Film, level_of, point_in_pixel
from pbrs_farm.transport.scene_tables.material_rows import GLASS

TAIL_FLOATS: Final = 36
NEAR_M: Final = 0.1
_HEAD_PACKETS: Final = 7
_LANES_PER_LAUNCH: Final = 1 << 22
_NEVER: Final = 0xFFFFFFFF


class Standing(Protocol):
    """Where N chains stand (chains.Chains)."""

    @property
    def pixel(self) -> Any:
        """(N,) UInt32."""
        ...

    @property
    def is_shared(self) -> Any:
        """(N,) Bool: whether the path's tail can be shown elsewhere."""
        ...

    @property
    def tails(self) -> Any:
        """(TAIL_FLOATS * N,), number by number."""
        ...


class Groups(NamedTuple):
    """The pixels dealt into groups of n. slots: (pixels,) place of each; pixels: (slots,) of each,
    _NEVER = none; a group's slots are neighbours."""

    slots: Any
    pixels: Any
    n: int


def deal(height: int, width: int, n: int, seed: int) -> Groups:
    """Groups of at most n pixels (of one, where n is 0), each spread over the whole picture.

    The picture is cut into as many square cells as a group may have pixels; every cell deals its
    pixels to different groups, at random, so that neighbours do not share their noise.
    """
    side = 1
    while -(-height // side) * -(-width // side) > max(n, 1):
        side += 1
    rows, columns = -(-height // side), -(-width // side)
    n_cells = rows * columns
    rng = np.random.default_rng(seed)
    order = rng.permuted(np.tile(np.arange(side * side), (n_cells, 1)), axis=1)
    y, x = np.mgrid[0:height, 0:width]
    cell = y // side * columns + x // side
    slots = order[cell, y % side * side + x % side] * n_cells + cell
    pixels = np.full(side * side * n_cells, _NEVER, np.uint32)
    pixels[slots.ravel()] = np.arange(width * height, dtype=np.uint32)
    return Groups(
        device_array(mi.UInt32, slots.ravel().astype(np.uint32)),
        device_array(mi.UInt32, pixels),
        n_cells,
    )


def first_vertices(context: PathContext, film: Film, n_pixels: int, seed: int) -> Any:
    """(pixels * 28,) floats: a head of each pixel through a random place in it.

    Invalid where a pixel does not see a rough surface first.
    """
    key = stream_key(dr.arange(mi.UInt32, n_pixels), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))
    sampler = HashedSampler(key, dr.opaque(mi.UInt32, 7))
    rows = dr.zeros(mi.Float, n_pixels * _HEAD_PACKETS * 4)
    _trace_heads(
        context.scene, context.emitters, context.fields, context.camera, film, sampler, rows
    )
    dr.eval(rows)
    return rows


@dr.syntax
def _trace_heads(
    scene: DeviceScene,
    emitters: Emitters,
    fields: DeviceFields,
    camera: DeviceCamera,
    film: Film,
    sampler: HashedSampler,
    rows: Any,
) -> None:
    off = EmitterFilter(None, None)
    lane = dr.arange(mi.UInt32, dr.width(rows) // (_HEAD_PACKETS * 4))
    at = point_in_pixel(film, lane, sampler.get_2d(mi.UInt32(0)), fields.is_tent)
    path = camera_path(camera, at.x, at.y)
    p, n, ng, wi = mi.Point3f(0), mi.Vector3f(0), mi.Vector3f(0), mi.Vector3f(0)
    kd, f0, tau, alpha = mi.Color3f(0), mi.Color3f(0), mi.Color3f(0), mi.Float(0)
    beta, is_valid = mi.Color3f(0), mi.Bool(False)
    active = mi.Bool(True)
    while active:
        before, d = mi.Color3f(path.beta), mi.Vector3f(path.d)
        path, result, alive = advance(scene, emitters, fields, sampler, path, off, active)
        here = active & result.is_rough & (path.depth == 1)
        m = result.si.bsdf
        p, n, ng = (
            dr.select(here, result.si.p, p),
            dr.select(here, result.si.n, n),
            dr.select(here, result.si.ng, ng),
        )
        wi, beta = dr.select(here, -d, wi), dr.select(here, before, beta)
        kd, f0 = dr.select(here, m.kd, kd), dr.select(here, m.f0, f0)
        tau, alpha = dr.select(here, m.tau, tau), dr.select(here, m.alpha, alpha)
        is_valid = is_valid | here
        active = active & alive & (path.depth == 0)
    values = (
        *(p.x, p.y, p.z, dr.select(is_valid, mi.Float(1), 0)),
        *(n.x, n.y, n.z, alpha),
        *(ng.x, ng.y, ng.z, wi.x),
        *(kd[0], kd[1], kd[2], wi.y),
        *(f0[0], f0[1], f0[2], wi.z),
        *(tau[0], tau[1], tau[2], mi.Float(0)),
        *(beta[0], beta[1], beta[2], mi.Float(0)),
    )
    for k, value in enumerate(values):
        dr.scatter(rows, value, lane * (_HEAD_PACKETS * 4) + k)


def passing_chance(si: SurfaceInteraction, d: Any) -> Any:
    """Chance that a path goes straight through what it met: below 1 for glass, 1 for all else."""
    is_glass = si.valid & ~si.is_cutout & (si.bsdf.kind == GLASS)
    return dr.select(is_glass, 1 - thin_glass_reflectance(dr.dot(si.n, d)), 1)


def write_tail(
    tail: Any,
    result: StepResult,
    path: PathState,
    passes: Any,
    emitter_filter: EmitterFilter,
    active: Any,
) -> None:
    """Keep, in local memory, the second vertex of a path just after it was made.

    walk: as it was when it set out from the first vertex, or from the last sheet of glass on the
    way; passes: chance of having passed those.
    """
    si, m = result.si, result.si.bsdf
    way = si.p - path.reference.p
    to = result.outdoor_sample if emitter_filter.indoor is None else result.indoor_sample
    # What turns the contribution into K's measure: the pdfs of x2 and of leaving it, the
    # chance of the glass between.
    cos = dr.abs(dr.dot(si.ng, path.d))
    pdfs = path.bsdf_pdf * cos / dr.squared_norm(way) * result.pdf * passes
    values = (
        *(si.p.x, si.p.y, si.p.z, pdfs),
        *(si.n_interpolated.x, si.n_interpolated.y, si.n_interpolated.z, m.alpha),
        *(si.ng.x, si.ng.y, si.ng.z, result.scattered_d.x),
        *(m.kd[0], m.kd[1], m.kd[2], result.scattered_d.y),
        *(m.f0[0], m.f0[1], m.f0[2], result.scattered_d.z),
        *(m.tau[0], m.tau[1], m.tau[2], to.d.x),
        *(to.strength[0], to.strength[1], to.strength[2], to.d.y),
    )
    for k, value in enumerate(values):
        tail.write(value, mi.UInt32(k), active)
    tail.write(to.d.z, mi.UInt32(31), active)


def close_tail(tail: Any, light: Any, beyond: Any, active: Any) -> None:
    """Add what is known at a path's end: its light, and what arrived out of its tail (T)."""
    own = light * tail.read(mi.UInt32(3), active)
    for c in range(3):
        tail.write(beyond[c], mi.UInt32(28 + c), active)
        tail.write(own[c], mi.UInt32(32 + c), active)


def show_tails(
    scene: DeviceScene, film: Film, heads: Any, groups: Groups, chains: Standing, weight: Any
) -> None:
    """Splat every chain's tail at all heads of its pixel's group.

    heads: rows of first_vertices(); weight: what each chain has to splat.
    """
    chosen = dr.compress(chains.is_shared)
    n_chains = dr.width(chosen)
    tails = _rows(chains.tails, dr.width(chains.pixel))
    per_launch = max(_LANES_PER_LAUNCH // groups.n, 1)
    for first in range(0, n_chains, per_launch):
        some = dr.arange(mi.UInt32, min(per_launch, n_chains - first))
        chain = dr.gather(mi.UInt32, chosen, some + dr.opaque(mi.UInt32, first))
        dr.eval(chain)
        _show(scene, film, heads, groups, tails, chains.pixel, chain, weight)


def _rows(tails: Any, n: int) -> Any:
    """(N * 36,) rows of what lies number by number."""
    index = dr.arange(mi.UInt32, TAIL_FLOATS * n)
    rows = dr.gather(mi.Float, tails, index % TAIL_FLOATS * n + index // TAIL_FLOATS)
    dr.eval(rows)
    return rows


def _show(
    scene: DeviceScene,
    film: Film,
    heads: Any,
    groups: Groups,
    tails: Any,
    pixel: Any,
    chain: Any,
    weight: Any,
) -> None:
    n = dr.opaque(mi.UInt32, groups.n)
    lane = dr.arange(mi.UInt32, dr.width(chain) * groups.n)
    row, k = lane // n, lane % n
    which = dr.gather(mi.UInt32, chain, row)
    own = dr.gather(mi.UInt32, pixel, which)
    slot = dr.gather(mi.UInt32, groups.slots, own)
    at = dr.gather(mi.UInt32, groups.pixels, slot - slot % n + k)
    value = _seen(scene, heads, tails, which, at, at != own, at != _NEVER)
    level = level_of(film, at, value, at != _NEVER)
    good = (level > 0) & dr.isfinite(level)
    total = dr.zeros(mi.Float, dr.width(chain))
    dr.scatter_add(total, level, row, good)
    dr.eval(total, value, good, at, which, row)
    value *= weight / dr.maximum(dr.gather(mi.Float, total, row), 1e-37)
    base = ((which & 1) * (film.width * film.height) + at) * 3
    for c in range(3):
        dr.scatter_add(film.splats, value[c], base + c, good)
    dr.eval(film.splats)


def _seen(
    scene: DeviceScene, heads: Any, tails: Any, chain: Any, at: Any, is_other: Any, active: Any
) -> Any:
    """K of a chain's tail at a head; of its own head as the chain has found it."""
    h = [
        dr.gather(mi.Vector4f, heads, at * _HEAD_PACKETS + k, active) for k in range(_HEAD_PACKETS)
    ]
    t = [dr.gather(mi.Vector4f, tails, chain * (TAIL_FLOATS // 4) + k) for k in range(9)]
    p1, p2 = _point(h[0]), _point(t[0])
    n1, ng1, ng2 = _vector(h[1]), _vector(h[2]), _vector(t[2])
    m1 = Bsdf(_colour(h[3]), _colour(h[4]), _colour(h[5]), h[1][3], mi.UInt32(0))
    m2 = Bsdf(_colour(t[3]), _colour(t[4]), _colour(t[5]), t[1][3], mi.UInt32(0))
    wi1 = mi.Vector3f(h[2][3], h[3][3], h[4][3])
    way = p2 - p1
    distance2 = dr.squared_norm(way)
    d = way * dr.rsqrt(distance2)

    # From x1 to x2: f1 and the geometry of the two.
    frame1 = mi.Frame3f(n1)
    local = frame1.to_local(wi1)
    local.z = dr.maximum(local.z, 1e-4)
    out = frame1.to_local(d)
    value1, pdf1 = evaluate_bsdf(m1, local, out)
    side, cos2 = dr.dot(ng1, d), -dr.dot(ng2, d)
    valid = is_other & active & (h[0][3] > 0) & (distance2 > NEAR_M**2) & (side * out.z > 0)
    valid &= (pdf1 > 0) & (dr.max(value1) > 0) & (cos2 > 0)

    # At x2: towards the lamp, and along the tail.
    frame2 = mi.Frame3f(bend_normal(_vector(t[1]), d))
    wi2 = frame2.to_local(-d)
    wi2.z = dr.maximum(wi2.z, 1e-4)
    to_lamp = mi.Vector3f(t[5][3], t[6][3], t[7][3])
    ahead = mi.Vector3f(t[2][3], t[3][3], t[4][3])
    from_lamp, _pdf = _scattered(m2, frame2, ng2, wi2, to_lamp)
    from_tail, pdf2 = _scattered(m2, frame2, ng2, wi2, ahead)
    inner = from_lamp * _colour(t[6]) * pdf2 + from_tail * _colour(t[7])
    valid &= (pdf2 > 0) & (dr.max(inner) > 0)

    begin = offset_ray_origin(p1, dr.select(side > 0, ng1, -ng1))
    aim = p2 - begin
    reach = dr.norm(aim)
    clear = scene.transmittance(begin, aim / reach, reach * (1 - 1e-4), valid)
    value = _colour(h[6]) * value1 * inner * clear * (cos2 / distance2)
    return dr.select(is_other, dr.select(valid, value, 0), _colour(t[8]))


def _scattered(m: Bsdf, frame: Any, ng: Any, wi: Any, d: Any) -> tuple[Any, Any]:
    """(f |cos|, pdf) of going on in direction d; nothing where d leaves through the face."""
    wo = frame.to_local(d)
    value, pdf = evaluate_bsdf(m, wi, wo)
    faces = dr.dot(ng, d) * wo.z > 0
    return dr.select(faces, value, 0), dr.select(faces, pdf, 0)


def _point(row: Any) -> Any:
    return mi.Point3f(row[0], row[1], row[2])


def _vector(row: Any) -> Any:
    return mi.Vector3f(row[0], row[1], row[2])


def _colour(row: Any) -> Any:
    return mi.Color3f(row[0], row[1], row[2])
