"""Unidirectional path tracing of both light groups from one trace; kernels, no effects.

At each vertex one shadow ray goes to the sky and one to a lamp, weighted against the scattered
ray by the balance heuristic; an emitter that is met counts to its own group. A lane takes up the
next sample of its pixel as soon as a path ends, so that no lane of a packet waits for the longest
path. A lane sums its samples in order: the same seed gives the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.camera import Camera
from pbrs_farm.recipe import LightFields
from pbrs_farm.transport.bsdf import evaluate, luminance, sample, thin_glass_reflectance
from pbrs_farm.transport.emitters import FIRST_PORTAL, Emitters
from pbrs_farm.transport.materials import GLASS, MIRROR
from pbrs_farm.transport.numbers import (
    CAMERA_DIMS,
    VERTEX_DIMS,
    Numbers,
    SobolNumbers,
    opaque3,
    stream_key,
)
from pbrs_farm.transport.surface import Hit, Stage, offset
from pbrs_farm.transport.tables import NO_LAMP

_MAX_NULLS = 32
_LOBE, _SCATTER, _ROULETTE, _LAMP, _LAMP_UV, _OUT, _OUT_UV = 0, 1, 3, 4, 5, 7, 8


@dataclass(frozen=True, slots=True, eq=False)
class Sums:
    """Sums over the samples of each lane, numpy, (N, 3) float32.

    outdoor, indoor: radiance; *_even: of every second sample; albedo, normal: of the first
    surface that is neither mirror nor glass; n_bad: contributions that were not finite.
    """

    outdoor: NDArray[np.float32]
    indoor: NDArray[np.float32]
    outdoor_even: NDArray[np.float32]
    indoor_even: NDArray[np.float32]
    albedo: NDArray[np.float32]
    normal: NDArray[np.float32]
    n_bad: int


class CameraRow(NamedTuple):
    """A camera as opaque device values: another camera is no new kernel."""

    eye: Any
    d0: Any
    du: Any
    dv: Any


@dataclass(frozen=True, slots=True)
class Lanes:
    """Which pixels to trace and how often.

    width, height: of the picture. first_sample, n_samples: of each pixel; n_total: samples the
    numbers are spread over. n_only: 0, or the number of emitters that the pilot asks one by one:
    lane = pixel * n_only + emitter.
    """

    width: int
    height: int
    first_sample: int
    n_samples: int
    seed: int
    n_only_lamps: int = 0
    n_only_outdoor: int = 0

    @property
    def n_lanes(self) -> int:
        """Lanes of a launch."""
        return self.width * self.height * max(self.n_only_lamps + self.n_only_outdoor, 1)


def camera_row(camera: Camera) -> CameraRow:
    """Device values: the direction at pixel coordinates (u, v) is d0 + u du + v dv."""
    i, r = camera.intrinsics, camera.world_from_camera[:3, :3]
    d0 = r @ np.array([-i.cx / i.fx, i.cy / i.fy, -1.0])

    return CameraRow(
        opaque3(mi.Point3f, camera.eye),
        opaque3(mi.Vector3f, d0),
        opaque3(mi.Vector3f, r[:, 0] / i.fx),
        opaque3(mi.Vector3f, -r[:, 1] / i.fy),
    )


def trace(
    stage: Stage, emitters: Emitters, camera: Camera, lanes: Lanes, fields: LightFields
) -> Sums:
    """Trace n_samples paths for every lane."""
    n_only = lanes.n_only_lamps + lanes.n_only_outdoor
    lane = dr.arange(mi.UInt32, lanes.n_lanes)
    per_pixel = dr.opaque(mi.UInt32, max(n_only, 1))
    pixel, which = lane // per_pixel, mi.Int32(lane % per_pixel)
    n_lamps = dr.opaque(mi.Int32, lanes.n_only_lamps)
    asked = dr.opaque(mi.Bool, n_only > 0)
    is_lamp = which < n_lamps

    # -2 shuts a whole group off: the pilot wants the light of one emitter alone.
    only_lamp = dr.select(asked, dr.select(is_lamp, which, -2), -1)
    only_outdoor = dr.select(asked, dr.select(is_lamp, -2, which - n_lamps), -1)
    out = _trace(
        stage,
        emitters,
        camera_row(camera),
        fields_row(fields),
        pixel,
        dr.opaque(mi.UInt32, lanes.width),
        dr.opaque(mi.UInt32, lanes.first_sample),
        dr.opaque(mi.UInt32, lanes.first_sample + lanes.n_samples),
        stream_key(lane, dr.opaque(mi.UInt32, lanes.seed & 0xFFFFFFFF)),
        only_lamp,
        only_outdoor,
    )
    dr.eval(*out)
    arrays = [np.ascontiguousarray(v.numpy().T, np.float32) for v in out[:6]]
    n_bad = int(np.sum(out[6].numpy(), dtype=np.int64))
    return Sums(arrays[0], arrays[1], arrays[2], arrays[3], arrays[4], arrays[5], n_bad)


class FieldsRow(NamedTuple):
    """The recipe's numbers as opaque device values."""

    max_depth: Any
    rr_depth: Any
    is_tent: Any


