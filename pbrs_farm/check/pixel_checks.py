"""Every label of a pixel against what an independent ray through its centre finds; no effects.

A ray that grazes an edge, or meets two surfaces in the same place, has more than one right
answer. Where the centre's answer does not explain what is stored, the triangles next to it (rays
at most 0.02 px away) and those of the stored instance at the same depth are tried. If one of them
explains every layer at once the pixel is a tie, which is counted; otherwise it failed. A tie of
two parallel surfaces within 0.1 mm is the source's own: a window frame in the plane of its wall.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.embree_caster import Faces, Floats, Hits, Rays
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView

Bools = NDArray[np.bool_]
Labels = dict[str, NDArray[Any]]  # layer -> what is stored at N pixels: (N,) or (N, 3)

ROUNDING_MM = 0.505  # of depth stored in whole mm
# Per metre of depth, over the cosine: rays with float32 directions, magnified by a slanting face.
RAY_ERROR_MM = 2e-4
MAX_RAY_ERROR_MM = 5.0
NORMAL_TOLERANCE_DEG = 0.02
SHADING_TOLERANCE_DEG = (
    0.5  # of a normal between texels of a map, whose bytes are half a degree apart
)
TIE_DEPTH_M = 1e-4  # two surfaces closer than this, across them, may both be hit
METRES = 2e-4  # tolerance of depths and positions stored as floats
ALBEDO_STEPS = 2  # of 255, by which an albedo may differ
ROUGHNESS_STEPS = 2  # of 255, by which a roughness of a map may differ
PHYSICAL_ALBEDO = (
    0.9  # that light holds colour times texture to, materials of the recipe's `physical`
)

_PARALLEL = 0.999  # least cosine between the normals of coincident surfaces
# From the pixel's centre to the neighbouring rays: a silhouette may be nearer than a thin thing is wide.
_JITTER_PX = (0.02, 0.005, 0.002)
_JITTER = np.concatenate(
    [
        r * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]])
        for r in _JITTER_PX
    ]
)


def labels_at(labels: Labels, index: NDArray[np.int64]) -> Labels:
    """The labels of some of the pixels."""
    return {name: array[index] for name, array in labels.items()}


@dataclass(frozen=True, slots=True, eq=False)
class PixelChecks:
    """What is right at N pixels."""

    right: dict[str, Bools]  # check -> (N,) what is stored is right
    tied: Bools  # (N,) right by another triangle than the one that the centre's ray hit
    face: Faces  # (N,) that triangle, -1 = nothing
    coincident: Bools  # (N,) tied, and the two triangles fill one place
    first: Faces  # (N,) the triangle that the centre's ray hit, -1 = nothing


def judge(
    view: StoredView,
    labels: Labels,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    scene: tuple[Triangles, Hits],
) -> PixelChecks:
    """Compare labels at pixels (rows, columns) with rays through the scene.

    labels: layer -> (N,) or (N, 3) stored values, of RAY_LAYERS. rows, columns: (N,). Where the ray
    through a centre does not explain what is stored, rays beside it and coincident surfaces
    are tried; the result says which checks hold by the triangle that explains most, and where that
    was a tie.
    """
    # Explain what is stored by the triangle that the centre's ray hits.
    _, rays = scene
    origin, directions = view.rays(rows, columns)
    first = rays.first(origin, directions)
    face = first.copy()
    right = _explain(view, labels, face, directions, scene)
    tied = np.zeros(len(rows), bool)

    # Try other triangles where the first one does not explain everything.
    open_ = np.nonzero(~np.logical_and.reduce(list(right.values())))[0]
    candidates = [
        rays.first(origin, view.rays(rows[open_] + dy, columns[open_] + dx)[1])
        for dx, dy in _JITTER
    ]
    candidates.append(
        _coincident(labels_at(labels, open_), face[open_], origin, directions[open_], scene)
    )
    # Take over a candidate where it leaves fewer checks wrong.
    best = np.sum([~right[name][open_] for name in right], axis=0)
    for other in candidates:
        trial = _explain(view, labels_at(labels, open_), other, directions[open_], scene)
        wrong = np.sum([~ok for ok in trial.values()], axis=0)
        better = wrong < best
        best = np.where(better, wrong, best)
        face[open_[better]] = other[better]
        for name in right:
            right[name][open_[better]] = trial[name][better]
    tied[open_] = best == 0
    coincident = tied & _fill_one_place(first, face, tied, origin, directions, scene)
    return PixelChecks(right, tied, face, coincident, first)


def _fill_one_place(
    first: Faces,
    other: Faces,
    chosen: Bools,
    origin: Floats,
    directions: Floats,
    scene: tuple[Triangles, Hits],
) -> Bools:
    """(N,) of the chosen pixels, those whose ray pierces two parallel triangles in one place."""
    triangles, rays = scene
    found = np.zeros(len(first), bool)
    # Only pixels where both rays hit something, and not the same triangle.
    both = np.nonzero(chosen & (first >= 0) & (other >= 0) & (first != other))[0]
    starts, legs, _way = rays.last_leg(origin, directions[both])
    for k, start, leg in zip(both, starts, legs, strict=True):
        pair, ray = np.array([first[k], other[k]]), directions[k]
        normals = rays.normal(pair, np.stack([ray, ray]))
        t = distances_pierced(triangles, pair, start, leg)
        # One place: parallel, and closer along the normal than a tie may be.
        if np.isfinite(t).all() and abs(normals[0] @ normals[1]) >= _PARALLEL:
            found[k] = abs(t[0] - t[1]) * abs(normals[0] @ ray) <= TIE_DEPTH_M
    return found


def _explain(
    view: StoredView, labels: Labels, face: Faces, directions: Floats, scene: tuple[Triangles, Hits]
) -> dict[str, Bools]:
    """Per layer whether hitting these faces explains what is stored."""
    triangles, rays = scene
    classes = np.zeros(max(triangles.nyu40, default=0) + 1, np.int64)
    classes[list(triangles.nyu40)] = list(triangles.nyu40.values())
    z = rays.distance(face, view.world_from_camera[:3, 3], directions)
    pierced = _Pierced(view, triangles, classes, face, z, rays.normal(face, directions), directions)
    return {
        name: np.asarray(_CHECKS[name](stored, pierced), bool) for name, stored in labels.items()
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Pierced:
    """N pixels and the faces that their rays are taken to meet."""

    view: StoredView
    triangles: Triangles
    classes: NDArray[np.int64]  # instance -> NYU40
    face: Faces  # (N,), -1 = nothing
    z: Floats  # (N,) metres along the ray, in units of directions
    normal: Floats  # (N, 3) of the face, world
    directions: Floats  # (N, 3)

    @property
    def hit(self) -> Bools:
        return self.face >= 0

    @property
    def instance(self) -> NDArray[np.int64]:
        return _of_face(self.triangles.instance, self.face)

    @property
    def point(self) -> Floats:
        return np.asarray(self.view.world_from_camera[:3, 3] + self.directions * self.z[:, None])

    @property
    def depth_error_mm(self) -> Floats:
        """(N,) by which a depth in whole mm may differ: rounding, and what the ray loses on a slant."""
        cosine = np.abs(np.einsum("ni,ni->n", self.normal, self.directions))
        slant_mm = RAY_ERROR_MM * self.z / np.maximum(cosine, 1e-9)
        return np.asarray(ROUNDING_MM + np.minimum(slant_mm, MAX_RAY_ERROR_MM))


def _depth_is_right(stored: NDArray[Any], at: _Pierced) -> Bools:
    mm = np.clip(at.z * 1000, 0.5, 65535)
    return np.where(at.hit, np.abs(stored - mm) <= at.depth_error_mm, stored == 0)


def _position_is_right(stored: NDArray[Any], at: _Pierced) -> Bools:
    near = np.abs(stored - at.point).max(axis=1) <= METRES
    return np.where(at.hit, near, ~stored.any(axis=1))


def _shading_is_right(stored: NDArray[Any], at: _Pierced) -> Bools:
    expected = np.zeros(at.point.shape)
    hit = np.nonzero(at.hit)[0]
    expected[hit] = at.triangles.shading_normals(at.face[hit], at.point[hit], at.normal[hit])
    return normal_is_right(stored, published_axes(expected, at.view), SHADING_TOLERANCE_DEG)


def _albedo_is_right(stored: NDArray[Any], at: _Pierced) -> Bools:
    expected = albedo_of_faces(at.view, at.face, at.point, at.triangles)
    return np.asarray(np.abs(stored - expected).max(axis=1) <= ALBEDO_STEPS + 0.5)


def albedo_of_faces(view: StoredView, face: Faces, point: Floats, triangles: Triangles) -> Floats:
    """(N, 3) sRGB 0..255 of the materials at points (N, 3) on faces; 0 where face is -1."""
    found = np.zeros((len(face), 3))
    hit = np.nonzero(face >= 0)[0]
    at = triangles.uv_at(face[hit], point[hit])
    is_physical = view.recipe is not None and view.recipe.materials.preset == "physical"
    most = PHYSICAL_ALBEDO if is_physical else 1.0
    found[hit] = triangles.colours.at(triangles.material[face[hit]], at, most)
    return found


def _roughness_is_right(stored: NDArray[Any], at: _Pierced) -> Bools:
    expected = np.zeros(len(at.face))
    hit = np.nonzero(at.hit)[0]
    expected[hit] = 255 * np.sqrt(at.triangles.alpha_at(at.face[hit], at.point[hit]))
    return np.asarray(np.abs(stored - expected) <= ROUGHNESS_STEPS + 0.5)


def _f0_is_right(stored: NDArray[Any], at: _Pierced) -> Bools:
    linear = np.zeros((len(at.face), 3))
    linear[at.hit] = at.triangles.finishes.f0()[at.triangles.material[at.face[at.hit]]]
    low = linear * 12.92
    srgb = np.where(linear <= 0.0031308, low, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    return np.asarray(np.abs(stored - 255 * srgb).max(axis=1) <= 0.51)


def _metallic_is_right(stored: NDArray[Any], at: _Pierced) -> Bools:
    metal = at.triangles.finishes.is_metal()[at.triangles.material]
    return np.asarray(stored == np.where(at.hit & _of_face(metal, at.face), 255, 0))


def _nocs_is_right(stored: NDArray[Any], at: _Pierced) -> Bools:
    """(N,) stored model coordinates are those of points (N, 3); of what is no placed model, 0."""
    triangles, instance, point = at.triangles, at.instance, at.point
    right = np.asarray(~stored.any(axis=1), bool)
    for row in at.view.table["instances"]:
        own = instance == int(row["id"])
        if "world_from_model" not in row or not own.any():
            continue
        pose = np.array(row["world_from_model"], np.float64)
        vertices = triangles.faces[triangles.instance == int(row["id"])].reshape(-1)
        # The model's box, with its triangles and the points back in its own frame.
        box = _in_frame(pose, triangles.vertices[vertices].astype(np.float64))
        middle, extent = (box.max(0) + box.min(0)) / 2, np.sqrt((np.ptp(box, axis=0) ** 2).sum())
        expected = 0.5 + (_in_frame(pose, point[own]) - middle) / extent
        tolerance = METRES / extent + 1 / 65535
        close = (np.abs(stored[own] / 65535 - expected) <= tolerance).all(axis=1)
        right[own] = close & stored[own].any(axis=1)
    return right


def _part_is_right(stored: NDArray[Any], at: _Pierced) -> Bools:
    """(N,) the part's row in articulation.json names the part of the face there; 0 what does not move."""
    rows = {int(row["id"]): (int(row["instance"]), str(row["part"])) for row in at.view.parts}
    names, own = at.triangles.parts, _of_face(at.triangles.part, at.face)
    return np.array(
        [
            rows.get(int(number)) == (int(instance), names[part]) if number else part == 0
            for number, instance, part in zip(stored, at.instance, own, strict=True)
        ],
        bool,
    )


