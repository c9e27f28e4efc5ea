"""Closed solids whose faces remember what they are: patches in, boolean work, patches out.

No effects. The only way into manifold3d, which gets closed meshes alone: some open ones kill the
process (3.5: fans of an odd number of faces). Every patch (one surface of one item) is a run
with its own original id and carries texture coordinates and normals as vertex properties, so
after any union or difference each face still has its item, surface, material and uv.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import manifold3d
import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.mesh import edges_are_paired, numbered_points, signed_volume
from pbrs_farm.repair.structure.slivers import without_slivers

WELD_M = 1e-5  # corners nearer than this become one where exact ones do not close
_NUMBER_OF_PROPERTIES = 8  # x y z, u v, nx ny nz


@dataclass(frozen=True, slots=True)
class Tag:
    """Origin of a face: preserved by every boolean, so that results can be assigned to their items."""

    item: int  # index into House.items
    surface: str  # name, one of its item's
    material: int  # index into House.materials


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """Triangles of one tag: the form in which surfaces enter and leave boolean work."""

    tag: Tag
    positions: F64  # (V, 3) metres
    faces: I64  # (F, 3) anticlockwise seen from outside
    uvs: F64  # (V, 2)
    normals: F64  # (V, 3) unit, or zeros where faces are flat


class TagTable:
    """Maps manifold3d's original ids to tags; one per repair, as solids of two cannot be combined."""

    def __init__(self) -> None:
        self._tags: dict[int, Tag] = {}

    def reserve(self, tags: Sequence[Tag]) -> NDArray[np.uint32]:
        """A new original id, unique in the process and different from run to run, for each tag."""
        first = Manifold.reserve_ids(len(tags))
        for k, tag in enumerate(tags):
            self._tags[first + k] = tag
        return np.arange(first, first + len(tags), dtype=np.uint32)

    def __getitem__(self, original_id: int) -> Tag:
        return self._tags[original_id]


def solid_from_patches(patches: Sequence[Patch], table: TagTable) -> Manifold | None:
    """The closed solid, faces outward, that patches bound, welded up to WELD_M if needed; or None."""
    patches = [p for p in patches if len(p.faces)]
    if not patches:
        return None
    # Weld equal corners only at first: a larger weld may close an intended gap.
    for weld_m in (0.0, WELD_M):
        solid = _manifold_of(patches, table, weld_m)
        if solid is not None:
            return solid
    return None


def _manifold_of(patches: Sequence[Patch], table: TagTable, weld_m: float) -> Manifold | None:
    vertices, faces, merge_from, merge_to = _welded(patches, weld_m)
    # Never pass an open mesh: manifold3d's own test may crash on it.
    place = np.arange(len(vertices))
    place[merge_from] = merge_to
    if not edges_are_paired(place[faces]):
        return None
    # Turn an inward mesh round, its normals with it.
    if signed_volume(vertices[faces, :3], vertices[:, :3].mean(0)) < 0:
        faces = faces[:, [0, 2, 1]]
        vertices = vertices * np.array([1.0] * 5 + [-1.0] * 3)  # x y z u v kept, normals turned
    # Pass each patch as a separate run with a new original id.
    mesh = manifold3d.Mesh64(
        np.ascontiguousarray(vertices),
        np.ascontiguousarray(faces, np.uint64),
        merge_from_vert=merge_from,
        merge_to_vert=merge_to,
        run_index=3 * np.cumsum([0, *(len(p.faces) for p in patches)]).astype(np.uint64),
        run_original_id=table.reserve([p.tag for p in patches]),
    )
    solid = Manifold(mesh)
    # Accept only closed solids with a volume.
    if solid.status() != manifold3d.Error.NoError or solid.is_empty() or solid.volume() <= 0:
        return None
    return solid


def faces_of_patches(patches: Sequence[Patch]) -> I64:
    """(F, 3) faces of all patches, corners numbered through the concatenated, unwelded vertices."""
    starts = np.cumsum([0, *(len(p.positions) for p in patches)])
    return np.concatenate([p.faces + s for p, s in zip(patches, starts[:-1], strict=True)])


class _Welded(NamedTuple):
    """The patches as one mesh."""

    vertices: F64  # (V, 8) x y z u v, normal
    faces: I64  # (F, 3)
    merge_from: NDArray[np.uint64]  # vertices merged into
    merge_to: NDArray[np.uint64]  # these


