"""Light that comes straight from an emitter to a vertex, by shadow rays; kernels, no effects.

Next-event estimation: one shadow ray goes to the sky and one to a lamp, weighted against the
scattered ray by the balance heuristic (Veach 1997, section 9.2).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.guiding.guided_rays import Guiding
from pbrs_farm.transport.guiding.nearby_lamps import NearbyLamps
from pbrs_farm.transport.kernels.bsdf import evaluate_bsdf, view_independent_pdf
from pbrs_farm.transport.kernels.device_scene import offset_ray_origin
from pbrs_farm.transport.kernels.emitters import FIRST_PORTAL, DirectionSample
from pbrs_farm.transport.kernels.path_state import (
    NO_EMITTERS,
    DirectLightSample,
    PathContext,
    Vertex,
)
from pbrs_farm.transport.kernels.sampler import Sampler
from pbrs_farm.transport.kernels.shadow_roulette import ShadowRoulette, shadow_roulettes

# Random dimensions of a vertex, one or two numbers each; path_step.py has the others.
_LAMP, _LAMP_UV, _OUT, _OUT_UV = 4, 5, 7, 8


class Strategy(NamedTuple):
    """How the rays of a vertex are sampled and weighted."""

    near: NearbyLamps | None = None  # the lamps that guide its rays, None = unguided
    guiding: Guiding | None = None
    bsdf_share: Any = 1.0  # of the scattered rays, those that the surface draws itself
    is_view_independent: Any = False  # Bool: the MIS weights do not depend on wi
    beta: Any = None  # throughput up to the vertex, for shadow rays' roulette; None = all are cast


def sample_direct_light(
    context: PathContext, sampler: Sampler, vertex: Vertex, strategy: Strategy, active: Any
) -> tuple[DirectLightSample, DirectLightSample]:
    """(outdoor, indoor) light scattered back along the path, a shadow ray each or none."""
    emitters, emitter_filter, dim = context.emitters, context.emitter_filter, vertex.dim
    outdoor = indoor = None
    if emitter_filter.outdoor is not None:
        u, uv = sampler.get_1d(dim + _OUT), sampler.get_2d(dim + _OUT_UV)
        is_asked = active & (emitter_filter.outdoor > NO_EMITTERS)
        outdoor = emitters.sample_outdoor(vertex.si.p, u, uv, emitter_filter.outdoor, is_asked)
    if emitter_filter.indoor is not None and vertex.near is not None:
        u, uv = sampler.get_1d(dim + _LAMP), sampler.get_2d(dim + _LAMP_UV)
        is_asked = active & (emitter_filter.indoor > NO_EMITTERS)
        indoor = emitters.sample_lamp(
            context.scene, vertex.near, u, uv, emitter_filter.indoor, is_asked
        )
    # A portal asked for alone has no light of scattered rays to be weighted against.
    if emitter_filter.outdoor is not None:
        share = dr.select(emitter_filter.outdoor >= FIRST_PORTAL, 0, strategy.bsdf_share)
        strategy = strategy._replace(bsdf_share=share)
    first, second = shadow_roulettes(strategy.beta, emitters.shadow_thresholds, sampler, dim)
    return (
        _direct_light(context, vertex, strategy, outdoor, first),
        _direct_light(context, vertex, strategy, indoor, second),
    )


def _direct_light(
    context: PathContext,
    vertex: Vertex,
    strategy: Strategy,
    sample: DirectionSample | None,
    roulette: ShadowRoulette | None,
) -> DirectLightSample:
    """What one shadow ray brings; nothing where its roulette casts none."""
    if sample is None:
        return DirectLightSample(mi.Color3f(0), mi.Vector3f(0, 1, 0), mi.Color3f(0))
    si, is_independent = vertex.si, strategy.is_view_independent
    wo = vertex.frame.to_local(sample.d)
    value, pdf = evaluate_bsdf(si.bsdf, vertex.wi, wo)
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
    if roulette is not None:
        rate = context.emitters.arrival.of_kind(si.p, sample.kind, contributes)
        is_cast, chance = roulette.cast_by_chance(value * sample.radiance * weight, rate)
        contributes, weight = contributes & is_cast, weight / chance

    # Aim again from the offset origin: a lamp near by must not shadow itself.
    begin = offset_ray_origin(si.p, dr.select(side > 0, si.ng, -si.ng))
    to = si.p + sample.d * sample.distance - begin
    distance = dr.norm(to)
    is_finite = sample.distance < dr.inf
    d = dr.select(is_finite, to / distance, sample.d)
    reach = dr.select(is_finite, distance * (1 - 1e-4), dr.inf)
    clear = context.scene.transmittance(begin, d, reach, contributes)
    incident = dr.select(contributes, sample.radiance * clear * weight, 0)
    light = dr.select(contributes & is_consistent, value * incident, 0)
    arrives = dr.max(clear) > 0
    return DirectLightSample(
        light, sample.d, incident, sample.emitter, sample.kind, contributes, arrives
    )
