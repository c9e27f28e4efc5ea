"""One step of a path through the scene, shared by `path` and `metropolis`; kernels, no effects.

At each vertex shadow rays go to the sky, to a lamp and in `path` to what the sun shines on (direct_light.py), weighted against
the scattered ray by the balance heuristic (Veach 1997, section 9.2). An emitter that the scattered
ray meets counts to its own group.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.kernels.bsdf import (
    evaluate_bsdf,
    is_reconnectable,
    sample_bsdf,
    thin_glass_reflectance,
    thin_glass_transmittance,
    view_independent_pdf,
    white_share,
)
from pbrs_farm.transport.kernels.device_scene import SurfaceInteraction, offset_ray_origin
from pbrs_farm.transport.kernels.direct_light import Strategy, sample_direct_light
from pbrs_farm.transport.kernels.emitters import FIRST_PORTAL, Emitters
from pbrs_farm.transport.kernels.guided_rays import (
    cone_technique_pdf,
    guided_mis_weight,
    guiding_at,
    reflection_probability,
    sample_guided,
    survival_boost,
    target_technique_share,
)
from pbrs_farm.transport.kernels.guiding_targets import NO_FACE
from pbrs_farm.transport.kernels.lamp_guiding import no_reference
from pbrs_farm.transport.kernels.path_state import (
    ALL_EMITTERS,
    LEAST_KD,
    NO_EMITTERS,
    DirectionPdfs,
    MirroredRay,
    PathContext,
    PathState,
    ScatteredRay,
    StepResult,
    Vertex,
    WhiteSplit,
)
from pbrs_farm.transport.kernels.sampler import CAMERA_DIMS, VERTEX_DIMS, Sampler
from pbrs_farm.transport.scene_tables.material_rows import GLASS, MIRROR
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP

MAX_NULLS = 32
_MAX_COUNT = 64  # vertices with separate random dimensions
_MAX_SURVIVAL = 0.95
# Chance that `path` follows what a pane mirrors, by its share of the light that comes from there.
_LEAST_FOLLOWED, _FOLLOWED = 0.05, 8.0
_MAX_PANE = 0.5  # maximum probability of reflecting a ray at a pane with a lower reflectance

# Random dimensions of a vertex, one or two numbers each; direct_light.py has the others.
_LOBE, _SCATTER, _ROULETTE = 0, 1, 3


class _Lobe(NamedTuple):
    """The choice between reflection and transmission at glass."""

    u: Any  # the random number, used for the lobe of a rough surface, too
    reflectance: Any
    probability: Any  # of choosing reflection
    reflected: Any  # Bool, at mirrors too


class _Step(NamedTuple):
    """A step under way: where the path has come to, and how it is to go on."""

    context: PathContext
    sampler: Sampler
    path: PathState
    vertex: Vertex
    strategy: Strategy
    lobe: _Lobe


def advance(
    context: PathContext, sampler: Sampler, path: PathState, active: Any, may_reconnect: Any = False
) -> tuple[PathState, StepResult, Any]:
    """(the path one vertex on, what that brought, whether it goes on).

    may_reconnect: Bool, the path's suffix from this vertex on may be reconnected to other prefixes
    (reconnection.py), so the MIS weights here must not depend on where the path came from, and the
    caller applies the weight of guided rays. False: no path's.
    """
    vertex = _next_vertex(context, path, active)
    si, bsdf = vertex.si, vertex.si.bsdf
    missed = active & ~si.valid
    u = sampler.get_1d(vertex.dim + _LOBE)
    lobe = _choose_lobe(context.emitters, vertex, path, u)

    # Weigh what a guided ray has met; add the light of an emitter there.
    weight: Any = mi.Float(1)
    if vertex.near is not None:
        counted, ends = context.emitter_filter.indoor, missed | lobe.reflected
        weight = guided_mis_weight(context.emitters, path, si, counted, ends, vertex.is_rough)
        path = replace(path, beta=path.beta * weight) if may_reconnect is False else path
    emitted_outdoor, emitted_indoor, sky_albedo = _emitted_light(context, path, si, missed)

    # Send shadow rays, and go on.
    goes_on = vertex.is_rough & (vertex.depth < context.fields.max_depth)
    strategy = _strategy(context, path, vertex, goes_on, may_reconnect)
    direct = sample_direct_light(context, sampler, vertex, strategy, goes_on, path)
    step = _Step(context, sampler, path, vertex, strategy, lobe)
    scattered = _scatter(step, goes_on)
    following, pdfs, alive = _follow(step, scattered)
    result = StepResult(
        emitted_outdoor=emitted_outdoor,
        emitted_indoor=emitted_indoor,
        direct_outdoor=path.beta * (direct.outdoor.light + direct.sunlit.light),
        direct_indoor=path.beta * direct.indoor.light,
        is_rough=vertex.is_rough,
        missed=missed,
        sky_albedo=sky_albedo,
        albedo=dr.minimum(bsdf.kd + bsdf.f0 + bsdf.tau, 1),
        si=si,
        scattered_d=scattered.d,
        pdfs=pdfs,
        guided_weight=weight,
        pass_probability=dr.select(vertex.is_glass, 1 - lobe.probability, 1),
        outdoor_sample=direct.outdoor,
        indoor_sample=direct.indoor,
        sunlit_sample=direct.sunlit,
        is_view_independent=strategy.is_view_independent,
    )
    if context.splits_white:
        share = white_share(scattered.value, vertex.frame.to_local(scattered.d))
        result = result._replace(
            white=WhiteSplit(
                path.beta * (direct.outdoor.white + direct.sunlit.white),
                path.beta * direct.indoor.white,
                dr.select(scattered.bounced, share, 0),
            )
        )
    if vertex.splits is not None:
        mirrored = _mirrored_ray(context.emitters, vertex, path, lobe.u, active)
        result = result._replace(mirrored=mirrored)
    return following, result, alive


def _next_vertex(context: PathContext, path: PathState, active: Any) -> Vertex:
    """Hit of the path's ray."""
    si, is_pane = context.scene.intersect(path.o, path.d, active), None
    is_inner = None
    if context.scene.panes is not None:
        looks = active & (path.bsdf_pdf <= 0)
        si, is_pane, is_inner = context.scene.panes.before(si, path.o, path.d, looks)
    if context.splits_white:
        si = si._replace(bsdf=si.bsdf._replace(kd=dr.maximum(si.bsdf.kd, LEAST_KD)))
    is_solid = si.valid & ~si.is_cutout
    is_glass, is_mirror = is_solid & (si.bsdf.kind == GLASS), is_solid & (si.bsdf.kind == MIRROR)
    depth = path.depth + dr.select(is_solid & ~is_glass, mi.UInt32(1), 0)

    # Give each vertex, pane and cut-out separate random dimensions. (The count must depend on the
    # surface: Dr.Jit 1.5 reads local memory at the wrong place by an index that began as a
    # literal.)
    count = depth + path.n_nulls + dr.select(is_solid & ~is_glass, mi.UInt32(0), 1)
    dim = CAMERA_DIMS + VERTEX_DIMS * dr.minimum(count - 1, _MAX_COUNT)
    frame = mi.Frame3f(si.n)
    wi = frame.to_local(-path.d)
    wi.z = dr.maximum(wi.z, 1e-4)

    # Weigh the lamps; a thin surface is lit from both sides.
    near, counted = None, context.emitter_filter.indoor
    if counted is not None:
        normal = dr.select(dr.max(si.bsdf.tau) > 0, 0, si.ng)
        near = context.emitters.near_lamps(si.p, normal, counted, is_solid)
        if context.may_guide is not None:
            near = near._replace(is_guided=near.is_guided & context.may_guide)
    is_rough = is_solid & ~is_glass & ~is_mirror
    splits, is_behind = None, None
    if context.splits_glass and is_pane is not None:
        # For solid glass the first face reflects for both walls: random choices at each would be
        # noisy.
        straight = is_glass & (path.bsdf_pdf <= 0)
        splits = is_pane | (straight & ~path.met_glass)
        is_behind = straight & ~splits
    return Vertex(
        si,
        frame,
        wi,
        is_glass,
        is_mirror,
        is_rough,
        depth,
        dim,
        near,
        is_pane,
        is_inner,
        splits,
        is_behind,
    )


