"""Light choice of OpenGL-IL: the lights that matter most to each item, and their scale; no effects.

Source: paper section 3.2, docs/spec/suncg.md section 4. The published code kept the worst eight
lights of a node and matched none of them to it; its intent is computed here.
"""

from __future__ import annotations

import math

import numpy as np

from pbrs_farm.core.arrays import F32, F64, I64
from pbrs_farm.core.house import House, Item, ItemKind, LightPart, corners_of_surfaces
from pbrs_farm.core.lighting import LightForm, flux_lm
from pbrs_farm.core.mesh import face_areas, unit_normals

SOFTENING_M = 0.35  # added in quadrature to every distance, so that a lampshade does not burn out
FLOOR_LEVEL = 0.6  # linear brightness, before the tone curve, of a white floor in median lamp light
LIGHT_FLOATS = 16  # columns of a light's row, four vec4 of the shader:
POSITION, FORM = slice(0, 3), 3  # m, world; number of the form
INTENSITY, DROPOFF = slice(4, 7), 7  # cd x colour; exponent of a spot's cosine
DIRECTION, COS_CUTOFF = slice(8, 11), 11  # unit axis of a spot; cosine of its half angle
END = slice(12, 15)  # other end of a line, with its length in the last column

_FORM_NUMBER = {LightForm.POINT: 0.0, LightForm.SPOT: 1.0, LightForm.LINE: 2.0}
_N_FLOOR_POINTS = 2000  # of a house, for its scale


def light_table(house: House) -> F32:
    """(L, 16) float32 of every light of the house, columns as above, in the items' order."""
    rows = [_row_of_light(part) for item in house.items for part in item.lights]
    return np.array(rows, np.float32).reshape(-1, LIGHT_FLOATS)


def _row_of_light(part: LightPart) -> list[float]:
    # Take a form that lacks a line's end or a spot's angle for a point that shines everywhere.
    candela = flux_lm(part.power, part.unit, part.share) / (4 * math.pi)
    intensity = [candela * c for c in part.rgb_linear]
    is_line = part.form is LightForm.LINE and part.position_end is not None
    form = part.form if is_line or part.form is LightForm.SPOT else LightForm.POINT
    end = part.position_end if is_line and part.position_end is not None else part.position
    length = math.dist(part.position, end)
    size = math.hypot(*part.direction)
    direction = [c / size for c in part.direction] if size > 0 else [0.0, -1.0, 0.0]
    return [
        *part.position,
        _FORM_NUMBER[form],
        *intensity,
        part.dropoff,
        *direction,
        math.cos(min(part.cutoff_rad, math.pi)),
        *end,
        length,
    ]


def best_lights(lights: F32, low: F64, high: F64, n_best: int) -> I64:
    """(N, min(n_best, L)) indices of the lights with the largest I / d^2 at each box, best first.

    low, high: (N, 3) boxes. I: the largest channel. d: from the light (for a line: from the nearest
    of five points along it) to the nearest point of the box. Ties keep their order.
    """
    brightest = lights[:, INTENSITY].max(axis=1) if len(lights) else np.zeros(0, np.float32)
    squared = np.full((len(low), len(lights)), np.inf)
    # Measure from points along each line to the boxes; a point's or spot's two ends coincide.
    for t in np.linspace(0, 1, 5):
        point = lights[:, POSITION] * (1 - t) + lights[:, END] * t
        gap = np.maximum(np.maximum(low[:, None] - point, point - high[:, None]), 0.0)
        squared = np.minimum(squared, np.einsum("nlk,nlk->nl", gap, gap))
    reach = brightest / (squared + SOFTENING_M**2)
    return np.argsort(-reach, axis=1, kind="stable")[:, :n_best]


def illuminance(points: F64, normals: F64, lights: F32) -> F64:
    """(N,) lx, without shadows, as in surface.frag.glsl, of points and unit normals under lights (N, K, 16)."""
    # Find the nearest point of each light: along a line, or the light's position.
    start, end = lights[..., POSITION].astype(np.float64), lights[..., END].astype(np.float64)
    along, p = end - start, points[:, None]
    squared_length = np.maximum(np.einsum("nkj,nkj->nk", along, along), 1e-12)
    t = np.clip(np.einsum("nkj,nkj->nk", p - start, along) / squared_length, 0, 1)
    to_light = start + t[..., None] * along - p
    squared = np.einsum("nkj,nkj->nk", to_light, to_light)
    # Apply both cosines, the spot's cone, and the softened inverse square.
    unit = to_light / np.sqrt(np.maximum(squared, 1e-12))[..., None]
    cosine = np.maximum(np.einsum("nkj,nj->nk", unit, normals), 0)
    axis = lights[..., DIRECTION].astype(np.float64)
    leaving = np.maximum(-np.einsum("nkj,nkj->nk", unit, axis), 0)
    spot = np.where(leaving >= lights[..., COS_CUTOFF], leaving ** lights[..., DROPOFF], 0.0)
    spot = np.where(lights[..., FORM] == _FORM_NUMBER[LightForm.SPOT], spot, 1.0)
    candela = lights[..., INTENSITY].max(axis=2)
    return np.asarray((candela * spot * cosine / (squared + SOFTENING_M**2)).sum(1))


def brightness_scale(house: House, n_best: int) -> float:
    """Brightness of white per lx that takes the median floor (or face) to FLOOR_LEVEL; 0 without lights."""
    lights = light_table(house)
    floors = [item for item in house.items if item.kind is ItemKind.FLOOR] or list(house.items)
    points, normals, owner = _spread_points(floors)
    if not len(lights) or not len(points):
        return 0.0
    # Light each point by the lights of its item, on the side that faces up.
    bounds = np.array([item.bounds for item in floors])
    best = best_lights(lights, bounds[:, 0], bounds[:, 1], n_best)
    up = np.where(normals[:, 1:2] < 0, -normals, normals)
    lx = illuminance(points, up, lights[best[owner]])
    reached = lx[lx > 0]
    return float(FLOOR_LEVEL / np.median(reached)) if len(reached) else 0.0


def _spread_points(items: list[Item]) -> tuple[F64, F64, I64]:
    """Points stratified by area over items' triangles: positions, unit normals, number of the item."""
    corners, owners = [np.zeros((0, 3, 3))], [np.zeros(0, np.int64)]
    for number, item in enumerate(items):
        corners.append(corners_of_surfaces(item.surfaces))
        owners.append(np.full(item.n_faces, number))
    triangles, owner = np.concatenate(corners), np.concatenate(owners)
    area = np.nan_to_num(face_areas(triangles))
    if not area.sum() > 0:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64)
    # Choose faces at even steps of the running area, and a uniform point in each.
    rng = np.random.default_rng(0)
    areas = (np.arange(_N_FLOOR_POINTS) + 0.5) / _N_FLOOR_POINTS * area.sum()
    face = np.searchsorted(np.cumsum(area), areas).clip(0, len(area) - 1)
    uv = rng.random((len(face), 2))
    uv = np.where(uv.sum(1, keepdims=True) > 1, 1 - uv, uv)
    t = triangles[face]
    points = t[:, 0] + uv[:, :1] * (t[:, 1] - t[:, 0]) + uv[:, 1:] * (t[:, 2] - t[:, 0])
    return points, unit_normals(t), owner[face]
