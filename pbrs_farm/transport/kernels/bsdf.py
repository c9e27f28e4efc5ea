"""The reflectance model: evaluate, pdf, sample; kernels, no effects.

One reflectance model for every material (two-sided, wi.z > 0 in the local frame):

    f(wi, wo) = kd / pi                                       wo.z > 0, without a coat
              + 28/23 kd/pi (1 - f0) a(wi) a(wo)              wo.z > 0, under a coat
              + F(wi.h) D(h) G2(wi, wo) / (4 wi.z wo.z)       wo.z > 0, the coat
              + tau / pi                                      wo.z < 0, translucent

a(w) = 1 - (1 - w.z / 2)^5 (Ashikhmin and Shirley 2000), F is Schlick's, D and G2 are GGX with
roughness alpha. It is reciprocal and reflects at most what arrives. Mirrors and thin glass are
deltas, handled by the tracers: thin glass bends nothing, so light goes straight through it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.core.frames import LUMINANCE

_MIN_RECONNECT_ALPHA = 0.1
_LEAST_WALL_COS = 0.1  # a round wall is met no flatter over its whole thickness


class Bsdf(NamedTuple):
    """The reflectance model at a point, lane by lane: diffuse base and transmission, a GGX coat above."""

    kd: Any  # Color3f, diffuse reflectance
    f0: Any  # Color3f, the coat's reflectance at normal incidence; of a mirror its reflectance
    tau: Any  # Color3f, diffuse transmittance; of thin glass its colour
    alpha: Any  # GGX roughness of the coat, 0 = no coat
    kind: Any  # UInt32, SURFACE, MIRROR, GLASS or NULL


def luminance(rgb: Any) -> Any:
    """Luminance of linear sRGB (Color3f or three numbers), Rec. 709 weights."""
    return rgb[0] * LUMINANCE[0] + rgb[1] * LUMINANCE[1] + rgb[2] * LUMINANCE[2]


def evaluate_bsdf(bsdf: Bsdf, wi: Any, wo: Any, *, least_diffuse: float = 0.0) -> tuple[Any, Any]:
    """(f |cos wo| as Color3f, pdf of sample_bsdf per solid angle) of two local directions.

    wi, wo: unit, in the shading frame (z is the normal), pointing away from the surface, wi.z
    > 0; wo.z < 0 is transmission. Mirrors and thin glass give 0: their directions are deltas,
    which only sample_bsdf draws. least_diffuse: as of sample_bsdf.
    """
    above = wo.z > 0
    cos_o = dr.abs(wo.z)
    has_coat = bsdf.alpha > 0

    # Diffuse reflection, below the coat, and diffuse transmission.
    coupled = 28 / 23 * (1 - bsdf.f0) * _ashikhmin(wi.z) * _ashikhmin(cos_o)
    diffuse = bsdf.kd * dr.select(has_coat, coupled, 1.0)
    value = dr.select(above, diffuse, bsdf.tau) * (cos_o * dr.inv_pi)

    # Reflection by the coat.
    use_coat = has_coat & above
    value += dr.select(use_coat, coat_reflection(bsdf.f0, bsdf.alpha, wi, wo), 0)

    # The pdf of all three lobes.
    p_diffuse, p_coat = _lobe_probabilities(bsdf, wi, least_diffuse)
    p_transmitted = 1 - p_diffuse - p_coat
    pdf = dr.select(above, p_diffuse, p_transmitted) * (cos_o * dr.inv_pi)
    d = _ggx_d(dr.normalize(wi + wo), bsdf.alpha)
    pdf += dr.select(use_coat, p_coat * d / (4 * wi.z * (1 + _lambda(wi, bsdf.alpha))), 0)
    return value, pdf


def diffuse_reflection(bsdf: Bsdf, cos_o: Any) -> Any:
    """f |cos wo| of diffuse reflection alone, less diffuse_response() to wi; cos_o > 0, both are above."""
    coated = 28 / 23 * (1 - bsdf.f0) * _ashikhmin(cos_o)
    return bsdf.kd * dr.select(bsdf.alpha > 0, coated, 1.0) * (cos_o * dr.inv_pi)


def diffuse_response(has_coat: Any, cos_i: Any) -> Any:
    """Factor on diffuse reflection towards wi under a coat; cos_i >= 0. 1 for plain matte surfaces."""
    return dr.select(has_coat, _ashikhmin(cos_i), 1.0)


def white_share(value: Any, wo: Any) -> Any:
    """Color3f of f |cos wo| of a white matte surface over value (of `evaluate_bsdf`); 0 below and where value is 0."""
    return dr.select((wo.z > 0) & (value > 0), wo.z * dr.inv_pi / value, 0)


def sample_bsdf(bsdf: Bsdf, wi: Any, u_lobe: Any, uv: Any, *, least_diffuse: float = 0.0) -> Any:
    """A direction wo drawn with the pdf of evaluate_bsdf(); it may be below the surface.

    wi: unit, local, z along the normal. u_lobe in [0, 1) chooses the lobe and is used up by it.
    least_diffuse: minimum Kd in the choice, if arriving light is asked for, too.
    """
    p_diffuse, p_coat = _lobe_probabilities(bsdf, wi, least_diffuse)
    cosine = mi.warp.square_to_cosine_hemisphere(uv)
    wo = dr.select(u_lobe < p_diffuse, cosine, mi.Vector3f(cosine.x, cosine.y, -cosine.z))
    use_coat = (u_lobe >= p_diffuse) & (u_lobe < p_diffuse + p_coat)
    h = _visible_normal(wi, dr.maximum(bsdf.alpha, 1e-4), uv)
    return dr.select(use_coat, 2 * dr.dot(wi, h) * h - wi, wo)


def coat_reflection(f0: Any, alpha: Any, wi: Any, wo: Any) -> Any:
    """f |cos wo| of the coat alone (GGX, Schlick); local directions, both above. f0: Color3f; alpha > 0."""
    h = dr.normalize(wi + wo)
    fresnel = _schlick(f0, dr.maximum(dr.dot(wi, h), 0))
    shadowed = 1 + _lambda(wi, alpha) + _lambda(wo, alpha)
    return fresnel * (_ggx_d(h, alpha) / (4 * wi.z * shadowed))


def is_reconnectable(bsdf: Bsdf) -> Any:
    """True for a surface rough enough that a path through it carries light when seen from elsewhere."""
    return (bsdf.alpha <= 0) | (bsdf.alpha >= _MIN_RECONNECT_ALPHA)


def view_independent_pdf(bsdf: Bsdf, ng: Any, w: Any) -> Any:
    """A pdf like sample_bsdf()'s, positive where it may go, that does not depend on wi; world directions."""
    is_thin = dr.max(bsdf.tau) > 0
    reflected, transmitted = luminance(bsdf.kd), luminance(bsdf.tau)
    p_above = dr.clip(reflected / dr.maximum(reflected + transmitted, 1e-9), 0.05, 0.95)
    cos = dr.dot(ng, w)
    share = dr.select(is_thin, dr.select(cos > 0, p_above, 1 - p_above), dr.select(cos > 0, 1, 0))
    return share * (dr.abs(cos) * dr.inv_pi)


