"""The film Metropolis splats on: positions from numbers, and splats; kernels, no effects."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.kernels.bsdf import luminance
from pbrs_farm.transport.kernels.path_state import film_position


class Film(NamedTuple):
    """Size of the picture, opaque; splats: (2 * pixels * 3,) sums of the two halves.

    importance: (pixels,) how much a unit of luminance counts for the chains.
    """

    width: Any
    height: Any
    splats: Any
    importance: Any


def film_point(film: Film, u: Any, is_tent: Any) -> tuple[Any, Any]:
    """(pixel index, film position in pixels spread by the filter) of two numbers."""
    x, y = u.x * mi.Float(film.width), u.y * mi.Float(film.height)
    column = dr.minimum(mi.UInt32(x), film.width - 1)
    row = dr.minimum(mi.UInt32(y), film.height - 1)
    inside = mi.Point2f(dr.clip(x - mi.Float(column), 0, 1), dr.clip(y - mi.Float(row), 0, 1))
    at = film_position(inside, is_tent) + mi.Point2f(mi.Float(column), mi.Float(row))
    return row * film.width + column, at


def point_in_pixel(film: Film, pixel: Any, u: Any, is_tent: Any) -> Any:
    """Film position of two numbers inside a pixel, spread by the filter."""
    corner = mi.Point2f(mi.Float(pixel % film.width), mi.Float(pixel // film.width))
    return film_position(u, is_tent) + corner


def level_of(film: Film, pixel: Any, light: Any, active: Any = True) -> Any:
    """What the chains are drawn by: the luminance of light at a pixel times its importance."""
    return luminance(light) * dr.gather(mi.Float, film.importance, pixel, active)


def splat(
    film: Film, chain: Any, pixel: Any, light: Any, level: Any, weight: Any, active: Any
) -> None:
    """Add light, brought from `level` to `weight`, to a pixel of the half the chain belongs to."""
    active = active & (level > 0) & (weight > 0)
    value = light * (weight / dr.select(level > 0, level, 1))
    base = ((chain & 1) * (film.width * film.height) + pixel) * 3
    for c in range(3):
        dr.scatter_add(film.splats, value[c], base + c, active)
