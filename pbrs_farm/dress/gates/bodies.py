"""The items of a house as seen by the gates: triangles, bounds, connected shells; no effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Piece
from pbrs_farm.core.house import Item
from pbrs_farm.core.mesh import edges_are_paired, points_bounds, signed_volume
from pbrs_farm.dress.mutable_house import ADDED_TAG, MutableHouse
from pbrs_farm.geometry.connected import connected_faces
from pbrs_farm.geometry.surface_points import item_triangles
from pbrs_farm.geometry.swept import Swept, swept_by_item

Faces = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Shell:
    """A connected part of a mesh."""

    vertices: F64  # (V, 3) metres
    faces: Faces  # (F, 3)
    low: F64  # (3,)
    high: F64
    is_closed: bool  # each directed edge has its reverse, and the faces look outwards

    @property
    def corners(self) -> F64:
        """(F, 3, 3) its triangles."""
        return np.asarray(self.vertices[self.faces])


@dataclass(eq=False)
class Body:
    """An item with its geometry, and whether dressing added it."""

    index: int  # in MutableHouse.items
    item: Item
    corners: F64  # (F, 3, 3) finite triangles, metres
    low: F64  # (3,)
    high: F64
    is_new: bool  # added, or another mesh than the source's
    was: Item | None  # the replaced item of the source; None for added items
    piece: Piece | None  # it was made from
    stops: dict[str, dict[int, float]] = field(default_factory=dict, repr=False)
    """Part -> id() of another item -> joint value at which it stops the part: cache of gates/fronts.py."""

    @property
    def group(self) -> str:
        """Catalogue group of the item; "" for an item of the source."""
        return self.piece.group if self.piece else ""

    @cached_property
    def shells(self) -> list[Shell]:
        """Its connected parts."""
        return shells_of(self.corners)

    @cached_property
    def swept(self) -> list[Swept]:
        """The space that each of its doors and drawers sweeps."""
        return swept_by_item(self.item)


def bodies_of(
    house: MutableHouse, pieces: Mapping[str, Piece], reusable: Mapping[int, Body] | None = None
) -> list[Body]:
    """A body for each item with triangles, in order; reusable: known ones by item id."""
    bodies = []
    n_source = len(house.source.items)
    for index, item in enumerate(house.items):
        was = house.source.items[index] if index < n_source else None
        cached = (reusable or {}).get(id(item))
        if cached is not None:
            cached.index = index
            bodies.append(cached)
            continue
        corners = item_triangles(item)
        if not len(corners):
            continue
        low, high = points_bounds(corners.reshape(-1, 3))
        # Walls are cut where rooms meet, but stay in place; boards lie along them.
        is_new = not item.kind.is_structure and (was is None or not has_same_mesh(item, was))
        piece = pieces.get(piece_id(item)) if is_new else None
        bodies.append(Body(index, item, corners, low, high, is_new, was, piece))
    return bodies


def piece_id(item: Item) -> str:
    """The id of the catalogue's piece of an added or swapped item, by its tags; "" for others."""
    return next((t.removeprefix(ADDED_TAG) for t in item.tags if t.startswith(ADDED_TAG)), "")


def has_same_mesh(a: Item, b: Item) -> bool:
    """True if two items have the same triangles to the bit, whatever their order and materials."""
    if a is b or a.surfaces is b.surfaces:
        return True
    if a.n_faces != b.n_faces:
        return False
    if len(a.surfaces) == len(b.surfaces) and all(
        s is t
        or (s.positions is t.positions and s.faces is t.faces)
        or np.array_equal(s.positions[s.faces], t.positions[t.faces])
        for s, t in zip(a.surfaces, b.surfaces, strict=True)
    ):
        return True
    # Doors are parted into leaf and frame: their triangles come in another order.
    mine, theirs = (item_triangles(x).reshape(-1, 9) for x in (a, b))
    order, other_order = (np.lexsort(rows.T[::-1]) for rows in (mine, theirs))
    return np.array_equal(mine[order], theirs[other_order])


def shells_of(corners: F64) -> list[Shell]:
    """The connected parts of triangles (F, 3, 3), joined at corners equal to the bit, degenerate ones left out."""
    faces, vertices = welded(corners)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(1)]
    if not len(faces):
        return []
    of_face = connected_faces(faces)
    order = np.argsort(of_face, kind="stable")
    cuts = np.flatnonzero(np.diff(of_face[order])) + 1
    return [_shell(vertices, faces[rows]) for rows in np.split(order, cuts)]


def _shell(vertices: F64, faces: Faces) -> Shell:
    used, numbers = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], numbers.reshape(-1, 3)
    low, high = points_bounds(vertices)
    is_closed = edges_are_paired(faces)
    # Flip an inverted closed shell; one without volume is a sheet.
    if is_closed:
        volume = signed_volume(vertices[faces], low)
        is_closed = abs(volume) > 1e-9
        faces = faces[:, ::-1] if volume < 0 else faces
    return Shell(vertices, faces, low, high, is_closed)


def welded(corners: F64) -> tuple[Faces, F64]:
    """(F, 3) numbers of places and the places (V, 3), different to the bit but for -0, of triangles."""
    points = np.ascontiguousarray(corners.reshape(-1, 3)) + 0.0  # no negative zero
    # Compare the bits of whole points: faster than comparing column by column.
    keys = points.view(np.dtype((np.void, 24))).ravel()
    _, first, numbers = np.unique(keys, return_index=True, return_inverse=True)
    return numbers.reshape(-1, 3).astype(np.int64), points[first]


def boxes_of(bodies: Sequence[Body]) -> tuple[F64, F64]:
    """(N, 3) lowest and highest corners of bodies, metres."""
    low = np.array([b.low for b in bodies]).reshape(-1, 3)
    return low, np.array([b.high for b in bodies]).reshape(-1, 3)