def fields_row(fields: LightFields) -> FieldsRow:
    """Device values of the fields the kernels use."""
    return FieldsRow(
        dr.opaque(mi.UInt32, fields.max_depth),
        dr.opaque(mi.UInt32, fields.rr_depth),
        dr.opaque(mi.Bool, fields.filter == "tent"),
    )


def film_position(u: Any, is_tent: Any) -> Any:
    """Position relative to a pixel's corner, spread by the reconstruction filter."""
    tent = mi.Point2f(_tent(u.x), _tent(u.y)) + 0.5
    return dr.select(is_tent, tent, u)


def _tent(u: Any) -> Any:
    low = u < 0.5
    return dr.select(low, dr.sqrt(2 * u) - 1, 1 - dr.sqrt(dr.maximum(2 - 2 * u, 0)))


def direct(
    stage: Stage,
    emitters: Emitters,
    hit: Hit,
    frame: Any,
    wi: Any,
    numbers: Numbers,
    dim: Any,
    only_lamp: Any,
    only_outdoor: Any,
    active: Any,
) -> tuple[Any, Any]:
    """(outdoor, indoor) light scattered towards wi, one shadow ray each, before throughput."""
    out = emitters.sample_outdoor(
        hit.p, numbers.one(dim + _OUT), numbers.two(dim + _OUT_UV), only_outdoor, active & (only_outdoor > -2)
    )  # fmt: skip
    lamp = emitters.sample_lamp(
        stage, hit.p, numbers.one(dim + _LAMP), numbers.two(dim + _LAMP_UV), only_lamp, active & (only_lamp > -2)
    )  # fmt: skip
    # The pilot draws a portal's light through the portal alone.
    alone = only_outdoor >= FIRST_PORTAL
    result = []
    for to in (out, lamp):
        wo = frame.to_local(to.d)
        value, density = evaluate(hit.scatter, wi, wo)
        # Light may not come through the face when the shading normal says it does not.
        side = dr.dot(hit.ng, to.d)
        lit = to.valid & (side * wo.z > 0) & (dr.max(value) > 0) & (to.density > 0)
        weight = 1 / (to.density + dr.select(alone, 0, density))
        start = offset(hit.p, dr.select(side > 0, hit.ng, -hit.ng))
        # Aim again from the moved start: a lamp near by must not shadow itself.
        aim = hit.p + to.d * to.distance - start
        reach = dr.norm(aim)
        is_near = to.distance < dr.inf
        way = dr.select(is_near, aim / reach, to.d)
        clear = stage.transmittance(start, way, dr.select(is_near, reach * (1 - 1e-4), dr.inf), lit)
        result.append(dr.select(lit, value * to.radiance * clear * weight, 0))
    return result[0], result[1]