def _choose_lobe(emitters: Emitters, vertex: Vertex, path: PathState, u: Any) -> _Lobe:
    """Reflect more rays at glass near lamps, and by light at panes; _throughput makes up for it."""
    reflectance = thin_glass_reflectance(vertex.wi.z)
    probability = reflectance
    if vertex.near is not None:
        often = reflection_probability(reflectance, survival_boost(vertex.near))
        probability = dr.select(path.bsdf_pdf > 0, often, reflectance)
    if vertex.is_pane is not None:
        mirrored = _mirrored_share(emitters, reflectance, vertex.is_inner)
        probability = dr.select(vertex.is_pane, mirrored, probability)
    if vertex.splits is not None:
        probability = dr.select(vertex.splits | vertex.is_behind, 0, probability)
        reflectance = dr.select(vertex.is_behind, 0, reflectance)
    reflected = vertex.is_mirror | (vertex.is_glass & (u < probability))
    return _Lobe(u, reflectance, probability, reflected)


def _mirrored_share(emitters: Emitters, reflectance: Any, is_inner: Any) -> Any:
    """Share of rays reflected at a pane: about in proportion to the light, at most half."""
    behind = (1 - reflectance) * dr.select(is_inner, 1, emitters.pane_odds)
    odds = reflectance / (reflectance + behind)
    return dr.minimum(odds, dr.maximum(reflectance, _MAX_PANE))


