"""Every label of a pixel against an independent ray through its centre; no effects.

A ray that grazes an edge, or meets two surfaces in the same place, has more than one right
answer. If the centre's answer does not explain the stored labels, the triangles next to it (rays
at most 0.02 px away) and those of the stored instance at the same depth are tried. If one of them
explains every layer together the pixel is a tie, which is counted; otherwise it failed. A tie of
two parallel surfaces within 0.1 mm is a fault of the source: a window frame in the plane of its wall.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.axes import dot, published_directions, stored_normals
from pbrs_farm.check.cases import Pixels, Scene, ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import srgb_from_linear
from pbrs_farm.check.mirror_rays import MirrorRays
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64, I64, Bools

Labels = dict[str, NDArray[Any]]  # layer -> stored values at N pixels: (N,) or (N, 3)

_ROUNDING_MM = 0.505  # tolerance of depth stored in whole mm
_RAY_ERROR_MM = 2e-4  # per metre of depth, over the cosine: float32 directions on a slanting face
_MAX_RAY_ERROR_MM = 5.0
_NORMAL_DEG = 0.02  # tolerance of a normal
_SHADING_DEG = 0.5  # the same between texels of a map, whose bytes are half a degree apart
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
    first: I64  # (N,) the triangle that the centre's ray hit, -1 = nothing


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
        rays = MirrorRays(triangles, case.now.rays, case.view.world_from_camera[:3, 3])
        scenes.append((Scene(triangles, rays), "ray: behind mirror ", mirrored))
    rows, columns = case.pixels
    for scene, prefix, files in scenes:
        labels = {k: case.arrays[f][rows, columns] for k, f in files.items() if f in case.arrays}
        if not labels:
            continue
        labels = {k: a.astype(np.int64) if a.dtype.kind == "u" else a for k, a in labels.items()}
        verdict = judge_pixels(case.view, labels, case.pixels, scene)
        # Coincident surfaces are listed by pairs of items.
        _note_pairs(case, verdict.first[verdict.coincident], verdict.face[verdict.coincident])
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
    origin, directions = case.view.rays(*case.pixels)
    faces = of_another_colour(verdict.first, origin, directions, case.scene)
    shown = np.nonzero((faces >= 0) & ~verdict.coincident)[0]
    first, second = verdict.first[shown], faces[shown]
    pairs = np.sort(np.stack([instance[first], instance[second]], 1), axis=1)
    _, number, n = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    many = n[number.reshape(-1)] > _MOST_COINCIDENT
    _note_pairs(case, first[many], second[many])


def judge_pixels(view: StoredView, labels: Labels, pixels: Pixels, scene: Scene) -> PixelVerdict:
    """Compare stored values of RAY_LAYERS at N pixels with rays through the scene."""
    rays, (rows, columns) = scene.rays, pixels
    origin, directions = view.rays(rows, columns)
    first = rays.first(origin, directions)
    face = first.copy()
    right = _explain(view, labels, face, directions, scene)
    tied = np.zeros(len(rows), bool)

    # Try other triangles where the first triangle does not explain every label.
    open_ = np.nonzero(~np.logical_and.reduce(list(right.values())))[0]
    open_labels = {name: array[open_] for name, array in labels.items()}
    beside = [view.rays(rows[open_] + dy, columns[open_] + dx)[1] for dx, dy in _JITTER]
    candidates = [rays.first(origin, ray) for ray in beside]
    candidates.append(_coincident(open_labels, face[open_], origin, directions[open_], scene))
    if len(open_) <= _MOST_GRAZED:
        # At the outline of an item its far side meets the near one: the ray may graze either.
        grazed = zip(candidates[: len(beside)], beside, strict=True)
        candidates += [_coincident(open_labels, c, origin, ray, scene) for c, ray in grazed]
    # Take a candidate that leaves fewer labels wrong.
    best = np.sum([~right[name][open_] for name in right], axis=0)
    for candidate in candidates:
        trial = _explain(view, open_labels, candidate, directions[open_], scene)
        wrong = np.sum([~ok for ok in trial.values()], axis=0)
        better = wrong < best
        best = np.where(better, wrong, best)
        face[open_[better]] = candidate[better]
        for name in right:
            right[name][open_[better]] = trial[name][better]
    tied[open_] = best == 0
    coincident = tied & _fill_one_place(first, face, tied, origin, directions, scene)
    return PixelVerdict(right, tied, face, coincident, first)


def _fill_one_place(
    first: I64, second: I64, chosen: Bools, origin: F64, directions: F64, scene: Scene
) -> Bools:
    """(N,) of the chosen pixels, those whose ray pierces two parallel triangles in one place."""
    triangles, rays = scene
    fill = np.zeros(len(first), bool)
    pixels = np.nonzero(chosen & (first >= 0) & (second >= 0) & (first != second))[0]
    starts, legs, _way = rays.last_leg(origin, directions[pixels])
    for k, start, leg in zip(pixels, starts, legs, strict=True):
        pair, ray = np.array([first[k], second[k]]), directions[k]
        normals = rays.normal(pair, np.stack([ray, ray]))
        t = distances_pierced(triangles, pair, start, leg)
        if np.isfinite(t).all() and abs(normals[0] @ normals[1]) >= _PARALLEL:
            fill[k] = abs(t[0] - t[1]) * abs(normals[0] @ ray) <= _TIE_M
    return fill


def _explain(
    view: StoredView, labels: Labels, face: I64, directions: F64, scene: Scene
) -> dict[str, Bools]:
    """Layer -> (N,) True where hitting these faces explains the stored value."""
    triangles, rays = scene
    classes = np.zeros(max(triangles.nyu40, default=0) + 1, np.int64)
    classes[list(triangles.nyu40)] = list(triangles.nyu40.values())
    z = rays.distance(face, view.world_from_camera[:3, 3], directions)
    hits = _Hits(view, triangles, classes, face, z, rays.normal(face, directions), directions)
    return {name: np.asarray(_LABELS[name](stored, hits), bool) for name, stored in labels.items()}


@dataclass(frozen=True, slots=True, eq=False)
class _Hits:
    """N pixels and the faces that their rays are assumed to hit."""

    view: StoredView
    triangles: Triangles
    classes: I64  # instance -> NYU40
    face: I64  # (N,), -1 = nothing
    z: F64  # (N,) metres along the ray, in units of directions
    normal: F64  # (N, 3) of the face, world
    directions: F64  # (N, 3)

    @property
    def hit(self) -> Bools:
        return self.face >= 0

    @property
    def instance(self) -> I64:
        return self.of_face(self.triangles.instance)

    @property
    def point(self) -> F64:
        return np.asarray(self.view.world_from_camera[:3, 3] + self.directions * self.z[:, None])

    @property
    def depth_error_mm(self) -> F64:
        """(N,) tolerance of a depth in whole mm: rounding, and the ray's error on a slant."""
        cosine = np.abs(dot(self.normal, self.directions))
        slant_mm = _RAY_ERROR_MM * self.z / np.maximum(cosine, 1e-9)
        return np.asarray(_ROUNDING_MM + np.minimum(slant_mm, _MAX_RAY_ERROR_MM))

    def of_face(self, table: NDArray[Any]) -> NDArray[Any]:
        """(N,) table[face], 0 where face is -1."""
        if not len(table):
            return np.zeros(len(self.face), table.dtype)
        return np.where(self.hit, table[self.face], table.dtype.type(0))

    def mask(self, chosen: Bools) -> NDArray[Any]:
        """(N,) 255 where something is hit and chosen, else 0."""
        return np.where(self.hit & chosen, 255, 0)

    def where_hit(self, function: Callable[[I64, F64, Any], Any], *width: int) -> F64:
        """(N, *width) function(face, point, index) where something is hit, else 0."""
        values = np.zeros((len(self.face), *width))
        hit = np.nonzero(self.hit)[0]
        values[hit] = function(self.face[hit], self.point[hit], hit)
        return values