def _welded(patches: Sequence[Patch], weld_m: float) -> _Welded:
    # Join the vertex lists; declare equal positions of different patches to be one vertex.
    positions = np.concatenate([p.positions for p in patches])
    keys = np.round(positions / weld_m) if weld_m else positions + 0.0  # + 0.0 makes -0 and 0 equal
    first, number = numbered_points(keys)
    canonical = first[number]  # each vertex -> the first at its place
    if weld_m:
        positions = positions[canonical]
    faces = faces_of_patches(patches)
    # List the vertices to merge with an earlier one.
    duplicates = np.flatnonzero(canonical != np.arange(len(canonical)))
    uvs = np.concatenate([p.uvs for p in patches])
    normals = np.concatenate([p.normals for p in patches])
    vertices = np.concatenate([positions, uvs, normals], 1)
    merge_to = canonical[duplicates].astype(np.uint64)
    return _Welded(vertices, faces, duplicates.astype(np.uint64), merge_to)


def unite(solids: Iterable[Manifold]) -> Manifold:
    """The union of any solids; faces keep their ids, and of coinciding faces one is left."""
    return Manifold.batch_boolean(list(solids), manifold3d.OpType.Add)


def subtract(solid: Manifold, cutters: Sequence[Manifold]) -> Manifold:
    """Subtract all cutters, which may overlap, from solid; faces of the hole carry the cutters' ids."""
    if not cutters:
        return solid
    return Manifold.batch_boolean([solid, *cutters], manifold3d.OpType.Subtract)


def common(a: Manifold, b: Manifold) -> Manifold:
    """Intersection of two solids."""
    return a ^ b


def bounds(solid: Manifold) -> F64:
    """(2, 3) axis-aligned minimum and maximum."""
    return np.array(solid.bounding_box(), np.float64).reshape(2, 3)


def overlap_of_bounds(a: F64, b: F64) -> F64:
    """(3,) extents of the common box of two (2, 3) bounds, negative where they are apart."""
    return np.asarray(np.minimum(a[1], b[1]) - np.maximum(a[0], b[0]))


def patches_from_solid(solid: Manifold, table: TagTable) -> list[Patch]:
    """The solid's surface by tag in order, float32 values, separate vertices, interpolated uv, no slivers."""
    mesh = solid.to_mesh64()
    vertices = np.asarray(mesh.vert_properties, np.float64)
    # Pad a result without properties, as of an empty solid.
    if vertices.shape[1] < _NUMBER_OF_PROPERTIES:
        pad = np.zeros((len(vertices), _NUMBER_OF_PROPERTIES - vertices.shape[1]))
        vertices = np.concatenate([vertices, pad], 1)
    triangles = np.asarray(mesh.tri_verts, np.int64)
    tags, tag_of_face = _tags_of_faces(mesh, table)
    vertices, triangles, tag_of_face = without_slivers(vertices, triangles, tag_of_face)
    # Collect the faces of each tag, in their order, with the vertices they use.
    order = np.argsort(tag_of_face, kind="stable")
    starts = np.searchsorted(tag_of_face[order], np.arange(len(tags) + 1))
    patches = [
        _compact(tag, vertices, triangles[order[a:b]])
        for tag, (a, b) in zip(tags, pairwise(starts), strict=True)
        if a < b
    ]
    return sorted(patches, key=lambda p: (p.tag.item, p.tag.surface, p.tag.material))


def _tags_of_faces(mesh: manifold3d.Mesh64, table: TagTable) -> tuple[list[Tag], I64]:
    # Number the tags; several runs may have one: a wall cut by two openings has two of reveals.
    run_index = np.asarray(mesh.run_index, np.int64) // 3
    tags: dict[Tag, int] = {}
    of_run = [tags.setdefault(table[int(i)], len(tags)) for i in mesh.run_original_id]
    return list(tags), np.repeat(np.array(of_run, np.int64), np.diff(run_index)[: len(of_run)])


def _compact(tag: Tag, vertices: F64, faces: I64) -> Patch:
    used, inverse = np.unique(faces, return_inverse=True)
    v = vertices[used]
    return Patch(tag, v[:, :3], inverse.reshape(-1, 3), v[:, 3:5], v[:, 5:8])