def thin_glass_reflectance(cos_i: Any) -> Any:
    """Share that a thin clear pane of index 1.5 reflects, all inner reflections counted; cos_i of either sign."""
    fresnel: Any = mi.fresnel
    r = fresnel(dr.abs(cos_i), mi.Float(1.5))[0]
    return 2 * r / (1 + r)


def thin_glass_transmittance(tau: Any, cos_i: Any) -> Any:
    """Color3f transmittance of glass for light that is not reflected.

    tau: Color3f, transmittance at normal incidence; cos_i: either sign. Unrefracted light travels 1 / cos as
    far through a wall, so that a jar is darkest at its outline (Beer and Lambert's law).
    """
    return dr.power(tau, dr.rcp(dr.maximum(dr.abs(cos_i), _LEAST_WALL_COS)))


def _lobe_probabilities(bsdf: Bsdf, wi: Any, least_diffuse: float) -> tuple[Any, Any]:
    """(probability of diffuse reflection, of the coat); the rest is transmitted."""
    coat = dr.select(bsdf.alpha > 0, dr.maximum(luminance(_schlick(bsdf.f0, wi.z)), 0.05), 0)
    reflected, transmitted = luminance(bsdf.kd), luminance(bsdf.tau)
    if least_diffuse > 0:
        reflected = dr.maximum(reflected, least_diffuse)
    total = reflected + transmitted + coat
    is_black = total <= 0
    scale = dr.rcp(dr.select(is_black, 1, total))
    return dr.select(is_black, 1, reflected * scale), coat * scale


def _ashikhmin(cos: Any) -> Any:
    t = 1 - 0.5 * cos
    return 1 - dr.square(dr.square(t)) * t


def _schlick(f0: Any, cos: Any) -> Any:
    t = 1 - cos
    return f0 + (1 - f0) * (dr.square(dr.square(t)) * t)


def _ggx_d(h: Any, alpha: Any) -> Any:
    a2 = dr.square(alpha)
    t = dr.square(h.z) * (a2 - 1) + 1
    return dr.select(h.z > 0, a2 / dr.maximum(math.pi * dr.square(t), 1e-20), 0)


def _lambda(w: Any, alpha: Any) -> Any:
    cos2 = dr.maximum(dr.square(w.z), 1e-12)
    return 0.5 * (dr.sqrt(1 + dr.square(alpha) * dr.maximum(1 - cos2, 0) / cos2) - 1)


def _visible_normal(wi: Any, alpha: Any, u: Any) -> Any:
    """A GGX normal as wi sees them (Heitz 2018)."""
    # Stretch wi to the hemisphere of roughness 1, with an orthonormal basis around it.
    v = dr.normalize(mi.Vector3f(alpha * wi.x, alpha * wi.y, wi.z))
    length2 = dr.square(v.x) + dr.square(v.y)
    t1 = dr.select(
        length2 > 1e-12,
        mi.Vector3f(-v.y, v.x, 0) * dr.rsqrt(dr.maximum(length2, 1e-12)),
        mi.Vector3f(1, 0, 0),
    )
    t2 = dr.cross(v, t1)
    # Draw a point of the projected hemisphere.
    r = dr.sqrt(u.x)
    sin_phi, cos_phi = dr.sincos(2 * math.pi * u.y)
    x = r * cos_phi
    s = 0.5 * (1 + v.z)
    y = (1 - s) * dr.safe_sqrt(1 - dr.square(x)) + s * r * sin_phi
    n = x * t1 + y * t2 + dr.safe_sqrt(1 - dr.square(x) - dr.square(y)) * v
    return dr.normalize(mi.Vector3f(alpha * n.x, alpha * n.y, dr.maximum(n.z, 1e-6)))