def _in_frame(world_from_frame: Floats, points: Floats) -> Floats:
    """(N, 3) world points in a frame."""
    own = np.linalg.solve(world_from_frame[:3, :3], (points - world_from_frame[:3, 3]).T)
    return np.asarray(own.T, np.float64)


def _of_face(table: NDArray[Any], face: Faces) -> NDArray[Any]:
    """table[face], 0 where face is -1."""
    if not len(table):
        return np.zeros(len(face), table.dtype)
    return np.where(face >= 0, table[face], table.dtype.type(0))


def published_axes(world: Floats, view: StoredView) -> Floats:
    """(N, 3) x right, y forward, z up from world directions.

    world is (N, 3) of directions, not points: the camera's position does not enter. The view's pose
    has OpenCV's axes.
    """
    camera = world @ view.world_from_camera[:3, :3]
    return np.stack([camera[:, 0], camera[:, 2], -camera[:, 1]], axis=1)


def normal_is_right(
    stored: NDArray[np.int64], expected: Floats, tolerance_deg: float = NORMAL_TOLERANCE_DEG
) -> Bools:
    """(N,) stored 16-bit normals decode to the expected ones; where those are 0, to nothing.

    stored is (N, 3) as in the layer, 0..65535 for -1..1, nothing = 32768 three times; expected is
    (N, 3) float64, of unit length or 0. tolerance_deg: between the two.
    """
    # Compare by the sine: the cosine of a small angle is too flat.
    decoded = stored * (2 / 65535) - 1
    length = np.linalg.norm(decoded, axis=1)
    sine = np.linalg.norm(np.cross(decoded, expected), axis=1)
    close = (np.einsum("ni,ni->n", decoded, expected) > 0) & (
        sine <= np.radians(tolerance_deg) * length
    )
    nothing = (stored == 32768).all(axis=1)
    right = np.where(expected.any(axis=1), close & (np.abs(length - 1) < 1e-3), nothing)
    return np.asarray(right, bool)


