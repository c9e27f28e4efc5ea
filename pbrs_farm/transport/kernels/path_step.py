"""One step of a path through the scene, shared by `path` and `metropolis`; kernels, no effects.

At each vertex one shadow ray goes to the sky and one to a lamp, weighted against the scattered
ray by the balance heuristic; an emitter that is met counts to its own group.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.guiding.guided_rays import (
    cone_chance,
    face_chance,
    guide_at,
    guided,
    kept,
    reflected_chance,
    worth,
)
from pbrs_farm.transport.guiding.guiding_targets import NO_FACE
from pbrs_farm.transport.guiding.nearby_lamps import Near, nowhere
from pbrs_farm.transport.kernels.bsdf import (
    Bsdf,
    evaluate,
    is_smooth_lobe,
    sample,
    steady_density,
    thin_glass_reflectance,
)
from pbrs_farm.transport.kernels.device_scene import (
    DeviceScene,
    SurfaceInteraction,
    offset_ray_origin,
)
from pbrs_farm.transport.kernels.emitters import FIRST_PORTAL, Emitters, Towards
from pbrs_farm.transport.kernels.path_state import FieldsRow, Found, Lit, Only, Walk
from pbrs_farm.transport.kernels.sampler import CAMERA_DIMS, VERTEX_DIMS, Numbers
from pbrs_farm.transport.scene_tables.material_rows import GLASS, MIRROR
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP

MAX_NULLS = 32
_LOBE, _SCATTER, _ROULETTE, _LAMP, _LAMP_UV, _OUT, _OUT_UV = 0, 1, 3, 4, 5, 7, 8


def advance(
    scene: DeviceScene,
    emitters: Emitters,
    fields: FieldsRow,
    numbers: Numbers,
    walk: Walk,
    only: Only,
    active: Any,
    may_be_steady: Any = False,
) -> tuple[Walk, Found, Any]:
    """(the walk one vertex on, what that brought, whether it goes on).

    may_be_steady: vertices whose share between scattered and shadow ray must not depend on where
    the path came from, where their material allows it.
    """
    si = scene.intersect(walk.o, walk.d, active)
    missed = active & ~si.valid

    # Kinds of surface.
    m = si.bsdf
    solid = si.valid & ~si.is_cutout
    glass, mirror = solid & (m.kind == GLASS), solid & (m.kind == MIRROR)
    rough = solid & ~glass & ~mirror
    depth = walk.depth + dr.select(solid & ~glass, mi.UInt32(1), 0)
    # Vertices, glass and holes each have numbers of their own. (What is counted must depend on the
    # surface: Dr.Jit 1.5 reads local memory at the wrong place by an index that began as a literal.)
    count = depth + walk.nulls + dr.select(solid & ~glass, mi.UInt32(0), 1)
    dim = CAMERA_DIMS + VERTEX_DIMS * dr.minimum(count - 1, 64)
    frame = mi.Frame3f(si.n)
    wi = frame.to_local(-walk.d)
    wi.z = dr.maximum(wi.z, 1e-4)
    near = None
    if only.lamp is not None:
        is_sheet = dr.max(m.tau) > 0
        near = emitters.nearby.seen(si.p, dr.select(is_sheet, 0, si.ng), only.lamp, solid)
    guiding = near if may_be_steady is False else None

    # Glass: near lamps more rays are reflected, and weigh less.
    lobe = numbers.one(dim + _LOBE)
    mirroring = thin_glass_reflectance(wi.z)
    p_mirroring = mirroring
    if guiding is not None:
        often = reflected_chance(mirroring, worth(guiding))
        p_mirroring = dr.select(walk.last_density > 0, often, mirroring)
    reflected = mirror | (glass & (lobe < p_mirroring))

    # Light that comes straight from an emitter.
    if guiding is not None:
        walk.beta *= kept(emitters, walk, si, only.lamp, missed | reflected, rough)
    met_outdoor, met_indoor = _met(emitters, walk, si, only, missed)
    go_on = rough & (depth < fields.max_depth)
    steady = False if may_be_steady is False else may_be_steady & rough & is_smooth_lobe(m)
    guide = None
    if guiding is not None:
        may_aim = go_on & (depth + 1 < fields.max_depth)
        guide = guide_at(guiding, m, walk.beta, may_aim)
    own = 1.0 if guide is None else 1 - guide.share
    out, lamp = direct(scene, emitters, si, frame, wi, numbers, dim, only, near, go_on, own, steady)

    # Bsdf. Glass and mirrors keep one direction; what passes glass straight is no vertex.
    uv = numbers.two(dim + _SCATTER)
    is_guided, target = mi.Bool(False), mi.UInt32(NO_FACE)
    if guide is None:
        ahead = mi.Vector3f(frame.to_world(sample(m, wi, lobe, uv)))
    else:
        to = guided(guide, scene, emitters, si, lobe, uv)
        is_guided, target = to.is_guided, to.target
        by_surface = mi.Vector3f(frame.to_world(sample(m, wi, to.own, uv)))
        ahead = dr.select(is_guided, to.d, by_surface)
        go_on &= to.valid
    wo = frame.to_local(ahead)
    value, density = evaluate(m, wi, wo)
    bounced = go_on & (dr.dot(si.ng, ahead) * wo.z > 0) & (density > 0)
    back = walk.d - 2 * dr.dot(si.n, walk.d) * si.n
    may_pass = walk.nulls < MAX_NULLS
    mirrored = reflected & may_pass & (depth < fields.max_depth) & (dr.dot(back, si.ng) > 0)
    passed = ((glass & ~reflected) | (si.valid & si.is_cutout)) & may_pass
    beta = walk.beta * _factor(m, value, density, rough, mirror, glass & passed)
    if guiding is not None:
        share = dr.select(reflected, mirroring / p_mirroring, (1 - mirroring) / (1 - p_mirroring))
        beta = dr.select(glass, beta * share, beta)

    # Roulette, of what the surface draws; then the throughput is over all that could draw it.
    q = dr.max(beta) / own
    if guiding is not None:
        q *= worth(guiding)
    q = dr.minimum(q, 0.95)
    tested = bounced & (depth >= fields.rr_depth)
    survives = ~tested | is_guided | (numbers.one(dim + _ROULETTE) < q)
    alive = (bounced | mirrored | passed) & survives & (dr.max(beta) > 0)
    chance = own * dr.select(tested, dr.maximum(q, 1e-6), 1)
    aimed = mi.Float(0)
    if guide is not None:
        chance += cone_chance(guide, ahead) / dr.maximum(density, 1e-30)
        aimed = face_chance(guide) / (chance * density)
    beta = dr.select(bounced, beta / chance, beta)

    weighed = density * own
    if steady is not False:
        weighed = dr.select(steady, steady_density(m, si.ng, ahead), density)
    d = dr.select(bounced, ahead, dr.select(mirrored, mi.Vector3f(back), walk.d))
    outward = dr.select(dr.dot(d, si.ng) > 0, si.ng, -si.ng)
    here = nowhere(si.p) if near is None else near.at
    following = Walk(
        o=offset_ray_origin(si.p, outward),
        d=d,
        beta=beta,
        depth=depth,
        nulls=walk.nulls + dr.select(passed | (glass & mirrored), mi.UInt32(1), 0),
        last=dr.select(bounced, here, walk.last),
        last_density=dr.select(bounced, weighed, dr.select(mirrored, 0, walk.last_density)),
        aimed=dr.select(bounced, aimed, dr.select(mirrored, 0, walk.aimed)),
        target=dr.select(bounced, target, dr.select(mirrored, NO_FACE, walk.target)),
    )
    found = Found(
        met_outdoor,
        met_indoor,
        walk.beta * out.light,
        walk.beta * lamp.light,
        rough,
        missed,
        dr.minimum(m.kd + m.f0 + m.tau, 1),
        si.n,
        si,
        ahead,
        dr.select(bounced, density, 0),
        out,
        lamp,
        steady,
    )
    return following, found, alive


def direct(
    scene: DeviceScene,
    emitters: Emitters,
    si: SurfaceInteraction,
    frame: Any,
    wi: Any,
    numbers: Numbers,
    dim: Any,
    only: Only,
    near: Near | None,
    active: Any,
    own: Any = 1.0,
    steady: Any = False,
) -> tuple[Lit, Lit]:
    """(outdoor, indoor) light scattered towards wi, one shadow ray each.

    own: share of the scattered rays that the surface draws itself.
    """
    out = lamp = None
    if only.outdoor is not None:
        asks = active & (only.outdoor > -2)
        u, uv = numbers.one(dim + _OUT), numbers.two(dim + _OUT_UV)
        out = emitters.sample_outdoor(si.p, u, uv, only.outdoor, asks)
    if only.lamp is not None and near is not None:
        asks = active & (only.lamp > -2)
        u, uv = numbers.one(dim + _LAMP), numbers.two(dim + _LAMP_UV)
        lamp = emitters.sample_lamp(scene, near, u, uv, only.lamp, asks)
    # The pilot draws a portal's light through the portal alone.
    alone = False if only.outdoor is None else only.outdoor >= FIRST_PORTAL
    to_outdoor, to_lamp = (_lit(scene, si, frame, wi, to, alone, own, steady) for to in (out, lamp))
    return to_outdoor, to_lamp


def _lit(
    scene: DeviceScene,
    si: SurfaceInteraction,
    frame: Any,
    wi: Any,
    to: Towards | None,
    alone: Any,
    own: Any,
    steady: Any,
) -> Lit:
    """What one shadow ray brings."""
    if to is None:
        return Lit(mi.Color3f(0), mi.Vector3f(0, 1, 0), mi.Color3f(0))
    wo = frame.to_local(to.d)
    value, density = evaluate(si.bsdf, wi, wo)
    density *= own
    # Light may not come through the face when the shading normal says it does not.
    side = dr.dot(si.ng, to.d)
    faces = side * wo.z > 0
    lit = faces & (dr.max(value) > 0)
    if steady is not False:
        # Whatever wi is: what could be lit from some wi is asked for.
        density = dr.select(steady, steady_density(si.bsdf, si.ng, to.d), density)
        lit = dr.select(steady, (side > 0) | (dr.max(si.bsdf.tau) > 0), lit)
    lit = lit & to.valid & (to.density > 0)
    weight = 1 / (to.density + dr.select(alone, 0, density))
    begin = offset_ray_origin(si.p, dr.select(side > 0, si.ng, -si.ng))
    # Aim again from the moved start: a lamp near by must not shadow itself.
    aim = si.p + to.d * to.distance - begin
    reach = dr.norm(aim)
    is_near = to.distance < dr.inf
    way = dr.select(is_near, aim / reach, to.d)
    far = dr.select(is_near, reach * (1 - 1e-4), dr.inf)
    clear = scene.transmittance(begin, way, far, lit)
    strength = dr.select(lit, to.radiance * clear * weight, 0)
    return Lit(dr.select(lit & faces, value * strength, 0), to.d, strength, to.lamp)


def _met(
    emitters: Emitters, walk: Walk, si: SurfaceInteraction, only: Only, missed: Any
) -> tuple[Any, Any]:
    """(outdoor, indoor) light of the emitter a ray meets; weight 1 where none could be sampled."""
    by_scatter = walk.last_density > 0

    def weight(density: Any) -> Any:
        return dr.select(by_scatter, walk.last_density / (walk.last_density + density), 1)

    # What the camera sees directly needs no choice: the pilot leaves it out.
    counts = mi.Bool(by_scatter)
    for asked in only:
        counts |= False if asked is None else asked == -1
    outdoor, indoor = mi.Color3f(0), mi.Color3f(0)
    if only.outdoor is not None:
        sun, sun_density = emitters.sun(walk.d, only.outdoor)
        dome, dome_density = emitters.dome(walk.last.p, walk.d, only.outdoor, missed)
        # The pilot of a portal counts what is drawn through it only.
        wanted = (only.outdoor > -2) & (only.outdoor < FIRST_PORTAL)
        sees_sky = missed & counts & emitters.has_sky & wanted
        sky = sun * weight(sun_density) + dome * weight(dome_density)
        outdoor = dr.select(sees_sky, walk.beta * sky, 0)
    if only.lamp is not None:
        glows = si.valid & counts & (only.lamp > -2) & (si.emitter != NO_LAMP)
        glow, lamp_density = emitters.hit_lamp(
            si.emitter,
            walk.last,
            dr.norm(si.p - walk.last.p),
            dr.dot(walk.d, si.ng),
            only.lamp,
            glows,
        )
        indoor = dr.select(glows, walk.beta * glow * weight(lamp_density), 0)
    return outdoor, indoor


def _factor(m: Bsdf, value: Any, density: Any, rough: Any, mirror: Any, passed: Any) -> Any:
    """What the throughput is multiplied by."""
    factor = dr.select(rough, value / density, mi.Color3f(1))
    factor = dr.select(mirror, m.f0, factor)
    return dr.select(passed, m.tau, factor)
