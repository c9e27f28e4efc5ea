"""Things moved half a millimetre out of the faces of walls, floors and ceilings; no effects.

A frame as thick as its wall lies in the wall's own faces, and so does a picture drawn on it: a ray
meets either of the two there, and no label is the only right one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Item, ItemKind, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors, unit_normals

MOVED_M = 5e-4
"""How far a thing is moved out of the face it lies in."""

_FACED = (ItemKind.WALL, ItemKind.FLOOR, ItemKind.CEILING)
_COINCIDE_M = 1e-4  # faces nearer than this are one to a ray
_PARALLEL = 0.9999  # cosine
_TURN = 0.015  # between unit normals whose cosine is that
_LEAST_AREA_M2 = 1e-5  # that two faces must share


@dataclass(frozen=True, slots=True, eq=False)
class _Faces:
    corners: F64  # (F, 3, 3) metres
    normals: F64  # (F, 3) unit


def with_frames_apart(house: House) -> tuple[House, int]:
    """The house with the corners of such things moved out of the wall, and how many pieces were.

    A thing is moved where a face of it shares area with a face of a wall, a floor or a ceiling that
    looks the same way. Where another face of it or of a wall lies within reach, it stays.
    """
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


def _move_out_of_planes(item: Item, walls: Sequence[Item]) -> Item:
    low, high = item.bounds
    own, around = _faces_of_structure([item], low, high), _faces_of_structure(walls, low, high)
    if not len(own.normals) or not len(around.normals):
        return item
    surfaces = list(item.surfaces)
    done: list[tuple[F64, float]] = []
    for normal, offset in _shared_planes(own, around):
        # Two keys may round one plane: move it once.
        if any(normal @ n > _PARALLEL and abs(offset - o) < 2 * _COINCIDE_M for n, o in done):
            continue
        done.append((normal, offset))
        # Move all of the item's corners in that plane, so that its faces stay joined.
        for k, s in enumerate(item.surfaces):
            in_plane = np.abs(s.positions.astype(np.float64) @ normal - offset) < _COINCIDE_M
            if in_plane.any():
                shift = np.where(in_plane[:, None], MOVED_M * normal, 0.0)
                positions = (surfaces[k].positions + shift).astype(np.float32)
                surfaces[k] = replace(surfaces[k], positions=positions)
    same = all(a is b for a, b in zip(surfaces, item.surfaces, strict=True))
    return item if same else replace(item, surfaces=tuple(surfaces))


def _faces_of_structure(items: Sequence[Item], low: F64, high: F64) -> _Faces:
    # Leave out faces without area, and those outside the box low..high and its reach.
    corners = corners_of_surfaces(s for i in items for s in i.surfaces)
    corners = corners[np.linalg.norm(area_vectors(corners), axis=1) > 1e-8]
    near = (corners.min(1) < high + 2 * MOVED_M) & (corners.max(1) > low - 2 * MOVED_M)
    corners = corners[near.all(1)]
    return _Faces(corners, unit_normals(corners))


def _shared_planes(own: _Faces, around: _Faces) -> Iterator[tuple[F64, float]]:
    """Normal and offset of every plane in which faces of both look one way and share area."""
    offsets = np.einsum("fi,fi->f", around.normals, around.corners[:, 0])
    keys = np.round(np.column_stack([around.normals * 1e3, offsets / _COINCIDE_M]))
    planes = np.sort(np.unique(keys, axis=0, return_index=True)[1])
    # Of the walls' planes those in which the piece has a face at all.
    tree = cKDTree(_shrink(own.normals, np.einsum("fi,fi->f", own.normals, own.corners[:, 0])))
    near = tree.query(_shrink(around.normals[planes], offsets[planes]), p=np.inf)[0] <= 1.0
    for first in planes[near]:
        normal, offset = around.normals[first], float(offsets[first])
        frame = _of_plane(own, normal, offset)
        if not len(frame) or _is_met(around, own, normal, offset):
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
    """Whether a parallel face lies so near before the plane that a moved frame would meet it."""
    for faces in (around, own):
        ahead = (faces.corners @ normal - offset).mean(1)
        parallel = np.abs(faces.normals @ normal) > _PARALLEL
        if (parallel & (ahead > _COINCIDE_M) & (ahead < MOVED_M + _COINCIDE_M)).any():
            return True
    return False


def _outline_of_faces(corners: F64, axes: F64) -> shapely.Geometry:
    return shapely.union_all(shapely.polygons(corners @ axes.T), grid_size=1e-6)
