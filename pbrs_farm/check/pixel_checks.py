"""Every label of a pixel against an independent ray through its centre; no effects.

A ray that grazes an edge, or meets two surfaces in the same place, has more than one right
answer. If the centre's answer does not explain the stored labels, the triangles next to it (rays
at most 0.02 px away) and those of the stored instance at the same depth are tried. If one of them
explains every layer together the pixel is a tie, which is counted; otherwise it failed. A tie of
two parallel surfaces within 0.1 mm is a fault of the source: a window frame in the plane of its wall.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.axes import dot, published_directions, stored_normals
from pbrs_farm.check.cases import Cast, Pixels, Scene, ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import srgb_from_linear
from pbrs_farm.check.embree_caster import MirrorRays
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64, I64, Bools

Labels = dict[str, NDArray[Any]]  # layer -> stored values at N pixels: (N,) or (N, 3)

_ROUNDING_MM = 0.505  # tolerance of depth stored in whole mm
_RAY_ERROR_MM = 2e-4  # per metre of depth, over the cosine: float32 directions on a slanting face
_MAX_RAY_ERROR_MM = 5.0
_NORMAL_DEG = 0.02  # tolerance of a normal
_SHADING_DEG = 0.5  # the same between texels of a map, whose bytes are half a degree apart
_BATCH = 100_000  # candidate triangles of one batch
_TIE_M = 1e-4  # two surfaces closer than this, across them, may both be hit
_METRES = 2e-4  # tolerance of depths and positions stored as floats
_ALBEDO_STEPS = 2.5  # of 255
_ROUGHNESS_STEPS = 2.5  # of 255
_PHYSICAL_ALBEDO = 0.9  # the recipe's `physical` materials clip colour times texture to this
_MOST_COINCIDENT = (
    3  # pixels of a view with two colours that chance explains: items meet at an edge
)
_PARALLEL = 0.999  # least cosine between the normals of coincident surfaces
# Distances of neighbouring rays from the pixel's centre: a silhouette may be nearer than a thin item is wide.
_JITTER_PX = (0.02, 0.005, 0.002)
_MOST_GRAZED = 200  # pixels that graze an outline; more are wrong
_JITTER = np.concatenate(
    [
        r * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]])
        for r in _JITTER_PX
    ]
)


@dataclass(frozen=True, slots=True, eq=False)
class PixelVerdict:
    """Which labels are right at N pixels."""

    right: dict[str, Bools]  # layer -> (N,)
    tied: Bools  # (N,) right by another triangle than the one that the centre's ray hit
    face: I64  # (N,) that triangle, -1 = nothing
    coincident: Bools  # (N,) tied, and the two triangles fill one place
    first: Cast  # the triangles that the centres' rays hit


def check_rays(case: ViewCase) -> None:
    """Judge the labels of some pixels, also behind glass and behind mirrors."""
    everything, triangles = case.scene, case.now.triangles
    basic = ("depth", "normal", "semantic", "instance")
    scenes: list[tuple[Scene, str, dict[str, str]]] = [
        (everything, "ray: ", {name: name for name in RAY_LAYERS}),
        (Scene(triangles, case.now.opaque), "ray: behind glass ", {name: f"behind_glass_{name}" for name in basic}),
    ]  # fmt: skip
    mirrored = {name: f"behind_mirror_{name}" for name in basic}
    if any(file in case.arrays for file in mirrored.values()):
        rays = MirrorRays(triangles, case.now.rays, case.view.eye)
        scenes.append((Scene(triangles, rays), "ray: behind mirror ", mirrored))
    rows, columns = case.pixels
    for scene, prefix, files in scenes:
        labels = {k: case.arrays[f][rows, columns] for k, f in files.items() if f in case.arrays}
        if not labels:
            continue
        labels = {k: a.astype(np.int64) if a.dtype.kind == "u" else a for k, a in labels.items()}
        verdict = judge_pixels(case.view, labels, case.pixels, scene)
        # Coincident surfaces are listed by pairs of items.
        of = verdict.coincident
        _note_pairs(case, verdict.first.face[of], verdict.face[of])
        if prefix == "ray: ":
            _note_glitter(case, verdict)
        ties = int((verdict.tied & ~verdict.coincident).sum())
        for layer, right in verdict.right.items():
            case.tally.add(f"{prefix}{layer}", len(rows), ties=ties)
            for k in np.nonzero(~right)[0]:
                place = f"row {rows[k]}, column {columns[k]}"
                case.tally.fail(f"{prefix}{layer}", case.place, place)


def _note_pairs(case: ViewCase, first: I64, second: I64) -> None:
    triangles = case.now.triangles
    for pair in np.stack([triangles.instance[first], triangles.instance[second]], axis=1):
        a, b = (triangles.item[int(i)] for i in pair)
        case.tally.coincide(case.place.partition("/")[0], (a, b))


def _note_glitter(case: ViewCase, verdict: PixelVerdict) -> None:
    """Report the pixels that show either of two colours, if a pair of items has more than a few."""
    instance = case.now.triangles.instance
    faces = of_another_colour(verdict.first)
    shown = np.nonzero((faces >= 0) & ~verdict.coincident)[0]
    first, second = verdict.first.face[shown], faces[shown]
    pairs = np.sort(np.stack([instance[first], instance[second]], 1), axis=1)
    _, number, n = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    many = n[number.reshape(-1)] > _MOST_COINCIDENT
    _note_pairs(case, first[many], second[many])


def judge_pixels(view: StoredView, labels: Labels, pixels: Pixels, scene: Scene) -> PixelVerdict:
    """Compare stored values of RAY_LAYERS at N pixels with rays through the scene."""
    first = Cast.of(view, *pixels, scene)
    face = first.face.copy()
    right = _explain(view, labels, first)
    tied = np.zeros(len(face), bool)

    # Try other triangles where the first triangle does not explain every label.
    open_ = np.nonzero(~np.logical_and.reduce(list(right.values())))[0]
    open_labels = {name: array[open_] for name, array in labels.items()}
    centre = first.some(open_)
    beside = [Cast.of(view, centre.rows + dy, centre.columns + dx, scene) for dx, dy in _JITTER]
    candidates = [cast.face for cast in beside]
    candidates.append(_coincident(open_labels, centre))
    if len(open_) <= _MOST_GRAZED:
        # At the outline of an item its far side meets the near one: the ray may graze either.
        candidates += [_coincident(open_labels, cast) for cast in beside]
    # Take a candidate that leaves fewer labels wrong.
    best = np.sum([~right[name][open_] for name in right], axis=0)
    for candidate in candidates:
        trial = _explain(view, open_labels, centre.at(candidate))
        wrong = np.sum([~ok for ok in trial.values()], axis=0)
        better = wrong < best
        best = np.where(better, wrong, best)
        face[open_[better]] = candidate[better]
        for name in right:
            right[name][open_[better]] = trial[name][better]
    tied[open_] = best == 0
    coincident = tied & _fill_one_place(first.face, first.at(face), tied)
    return PixelVerdict(right, tied, face, coincident, first)


def _fill_one_place(first: I64, second: Cast, chosen: Bools) -> Bools:
    """(N,) of the chosen pixels, those whose ray pierces two parallel triangles in one place."""
    triangles, rays = second.scene
    fill = np.zeros(len(first), bool)
    pixels = np.nonzero(chosen & (first >= 0) & second.hit & (first != second.face))[0]
    starts, legs, _way = rays.last_leg(second.origin, second.directions[pixels])
    for k, start, leg in zip(pixels, starts, legs, strict=True):
        pair, ray = np.array([first[k], second.face[k]]), second.directions[k]
        normals = rays.normal(pair, np.stack([ray, ray]))
        t = distances_pierced(triangles, pair, start, leg)
        if np.isfinite(t).all() and abs(normals[0] @ normals[1]) >= _PARALLEL:
            fill[k] = abs(t[0] - t[1]) * abs(normals[0] @ ray) <= _TIE_M
    return fill


def _explain(view: StoredView, labels: Labels, cast: Cast) -> dict[str, Bools]:
    """Layer -> (N,) True where hitting the faces of a cast explains the stored value."""
    return {n: np.asarray(_LABELS[n](stored, cast, view), bool) for n, stored in labels.items()}


def _error_mm(cast: Cast) -> F64:
    """(N,) tolerance of a depth in whole mm: rounding, and the ray's error on a slant."""
    cosine = np.abs(dot(cast.normal, cast.directions))
    slant_mm = _RAY_ERROR_MM * cast.z / np.maximum(cosine, 1e-9)
    return np.asarray(_ROUNDING_MM + np.minimum(slant_mm, _MAX_RAY_ERROR_MM))


