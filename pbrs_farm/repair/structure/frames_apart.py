"""Move coplanar faces of items half a millimetre apart from walls and from each other; no effects.

A frame as thick as its wall has faces in the wall's own planes, as has a flat picture on it: a ray
hits either of the two, and labels are ambiguous. Coplanar faces of two materials, in one piece or
in touching pieces, flicker.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Item, ItemKind, Surface, corners_of_surfaces
from pbrs_farm.core.mesh import (
    area_vectors,
    boxes_meeting,
    lengths,
    points_bounds,
    triangle_bounds,
    unit_normals,
)

MOVED_M = 5e-4
"""Distance that an item is moved out of a coplanar face, metres."""

_FACED = (ItemKind.WALL, ItemKind.FLOOR, ItemKind.CEILING)
_COINCIDE_M = 1e-4  # faces nearer than this are one to a ray
_PARALLEL = 0.9999  # cosine
_TURN = 0.015  # between unit normals whose cosine is that
_LEAST_AREA_M2 = 1e-5  # that two faces must share
_SEEN_M2 = 1e-3  # that parts must share: less is a few pixels from near
_LEAST_FACE_M2 = 1e-4  # minimum face area; smaller faces belong to round shapes
_MOST_PAIRS = 256  # of triangles; outlines of parts with more are compared without this test
_ROUNDS = 3  # parts that lie in one plane by threes are moved by steps


@dataclass(frozen=True, slots=True, eq=False)
class _Faces:
    corners: F64  # (F, 3, 3) metres
    normals: F64  # (F, 3) unit


def with_frames_apart(house: House) -> tuple[House, int]:
    """Move faces out of coplanar structure unless another face is near; also the number of moved pieces."""
    walls = [i for i in house.items if i.kind in _FACED and i.n_faces]
    bounds = np.array([w.bounds for w in walls]).reshape(-1, 2, 3)
    items, n_moved = [], 0
    for item in house.items:
        moved = item
        if not item.kind.is_structure and item.n_faces:
            low, high = item.bounds
            near = (bounds[:, 0] < high + MOVED_M) & (bounds[:, 1] > low - MOVED_M)
            moved = _move_out_of_planes(item, [walls[k] for k in np.flatnonzero(near.all(1))])
        items.append(moved)
        n_moved += moved is not item
    return (house.with_items(items), n_moved) if n_moved else (house, 0)


def with_parts_apart(house: House) -> tuple[House, int]:
    """Move the later of overlapping coplanar parts (surfaces of a material); also their number."""
    moved = set[tuple[int, int]]()
    for _ in range(_ROUNDS):
        house, moved_now = _move_parts_once(house)
        moved |= moved_now
        if not moved_now:
            break
    return house, len(moved)


def _move_parts_once(house: House) -> tuple[House, set[tuple[int, int]]]:
    """The house with the later of any two parts moved, and (item, material) of those that were."""
    parts = [
        (k, m)
        for k, item in enumerate(house.items)
        if not item.kind.is_structure
        for m in dict.fromkeys(s.material for s in item.surfaces if len(s.faces))
    ]
    corners = [
        corners_of_surfaces(s for s in house.items[k].surfaces if s.material == m) for k, m in parts
    ]
    of = np.repeat(np.arange(len(parts)), [len(c) for c in corners])
    faces = np.concatenate([np.zeros((0, 3, 3)), *corners])
    items, moved = list(house.items), set[tuple[int, int]]()
    for part, earlier, normal, offset in _pairs_in_one_plane(faces, of):
        k, material = parts[part]
        mine, its = (_Faces(c, unit_normals(c)) for c in (faces[of == part], faces[of == earlier]))
        if _is_met(mine, its, normal, offset):
            continue
        surfaces = [
            _moved_in_plane(s, normal, offset) if s.material == material else s
            for s in items[k].surfaces
        ]
        items[k] = replace(items[k], surfaces=tuple(surfaces))
        moved.add(parts[part])
    return (house.with_items(items) if moved else house), moved


def _pairs_in_one_plane(corners: F64, of: NDArray[np.intp]) -> list[tuple[int, int, F64, float]]:
    """(later part, earlier part, normal, offset) of parts `of` (F,) that share area in a plane."""
    vectors = area_vectors(corners)
    twice = lengths(vectors)
    faces = np.flatnonzero(twice > 2 * _LEAST_FACE_M2)
    if not len(faces):
        return []
    normals = vectors[faces] / twice[faces, None]
    offsets = np.einsum("fi,fi->f", normals, corners[faces, 0])
    keys = np.round(np.column_stack([normals * 1e3, offsets / _COINCIDE_M])).astype(np.int64)
    plane = np.unique(keys @ [1, 4_001, 16_008_001, 64_048_012_001], return_inverse=True)[1]
    order = np.argsort(plane, kind="stable")
    part_of_face = of[faces[order]]
    start = np.r_[0, np.flatnonzero(np.diff(plane[order])) + 1]
    end = np.r_[start[1:], len(order)]
    pairs = []
    # Faces of a plane are in the order of their parts: where the first and the last differ are several.
    for k in np.flatnonzero(part_of_face[start] != part_of_face[end - 1]):
        group = order[start[k] : end[k]]
        normal, offset = normals[group[0]], float(offsets[group[0]])
        members = {
            int(p): corners[faces[group[of[faces[group]] == p]]]
            for p in np.unique(of[faces[group]])
        }
        boxes = {p: points_bounds(c.reshape(-1, 3)) for p, c in members.items()}
        outlines = dict[int, shapely.Geometry]()
        for part in sorted(members, reverse=True):
            low, high = boxes[part]
            for earlier in members:
                if earlier >= part:
                    continue
                spans = np.minimum(high, boxes[earlier][1]) - np.maximum(low, boxes[earlier][0])
                # Of their boxes the two longer sides bound the area, but for a plane's slant.
                longer = np.sort(spans)[1:]
                if spans.min() < -_COINCIDE_M or longer[0] < 0 or 2 * longer.prod() < _SEEN_M2:
                    continue
                axes = np.linalg.svd(normal[None])[2][1:]
                if most_shared_m2(members[part], members[earlier], axes) < 0.9 * _SEEN_M2:
                    continue
                for p in {part, earlier} - outlines.keys():
                    outlines[p] = _outline_of_faces(members[p], axes)
                shared = shapely.intersection(outlines[part], outlines[earlier])
                if float(shapely.area(shared)) > _SEEN_M2:
                    pairs.append((part, earlier, normal, offset))
                    break
    return pairs


def most_shared_m2(corners: F64, others: F64, axes: F64) -> float:
    """At least the area that two groups of triangles of a plane share; inf for more than _MOST_PAIRS pairs."""
    (a, low, high), (b, lows, highs) = (
        (plan, *triangle_bounds(plan)) for plan in (c @ axes.T for c in (corners, others))
    )
    if len(a) * len(b) > _MOST_PAIRS:
        return np.inf
    meet = (high[:, None] > lows) & (low[:, None] < highs)
    i, j = np.nonzero(meet.all(-1))
    if not len(i):
        return 0.0
    shared = shapely.intersection(shapely.polygons(a[i]), shapely.polygons(b[j]))
    return float(shapely.area(shared).sum())


def _moved_in_plane(surface: Surface, normal: F64, offset: float) -> Surface:
    """The surface with its corners in a plane moved along the normal, so that its faces stay joined."""
    in_plane = np.abs(surface.positions.astype(np.float64) @ normal - offset) < _COINCIDE_M
    if not in_plane.any():
        return surface
    shift = np.where(in_plane[:, None], MOVED_M * normal, 0.0)
    return replace(surface, positions=(surface.positions + shift).astype(np.float32))


def _move_out_of_planes(item: Item, walls: Sequence[Item]) -> Item:
    low, high = item.bounds
    mine, around = (_faces_of_structure([item], low, high), _faces_of_structure(walls, low, high))
    if not len(mine.normals) or not len(around.normals):
        return item
    surfaces = list(item.surfaces)
    done: list[tuple[F64, float]] = []
    for normal, offset in _shared_planes(mine, around):
        # Two keys may round one plane: move it once.
        if any(normal @ n > _PARALLEL and abs(offset - o) < 2 * _COINCIDE_M for n, o in done):
            continue
        done.append((normal, offset))
        for k, surface in enumerate(surfaces):
            surfaces[k] = _moved_in_plane(surface, normal, offset)
    same = all(a is b for a, b in zip(surfaces, item.surfaces, strict=True))
    return item if same else replace(item, surfaces=tuple(surfaces))


def _faces_of_structure(items: Sequence[Item], low: F64, high: F64) -> _Faces:
    # Leave out faces without area, and those outside the box low..high and its reach.
    corners = corners_of_surfaces(s for i in items for s in i.surfaces)
    corners = corners[lengths(area_vectors(corners)) > 1e-8]
    least, most = triangle_bounds(corners)
    corners = corners[boxes_meeting(least, most, low - 2 * MOVED_M, high + 2 * MOVED_M)]
    return _Faces(corners, unit_normals(corners))


def _shared_planes(faces: _Faces, around: _Faces) -> Iterator[tuple[F64, float]]:
    """Normal and offset of every plane in which faces of both look one way and share area."""
    offsets = np.einsum("fi,fi->f", around.normals, around.corners[:, 0])
    keys = np.round(np.column_stack([around.normals * 1e3, offsets / _COINCIDE_M]))
    planes = np.sort(np.unique(keys, axis=0, return_index=True)[1])
    # Of the walls' planes those in which the piece has a face at all.
    tree = cKDTree(
        _shrink(faces.normals, np.einsum("fi,fi->f", faces.normals, faces.corners[:, 0]))
    )
    near = tree.query(_shrink(around.normals[planes], offsets[planes]), p=np.inf)[0] <= 1.0
    for first in planes[near]:
        normal, offset = around.normals[first], float(offsets[first])
        frame = _of_plane(faces, normal, offset)
        if not len(frame) or _is_met(around, faces, normal, offset):
            continue
        # Compare areas in the plane.
        axes = np.linalg.svd(normal[None])[2][1:]
        walls = _of_plane(around, normal, offset)
        shared = shapely.intersection(
            _outline_of_faces(frame, axes), _outline_of_faces(walls, axes)
        )
        if float(shapely.area(shared)) > _LEAST_AREA_M2:
            yield normal, offset


def _shrink(normals: F64, offsets: F64) -> F64:
    """(N, 4) planes so that those less than 1 apart along each axis may be one."""
    return np.column_stack([normals / _TURN, offsets / (2 * _COINCIDE_M)])


def _of_plane(faces: _Faces, normal: F64, offset: float) -> F64:
    """(N, 3, 3) corners of the faces that lie in a plane and look along its normal."""
    off = np.abs(faces.corners @ normal - offset).max(1)
    return np.asarray(faces.corners[(off < _COINCIDE_M) & (faces.normals @ normal > _PARALLEL)])


def _is_met(around: _Faces, own: _Faces, normal: F64, offset: float) -> bool:
    """True if a parallel face is so close in front of the plane that a moved frame would touch it."""
    for faces in (around, own):
        ahead = (faces.corners @ normal - offset).mean(1)
        parallel = np.abs(faces.normals @ normal) > _PARALLEL
        if (parallel & (ahead > _COINCIDE_M) & (ahead < MOVED_M + _COINCIDE_M)).any():
            return True
    return False


def _outline_of_faces(corners: F64, axes: F64) -> shapely.Geometry:
    return shapely.union_all(shapely.polygons(corners @ axes.T), grid_size=1e-6)
