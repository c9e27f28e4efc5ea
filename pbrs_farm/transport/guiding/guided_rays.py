"""Guided rays: a part of the scattered rays goes to where lamps light their own insides; kernels.

A bulb deep in its shade lights a room by way of the shade. Shadow rays to the bulb are blocked, and
a ray scattered by the surface alone meets the shade once in a hundred tries: a firefly. So every
direction d out of a vertex is drawn by one of three techniques, with shares that depend on what
came before and not on d:

    own     by the surface (bsdf.sample), after roulette     (1 - share) q(d) p_own(d)
    cone    uniform in the cone around a lamp's inside       share CONED p_cone(d)
    face    at a point y on a face side that glows           share (1 - CONED) p_face(y) r^2 / cos

and the path's throughput is divided by their sum, the balance heuristic in one-sample form. The
third pdf is known only where the ray ends: `kept` applies it there. A ray aimed at a face that
meets another one brings nothing. Cones also catch what reaches a bulb by a reflection in a lamp's
glass cover. No effects.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.guiding.guiding_targets import NO_FACE
from pbrs_farm.transport.guiding.nearby_lamps import Near, cone_pdf, drawn, in_cones
from pbrs_farm.transport.kernels.bsdf import Bsdf
from pbrs_farm.transport.kernels.device_scene import (
    DeviceScene,
    SurfaceInteraction,
    offset_ray_origin,
)
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.path_state import PathState

MOST, LEAST = 0.2, 0.1
"""Of the rays scattered at a vertex. In between it takes the rays that roulette would end, so that
daylight, which is not guided, loses little."""

CONED: Final = 0.3
"""Of the guided rays, into cones."""

REFLECTED: Final = 0.5
"""At most, of the scattered rays that meet thin glass near a lamp."""

_MOST_WORTH, _WORTH_M2 = 100.0, 5.0
"""How much longer paths live: 5 where the one lamp that matters is 1 m off, 100 within 22 cm."""

_MATTERS = 4.0
"""Guiding is at its full share where lamps send a quarter of their light out by their insides."""


class Guide(NamedTuple):
    """What guides the rays of one vertex. share: of all its rays; coned: of those, into cones."""

    near: Near
    share: Any
    coned: Any


class Guided(NamedTuple):
    """A direction and how it came about. is_guided: not drawn by the surface; own: the surface's
    random number made uniform again; target: the face aimed at, NO_FACE = none; valid."""

    d: Any
    is_guided: Any
    own: Any
    target: Any
    valid: Any


def guide_at(near: Near, m: Bsdf, beta: Any, may_aim: Any) -> Guide:
    """The guide of a vertex that a path of throughput beta has reached."""
    albedo = dr.minimum(m.kd + m.f0 + m.tau, 1)
    # Within a lamp the surface finds the light by itself.
    least = LEAST * near.cones.total / dr.maximum(near.at.aim_total, 1e-30)
    spare = dr.clip(1 - 0.95 * survival_boost(near) * dr.max(beta * albedo), least, MOST)
    # Where lamps send little out by way of their insides, there is little to find.
    matters = dr.minimum(_MATTERS * near.at.aim_total / dr.maximum(near.at.total, 1e-30), 1)
    share = dr.select(may_aim & (near.at.aim_total > 0), spare * matters, 0)
    return Guide(near, share, dr.select(near.cones.total > 0, mi.Float(CONED), 0))


def survival_boost(near: Near) -> Any:
    """How much less often roulette ends a path here: more than 1 near lamps, where it is bright."""
    return dr.clip(_WORTH_M2 * near.at.total, 1, _MOST_WORTH)


def reflection_probability(reflectance: Any, boost: Any) -> Any:
    """How often a scattered ray is reflected by thin glass: often near lamps, by their covers."""
    return dr.clip(boost * reflectance, reflectance, dr.maximum(reflectance, REFLECTED))


def guided(
    guide: Guide, scene: DeviceScene, emitters: Emitters, si: SurfaceInteraction, u: Any, uv: Any
) -> Guided:
    """A direction by the second or third technique, where u says so."""
    share, coned = guide.share, guide.coned
    is_guided = u < share
    own = dr.select(is_guided, 0, (u - share) / (1 - share))
    v = u / dr.maximum(share, 1e-6)
    is_coned = is_guided & (v < coned)
    v = dr.select(is_coned, v / CONED, (v - coned) / (1 - coned))
    v = dr.clip(v, 0, 1 - 1e-7)
    lamp, rest = drawn(guide.near.lamps, guide.near.aims, guide.near.at.aim_total, v)
    at_face = is_guided & ~is_coned
    aim = emitters.aims.aim(scene, (si.p, si.ng), lamp, rest, uv, at_face)
    d = dr.select(is_coned, in_cones(guide.near.cones, v, uv), aim.d)
    target = dr.select(at_face, aim.face, mi.UInt32(NO_FACE))
    return Guided(d, is_guided, own, target, ~at_face | aim.valid)


def cone_chance(guide: Guide, d: Any) -> Any:
    """Pdf of the second technique in direction d, chance included."""
    return guide.share * guide.coned * cone_pdf(guide.near.cones, d)


def face_chance(guide: Guide) -> Any:
    """Chance of the third technique, over what the aims of all lamps add up to."""
    total = dr.maximum(guide.near.at.aim_total, 1e-30)
    return guide.share * (1 - guide.coned) / total


def mis_weight(
    emitters: Emitters, path: PathState, si: SurfaceInteraction, only: Any, turned: Any, rough: Any
) -> Any:
    """What a walk's throughput keeps where its ray ends; 1 where it passes on.

    turned: it ends without meeting what a guided ray may aim at.
    """
    ref, d = path.reference, path.d
    _level, aim = emitters.nearby.level(si.target_emitter, ref.p, ref.n, only, rough)
    cos = dr.maximum(dr.abs(dr.dot(si.ng, d)), 1e-6)
    begin = offset_ray_origin(ref.p, dr.select(dr.dot(ref.n, d) > 0, ref.n, -ref.n))
    pdf = aim * si.target_pdf * dr.squared_norm(si.p - begin) / cos
    balanced = dr.select(rough, dr.rcp(1 + path.guiding_odds * pdf), 1)
    astray = (path.target_face != NO_FACE) & (turned | (rough & (path.target_face != si.face)))
    return dr.select(astray, 0, balanced)
