"""The closed shells a structure item is made of; or that it is flat; or neither. No effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from manifold3d import Manifold

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.house import Item, Surface
from pbrs_farm.core.mesh import (
    boxes_meeting,
    face_areas,
    faces_with_area,
    numbered_points,
    points_bounds,
    signed_volume,
    triangle_corners,
    unit_normals,
)
from pbrs_farm.geometry.connected import connected_faces
from pbrs_farm.repair.structure.booleans import (
    WELD_M,
    Patch,
    Tag,
    TagTable,
    faces_of_patches,
    solid_from_patches,
    unite,
)
from pbrs_farm.repair.structure.slivers import MIN_AREA_M2

_FLAT_M = 1e-3  # how far corners may lie off the plane of a planar wall
_LEAST_FACES = 4  # of a closed solid
_THICKER_THAN_WALLS_M = (
    0.4  # thinner shells that face inward are walls with inverted winding, metres
)
ClosedShell = tuple[Manifold, list[Patch]]  # the solid, and the patches it was made of


def patch_from_surface(surface: Surface, item: int) -> Patch:
    """The surface in double precision, tagged with its item's index, with metric uv if it lacks uv."""
    positions = surface.positions.astype(np.float64)
    uvs = surface.uvs.astype(np.float64) if surface.uvs is not None else positions[:, [0, 2]]
    normals = (
        surface.normals.astype(np.float64)
        if surface.normals is not None
        else np.zeros_like(positions)
    )
    tag = Tag(item, surface.name, surface.material)
    return Patch(tag, positions, surface.faces.astype(np.int64), uvs, normals)


def surface_from_patch(patch: Patch) -> Surface | None:
    """The patch in single precision without faces that lose their area so; None if nothing is left."""
    positions = patch.positions.astype(np.float32)
    keep = faces_with_area(triangle_corners(positions, patch.faces), MIN_AREA_M2)
    if not keep.any():
        return None
    # Keep the vertices that the remaining faces use.
    used, inverse = np.unique(patch.faces[keep], return_inverse=True)
    # Store normals only where every vertex has one.
    length = np.linalg.norm(patch.normals[used], axis=1, keepdims=True)
    normals = None
    if bool((length > 0.1).all()):
        normals = (patch.normals[used] / length).astype(np.float32)
    return Surface(
        patch.tag.surface,
        positions[used],
        inverse.reshape(-1, 3).astype(np.int32),
        patch.tag.material,
        patch.uvs[used].astype(np.float32),
        normals,
    )


@dataclass(frozen=True, slots=True, eq=False)
class FlatPatch:
    """All of an item's triangles, which lie in one plane."""

    patch: Patch
    normal: F64  # (3,) unit, mean of the faces' by area


def shells_from_item(item: Item, index: int, table: TagTable) -> list[ClosedShell] | None:
    """The item as closed solids, one per shell; None if a part is open or the inside of a room."""
    patches = [patch_from_surface(s, index) for s in item.surfaces if len(s.faces)]
    if not patches:
        return None
    shells = []
    for part in _split(patches, components(patches)):
        solid = None if _shows_a_room(part) else solid_from_patches(part, table)
        # Give the whole item up for one open part: it would not be watertight.
        if solid is None:
            return None
        shells.append((solid, part))
    return shells


def _shows_a_room(patches: Sequence[Patch]) -> bool:
    # Twice the volume over the area is a plate's thickness: negative where faces look inward.
    corners = np.concatenate([p.positions[p.faces] for p in patches])
    area = float(face_areas(corners).sum())
    volume = signed_volume(corners, corners.reshape(-1, 3).mean(0))
    return 2 * volume < -_THICKER_THAN_WALLS_M * area


class ClosedShells:
    """The closed solids among the connected parts of an item, each made when its box is asked for."""

    def __init__(self, item: Item) -> None:
        patches = [patch_from_surface(s, 0) for s in item.surfaces if len(s.faces)]
        parts = _split(patches, components(patches)) if patches else []
        # A solid has at least four faces; skip leaves and sheets.
        self._parts = [p for p in parts if sum(len(patch.faces) for patch in p) >= _LEAST_FACES]
        ends = [points_bounds(np.concatenate([p.positions for p in part])) for part in self._parts]
        self._low, self._high = np.array(ends).reshape(-1, 2, 3).transpose(1, 0, 2)
        self._solids: dict[int, Manifold | None] = {}

    def within(self, low: F64, high: F64) -> Manifold | None:
        """Union of the solids whose boxes meet the box low..high (3,), metres; None without any."""
        near = np.flatnonzero(boxes_meeting(self._low, self._high, low, high)).tolist()
        for k in near:
            if k not in self._solids:
                self._solids[k] = solid_from_patches(self._parts[k], TagTable())
        solids = [s for k in near if (s := self._solids[k]) is not None]
        return unite(solids) if solids else None


def components(patches: Sequence[Patch]) -> list[I64]:
    """For each patch the shell (F,) of each face; faces of all patches are joined at corners within WELD_M."""
    positions = np.concatenate([p.positions for p in patches])
    # Number the places of corners through all patches.
    _, node = numbered_points(np.round(positions / WELD_M))
    label = connected_faces(node[faces_of_patches(patches)])
    # Hand the labels of faces back to their patches.
    ends = np.cumsum([len(p.faces) for p in patches])
    return np.split(label, ends[:-1])


def _split(patches: Sequence[Patch], labels: Sequence[I64]) -> list[list[Patch]]:
    """The parts of the patches that each shell is made of, with the vertices they use."""
    labels_used = np.unique(np.concatenate(labels))
    # Keep the patches of a single shell unchanged.
    if len(labels_used) == 1:
        return [list(patches)]
    shells: list[list[Patch]] = [[] for _ in labels_used]
    for patch, label in zip(patches, labels, strict=True):
        # Sort the faces by shell, in their order within it: a plant has 60,000 leaves.
        order = np.argsort(label, kind="stable")
        starts = np.searchsorted(label[order], labels_used)
        for shell, (a, b) in enumerate(pairwise([*starts.tolist(), len(order)])):
            if a < b:
                shells[shell].append(_part(patch, order[a:b]))
    return shells


def _part(patch: Patch, faces: I64) -> Patch:
    used, corners = np.unique(patch.faces[faces], return_inverse=True)
    return Patch(
        patch.tag,
        patch.positions[used],
        corners.reshape(-1, 3),
        patch.uvs[used],
        patch.normals[used],
    )


def flat_patch(item: Item, index: int) -> FlatPatch | None:
    """The item of that index as one patch of its first surface's tag; None unless planar and one-sided."""
    patches = [patch_from_surface(s, index) for s in item.surfaces if len(s.faces)]
    if not patches:
        return None
    positions, faces = np.concatenate([p.positions for p in patches]), faces_of_patches(patches)
    corners = positions[faces]
    # Average the normals by area; two faces back to back leave no normal.
    normal = (unit_normals(corners) * face_areas(corners)[:, None]).sum(0)
    length = np.linalg.norm(normal)
    if length < 1e-9:
        return None
    normal = normal / length
    # Measure how far the used corners lie off the plane.
    off = (positions - positions[faces[0, 0]]) @ normal
    if np.abs(off[np.unique(faces)]).max() > _FLAT_M:
        return None
    merged = Patch(
        patches[0].tag,
        positions,
        faces,
        np.concatenate([p.uvs for p in patches]),
        np.zeros_like(positions),
    )
    return FlatPatch(merged, normal)