def _mirrored_ray(
    emitters: Emitters, vertex: Vertex, path: PathState, u: Any, active: Any
) -> MirroredRay:
    """Reflection of a path that passes through glass: of a pane by chance if it is faint."""
    si, reflectance = vertex.si, thin_glass_reflectance(vertex.wi.z)
    d = path.d - 2 * dr.dot(si.n, path.d) * si.n
    is_pane = vertex.is_pane
    of_pane = _mirrored_share(emitters, reflectance, vertex.is_inner)
    share = dr.select(is_pane, of_pane, reflectance)
    chance = dr.select(is_pane, dr.minimum(_LEAST_FOLLOWED + _FOLLOWED * of_pane, 1), 1)
    beta = path.beta * (reflectance / chance)
    o = offset_ray_origin(si.p, si.ng)
    is_followed = (u < chance) & (dr.dot(d, si.ng) > 0)
    # The guides leave out reflections followed by chance: the denoiser expects guides
    # without noise.
    share = dr.select(chance < 1, 0, share)
    return MirroredRay(active & vertex.splits, is_followed, o, d, beta, share)


def _strategy(
    context: PathContext, path: PathState, vertex: Vertex, goes_on: Any, may_reconnect: Any
) -> Strategy:
    """How the rays that leave a vertex are sampled."""
    is_independent, beta = False, path.beta
    if may_reconnect is not False:
        # Guide by the suffix alone; cast all shadow rays.
        is_independent = may_reconnect & vertex.is_rough & is_reconnectable(vertex.si.bsdf)
        beta = dr.select(is_independent, mi.Color3f(1), beta)
    if vertex.near is None:
        return Strategy(is_view_independent=is_independent)
    may_aim = goes_on & (vertex.depth + 1 < context.fields.max_depth)
    guiding = guiding_at(vertex.near, vertex.si.bsdf, beta, may_aim)
    throughput = path.beta / mi.Color3f(path.faintness) if may_reconnect is False else None
    return Strategy(vertex.near, guiding, 1 - guiding.share, is_independent, beta=throughput)


def _emitted_light(
    context: PathContext, path: PathState, si: SurfaceInteraction, missed: Any
) -> tuple[Any, Any, Any]:
    """(outdoor, indoor light of the emitter a ray meets, the colour shown past the home, white for the sky)."""
    emitter_filter = context.emitter_filter
    # Leave out what the camera sees directly where one emitter is asked for: it needs no choice.
    counts = mi.Bool(path.bsdf_pdf > 0)
    for counted in emitter_filter:
        counts |= False if counted is None else counted == ALL_EMITTERS
    outdoor, indoor, sky_albedo = mi.Color3f(0), mi.Color3f(0), mi.Color3f(1)
    if emitter_filter.outdoor is not None:
        outdoor, sky_albedo = _sky_light(context, path, missed, counts)
    if emitter_filter.indoor is not None:
        shines = si.valid & counts & (emitter_filter.indoor > NO_EMITTERS) & (si.emitter != NO_LAMP)
        indoor = _lamp_light(context, path, si, shines)
    return outdoor, indoor, sky_albedo


def _balanced(path: PathState, pdf: Any) -> Any:
    """Weight of light that a ray meets, by the pdf with which a shadow ray would have found it."""
    return dr.select(path.bsdf_pdf > 0, path.bsdf_pdf / (path.bsdf_pdf + pdf), 1)