def _mask(cast: Cast, chosen: Bools) -> NDArray[Any]:
    """(N,) 255 where something is hit and chosen, else 0."""
    return np.where(cast.hit & chosen, 255, 0)


def _where_hit(cast: Cast, function: Callable[[Cast], Any], *width: int) -> F64:
    """(N, *width) values of a function of the rays that hit anything, else 0."""
    values = np.zeros((len(cast), *width))
    values[cast.hit] = function(cast.some(cast.hit))
    return values


def _depth_is_right(stored: NDArray[Any], cast: Cast, _view: StoredView) -> Bools:
    mm = np.clip(cast.z * 1000, 0.5, 65535)
    return np.where(cast.hit, np.abs(stored - mm) <= _error_mm(cast), stored == 0)


def _position_is_right(stored: NDArray[Any], cast: Cast, _view: StoredView) -> Bools:
    near = np.abs(stored - cast.point).max(axis=1) <= _METRES
    return np.where(cast.hit, near, ~stored.any(axis=1))


def _shading_is_right(stored: NDArray[Any], cast: Cast, view: StoredView) -> Bools:
    of = cast.scene.triangles.shading_normals
    normals = _where_hit(cast, lambda hit: of(hit.face, hit.point, hit.normal), 3)
    published = published_directions(normals, view.world_from_camera)
    return normal_is_right(stored, published, _SHADING_DEG)