def _depth_is_right(stored: NDArray[Any], hits: _Hits) -> Bools:
    mm = np.clip(hits.z * 1000, 0.5, 65535)
    return np.where(hits.hit, np.abs(stored - mm) <= hits.depth_error_mm, stored == 0)


def _position_is_right(stored: NDArray[Any], hits: _Hits) -> Bools:
    near = np.abs(stored - hits.point).max(axis=1) <= _METRES
    return np.where(hits.hit, near, ~stored.any(axis=1))


def _shading_is_right(stored: NDArray[Any], hits: _Hits) -> Bools:
    normals = hits.where_hit(
        lambda face, point, k: hits.triangles.shading_normals(face, point, hits.normal[k]), 3
    )
    published = published_directions(normals, hits.view.world_from_camera)
    return normal_is_right(stored, published, _SHADING_DEG)


def _albedo_is_right(stored: NDArray[Any], hits: _Hits) -> Bools:
    expected = albedo_of_faces(hits.view, hits.face, hits.point, hits.triangles)
    return np.asarray(np.abs(stored - expected).max(axis=1) <= _ALBEDO_STEPS)


def albedo_of_faces(view: StoredView, face: I64, point: F64, triangles: Triangles) -> F64:
    """(N, 3) sRGB 0..255 of the materials at points (N, 3) on faces; 0 where face is -1."""
    colours = np.zeros((len(face), 3))
    hit = np.nonzero(face >= 0)[0]
    is_physical = view.recipe is not None and view.recipe.materials.preset == "physical"
    most = _PHYSICAL_ALBEDO if is_physical else 1.0
    colours[hit] = triangles.colour_at(face[hit], point[hit], most)
    return colours