@dr.syntax
def _sky_light(context: PathContext, path: PathState, missed: Any, counts: Any) -> tuple[Any, Any]:
    """(light of the sky, or of surroundings before it, their colour) where rays leave the home."""
    light, sky_albedo = mi.Color3f(0), mi.Color3f(1)
    # Branch: packets of lanes whose rays are all at home pass by.
    if missed:
        emitters, counted = context.emitters, context.emitter_filter.outdoor
        by_scatter, reference = path.bsdf_pdf > 0, path.reference.p
        chances = emitters.outdoor_choice.chances(reference, missed)
        sun, sun_pdf = emitters.eval_sun(chances, path.d, counted)
        is_seen = False if emitters.outside is None else ~by_scatter
        dome, dome_pdf = emitters.eval_dome(chances, reference, path.d, counted, missed, is_seen)
        # If only a portal counts, add only directions drawn through it.
        is_asked = (counted > NO_EMITTERS) & (counted < FIRST_PORTAL)
        sees_sky = missed & counts & emitters.has_sky & is_asked
        if dr.hint(emitters.outside is not None, mode="scalar"):
            meets_sun = missed & by_scatter & (dr.max(sun) > 0)
            sun *= emitters.sun.past_outside(path.o, path.d, meets_sun)
        sky = sun * _balanced(path, sun_pdf) + dome * _balanced(path, dome_pdf)
        if dr.hint(emitters.outside is not None, mode="scalar"):
            assert emitters.outside is not None
            # Unscattered rays see the surroundings; for others their light is in the dome.
            beyond = emitters.outside.seen(context.scene, path.o, path.d, missed & ~by_scatter)
            sky = dr.select(beyond.valid, beyond.radiance, sky)
            sees_sky |= beyond.valid & counts & is_asked
            sky_albedo = dr.select(beyond.valid, beyond.albedo, sky_albedo)
        light = dr.select(sees_sky, path.beta * sky, 0)
    return light, sky_albedo


@dr.syntax
def _lamp_light(context: PathContext, path: PathState, si: SurfaceInteraction, shines: Any) -> Any:
    """Color3f of the lamp that a ray meets."""
    light = mi.Color3f(0)
    # Branch: packets of lanes whose rays all meet something else pass by.
    if shines:
        distance, cos = dr.norm(si.p - path.reference.p), dr.dot(path.d, si.ng)
        radiance, lamp_pdf = context.emitters.eval_lamp(
            si.emitter, path.reference, distance, cos, context.emitter_filter.indoor, shines
        )
        light = path.beta * radiance * _balanced(path, lamp_pdf)
    return light


def _scatter(step: _Step, goes_on: Any) -> ScatteredRay:
    """Draw a direction at a rough surface; mirrors and glass keep one, and glass is no vertex."""
    context, path, vertex, lobe = step.context, step.path, step.vertex, step.lobe
    si, frame, guiding = vertex.si, vertex.frame, step.strategy.guiding
    uv = step.sampler.get_2d(vertex.dim + _SCATTER)
    is_guided, target_face = mi.Bool(False), mi.UInt32(NO_FACE)
    if guiding is None:
        drawn = sample_bsdf(si.bsdf, vertex.wi, lobe.u, uv, least_diffuse=context.least_diffuse)
        d = mi.Vector3f(frame.to_world(drawn))
    else:
        to = sample_guided(guiding, context.scene, context.emitters, si, lobe.u, uv)
        is_guided, target_face = to.is_guided, to.target_face
        drawn = sample_bsdf(si.bsdf, vertex.wi, to.u_bsdf, uv, least_diffuse=context.least_diffuse)
        d = dr.select(is_guided, to.d, mi.Vector3f(frame.to_world(drawn)))
        goes_on = goes_on & to.valid
    wo = frame.to_local(d)
    value, pdf = evaluate_bsdf(si.bsdf, vertex.wi, wo, least_diffuse=context.least_diffuse)
    bounced = goes_on & (dr.dot(si.ng, d) * wo.z > 0) & (pdf > 0)

    # Reflect about the shading normal, or go straight on.
    mirror_d = path.d - 2 * dr.dot(si.n, path.d) * si.n
    may_pass = path.n_nulls < MAX_NULLS
    may_reflect = may_pass & (vertex.depth < context.fields.max_depth)
    mirrored = lobe.reflected & may_reflect & (dr.dot(mirror_d, si.ng) > 0)
    passed = ((vertex.is_glass & ~lobe.reflected) | (si.valid & si.is_cutout)) & may_pass
    return ScatteredRay(d, value, pdf, is_guided, target_face, bounced, mirrored, mirror_d, passed)