@dr.syntax
def _trace(
    stage: Stage,
    emitters: Emitters,
    camera: CameraRow,
    fields: FieldsRow,
    pixel: Any,
    width: Any,
    first: Any,
    last: Any,
    key: Any,
    only_lamp: Any,
    only_outdoor: Any,
) -> tuple[Any, ...]:
    # Sums over samples, and the light of the path that is under way.
    outdoor, indoor = mi.Color3f(0), mi.Color3f(0)
    outdoor_even, indoor_even = mi.Color3f(0), mi.Color3f(0)
    albedo, normal = mi.Color3f(0), mi.Vector3f(0)
    n_bad = mi.UInt32(0)
    l_out, l_in = mi.Color3f(0), mi.Color3f(0)

    # The path: its ray, throughput, number of segments, and how its last direction was drawn.
    s = mi.UInt32(first)
    fresh = mi.Bool(True)
    o, d = mi.Point3f(0), mi.Vector3f(0, 0, 1)
    beta = mi.Color3f(1)
    depth, nulls = mi.UInt32(0), mi.UInt32(0)
    last_p, last_density = mi.Point3f(0), mi.Float(0)
    seen = mi.Bool(False)
    active = s < last
    x0, y0 = mi.Float(pixel % width), mi.Float(pixel // width)

    while active:
        numbers = SobolNumbers(key, s)

        # Start the next sample where the last path has ended.
        jitter = film_position(numbers.two(mi.UInt32(0)), fields.is_tent)
        way = dr.normalize(camera.d0 + (x0 + jitter.x) * camera.du + (y0 + jitter.y) * camera.dv)
        o, d = dr.select(fresh, mi.Point3f(camera.eye), o), dr.select(fresh, mi.Vector3f(way), d)
        beta = dr.select(fresh, mi.Color3f(1), beta)
        depth, nulls = dr.select(fresh, 0, depth), dr.select(fresh, 0, nulls)
        last_density = dr.select(fresh, 0, last_density)
        l_out, l_in = dr.select(fresh, mi.Color3f(0), l_out), dr.select(fresh, mi.Color3f(0), l_in)
        seen = seen & ~fresh

        hit = stage.hit(o, d, active)
        missed = active & ~hit.valid
        wi_cos = -dr.dot(d, hit.ng)

        # Emitters that the ray meets: weight 1 behind the camera, mirrors and glass.
        by_scatter = last_density > 0
        # What the camera sees directly needs no choice: the pilot leaves it out.
        counts = (only_lamp == -1) | by_scatter
        sun, sun_density = emitters.sun(d, only_outdoor)
        dome, dome_density = emitters.dome(last_p, d, only_outdoor, missed)
        sun_weight = dr.select(by_scatter, last_density / (last_density + sun_density), 1)
        dome_weight = dr.select(by_scatter, last_density / (last_density + dome_density), 1)
        # The pilot of a portal counts what is drawn through it only.
        sees_sky = (
            missed & counts & emitters.has_sky & (only_outdoor > -2) & (only_outdoor < FIRST_PORTAL)
        )
        l_out += dr.select(sees_sky, beta * (sun * sun_weight + dome * dome_weight), 0)
        distance = dr.norm(hit.p - last_p)
        glow, lamp_density = emitters.hit_lamp(
            hit.lamp, distance, wi_cos, only_lamp, hit.valid & (only_lamp > -2)
        )
        lamp_weight = dr.select(by_scatter, last_density / (last_density + lamp_density), 1)
        met = hit.valid & counts & (hit.lamp != NO_LAMP)
        l_in += dr.select(met, beta * glow * lamp_weight, 0)

        # Kinds of surface.
        m = hit.scatter
        glass = hit.valid & ~hit.is_hole & (m.kind == GLASS)
        mirror = hit.valid & ~hit.is_hole & (m.kind == MIRROR)
        rough = hit.valid & ~hit.is_hole & ~glass & ~mirror
        depth = depth + dr.select(hit.valid & ~hit.is_hole & ~glass, 1, 0)
        dim = CAMERA_DIMS + VERTEX_DIMS * dr.minimum(depth + nulls, 64)
        frame = mi.Frame3f(hit.n)
        wi = frame.to_local(-d)
        wi.z = dr.maximum(wi.z, 1e-4)

        # What the denoiser is told of the first surface that is not a mirror or glass.
        first_rough = rough & ~seen
        colour = dr.minimum(m.kd + m.f0 + m.tau, 1)
        albedo += dr.select(first_rough, colour, 0)
        normal += dr.select(first_rough, hit.n, 0)
        albedo += dr.select(missed & ~seen, mi.Color3f(1), 0)
        seen = seen | first_rough

        # Light that comes straight from an emitter.
        go_on = rough & (depth < fields.max_depth)
        e_out, e_in = direct(
            stage, emitters, hit, frame, wi, numbers, dim, only_lamp, only_outdoor, go_on
        )
        l_out += beta * e_out
        l_in += beta * e_in

        # Scatter. Glass and mirrors keep one direction; what passes glass straight is no vertex.
        lobe = numbers.one(dim + _LOBE)
        wo = sample(m, wi, lobe, numbers.two(dim + _SCATTER))
        value, density = evaluate(m, wi, wo)
        ahead = frame.to_world(wo)
        side = dr.dot(hit.ng, ahead)
        bounced = go_on & (side * wo.z > 0) & (density > 0)
        reflectance = thin_glass_reflectance(wi.z)
        reflected = mirror | (glass & (lobe < reflectance))
        passed = (glass & ~reflected) | (hit.valid & hit.is_hole)
        mirrored = reflected & (depth < fields.max_depth) & (nulls < _MAX_NULLS)
        bent = d - 2 * dr.dot(hit.n, d) * hit.n
        mirrored = mirrored & (dr.dot(bent, hit.ng) > 0)
        passed = passed & (nulls < _MAX_NULLS)
        factor = dr.select(rough, value / density, mi.Color3f(1))
        factor = dr.select(mirror, m.f0, factor)
        factor = dr.select(glass & passed, m.tau, factor)
        beta = beta * factor
        nulls = nulls + dr.select(passed | (glass & mirrored), 1, 0)
        last_p = dr.select(bounced, hit.p, last_p)
        last_density = dr.select(bounced, density, dr.select(mirrored, 0, last_density))
        d = dr.select(bounced, mi.Vector3f(ahead), dr.select(mirrored, bent, d))
        outward = dr.select(dr.dot(d, hit.ng) > 0, hit.ng, -hit.ng)
        o = offset(hit.p, outward)
        alive = bounced | mirrored | passed

        # Roulette.
        q = dr.minimum(dr.max(beta), 0.95)
        tested = bounced & (depth >= fields.rr_depth)
        survives = ~tested | (numbers.one(dim + _ROULETTE) < q)
        alive = alive & survives & (dr.max(beta) > 0)
        beta = dr.select(tested, beta * dr.rcp(dr.maximum(q, 1e-6)), beta)

        # Close the sample where the path ends.
        done = active & ~alive
        good = dr.isfinite(luminance(l_out)) & dr.isfinite(luminance(l_in))
        n_bad += dr.select(done & ~good, 1, 0)
        even = (s & 1) == 0
        outdoor += dr.select(done & good, l_out, 0)
        indoor += dr.select(done & good, l_in, 0)
        outdoor_even += dr.select(done & good & even, l_out, 0)
        indoor_even += dr.select(done & good & even, l_in, 0)
        s = s + dr.select(done, 1, 0)
        fresh = mi.Bool(done)
        active = s < last

    return outdoor, indoor, outdoor_even, indoor_even, albedo, normal, n_bad