def _albedo_is_right(stored: NDArray[Any], cast: Cast, view: StoredView) -> Bools:
    return np.asarray(np.abs(stored - albedo_of(view, cast)).max(axis=1) <= _ALBEDO_STEPS)


def albedo_of(view: StoredView, cast: Cast) -> F64:
    """(N, 3) sRGB 0..255 of the materials at the hits; 0 for nothing."""
    is_physical = view.recipe is not None and view.recipe.materials.preset == "physical"
    most = _PHYSICAL_ALBEDO if is_physical else 1.0

    def colour(hit: Cast) -> F64:
        point = np.where(np.isfinite(hit.point), hit.point, 0.0)
        return cast.scene.triangles.colour_at(hit.face, point, most)

    return _where_hit(cast, colour, 3)


def _roughness_is_right(stored: NDArray[Any], cast: Cast, _view: StoredView) -> Bools:
    of = cast.scene.triangles.alpha_at
    alpha = _where_hit(cast, lambda hit: of(hit.face, hit.point))
    return np.asarray(np.abs(stored - 255 * np.sqrt(alpha)) <= _ROUGHNESS_STEPS)


def _f0_is_right(stored: NDArray[Any], cast: Cast, _view: StoredView) -> Bools:
    triangles = cast.scene.triangles
    linear = _where_hit(cast, lambda hit: triangles.finishes.f0[triangles.material[hit.face]], 3)
    return np.asarray(np.abs(stored - 255 * srgb_from_linear(linear)).max(axis=1) <= 0.51)


def _is_metal(cast: Cast) -> Bools:
    triangles = cast.scene.triangles
    return np.asarray(cast.of_face(triangles.of_material(triangles.finishes.is_metal)), bool)


def _nocs_is_right(stored: NDArray[Any], cast: Cast, view: StoredView) -> Bools:
    """(N,) stored model coordinates are those of the points; 0 off placed models."""
    triangles, instance, point = cast.scene.triangles, cast.instance, cast.point
    right = np.asarray(~stored.any(axis=1), bool)
    for row in view.table["instances"]:
        chosen = instance == int(row["id"])
        if "world_from_model" not in row or not chosen.any():
            continue
        pose = np.array(row["world_from_model"], np.float64)
        # The model's box, and the points, in the model's own frame.
        box = _in_model(pose, triangles.points_of(triangles.instance == int(row["id"])))
        middle, extent = (box.max(0) + box.min(0)) / 2, np.sqrt((np.ptp(box, axis=0) ** 2).sum())
        expected = 0.5 + (_in_model(pose, point[chosen]) - middle) / extent
        tolerance = _METRES / extent + 1 / 65535
        close = (np.abs(stored[chosen] / 65535 - expected) <= tolerance).all(axis=1)
        right[chosen] = close & stored[chosen].any(axis=1)
    return right


