"""All surfaces along the straight rays of some pixels against depth_layers; no effects.

Every crossing of a ray is collected with its triangle. Stored surfaces must be crossings in their order, and each
crossing before the last of them must be stored or within 0.1 mm of a stored one or of a hole: a caster that steps
behind a hole may miss it. Where a ray grazes an edge, rays at most 0.02 px away are tried; where triangles coincide,
all triangles of the stored instances.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from pbrs_farm.check.axes import dot
from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.pixel_checks import distances_pierced
from pbrs_farm.core.arrays import F64, I64, Bools

_LAYERS = ("depth_layers", "depth_layers_instance", "depth_layers_semantic", "depth_layers_clear")
_METHOD = "each surface along the straight ray recomputed by rays"
_MOST = 8  # stored surfaces
_CROSSINGS = 24  # that a ray is followed through
_STEP = 1e-5  # behind a crossing, relative to the largest coordinate plus 1 m
_APART_MM = 0.1  # along the ray: nearer surfaces are one
_ROUNDING_MM, _SLANT_MM, _MOST_SLANT_MM = 0.505, 2e-3, 5.0
_SATURATED_MM = 65535
_JITTER_PX = 0.02 * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1]])


class _Surfaces(NamedTuple):
    """Stored surfaces of N pixels, or crossings of their rays; each (N, K)."""

    depth_mm: F64  # 0 = none
    instance: F64
    semantic: F64
    clear: F64

    def some(self, k: I64) -> _Surfaces:
        """Those of some pixels."""
        return _Surfaces(*(values[k] for values in self))


def check_depth_layers(case: ViewCase) -> None:
    """Judge depth, instance, class and clearness of the surfaces of some pixels together."""
    check = "depth layers"
    missing = [name for name in _LAYERS if name not in case.arrays]
    if not case.expect(check)(not missing, f"lacks {', '.join(missing)}"):
        return
    rows, columns = case.pixels
    if not len(case.now.triangles.faces):
        case.tally.pixels(check, case.place, np.asarray(~case.arrays["depth_layers"].any(2)))
        return
    stored = _Surfaces(*(case.arrays[name][rows, columns].astype(np.float64) for name in _LAYERS))
    origin, directions = case.view.rays(rows, columns)
    right, n_certain = np.zeros(len(rows), bool), 0
    for is_doubled, (dx, dy) in itertools.product((False, True), _JITTER_PX):
        # A ray that grazes an edge is judged by those beside it.
        k = np.nonzero(~right)[0]
        if not len(k):
            break
        beside = case.view.rays(rows[k] + dy, columns[k] + dx)[1]
        faces = _crossed_faces(case.now.rays, origin, beside)
        if is_doubled:
            faces = _with_doubles(case, faces, stored.some(k), origin, beside)
        fits, missed_mm = _compared(case, stored.some(k), faces, origin, directions[k])
        right[k] = fits & ~missed_mm.any(1)
        if dx == dy == 0 and is_doubled:
            right[k] |= _explained_by_holes(case, stored.some(k), faces, origin, beside)
        elif dx == dy == 0:
            n_certain = int(right.sum())
    case.tally.add(check, len(rows), ties=int(right.sum()) - n_certain)
    for row, column in zip(rows[~right], columns[~right], strict=True):
        case.tally.fail(check, case.place, f"row {row}, column {column}")


def _crossed_faces(rays: Rays, origin: F64, directions: F64) -> I64:
    """(N, K) the triangles that each ray crosses, nearest first, -1 = none."""
    faces = np.full((len(directions), _CROSSINGS), -1, np.int64)
    on, way = np.arange(len(directions)), np.zeros(len(directions))
    for k in range(_CROSSINGS):
        face = rays.first(origin + way[on, None] * directions[on], directions[on])
        on, face = on[face >= 0], face[face >= 0]
        if not len(on):
            break
        faces[on, k], d = face, directions[on]
        t = np.nan_to_num(rays.distance(face, origin, d), posinf=0.0, neginf=0.0)
        t = np.maximum(t, way[on])
        largest = np.abs(origin + t[:, None] * d).max(1)
        way[on] = t + _STEP * (1 + largest) / np.linalg.norm(d, axis=1)
    return faces


def _with_doubles(
    case: ViewCase, faces: I64, stored: _Surfaces, origin: F64, directions: F64
) -> I64:
    """(N, K) faces and those that the rays cross among the triangles of each stored surface's kind alone."""
    triangles = case.now.triangles
    doubles = np.full((len(faces), _MOST, _CROSSINGS), -1, np.int64)
    kinds = np.stack([stored.instance, stored.clear], axis=2)
    for instance, clear in np.unique(kinds[stored.depth_mm > 0], axis=0):
        numbers = np.nonzero(triangles.instance == instance)[0]
        item = triangles.only(int(instance))
        rays = Rays(item, item.see_through == (clear > 0))
        is_kind = (kinds == (instance, clear)).all(2) & (stored.depth_mm > 0)
        some = np.nonzero(is_kind.any(1))[0]
        crossed = _crossed_faces(rays, origin, directions[some])
        crossed[crossed >= 0] = numbers[crossed[crossed >= 0]]
        doubles[some, is_kind[some].argmax(1)] = crossed
    faces = -np.sort(-np.concatenate([faces, doubles.reshape(len(faces), -1)], axis=1), axis=1)
    faces[:, 1:][faces[:, 1:] == faces[:, :-1]] = -1
    last = np.flatnonzero((faces >= 0).any(0)).max(initial=0)
    return np.asarray(faces[:, : last + 1])


