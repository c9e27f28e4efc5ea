"""Slivers dissolved: a mesh closed in double precision stays closed in single precision; no effects.

Rounded to float32, thin triangles of a boolean result lose their area. Left out, they would
leave a vertex in the middle of another triangle's edge, and rays may slip through there. Here
each is dissolved instead: the triangle across its longest edge is split at that vertex.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.mesh import face_areas, numbered_points
from pbrs_farm.geometry.connected import connected_nodes

MIN_AREA_M2 = 1e-12  # a triangle of less is a sliver: float32 holds no smaller one
_MERGE_M = 4e-6  # a few steps of float32 ten metres from the origin
_THIN_M = 1e-8  # height of a near-sliver
_MAX_ROUNDS = 8  # splitting may leave new slivers


def without_slivers(vertices: F64, faces: I64, labels: I64) -> tuple[F64, I64, I64]:
    """The mesh with float32 positions and no face without area, its edges still in pairs.

    Points nearer than a few micrometres, which differ by noise, become one.

    vertices: (V, P) positions and properties, those of one position possibly several times.
    faces: (F, 3); labels: (F,), kept with each face. New vertices get properties in between.
    """
    # Round positions to float32, one for each cluster of close points.
    vertices = vertices.copy()
    vertices[:, :3] = vertices[_representatives(vertices[:, :3]), :3].astype(np.float32)
    _, place = numbered_points(vertices[:, :3])
    # Dissolve until no sliver is left.
    mesh = _Mesh(vertices, place, faces, labels)
    for k in range(2 * _MAX_ROUNDS):
        # Take near slivers too where slivers in one line with them keep splitting each other.
        if not mesh.dissolve(with_thin=k >= _MAX_ROUNDS):
            break
    return mesh.result()


def _representatives(positions: F64) -> I64:
    # Take for each point the first of those linked to it by steps below _MERGE_M.
    n = len(positions)
    pairs = KDTree(positions).query_pairs(_MERGE_M, output_type="ndarray").reshape(-1, 2)
    cluster = connected_nodes(pairs[:, 0], pairs[:, 1], n)
    return np.unique(cluster, return_index=True)[1].astype(np.int64)[cluster]


class _Mesh:
    """Faces that can be replaced, with the faces at each directed edge between positions."""

    def __init__(self, vertices: F64, place: I64, faces: I64, labels: I64) -> None:
        self._vertices = list(vertices)  # (P,) position and properties each
        self._place = place.tolist()  # vertex -> number of its position
        self._faces: list[tuple[int, int, int]] = [(a, b, c) for a, b, c in faces.tolist()]
        self._labels = labels.tolist()
        self._alive = [True] * len(self._faces)  # a dissolved face keeps its number
        self._at_edge: dict[tuple[int, int], list[int]] = {}  # directed edge of places -> its faces
        for f in range(len(self._faces)):
            self._enter(f)

    def dissolve(self, *, with_thin: bool) -> int:
        """Dissolve every sliver once, with faces nearly as thin, longest first; how many slivers."""
        slivers = self._slivers()
        for f in self._thin() if with_thin and slivers else slivers:
            if self._alive[f]:
                self._dissolve_one(f)
        return len(slivers)

    def result(self) -> tuple[F64, I64, I64]:
        """Vertices, living faces, their labels."""
        rows = [f for f, alive in enumerate(self._alive) if alive]
        faces = np.array([self._faces[f] for f in rows], np.int64).reshape(-1, 3)
        return (
            np.array(self._vertices),
            faces,
            np.array([self._labels[f] for f in rows], np.int64),
        )

    def _slivers(self) -> list[int]:
        vertices = np.array(self._vertices)[:, :3]
        area = face_areas(vertices[np.array(self._faces, np.int64)])
        return np.flatnonzero((area <= MIN_AREA_M2) & np.array(self._alive)).tolist()

    def _thin(self) -> list[int]:
        corners = np.array(self._vertices)[:, :3][np.array(self._faces, np.int64)]
        longest = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2).max(1)
        is_thin = face_areas(corners) <= np.maximum(MIN_AREA_M2, 0.5 * _THIN_M * longest)
        slivers = np.flatnonzero(is_thin & np.array(self._alive)).tolist()
        return sorted(slivers, key=lambda f: -longest[f])

    def _dissolve_one(self, f: int) -> None:
        places = [self._place[v] for v in self._faces[f]]
        # Drop a face that collapsed to a line or a point.
        if len(set(places)) < 3:
            self._leave(f)
            return
        corners = np.array([self._vertices[v][:3] for v in self._faces[f]])
        # Find the longest edge c a and the vertex b on it.
        longest = int(np.linalg.norm(corners - np.roll(corners, -1, 0), axis=1).argmax())
        a, c, b = (self._faces[f][(longest + k) % 3] for k in range(3))
        # Split the face on the other side of that edge at b.
        across = self._at_edge.get((self._place[c], self._place[a]))
        if across:
            self._leave(f)
            self._split(across[0], self._place[c], self._place[a], b)

    def _split(self, f: int, c: int, a: int, b: int) -> None:
        # Put the position of vertex b into the edge of face f from place c to place a.
        face = self._faces[f]
        k = next(
            k for k in range(3) if self._place[face[k]] == c and self._place[face[(k + 1) % 3]] == a
        )
        first, second, third = (face[(k + j) % 3] for j in range(3))
        start, end, point = self._vertices[first], self._vertices[second], self._vertices[b]
        # Interpolate properties there, but keep b's exact position.
        along = end[:3] - start[:3]
        t = float(np.clip((point[:3] - start[:3]) @ along / max(along @ along, 1e-300), 0.0, 1.0))
        middle = start + t * (end - start)
        middle[:3] = point[:3]
        new = len(self._vertices)
        self._vertices.append(middle)
        self._place.append(self._place[b])
        self._leave(f)
        # Replace the face by its two halves.
        for part in ((first, new, third), (new, second, third)):
            self._faces.append(part)
            self._labels.append(self._labels[f])
            self._alive.append(True)
            self._enter(len(self._faces) - 1)

    def _edges(self, f: int) -> list[tuple[int, int]]:
        a, b, c = (self._place[v] for v in self._faces[f])
        return [(a, b), (b, c), (c, a)]

    def _enter(self, f: int) -> None:
        for edge in self._edges(f):
            self._at_edge.setdefault(edge, []).append(f)

    def _leave(self, f: int) -> None:
        self._alive[f] = False
        for edge in self._edges(f):
            self._at_edge[edge].remove(f)