def _in_model(pose: F64, points: F64) -> F64:
    """(N, 3) world points in the frame of a pose, which may be off a rotation."""
    local = np.linalg.solve(pose[:3, :3], (points - pose[:3, 3]).T)
    return np.asarray(local.T, np.float64)


def _part_is_right(stored: NDArray[Any], cast: Cast, view: StoredView) -> Bools:
    """(N,) the part's row in articulation.json names the part of the face; 0 for static faces."""
    rows = {int(row["id"]): (int(row["instance"]), str(row["part"])) for row in view.parts}
    names, parts = cast.scene.triangles.parts, cast.of_face(cast.scene.triangles.part)
    return np.array(
        [
            rows.get(int(number)) == (int(instance), names[part]) if number else part == 0
            for number, instance, part in zip(stored, cast.instance, parts, strict=True)
        ],
        bool,
    )


def normal_is_right(
    stored: NDArray[Any], expected: F64, tolerance_deg: float = _NORMAL_DEG
) -> Bools:
    """(N,) stored 16-bit normals (N, 3) decode to the expected unit vectors; where those are 0, to nothing."""
    # The sine is more accurate than the cosine for small angles.
    normals = stored_normals(stored)
    length = np.linalg.norm(normals, axis=1)
    sine = np.linalg.norm(np.cross(normals, expected), axis=1)
    is_near = sine <= np.radians(tolerance_deg) * length
    close = (dot(normals, expected) > 0) & is_near & (np.abs(length - 1) < 1e-3)
    nothing = (stored == 32768).all(axis=1)
    return np.asarray(np.where(expected.any(axis=1), close, nothing), bool)


def _coincident(labels: Labels, cast: Cast) -> I64:
    """(N,) another triangle of the stored instance pierced at the first hit's depth (a doubled face), or -1."""
    if "instance" not in labels:
        return np.full(len(cast), -1, np.int64)

    @functools.cache
    def of_instance(instance: int) -> I64:
        return np.nonzero(cast.scene.triangles.instance == instance)[0]

    def candidates(k: int) -> I64:
        faces = of_instance(int(labels["instance"][k]))
        return np.asarray(faces[faces != cast.face[k]])

    return _pierced_beside(cast, candidates)


def of_another_colour(cast: Cast) -> I64:
    """(N,) a coincident triangle of another material (the picture shows either), or -1."""
    triangles, face = cast.scene.triangles, cast.face
    planes = _number_planes(triangles.vertices.astype(np.float64)[triangles.faces])
    order = np.argsort(planes, kind="stable")
    last = np.searchsorted(planes[order], planes, side="right")
    start = np.searchsorted(planes[order], planes, side="left")

    def candidates(k: int) -> I64:
        faces = order[start[face[k]] : last[face[k]]] if face[k] >= 0 else order[:0]
        return np.asarray(faces[triangles.material[faces] != triangles.material[face[k]]])

    return _pierced_beside(cast, candidates)


def of_another_part(cast: Cast) -> I64:
    """(N,) a coincident triangle of another item or part, as where a leaf crosses its frame, or -1."""
    triangles, face, point = cast.scene.triangles, cast.face, cast.point
    corners = triangles.vertices.astype(np.float64)[triangles.faces]
    low, high = corners.min(1) - _TIE_M, corners.max(1) + _TIE_M

    def candidates(k: int) -> I64:
        is_other = triangles.instance != triangles.instance[face[k]]
        is_other |= triangles.part != triangles.part[face[k]]
        is_other &= bool(face[k] >= 0)
        return np.nonzero(is_other & ((low <= point[k]) & (point[k] <= high)).all(1))[0]

    return _pierced_beside(cast, candidates)


