"""One step of a path through the scene, shared by `path` and `metropolis`; kernels, no effects.

At each vertex one shadow ray goes to the sky and one to a lamp, weighted against the scattered
ray by the balance heuristic; an emitter that is met counts to its own group.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.guiding.guided_rays import (
    cone_technique_pdf,
    guiding_at,
    mis_weight,
    reflection_probability,
    sample_guided,
    survival_boost,
    target_technique_share,
)
from pbrs_farm.transport.guiding.guiding_targets import NO_FACE
from pbrs_farm.transport.guiding.nearby_lamps import NearbyLamps, no_reference
from pbrs_farm.transport.kernels.bsdf import (
    Bsdf,
    evaluate_bsdf,
    is_reconnectable,
    sample,
    thin_glass_reflectance,
    view_independent_pdf,
)
from pbrs_farm.transport.kernels.device_scene import (
    DeviceScene,
    SurfaceInteraction,
    offset_ray_origin,
)
from pbrs_farm.transport.kernels.emitters import FIRST_PORTAL, DirectionSample, Emitters
from pbrs_farm.transport.kernels.path_state import (
    DeviceFields,
    DirectLightSample,
    EmitterFilter,
    PathState,
    StepResult,
)
from pbrs_farm.transport.kernels.sampler import CAMERA_DIMS, VERTEX_DIMS, Sampler
from pbrs_farm.transport.scene_tables.material_rows import GLASS, MIRROR
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP

MAX_NULLS = 32
_LOBE, _SCATTER, _ROULETTE, _LAMP, _LAMP_UV, _OUT, _OUT_UV = 0, 1, 3, 4, 5, 7, 8


def advance(
    scene: DeviceScene,
    emitters: Emitters,
    fields: DeviceFields,
    sampler: Sampler,
    path: PathState,
    emitter_filter: EmitterFilter,
    active: Any,
    may_reconnect: Any = False,
) -> tuple[PathState, StepResult, Any]:
    """(the walk one vertex on, what that brought, whether it goes on).

    may_be_steady: vertices whose share between scattered and shadow ray must not depend on where
    the path came from, where their material allows it.
    """
    si = scene.intersect(path.o, path.d, active)
    missed = active & ~si.valid

    # Kinds of surface.
    m = si.bsdf
    solid = si.valid & ~si.is_cutout
    glass, mirror = solid & (m.kind == GLASS), solid & (m.kind == MIRROR)
    rough = solid & ~glass & ~mirror
    depth = path.depth + dr.select(solid & ~glass, mi.UInt32(1), 0)
    # Vertices, glass and holes each have numbers of their own. (What is counted must depend on the
    # surface: Dr.Jit 1.5 reads local memory at the wrong place by an index that began as a literal.)
    count = depth + path.n_nulls + dr.select(solid & ~glass, mi.UInt32(0), 1)
    dim = CAMERA_DIMS + VERTEX_DIMS * dr.minimum(count - 1, 64)
    frame = mi.Frame3f(si.n)
    wi = frame.to_local(-path.d)
    wi.z = dr.maximum(wi.z, 1e-4)
    near = None
    if emitter_filter.indoor is not None:
        is_sheet = dr.max(m.tau) > 0
        near = emitters.nearby.at_vertex(
            si.p, dr.select(is_sheet, 0, si.ng), emitter_filter.indoor, solid
        )
    guiding = near if may_reconnect is False else None

    # Glass: near lamps more rays are reflected, and weigh less.
    lobe = sampler.get_1d(dim + _LOBE)
    mirroring = thin_glass_reflectance(wi.z)
    p_mirroring = mirroring
    if guiding is not None:
        often = reflection_probability(mirroring, survival_boost(guiding))
        p_mirroring = dr.select(path.bsdf_pdf > 0, often, mirroring)
    reflected = mirror | (glass & (lobe < p_mirroring))

    # Light that comes straight from an emitter.
    if guiding is not None:
        path.beta *= mis_weight(
            emitters, path, si, emitter_filter.indoor, missed | reflected, rough
        )
    emitted_outdoor, emitted_indoor = _met(emitters, path, si, emitter_filter, missed)
    go_on = rough & (depth < fields.max_depth)
    is_view_independent = (
        False if may_reconnect is False else may_reconnect & rough & is_reconnectable(m)
    )
    guide = None
    if guiding is not None:
        may_aim = go_on & (depth + 1 < fields.max_depth)
        guide = guiding_at(guiding, m, path.beta, may_aim)
    bsdf_share = 1.0 if guide is None else 1 - guide.share
    out, lamp = direct(
        scene,
        emitters,
        si,
        frame,
        wi,
        sampler,
        dim,
        emitter_filter,
        near,
        go_on,
        bsdf_share,
        is_view_independent,
    )

    # Scatter. Glass and mirrors keep one direction; what passes glass straight is no vertex.
    uv = sampler.get_2d(dim + _SCATTER)
    is_guided, target = mi.Bool(False), mi.UInt32(NO_FACE)
    if guide is None:
        ahead = mi.Vector3f(frame.to_world(sample(m, wi, lobe, uv)))
    else:
        to = sample_guided(guide, scene, emitters, si, lobe, uv)
        is_guided, target = to.is_guided, to.target_face
        by_surface = mi.Vector3f(frame.to_world(sample(m, wi, to.u_bsdf, uv)))
        ahead = dr.select(is_guided, to.d, by_surface)
        go_on &= to.valid
    wo = frame.to_local(ahead)
    value, pdf = evaluate_bsdf(m, wi, wo)
    bounced = go_on & (dr.dot(si.ng, ahead) * wo.z > 0) & (pdf > 0)
    back = path.d - 2 * dr.dot(si.n, path.d) * si.n
    may_pass = path.n_nulls < MAX_NULLS
    mirrored = reflected & may_pass & (depth < fields.max_depth) & (dr.dot(back, si.ng) > 0)
    passed = ((glass & ~reflected) | (si.valid & si.is_cutout)) & may_pass
    beta = path.beta * _factor(m, value, pdf, rough, mirror, glass & passed)
    if guiding is not None:
        share = dr.select(reflected, mirroring / p_mirroring, (1 - mirroring) / (1 - p_mirroring))
        beta = dr.select(glass, beta * share, beta)

    # Roulette, of what the surface draws; then the throughput is over all that could draw it.
    q = dr.max(beta) / bsdf_share
    if guiding is not None:
        q *= survival_boost(guiding)
    q = dr.minimum(q, 0.95)
    tested = bounced & (depth >= fields.rr_depth)
    survives = ~tested | is_guided | (sampler.get_1d(dim + _ROULETTE) < q)
    alive = (bounced | mirrored | passed) & survives & (dr.max(beta) > 0)
    chance = bsdf_share * dr.select(tested, dr.maximum(q, 1e-6), 1)
    aimed = mi.Float(0)
    if guide is not None:
        chance += cone_technique_pdf(guide, ahead) / dr.maximum(pdf, 1e-30)
        aimed = target_technique_share(guide) / (chance * pdf)
    beta = dr.select(bounced, beta / chance, beta)

    weighed = pdf * bsdf_share
    if is_view_independent is not False:
        weighed = dr.select(is_view_independent, view_independent_pdf(m, si.ng, ahead), pdf)
    d = dr.select(bounced, ahead, dr.select(mirrored, mi.Vector3f(back), path.d))
    outward = dr.select(dr.dot(d, si.ng) > 0, si.ng, -si.ng)
    here = no_reference(si.p) if near is None else near.reference
    following = PathState(
        o=offset_ray_origin(si.p, outward),
        d=d,
        beta=beta,
        depth=depth,
        n_nulls=path.n_nulls + dr.select(passed | (glass & mirrored), mi.UInt32(1), 0),
        reference=dr.select(bounced, here, path.reference),
        bsdf_pdf=dr.select(bounced, weighed, dr.select(mirrored, 0, path.bsdf_pdf)),
        guiding_odds=dr.select(bounced, aimed, dr.select(mirrored, 0, path.guiding_odds)),
        target_face=dr.select(bounced, target, dr.select(mirrored, NO_FACE, path.target_face)),
    )
    result = StepResult(
        emitted_outdoor,
        emitted_indoor,
        path.beta * out.light,
        path.beta * lamp.light,
        rough,
        missed,
        dr.minimum(m.kd + m.f0 + m.tau, 1),
        si.n,
        si,
        ahead,
        dr.select(bounced, pdf, 0),
        out,
        lamp,
        is_view_independent,
    )
    return following, result, alive


def direct(
    scene: DeviceScene,
    emitters: Emitters,
    si: SurfaceInteraction,
    frame: Any,
    wi: Any,
    sampler: Sampler,
    dim: Any,
    emitter_filter: EmitterFilter,
    near: NearbyLamps | None,
    active: Any,
    bsdf_share: Any = 1.0,
    is_view_independent: Any = False,
) -> tuple[DirectLightSample, DirectLightSample]:
    """(outdoor, indoor) light scattered towards wi, one shadow ray each.

    own: share of the scattered rays that the surface draws itself.
    """
    out = lamp = None
    if emitter_filter.outdoor is not None:
        asks = active & (emitter_filter.outdoor > -2)
        u, uv = sampler.get_1d(dim + _OUT), sampler.get_2d(dim + _OUT_UV)
        out = emitters.sample_outdoor(si.p, u, uv, emitter_filter.outdoor, asks)
    if emitter_filter.indoor is not None and near is not None:
        asks = active & (emitter_filter.indoor > -2)
        u, uv = sampler.get_1d(dim + _LAMP), sampler.get_2d(dim + _LAMP_UV)
        lamp = emitters.sample_lamp(scene, near, u, uv, emitter_filter.indoor, asks)
    # The pilot draws a portal's light through the portal alone.
    alone = False if emitter_filter.outdoor is None else emitter_filter.outdoor >= FIRST_PORTAL
    outdoor_sample, to_lamp = (
        _lit(scene, si, frame, wi, to, alone, bsdf_share, is_view_independent) for to in (out, lamp)
    )
    return outdoor_sample, to_lamp


def _lit(
    scene: DeviceScene,
    si: SurfaceInteraction,
    frame: Any,
    wi: Any,
    to: DirectionSample | None,
    alone: Any,
    bsdf_share: Any,
    is_view_independent: Any,
) -> DirectLightSample:
    """What one shadow ray brings."""
    if to is None:
        return DirectLightSample(mi.Color3f(0), mi.Vector3f(0, 1, 0), mi.Color3f(0))
    wo = frame.to_local(to.d)
    value, pdf = evaluate_bsdf(si.bsdf, wi, wo)
    pdf *= bsdf_share
    # Light may not come through the face when the shading normal says it does not.
    side = dr.dot(si.ng, to.d)
    faces = side * wo.z > 0
    lit = faces & (dr.max(value) > 0)
    if is_view_independent is not False:
        # Whatever wi is: what could be lit from some wi is asked for.
        pdf = dr.select(is_view_independent, view_independent_pdf(si.bsdf, si.ng, to.d), pdf)
        lit = dr.select(is_view_independent, (side > 0) | (dr.max(si.bsdf.tau) > 0), lit)
    lit = lit & to.valid & (to.pdf > 0)
    weight = 1 / (to.pdf + dr.select(alone, 0, pdf))
    begin = offset_ray_origin(si.p, dr.select(side > 0, si.ng, -si.ng))
    # Aim again from the moved start: a lamp near by must not shadow itself.
    aim = si.p + to.d * to.distance - begin
    reach = dr.norm(aim)
    is_near = to.distance < dr.inf
    way = dr.select(is_near, aim / reach, to.d)
    far = dr.select(is_near, reach * (1 - 1e-4), dr.inf)
    clear = scene.transmittance(begin, way, far, lit)
    strength = dr.select(lit, to.radiance * clear * weight, 0)
    return DirectLightSample(
        dr.select(lit & faces, value * strength, 0), to.d, strength, to.emitter
    )


def _met(
    emitters: Emitters,
    path: PathState,
    si: SurfaceInteraction,
    emitter_filter: EmitterFilter,
    missed: Any,
) -> tuple[Any, Any]:
    """(outdoor, indoor) light of the emitter a ray meets; weight 1 where none could be sampled."""
    by_scatter = path.bsdf_pdf > 0

    def weight(pdf: Any) -> Any:
        return dr.select(by_scatter, path.bsdf_pdf / (path.bsdf_pdf + pdf), 1)

    # What the camera sees directly needs no choice: the pilot leaves it out.
    counts = mi.Bool(by_scatter)
    for asked in emitter_filter:
        counts |= False if asked is None else asked == -1
    outdoor, indoor = mi.Color3f(0), mi.Color3f(0)
    if emitter_filter.outdoor is not None:
        sun, sun_pdf = emitters.eval_sun(path.d, emitter_filter.outdoor)
        dome, dome_pdf = emitters.eval_dome(
            path.reference.p, path.d, emitter_filter.outdoor, missed
        )
        # The pilot of a portal counts what is drawn through it only.
        wanted = (emitter_filter.outdoor > -2) & (emitter_filter.outdoor < FIRST_PORTAL)
        sees_sky = missed & counts & emitters.has_sky & wanted
        sky = sun * weight(sun_pdf) + dome * weight(dome_pdf)
        outdoor = dr.select(sees_sky, path.beta * sky, 0)
    if emitter_filter.indoor is not None:
        glows = si.valid & counts & (emitter_filter.indoor > -2) & (si.emitter != NO_LAMP)
        glow, lamp_pdf = emitters.eval_lamp(
            si.emitter,
            path.reference,
            dr.norm(si.p - path.reference.p),
            dr.dot(path.d, si.ng),
            emitter_filter.indoor,
            glows,
        )
        indoor = dr.select(glows, path.beta * glow * weight(lamp_pdf), 0)
    return outdoor, indoor


def _factor(m: Bsdf, value: Any, pdf: Any, rough: Any, mirror: Any, passed: Any) -> Any:
    """What the throughput is multiplied by."""
    factor = dr.select(rough, value / pdf, mi.Color3f(1))
    factor = dr.select(mirror, m.f0, factor)
    return dr.select(passed, m.tau, factor)