def _coincident(
    labels: Labels, face: Faces, origin: Floats, directions: Floats, scene: tuple[Triangles, Hits]
) -> Faces:
    """(N,) another triangle of the stored instance that the ray pierces at the first hit's depth, or -1.

    A model may have a face twice, with other texture coordinates.
    """
    triangles, rays = scene
    found = np.full(len(face), -1, np.int64)
    if "instance" not in labels:
        return found
    starts, legs, way = rays.last_leg(origin, directions)
    first = rays.distance(face, origin, directions) - way
    # Measure gaps across the surface: a slanting ray is longer between the two.
    across = np.abs(np.einsum("ni,ni->n", rays.normal(face, directions), directions))
    for instance in np.unique(labels["instance"]):
        # Look for a triangle of that instance at the depth of the first hit.
        own = np.nonzero(triangles.instance == instance)[0]
        for pixel in np.nonzero(labels["instance"] == instance)[0]:
            t = distances_pierced(triangles, own, starts[pixel], legs[pixel])
            gap = np.abs(t - first[pixel]) * across[pixel]
            gap[own == face[pixel]] = np.inf
            if len(own) and gap.min() <= TIE_DEPTH_M:
                found[pixel] = own[gap.argmin()]
    return rays.without_holes(found, origin, directions)