def _pierced_beside(cast: Cast, candidates: Callable[[int], I64]) -> I64:
    """(N,) of each ray's candidate triangles, the one that it pierces at the depth of its hit, or -1."""
    triangles, rays = cast.scene
    nearest = np.full(len(cast), -1, np.int64)
    starts, legs, way = rays.last_leg(cast.origin, cast.directions)
    depth = cast.z - way
    # Measure gaps across the surface: along a slanting ray they are longer.
    across = np.abs(dot(cast.normal, cast.directions))
    for ray, faces in _candidate_batches(candidates, len(cast)):
        gap = np.abs(distances_pierced(triangles, faces, starts[ray], legs[ray]) - depth[ray])
        order = np.lexsort((gap, ray))
        least = order[np.unique(ray[order], return_index=True)[1]]
        ties = least[gap[least] * across[ray[least]] <= _TIE_M]
        nearest[ray[ties]] = faces[ties]
    return rays.without_holes(nearest, cast.origin, cast.directions)


def _candidate_batches(candidates: Callable[[int], I64], n_rays: int) -> Iterator[tuple[I64, I64]]:
    """(ray, face) pairs of all rays and their candidates, some 100,000 at a time, each ray's together."""
    parts: list[I64] = []
    n_faces = 0
    for k in range(n_rays):
        parts.append(candidates(k))
        n_faces += len(parts[-1])
        if k == n_rays - 1 or n_faces > _BATCH:
            rays = np.arange(k + 1 - len(parts), k + 1)
            yield np.repeat(rays, [len(faces) for faces in parts]), np.concatenate(parts)
            parts, n_faces = [], 0


def _number_planes(corners: F64) -> I64:
    """(F,) the number of each triangle's plane, whichever way it faces; planes 0.1 mm apart differ."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.nan_to_num(normal)
    largest = np.take_along_axis(normal, np.abs(normal).argmax(1)[:, None], 1)
    normal *= np.where(largest < 0, -1.0, 1.0)
    offset = dot(normal, corners[:, 0])
    keys = np.round(np.column_stack([normal * 1e3, offset / _TIE_M])).astype(np.int64)
    return np.asarray(np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1), np.int64)


def distances_pierced(triangles: Triangles, faces: I64, origin: F64, ray: F64) -> F64:
    """(F,) distance at which rays pierce triangles, in lengths of ray; inf = misses it; one ray (3,) or (F, 3)."""
    a, b, c = (triangles.vertices[triangles.faces[faces, k]].astype(np.float64) for k in range(3))
    # Moeller and Trumbore 1997.
    e1, e2, s = b - a, c - a, origin - a
    p = np.cross(ray, e2)
    q = np.cross(s, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / dot(e1, p)
        # Barycentric coordinates, with slack at the edges, and the distance.
        u, v = dot(s, p) * inverse, dot(q, ray) * inverse
        t = dot(e2, q) * inverse
        inside = (u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6) & (t > 0)
    return np.where(inside, t, np.inf)


# Layer -> which of its stored values are right.
_LABELS: Final[Mapping[str, Callable[[NDArray[Any], Cast, StoredView], Any]]] = {
    "instance": lambda stored, cast, _view: stored == cast.instance,
    "semantic": lambda stored, cast, _view: stored == cast.scene.triangles.classes[cast.instance],
    "depth": _depth_is_right,
    "normal": lambda stored, cast, view: normal_is_right(
        stored, published_directions(cast.normal, view.world_from_camera)
    ),
    "valid": lambda stored, cast, _view: stored == np.where(cast.hit, 255, 0),
    "depth_z": lambda stored, cast, _view: np.where(
        cast.hit, np.abs(stored - cast.z) <= _METRES, stored == 0
    ),
    "position": _position_is_right,
    "normal_world": lambda stored, cast, _view: normal_is_right(stored, cast.normal),
    "material": lambda stored, cast, _view: (
        stored == cast.of_face(cast.scene.triangles.material + 1)
    ),
    "glass": lambda stored, cast, _view: (
        stored == _mask(cast, cast.of_face(cast.scene.triangles.see_through))
    ),
    "mirror": lambda stored, cast, _view: (
        stored == _mask(cast, cast.scene.triangles.kinds_of(cast.face) == "mirror")
    ),
    "roughness": _roughness_is_right,
    "metallic": lambda stored, cast, _view: stored == _mask(cast, _is_metal(cast)),
    "f0": _f0_is_right,
    "normal_shading": _shading_is_right,
    "nocs": _nocs_is_right,
    "part": _part_is_right,
    "albedo": _albedo_is_right,
}

RAY_LAYERS: Final = tuple(_LABELS)
"""Layers that a ray through the pixel's centre decides."""


CHECKS = (Check("ray", "view", check_rays, 90),)