def _follow(step: _Step, scattered: ScatteredRay) -> tuple[PathState, DirectionPdfs, Any]:
    """(the path behind the vertex, how it was drawn, whether it goes on)."""
    path, vertex, strategy, si = step.path, step.vertex, step.strategy, step.vertex.si
    bounced, mirrored, passed = scattered.bounced, scattered.mirrored, scattered.passed
    beta = _throughput(step, scattered)
    survival, survives = _roulette(step, scattered, beta)
    alive = (bounced | mirrored | passed) & survives & (dr.max(beta) > 0)

    # Divide by the pdf of all techniques that could have drawn the direction, over the surface's.
    ratio, odds, guiding = strategy.bsdf_share * survival, mi.Float(0), strategy.guiding
    if guiding is not None:
        ratio += cone_technique_pdf(guiding, scattered.d) / dr.maximum(scattered.pdf, 1e-30)
        odds = target_technique_share(guiding) / (ratio * scattered.pdf)
    beta = dr.select(bounced, beta / ratio, beta)

    # Keep the sampling pdf of the direction, for the weight of its hit.
    pdf, is_independent = scattered.pdf * strategy.bsdf_share, strategy.is_view_independent
    if is_independent is not False:
        independent = view_independent_pdf(si.bsdf, si.ng, scattered.d)
        pdf = dr.select(is_independent, independent, pdf)
    straight_d = dr.select(mirrored, mi.Vector3f(scattered.mirror_d), path.d)
    d = dr.select(bounced, scattered.d, straight_d)
    outward = dr.select(dr.dot(d, si.ng) > 0, si.ng, -si.ng)
    reference = no_reference(si.p) if vertex.near is None else vertex.near.reference
    is_null = passed | (vertex.is_glass & mirrored)
    target_face = dr.select(mirrored, NO_FACE, path.target_face)
    pdf_by_surface = dr.select(bounced, scattered.pdf, 0)
    pdfs = DirectionPdfs(pdf_by_surface, mi.Float(strategy.bsdf_share), ratio * scattered.pdf)
    return (
        PathState(
            o=offset_ray_origin(si.p, outward),
            d=d,
            beta=beta,
            faintness=path.faintness,
            depth=vertex.depth,
            n_nulls=path.n_nulls + dr.select(is_null, mi.UInt32(1), 0),
            met_glass=path.met_glass | (vertex.is_glass & is_null),
            reference=dr.select(bounced, reference, path.reference),
            bsdf_pdf=dr.select(bounced, pdf, dr.select(mirrored, 0, path.bsdf_pdf)),
            guiding_odds=dr.select(bounced, odds, dr.select(mirrored, 0, path.guiding_odds)),
            target_face=dr.select(bounced, scattered.target_face, target_face),
        ),
        pdfs,
        alive,
    )


def _roulette(step: _Step, scattered: ScatteredRay, beta: Any) -> tuple[Any, Any]:
    """(probability to survive, Bool: survives) of Russian roulette, of what the surface draws."""
    q = dr.max(beta) / (step.strategy.bsdf_share * step.path.faintness)
    if step.strategy.near is not None:
        q *= survival_boost(step.strategy.near)
    q = dr.minimum(q, _MAX_SURVIVAL)
    tested = scattered.bounced & (step.vertex.depth >= step.context.fields.rr_depth)
    lives = step.sampler.get_1d(step.vertex.dim + _ROULETTE) < q
    survives = ~tested | scattered.is_guided | lives
    return dr.select(tested, dr.maximum(q, 1e-6), 1), survives


def _throughput(step: _Step, scattered: ScatteredRay) -> Any:
    """The path's throughput times f |cos| / pdf, or times the share of a mirror or glass."""
    vertex, lobe, bsdf = step.vertex, step.lobe, step.vertex.si.bsdf
    factor = dr.select(vertex.is_rough, scattered.value / scattered.pdf, mi.Color3f(1))
    factor = dr.select(vertex.is_mirror, bsdf.f0, factor)
    passed = vertex.is_glass & scattered.passed
    passed_light = thin_glass_transmittance(bsdf.tau, vertex.wi.z)
    beta = step.path.beta * dr.select(passed, passed_light, factor)
    if step.strategy.near is None and vertex.is_pane is None:
        return beta
    # Make up for having chosen reflection more often than it happens.
    r, p = lobe.reflectance, lobe.probability
    share = dr.select(lobe.reflected, r / p, (1 - r) / (1 - p))
    return dr.select(vertex.is_glass, beta * share, beta)
