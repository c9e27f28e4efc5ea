"""Cut meshes where a picture that does not repeat ends, as surfaces only know repeating ones; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.read.mesh.obj import Mesh

REPEAT, CLAMP, MIRROR = "repeat", "clamp", "mirror"
_MOST_CUTS: Final = 64  # lines along which a mesh is cut for one direction of its picture
_MOST_ADDED: Final = 50_000  # triangles that the cuts of one mesh may add
_EDGE: Final = 1e-3  # coordinates that leave 0..1 by less lie within it: half a texel of 500


@dataclass(frozen=True, slots=True)
class Wraps:
    """How a picture goes on beyond its edges, along u and v, and its size in pixels."""

    modes: tuple[str, str]
    size_px: tuple[int, int]


def leaves_picture(mesh: Mesh, wraps: tuple[str, str]) -> bool:
    """True if a mesh extends beyond the edges of a picture that does not repeat."""
    if mesh.uvs is None or not len(mesh.uvs):
        return False
    ends = zip(wraps, mesh.uvs.min(0), mesh.uvs.max(0), strict=True)
    return any(mode != REPEAT and (low < -_EDGE or high > 1 + _EDGE) for mode, low, high in ends)


def wrapped(mesh: Mesh, wraps: Wraps) -> Mesh | None:
    """The mesh as it looks with a picture that repeats; None where it would have to be cut too often."""
    most = len(mesh.faces) + _MOST_ADDED
    for axis, (mode, size) in enumerate(zip(wraps.modes, wraps.size_px, strict=True)):
        assert mesh.uvs is not None
        low, high = float(mesh.uvs[:, axis].min()), float(mesh.uvs[:, axis].max())
        if mode == REPEAT or (low >= -_EDGE and high <= 1 + _EDGE):
            continue
        # Cut half a texel off each edge, so that no pixel is mixed of both ends of the picture.
        half = 0.5 / size
        ends = np.arange(np.floor(low), np.ceil(high) + 1) if mode == MIRROR else np.array([0, 1])
        if len(ends) > _MOST_CUTS:
            return None
        for end in ends:
            for cut in (end - half, end + half):
                if low < cut < high and (mode == MIRROR or 0 <= cut <= 1):
                    mesh = _cut_along(mesh, axis, float(cut))
                if len(mesh.faces) > most:
                    return None
        mesh = _folded(mesh, axis, mode, half)
    return mesh


def _folded(mesh: Mesh, axis: int, mode: str, half: float) -> Mesh:
    """The mesh with coordinates along one axis within the picture, half a texel off its edges."""
    assert mesh.uvs is not None
    uvs = mesh.uvs.copy()
    u = uvs[:, axis]
    if mode == MIRROR:
        u = 1 - np.abs(1 - np.mod(u, 2))
    uvs[:, axis] = np.clip(u, half, 1 - half)
    return replace(mesh, uvs=uvs)


def _cut_along(mesh: Mesh, axis: int, at: float) -> Mesh:
    """The mesh with triangles that cross a line of the picture parted there."""
    assert mesh.uvs is not None
    is_above = mesh.uvs[:, axis] >= at
    sides = is_above[mesh.faces]
    crosses = sides.any(1) & ~sides.all(1)
    if not crosses.any():
        return mesh
    # Turn each crossing triangle so that the corner alone on its side comes first.
    faces = mesh.faces[crosses].astype(np.int64)
    is_on_side = sides[crosses]
    alone = np.argmax(is_on_side == (is_on_side.sum(1) == 1)[:, None], axis=1)
    p, q, r = (np.take_along_axis(faces, ((alone + k) % 3)[:, None], 1)[:, 0] for k in range(3))
    n, k = len(mesh.positions), len(faces)
    a, b = n + np.arange(k), n + k + np.arange(k)
    rows = np.concatenate([_between(mesh, axis, at, p, q), _between(mesh, axis, at, p, r)])
    parted = np.concatenate([np.stack(f, 1) for f in ((p, a, b), (a, q, r), (a, r, b))])
    positions = np.concatenate([mesh.positions, rows[:, :3]])
    # A corner on the line leaves triangles without area.
    parted = parted[face_areas(triangle_corners(positions, parted)) > 0]
    return replace(
        mesh,
        positions=positions,
        uvs=np.concatenate([mesh.uvs, rows[:, 3:5]]),
        normals=np.concatenate([mesh.normals, rows[:, 5:]]),
        faces=np.concatenate([mesh.faces[~crosses], parted]).astype(np.int32),
    )


def _between(mesh: Mesh, axis: int, at: float, one: I64, other: I64) -> F64:
    """(K, 8) position, uv and normal where edges meet a line; the same from either end of an edge."""
    assert mesh.uvs is not None
    first, last = np.minimum(one, other), np.maximum(one, other)
    rows = np.concatenate([mesh.positions, mesh.uvs, mesh.normals], axis=1)
    start, along = rows[first], rows[last] - rows[first]
    share = (at - start[:, 3 + axis]) / along[:, 3 + axis]
    points = start + share[:, None] * along
    length = np.linalg.norm(points[:, 5:], axis=1, keepdims=True)
    points[:, 5:] /= np.where(length > 0, length, 1)
    return np.asarray(points)