def _roughness_is_right(stored: NDArray[Any], hits: _Hits) -> Bools:
    alpha = hits.where_hit(lambda face, point, _k: hits.triangles.alpha_at(face, point))
    return np.asarray(np.abs(stored - 255 * np.sqrt(alpha)) <= _ROUGHNESS_STEPS)


def _f0_is_right(stored: NDArray[Any], hits: _Hits) -> Bools:
    triangles = hits.triangles
    linear = hits.where_hit(lambda face, *_: triangles.finishes.f0()[triangles.material[face]], 3)
    return np.asarray(np.abs(stored - 255 * srgb_from_linear(linear)).max(axis=1) <= 0.51)


def _nocs_is_right(stored: NDArray[Any], hits: _Hits) -> Bools:
    """(N,) stored model coordinates are those of the points; 0 off placed models."""
    triangles, instance, point = hits.triangles, hits.instance, hits.point
    right = np.asarray(~stored.any(axis=1), bool)
    for row in hits.view.table["instances"]:
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


def _part_is_right(stored: NDArray[Any], hits: _Hits) -> Bools:
    """(N,) the part's row in articulation.json names the part of the face; 0 for static faces."""
    rows = {int(row["id"]): (int(row["instance"]), str(row["part"])) for row in hits.view.parts}
    names, parts = hits.triangles.parts, hits.of_face(hits.triangles.part)
    return np.array(
        [
            rows.get(int(number)) == (int(instance), names[part]) if number else part == 0
            for number, instance, part in zip(stored, hits.instance, parts, strict=True)
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


def _coincident(labels: Labels, face: I64, origin: F64, directions: F64, scene: Scene) -> I64:
    """(N,) another triangle of the stored instance pierced at the first hit's depth (a doubled face), or -1."""
    if "instance" not in labels:
        return np.full(len(face), -1, np.int64)

    @functools.cache
    def of_instance(instance: int) -> I64:
        return np.nonzero(scene.triangles.instance == instance)[0]

    def candidates(k: int) -> I64:
        faces = of_instance(int(labels["instance"][k]))
        return np.asarray(faces[faces != face[k]])

    return _pierced_beside(face, origin, directions, scene, candidates)


def of_another_colour(face: I64, origin: F64, directions: F64, scene: Scene) -> I64:
    """(N,) a coincident triangle of another material (the picture shows either), or -1."""
    triangles = scene.triangles
    planes = _number_planes(triangles.vertices.astype(np.float64)[triangles.faces])
    order = np.argsort(planes, kind="stable")
    last = np.searchsorted(planes[order], planes, side="right")
    start = np.searchsorted(planes[order], planes, side="left")

    def candidates(k: int) -> I64:
        faces = order[start[face[k]] : last[face[k]]] if face[k] >= 0 else order[:0]
        return np.asarray(faces[triangles.material[faces] != triangles.material[face[k]]])

    return _pierced_beside(face, origin, directions, scene, candidates)


def of_another_part(face: I64, origin: F64, directions: F64, scene: Scene) -> I64:
    """(N,) a coincident triangle of another item or part, as where a leaf crosses its frame, or -1."""
    triangles, rays = scene
    corners = triangles.vertices.astype(np.float64)[triangles.faces]
    low, high = corners.min(1) - _TIE_M, corners.max(1) + _TIE_M
    distance = rays.distance(face, origin, directions)

    def candidates(k: int) -> I64:
        point = origin + distance[k] * directions[k]
        is_other = triangles.instance != triangles.instance[face[k]]
        is_other |= triangles.part != triangles.part[face[k]]
        is_other &= bool(face[k] >= 0)
        return np.nonzero(is_other & ((low <= point) & (point <= high)).all(1))[0]

    return _pierced_beside(face, origin, directions, scene, candidates)


def _pierced_beside(
    face: I64, origin: F64, directions: F64, scene: Scene, candidates: Callable[[int], I64]
) -> I64:
    """(N,) of each ray's candidate triangles, the one that it pierces at the depth of face, or -1."""
    triangles, rays = scene
    nearest = np.full(len(face), -1, np.int64)
    starts, legs, way = rays.last_leg(origin, directions)
    depth = rays.distance(face, origin, directions) - way
    # Measure gaps across the surface: along a slanting ray they are longer.
    across = np.abs(dot(rays.normal(face, directions), directions))
    for k in range(len(face)):
        faces = candidates(k)
        if len(faces):
            gap = np.abs(distances_pierced(triangles, faces, starts[k], legs[k]) - depth[k])
            if gap.min() * across[k] <= _TIE_M:
                nearest[k] = faces[gap.argmin()]
    return rays.without_holes(nearest, origin, directions)


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
    """(F,) distance at which a ray pierces each of some triangles, in lengths of ray; inf = misses it."""
    a, b, c = (triangles.vertices[triangles.faces[faces, k]].astype(np.float64) for k in range(3))
    # Moeller and Trumbore 1997, one ray and many triangles.
    e1, e2, s = b - a, c - a, origin - a
    p = np.cross(ray, e2)
    q = np.cross(s, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / dot(e1, p)
        # Barycentric coordinates, with slack at the edges, and the distance.
        u, v = dot(s, p) * inverse, (q @ ray) * inverse
        t = dot(e2, q) * inverse
        inside = (u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6) & (t > 0)
    return np.where(inside, t, np.inf)


# Layer -> which of its stored values are right.
_LABELS: Final[Mapping[str, Callable[[NDArray[Any], _Hits], Any]]] = {
    "instance": lambda stored, hits: stored == hits.instance,
    "semantic": lambda stored, hits: stored == hits.classes[hits.instance],
    "depth": _depth_is_right,
    "normal": lambda stored, hits: normal_is_right(
        stored, published_directions(hits.normal, hits.view.world_from_camera)
    ),
    "valid": lambda stored, hits: stored == np.where(hits.hit, 255, 0),
    "depth_z": lambda stored, hits: np.where(
        hits.hit, np.abs(stored - hits.z) <= _METRES, stored == 0
    ),
    "position": _position_is_right,
    "normal_world": lambda stored, hits: normal_is_right(stored, hits.normal),
    "material": lambda stored, hits: stored == hits.of_face(hits.triangles.material + 1),
    "glass": lambda stored, hits: stored == hits.mask(hits.of_face(hits.triangles.see_through)),
    "mirror": lambda stored, hits: (
        stored == hits.mask(hits.triangles.kinds_of(hits.face) == "mirror")
    ),
    "roughness": _roughness_is_right,
    "metallic": lambda stored, hits: (
        stored
        == hits.mask(hits.of_face(hits.triangles.of_material(hits.triangles.finishes.is_metal())))
    ),
    "f0": _f0_is_right,
    "normal_shading": _shading_is_right,
    "nocs": _nocs_is_right,
    "part": _part_is_right,
    "albedo": _albedo_is_right,
}

RAY_LAYERS: Final = tuple(_LABELS)
"""Layers that a ray through the pixel's centre decides."""


CHECKS = (Check("ray", "view", check_rays, 90),)