def _explained_by_holes(
    case: ViewCase, stored: _Surfaces, faces: I64, origin: F64, directions: F64
) -> Bools:
    """(N,) True where the rays pass a hole within 0.1 mm of each surface that the faces (N, K) have too much.

    All triangles with holes are asked, as rays that step behind a hole miss the next surface.
    """
    triangles, rays, right = case.now.triangles, case.now.rays, np.zeros(len(faces), bool)
    sheets = np.nonzero(triangles.has_holes)[0]
    corners = triangles.vertices[triangles.faces[sheets]].astype(np.float64) - origin
    middle = corners.mean(1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(1, initial=0)
    for k in range(len(faces)) if len(sheets) else ():
        direction = directions[k]
        length = np.linalg.norm(direction)
        off_ray_m = np.linalg.norm(np.cross(middle, direction), axis=1) / length
        near = sheets[off_ray_m <= radius]
        distance = distances_pierced(triangles, near, origin, direction)
        near, distance = near[np.isfinite(distance)], distance[np.isfinite(distance)]
        along = np.broadcast_to(direction, (len(near), 3))
        is_solid = rays.without_holes(near, origin, along) >= 0
        crossed = np.union1d(faces[k], near[is_solid])[None]
        one = np.array([k])
        fits, missed_mm = _compared(case, stored.some(one), crossed, origin, directions[one])
        gaps_mm = np.abs(missed_mm[missed_mm > 0, None] - 1000 * distance[~is_solid]) * length
        right[k] = fits[0] and (gaps_mm <= _APART_MM).any(1).all()
    return right


def _surfaces_of(case: ViewCase, faces: I64, origin: F64, directions: F64) -> tuple[_Surfaces, F64]:
    """Crossings of rays with faces (N, K), nearest first, and how far their depths may be off, mm."""
    triangles, rays, shape = case.now.triangles, case.now.rays, faces.shape
    along = np.repeat(directions[:, None], shape[1], 1).reshape(-1, 3)
    t = rays.distance(faces.reshape(-1), origin, along).reshape(shape)
    is_hit = (faces >= 0) & np.isfinite(t) & (t > 0)
    t = np.where(is_hit, t, np.inf)
    cosine = np.abs(dot(rays.normal(faces.reshape(-1), along), along)).reshape(shape)
    slant_mm = np.minimum(
        _SLANT_MM * np.where(is_hit, t, 0) / np.maximum(cosine, 1e-9), _MOST_SLANT_MM
    )
    instance = np.where(is_hit, triangles.instance[faces], 0)
    surfaces = _Surfaces(
        np.where(is_hit, np.clip(1000 * t, 1, _SATURATED_MM), 0),
        instance.astype(np.float64),
        triangles.classes[instance].astype(np.float64),
        np.where(is_hit & triangles.see_through[faces], 255.0, 0.0),
    )
    order = np.argsort(t, axis=1, kind="stable")
    sorted_ = [np.take_along_axis(values, order, 1) for values in (*surfaces, slant_mm)]
    return _Surfaces(*sorted_[:4]), _ROUNDING_MM + sorted_[4]


def _compared(
    case: ViewCase, stored: _Surfaces, faces: I64, origin: F64, directions: F64
) -> tuple[Bools, F64]:
    """(N,) True where stored surfaces are crossings of rays with faces (N, K), and depths (N, K) not stored, or 0."""
    crossed, tolerance_mm = _surfaces_of(case, faces, origin, directions)
    length = np.linalg.norm(directions, axis=1)
    is_stored, is_crossed = stored.depth_mm > 0, crossed.depth_mm > 0
    right = ~(np.diff(is_stored.astype(int), axis=1) > 0).any(1)  # nothing behind nothing
    right &= ~np.any([(values * ~is_stored).any(1) for values in stored], axis=0)
    last = np.full(len(right), -1)
    near = np.zeros(is_crossed.shape, bool)  # crossings at a stored depth
    for k in range(_MOST):
        gap_mm = np.abs(crossed.depth_mm - stored.depth_mm[:, k, None])
        here = is_crossed & is_stored[:, k, None]
        near |= here & (gap_mm <= tolerance_mm + _APART_MM / np.maximum(length, 1)[:, None])
        fits = here & (gap_mm <= tolerance_mm) & (np.arange(here.shape[1]) > last[:, None])
        for ours, theirs in zip(stored[1:], crossed[1:], strict=True):
            fits &= ours[:, k, None] == theirs
        right &= fits.any(1) | ~is_stored[:, k]
        last = np.where(fits.any(1), fits.argmax(1), last)
    end = np.where(is_stored.all(1), stored.depth_mm[:, -1], np.inf)
    is_before = is_crossed & (crossed.depth_mm < end[:, None] - tolerance_mm)
    return np.asarray(right), np.where(is_before & ~near, crossed.depth_mm, 0.0)


CHECKS = (
    Check(
        "depth layers",
        "view",
        check_depth_layers,
        85,
        _LAYERS,
        {
            f"depth_layers/{name}.png": _METHOD
            for name in ("depth", "semantic", "instance", "clear")
        },
    ),
)