def of_another_colour(
    face: Faces, origin: Floats, directions: Floats, scene: tuple[Triangles, Rays]
) -> Faces:
    """(N,) a triangle of another material that each ray pierces where it meets face, or -1.

    Both are right for a label that they share, and the picture shows either: it glitters.
    """
    triangles, rays = scene
    found = np.full(len(face), -1, np.int64)
    corners = triangles.vertices.astype(np.float64)[triangles.faces]
    planes = _number_planes(corners)
    order = np.argsort(planes, kind="stable")
    last = np.searchsorted(planes[order], planes, side="right")
    start = np.searchsorted(planes[order], planes, side="left")
    distance = rays.distance(face, origin, directions)
    across = np.abs(np.einsum("ni,ni->n", rays.normal(face, directions), directions))
    for k in np.nonzero(face >= 0)[0]:
        own = order[start[face[k]] : last[face[k]]]
        own = own[triangles.material[own] != triangles.material[face[k]]]
        if len(own):
            gap = np.abs(distances_pierced(triangles, own, origin, directions[k]) - distance[k])
            if gap.min() * across[k] <= TIE_DEPTH_M:
                found[k] = own[gap.argmin()]
    return rays.without_holes(found, origin, directions)


def of_another_part(
    face: Faces, origin: Floats, directions: Floats, scene: tuple[Triangles, Rays]
) -> Faces:
    """(N,) a triangle of another item or part that each ray pierces where it meets face, or -1.

    Of a leaf and its frame that cross at one depth either may be seen.
    """
    triangles, rays = scene
    found = np.full(len(face), -1, np.int64)
    corners = triangles.vertices.astype(np.float64)[triangles.faces]
    low, high = corners.min(1) - TIE_DEPTH_M, corners.max(1) + TIE_DEPTH_M
    distance = rays.distance(face, origin, directions)
    across = np.abs(np.einsum("ni,ni->n", rays.normal(face, directions), directions))
    for k in np.nonzero(face >= 0)[0]:
        point = origin + distance[k] * directions[k]
        is_other = triangles.instance != triangles.instance[face[k]]
        is_other |= triangles.part != triangles.part[face[k]]
        own = np.nonzero(is_other & ((low <= point) & (point <= high)).all(1))[0]
        if len(own):
            gap = np.abs(distances_pierced(triangles, own, origin, directions[k]) - distance[k])
            if gap.min() * across[k] <= TIE_DEPTH_M:
                found[k] = own[gap.argmin()]
    return rays.without_holes(found, origin, directions)


