"""Textures of the atlas between their texels, and what roughness and normal maps make of a surface; kernels, no effects."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.core.gloss import MIN_ALPHA
from pbrs_farm.transport.scene_tables.texture_atlas import NORMAL_ZERO

_MIN_UV_AREA = 1e-6  # of a triangle's uvs, over the squares of their edges: less is no area


class Triangle(NamedTuple):
    """Inputs of a face's tangent frame."""

    e1: Any  # Vector3f, edges from its first corner
    e2: Any
    uv1: Any  # Point2f, steps of the texture coordinates along them
    uv2: Any


class ShadedSurface(NamedTuple):
    """Surface properties after maps, seen from the front."""

    normal: Any  # unit shading normal
    alpha: Any  # GGX roughness, 0 = no coat


def colour_at(texels: Any, slot: Any, uv: Any, active: Any) -> Any:
    """Color3f of a colour texture; slot: packet of first texel (bits), width and height."""
    total = mi.Color3f(0)
    # A texel holds square roots in 10 bits each.
    for bits, weight in _four_texels(texels, slot, uv, active):
        root = mi.Color3f(bits & 1023, (bits >> 10) & 1023, (bits >> 20) & 1023) * (1 / 1023)
        total += weight * dr.square(root)
    return total


@dr.syntax
def is_hole_at(texels: Any, slot: Any, uv: Any, may_be_hole: Any) -> Any:
    """Bool: alpha, behind the colours' texels, is below the cutoff (0..255, in slot) at uv."""
    hole = mi.Bool(False)
    # Branch: packets of lanes on surfaces without holes pass by.
    if may_be_hole:
        n_texels = mi.UInt32(slot[1]) * mi.UInt32(slot[2])
        alpha = mi.Float(0)
        for bits, weight in _four_texels(texels, slot, uv, may_be_hole, n_texels):
            alpha += weight * mi.Float(bits)
        hole = may_be_hole & (alpha < slot[3])
    return hole


@dr.syntax
def follow_maps(
    texels: Any,
    materials: Any,
    packet: Any,
    uv: Any,
    triangle: Triangle,
    surface: ShadedSurface,
    roughness: Any,
    has_maps: Any,
) -> ShadedSurface:
    """The surface with its roughness and normal maps; packet: their slot's index, roughness: its factor."""
    normal, alpha = mi.Vector3f(surface.normal), mi.Float(surface.alpha)
    # Branch: packets of lanes without any map pass by.
    if has_maps:
        slot = dr.gather(mi.Vector4f, materials, packet, has_maps)
        x, y, r = mi.Float(0), mi.Float(0), mi.Float(0)
        for bits, weight in _four_texels(texels, slot, uv, has_maps):
            x += weight * mi.Float(bits & 2047)
            y += weight * mi.Float((bits >> 11) & 2047)
            r += weight * mi.Float(bits >> 22)
        x, y = (x - NORMAL_ZERO) * (1 / 1023), (y - NORMAL_ZERO) * (1 / 1023)
        normal = _perturbed_normal(normal, triangle, x, y)
        mapped = dr.maximum(dr.square(roughness * r * (1 / 1023)), MIN_ALPHA)
        alpha = dr.select(alpha > 0, mapped, alpha)
    return ShadedSurface(normal, alpha)


def _perturbed_normal(n: Any, triangle: Triangle, x: Any, y: Any) -> Any:
    """The unit normal x t + y b + z n, with t along u and b along v."""
    # Solve e = du dp/du + dv dp/dv for both edges.
    e1, e2, a, b = triangle
    area = a.x * b.y - a.y * b.x
    side = dr.select(area < 0, mi.Float(-1), 1)
    t = side * (b.y * e1 - a.y * e2)
    # Make the tangent perpendicular to the shading normal.
    t -= n * dr.dot(n, t)
    length2 = dr.squared_norm(t)
    t *= dr.rsqrt(length2)
    z = dr.safe_sqrt(1 - dr.square(x) - dr.square(y))
    bent = dr.normalize(x * t + (y * side) * dr.cross(n, t) + z * n)
    # Leave a surface flat whose texture coordinates span no area.
    has_area = dr.abs(area) > _MIN_UV_AREA * (dr.squared_norm(a) + dr.squared_norm(b))
    return dr.select(has_area & (length2 > 1e-30), bent, n)


def _four_texels(
    texels: Any, slot: Any, uv: Any, active: Any, skipped: Any = 0
) -> list[tuple[Any, Any]]:
    """(bits, weight) of the four texels around uv, both axes repeating; skipped: texels before them."""
    first: Any = dr.reinterpret_array(mi.UInt32, slot[0]) + skipped
    width, height = slot[1], slot[2]
    # Find the texel to the top left; row 0 is the top (v = 1).
    w, h = dr.maximum(mi.Int32(width), 1), dr.maximum(mi.Int32(height), 1)
    x = (uv.x - dr.floor(uv.x)) * width - 0.5
    y = (1 - (uv.y - dr.floor(uv.y))) * height - 0.5
    fx, fy = dr.floor(x), dr.floor(y)
    x0, y0 = mi.Int32(fx), mi.Int32(fy)
    tx, ty = x - fx, y - fy
    samples = []
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = x0 + dx, y0 + dy
        column = dr.select(column < 0, column + w, dr.select(column >= w, column - w, column))
        row = dr.select(row < 0, row + h, dr.select(row >= h, row - h, row))
        index = first + mi.UInt32(row * w + column)
        bits = dr.gather(mi.UInt32, texels, index, active)
        samples.append((bits, (tx if dx else 1 - tx) * (ty if dy else 1 - ty)))
    return samples
