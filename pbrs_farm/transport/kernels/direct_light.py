"""Light that comes straight from an emitter to a vertex, by shadow rays; kernels, no effects.

Next-event estimation: one shadow ray goes to the sky, one to a lamp and in `path` one to a sunlit point
(sunlit_points.py), weighted against the scattered ray by the balance heuristic (Veach 1997, section 9.2).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.kernels.bsdf import evaluate_bsdf, view_independent_pdf, white_share
from pbrs_farm.transport.kernels.device_scene import offset_ray_origin
from pbrs_farm.transport.kernels.emitters import FIRST_PORTAL, SUN, DirectionSample
from pbrs_farm.transport.kernels.guided_rays import Guiding
from pbrs_farm.transport.kernels.lamp_guiding import NearbyLamps
from pbrs_farm.transport.kernels.path_state import (
    NO_EMITTERS,
    DirectLightSample,
    PathContext,
    PathState,
    Vertex,
)
from pbrs_farm.transport.kernels.sampler import Sampler
from pbrs_farm.transport.kernels.shadow_roulette import FREE_DIM, ShadowRoulette, shadow_roulette
from pbrs_farm.transport.kernels.sunlit_points import SunlitSample

# Random dimensions of a vertex, one or two numbers each; path_step.py has the others.
_LAMP, _LAMP_UV, _OUT, _OUT_UV = 4, 5, 7, 8
_SUNLIT = 3  # after those of roulette (shadow_roulette.py)


class Strategy(NamedTuple):
    """How the rays of a vertex are sampled and weighted."""

    near: NearbyLamps | None = None  # the lamps that guide its rays, None = unguided
    guiding: Guiding | None = None
    bsdf_share: Any = 1.0  # of the scattered rays, those that the surface draws itself
    is_view_independent: Any = False  # Bool: the MIS weights do not depend on wi
    beta: Any = None  # throughput up to the vertex, for shadow rays' roulette; None = all are cast


class DirectLight(NamedTuple):
    """Contributions of the shadow rays of a vertex."""

    outdoor: DirectLightSample  # straight from the sky
    indoor: DirectLightSample
    sunlit: DirectLightSample  # by way of a sunlit point


def sample_direct_light(
    context: PathContext,
    sampler: Sampler,
    vertex: Vertex,
    strategy: Strategy,
    active: Any,
    path: PathState | None = None,
) -> DirectLight:
    """Light scattered back along the path (to the vertex) by a shadow ray each to sky, lamps and sunlit points."""
    emitters, emitter_filter, dim = context.emitters, context.emitter_filter, vertex.dim
    p, outdoor, indoor, sunlit = vertex.si.p, None, None, None
    if emitter_filter.outdoor is not None:
        u, uv = sampler.get_1d(dim + _OUT), sampler.get_2d(dim + _OUT_UV)
        is_asked = active & (emitter_filter.outdoor > NO_EMITTERS)
        outdoor = emitters.sample_outdoor(p, u, uv, emitter_filter.outdoor, is_asked)
    if emitter_filter.indoor is not None and vertex.near is not None:
        u, uv = sampler.get_1d(dim + _LAMP), sampler.get_2d(dim + _LAMP_UV)
        is_asked = active & (emitter_filter.indoor > NO_EMITTERS)
        indoor = emitters.sample_lamp(
            context.scene, vertex.near, u, uv, emitter_filter.indoor, is_asked
        )
    if context.sunlit is not None:
        goes_on = active & (vertex.depth + 1 < context.fields.max_depth)
        sunlit = context.sunlit.sample(p, sampler.get_1d(dim + (FREE_DIM + _SUNLIT)), goes_on)

    # A portal asked for alone has no light of scattered rays to be weighted against.
    of_sky = strategy
    if emitter_filter.outdoor is not None:
        share = dr.select(emitter_filter.outdoor >= FIRST_PORTAL, 0, strategy.bsdf_share)
        of_sky = strategy._replace(bsdf_share=share)
    by_sky, by_lamps = emitters.shadow_thresholds
    roulettes = [
        shadow_roulette(strategy.beta, threshold, sampler, dim, k)
        for k, threshold in enumerate((by_sky, by_lamps, by_sky))
    ]
    return DirectLight(
        _direct_light(context, vertex, of_sky, outdoor, roulettes[0], path),
        _direct_light(context, vertex, of_sky, indoor, roulettes[1]),
        _direct_light(context, vertex, strategy, sunlit, roulettes[2]),
    )


def _direct_light(
    context: PathContext,
    vertex: Vertex,
    strategy: Strategy,
    sample: DirectionSample | SunlitSample | None,
    roulette: ShadowRoulette | None,
    path: PathState | None = None,
) -> DirectLightSample:
    """Contribution of one shadow ray; zero if its roulette casts none. path: where sunlit points take over."""
    if sample is None:
        none = mi.Color3f(0)
        return DirectLightSample(none, mi.Vector3f(0, 1, 0), mi.Color3f(0), white=none)
    si, is_independent = vertex.si, strategy.is_view_independent
    wo = vertex.frame.to_local(sample.d)
    value, pdf = evaluate_bsdf(si.bsdf, vertex.wi, wo, least_diffuse=context.least_diffuse)
    pdf *= strategy.bsdf_share

    # Refuse light through the face where the shading normal says that it does not pass.
    side = dr.dot(si.ng, sample.d)
    is_consistent = side * wo.z > 0
    contributes = is_consistent & (dr.max(value) > 0)
    if is_independent is not False:
        # Ask for what could contribute from some wi, whatever this wi is.
        pdf = dr.select(is_independent, view_independent_pdf(si.bsdf, si.ng, sample.d), pdf)
        contributes = dr.select(is_independent, (side > 0) | (dr.max(si.bsdf.tau) > 0), contributes)
    contributes = contributes & sample.valid & (sample.pdf > 0)
    # Weigh by the balance heuristic; the sample's own pdf cancels with the estimator's.
    weight = 1 / (sample.pdf + pdf)
    taken = _taken_by_sunlit(context, vertex, path, sample, value, contributes)
    if roulette is not None:
        rate = context.emitters.arrival.of_kind(si.p, sample.kind, contributes)
        rest = value * sample.radiance * weight
        if taken is not None:
            rest = dr.maximum(rest - taken, 0)
        is_cast, chance = roulette.cast_by_chance(rest, rate)
        contributes, weight = contributes & is_cast, weight / chance
        taken = None if taken is None else taken / chance

    # Aim again from the offset origin: a lamp near by must not shadow itself.
    begin = offset_ray_origin(si.p, dr.select(side > 0, si.ng, -si.ng))
    to = si.p + sample.d * sample.distance - begin
    distance = dr.norm(to)
    is_finite = sample.distance < dr.inf
    d = dr.select(is_finite, to / distance, sample.d)
    reach = dr.select(is_finite, distance * (1 - 1e-4), dr.inf)
    clear = context.scene.transmittance(begin, d, reach, contributes)
    if (
        context.emitters.outside is not None
        and isinstance(sample, DirectionSample)
        and sample.emitter is None
    ):
        # The dome includes outdoor occlusion; only the sun is occluded here.
        to_sun = contributes & (sample.kind == SUN) & (dr.max(clear) > 0)
        clear *= context.emitters.sun.past_outside(begin, d, to_sun)
    incident = dr.select(contributes, sample.radiance * clear * weight, 0)
    light = dr.select(contributes & is_consistent, value * incident, 0)
    if taken is not None:
        light -= dr.select(contributes & is_consistent, taken * clear, 0)
    arrives = dr.max(clear) > 0
    white = light * white_share(value, wo) if context.splits_white else None
    return DirectLightSample(
        light, sample.d, incident, sample.emitter, sample.kind, contributes, arrives, white
    )


def _taken_by_sunlit(
    context: PathContext,
    vertex: Vertex,
    path: PathState | None,
    sample: DirectionSample | SunlitSample,
    value: Any,
    active: Any,
) -> Any:
    """Color3f part of a sample's light that sunlit points contribute instead; None without them."""
    if context.sunlit is None or path is None:
        return None
    by_sun = active & (sample.kind == SUN)
    ray = path.reference.p, path.bsdf_pdf
    share = context.sunlit.share_of_sun(ray, vertex.si, sample.d, by_sun)
    return dr.select(by_sun, value * sample.radiance * (share / sample.pdf), 0)
