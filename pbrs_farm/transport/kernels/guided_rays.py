"""Guided rays: a part of the scattered rays goes to the lit insides of lamps; kernels, no effects.

A bulb deep in its shade lights a room by way of the shade. Shadow rays to the bulb are blocked, and
a ray drawn by the surface alone meets the shade once in a hundred tries: a firefly. So a direction d
out of a vertex is drawn by one of three techniques, with shares that depend on what came before
and not on d:

    bsdf    by the surface (sample_bsdf), after roulette       (1 - share) q(d) p_bsdf(d)
    cone    uniform in the cone around a lamp's interior       share CONE_SHARE p_cone(d)
    target  at a point y on a guiding target                   share (1 - CONE_SHARE) p(y) r^2 / cos

The path's throughput is divided by their sum, the balance heuristic in one-sample form (Veach
1997, section 9.2.4). The third pdf is known only where the ray ends: `guided_mis_weight` applies
it there. A ray aimed at a target that meets another face brings nothing. Cones also catch what
reaches a bulb by a reflection in a lamp's glass cover.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.kernels.bsdf import Bsdf
from pbrs_farm.transport.kernels.device_scene import (
    DeviceScene,
    SurfaceInteraction,
    offset_ray_origin,
)
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.guiding_targets import NO_FACE
from pbrs_farm.transport.kernels.lamp_guiding import (
    NearbyLamps,
    cone_pdf,
    sample_cones,
    sample_discrete,
)
from pbrs_farm.transport.kernels.path_state import PathState
from pbrs_farm.transport.kernels.sampler import as_random

# Guided part of the rays scattered at a vertex. In between it takes the rays that roulette would
# end, so that daylight, which is not guided, loses little.
MAX_SHARE, MIN_SHARE = 0.2, 0.1

CONE_SHARE: Final = 0.3  # of the guided rays, into cones

MAX_REFLECTED: Final = 0.5  # of the scattered rays that meet thin glass near a lamp

# Factor on path survival: 5 if the only relevant lamp is 1 m away, 100 within 22 cm.
MAX_BOOST, _BOOST_M2 = 100.0, 5.0

# Guiding has its full share where lamps send a quarter of their light out by their interiors.
_FULL_GUIDING: Final = 4.0


class Guiding(NamedTuple):
    """How the rays of one vertex are guided."""

    near: NearbyLamps
    share: Any  # guided part of all its rays
    cone_share: Any  # of the guided ones, into cones


class GuidedSample(NamedTuple):
    """A guided direction, and how it came about."""

    d: Any  # unit Vector3f
    is_guided: Any  # Bool: not to be drawn by the surface
    u_bsdf: Any  # the random number made uniform again, for the surface
    target_face: Any  # UInt32, the face aimed at, NO_FACE = none
    valid: Any


def guiding_at(near: NearbyLamps, bsdf: Bsdf, beta: Any, may_aim: Any) -> Guiding:
    """The guiding of a vertex that a path of throughput beta has reached.

    beta: Color3f; may_aim: Bool, False where a ray may not be aimed (glass). The share of guided
    rays is about what roulette would end here anyway, and less where lamps send little light out by
    way of their interiors.
    """
    albedo = dr.minimum(bsdf.kd + bsdf.f0 + bsdf.tau, 1)
    # Inside a lamp the BSDF finds the light without guiding.
    reference = near.reference
    least = MIN_SHARE * near.cones.total / dr.maximum(reference.guided_total, 1e-30)
    spare = dr.clip(1 - 0.95 * survival_boost(near) * dr.max(beta * albedo), least, MAX_SHARE)
    # Where lamps send little out by way of their interiors, there is little to find.
    gain = dr.minimum(_FULL_GUIDING * reference.guided_total / dr.maximum(near.closeness, 1e-30), 1)
    may_aim = may_aim & near.is_guided & (reference.guided_total > 0)
    share = dr.select(may_aim, spare * gain, 0)
    return Guiding(near, share, dr.select(near.cones.total > 0, mi.Float(CONE_SHARE), 0))


def survival_boost(near: NearbyLamps) -> Any:
    """Factor by which roulette ends fewer paths here: above 1 near lamps, where it is bright.

    1 in views without guiding.
    """
    boost = dr.clip(_BOOST_M2 * near.closeness, 1, MAX_BOOST)
    return dr.select(near.is_guided, boost, 1)


def reflection_probability(reflectance: Any, boost: Any) -> Any:
    """Probability that thin glass reflects a scattered ray: high near lamps, for their covers."""
    return dr.clip(boost * reflectance, reflectance, dr.maximum(reflectance, MAX_REFLECTED))


def sample_guided(
    guiding: Guiding,
    scene: DeviceScene,
    emitters: Emitters,
    si: SurfaceInteraction,
    u: Any,
    uv: Any,
) -> GuidedSample:
    """A direction by the second or third technique, if u selects one of them.

    u: in [0, 1) selects the technique; `u_bsdf` of the result is its remainder for the BSDF if neither was
    selected. A target's direction may hit another face first: compare `face` with the hit.
    """
    # Select the technique; use the remainder of u for the surface, or for the lamp.
    share, cone_share = guiding.share, guiding.cone_share
    is_guided = u < share
    u_bsdf = dr.select(is_guided, 0, (u - share) / (1 - share))
    v = u / dr.maximum(share, 1e-6)
    is_cone = is_guided & (v < cone_share)
    v = as_random(dr.select(is_cone, v / CONE_SHARE, (v - cone_share) / (1 - cone_share)))
    # Choose a lamp, and a point on one of its targets.
    near = guiding.near
    lamp, rest = sample_discrete(near.lamps, near.guided, near.reference.guided_total, v)
    is_target = is_guided & ~is_cone
    target = emitters.targets.sample(scene, si.p, si.ng, lamp, rest, uv, is_target)
    d = dr.select(is_cone, sample_cones(near.cones, v, uv), target.d)
    face = dr.select(is_target, target.face, mi.UInt32(NO_FACE))
    return GuidedSample(d, is_guided, u_bsdf, face, ~is_target | target.valid)


def cone_technique_pdf(guiding: Guiding, d: Any) -> Any:
    """Pdf of the second technique in direction d, its share included.

    d: unit Vector3f. Per solid angle; add it to the pdfs of the other techniques.
    """
    return guiding.share * guiding.cone_share * cone_pdf(guiding.near.cones, d)


def target_technique_share(guiding: Guiding) -> Any:
    """Share of the third technique over the sum of guided importances."""
    total = dr.maximum(guiding.near.reference.guided_total, 1e-30)
    return guiding.share * (1 - guiding.cone_share) / total


def guided_mis_weight(
    emitters: Emitters,
    path: PathState,
    si: SurfaceInteraction,
    counted: Any,
    reflected: Any,
    rough: Any,
) -> Any:
    """Factor on a path's throughput at the end of its ray; 1 where it passes through.

    reflected: the ray ends on a face that it cannot have been aimed at.
    """
    # Compute the pdf with which the third technique would have aimed here.
    ref, d = path.reference, path.d
    _importance, guided = emitters.nearby.importance(
        si.target_emitter, ref.p, ref.n, counted, rough
    )
    cos = dr.maximum(dr.abs(dr.dot(si.ng, d)), 1e-6)
    begin = offset_ray_origin(ref.p, dr.select(dr.dot(ref.n, d) > 0, ref.n, -ref.n))
    pdf = guided * si.target_pdf * dr.squared_norm(si.p - begin) / cos
    balanced = dr.select(rough, dr.rcp(1 + path.guiding_odds * pdf), 1)
    # Drop rays aimed at one face that hit another.
    is_aimed = path.target_face != NO_FACE
    missed = is_aimed & (reflected | (rough & (path.target_face != si.face)))
    return dr.select(missed, 0, balanced)