def _number_planes(corners: Floats) -> NDArray[np.int64]:
    """(F,) the number of each triangle's plane, whichever way it looks; planes 0.1 mm apart differ."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.nan_to_num(normal)
    largest = np.take_along_axis(normal, np.abs(normal).argmax(1)[:, None], 1)
    normal *= np.where(largest < 0, -1.0, 1.0)
    offset = np.einsum("fi,fi->f", normal, corners[:, 0])
    keys = np.round(np.column_stack([normal * 1e3, offset / TIE_DEPTH_M])).astype(np.int64)
    return np.asarray(np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1), np.int64)


def distances_pierced(
    triangles: Triangles, own: NDArray[np.int64], origin: Floats, ray: Floats
) -> Floats:
    """(F,) distance at which one ray pierces each of the triangles own, in lengths of ray; inf = misses it."""
    a, b, c = (triangles.vertices[triangles.faces[own, k]].astype(np.float64) for k in range(3))
    # Moeller and Trumbore 1997, one ray and many triangles.
    e1, e2, s = b - a, c - a, origin - a
    p = np.cross(ray, e2)
    q = np.cross(s, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / np.einsum("fi,fi->f", e1, p)
        # Barycentric coordinates, with slack at the edges, and the distance.
        u, v = np.einsum("fi,fi->f", s, p) * inverse, (q @ ray) * inverse
        t = np.einsum("fi,fi->f", e2, q) * inverse
        inside = (u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6) & (t > 0)
    return np.where(inside, t, np.inf)


# Layer -> what is right of its stored values at the pixels.
_CHECKS: Final[Mapping[str, Callable[[NDArray[Any], _Pierced], Any]]] = {
    "instance": lambda stored, at: stored == at.instance,
    "semantic": lambda stored, at: stored == at.classes[at.instance],
    "depth": _depth_is_right,
    "normal": lambda stored, at: normal_is_right(stored, published_axes(at.normal, at.view)),
    "valid": lambda stored, at: stored == np.where(at.hit, 255, 0),
    "depth_z": lambda stored, at: np.where(at.hit, np.abs(stored - at.z) <= METRES, stored == 0),
    "position": _position_is_right,
    "normal_world": lambda stored, at: normal_is_right(stored, at.normal),
    "material": lambda stored, at: (
        stored == np.where(at.hit, _of_face(at.triangles.material, at.face) + 1, 0)
    ),
    "glass": lambda stored, at: (
        stored == np.where(at.hit & _of_face(at.triangles.see_through, at.face), 255, 0)
    ),
    "mirror": lambda stored, at: (
        stored == np.where(at.hit & (at.triangles.kinds_of(at.face) == "mirror"), 255, 0)
    ),
    "roughness": _roughness_is_right,
    "metallic": _metallic_is_right,
    "f0": _f0_is_right,
    "normal_shading": _shading_is_right,
    "nocs": _nocs_is_right,
    "part": _part_is_right,
    "albedo": _albedo_is_right,
}

RAY_LAYERS: Final = tuple(_CHECKS)
"""Layers that a ray through the pixel's centre decides."""
