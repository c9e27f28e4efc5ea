"""A mesh of several planar walls -> an item per plane, so that repair can thicken each; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import I64
from pbrs_farm.core.house import Item, ItemKind, Surface, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors, closed_edge_share
from pbrs_farm.read.common.placed_mesh import part_of

MAX_PLANES: Final = 200  # A wall of more planes is sculpted, not built of sheets, and stays whole

_WELD_M: Final = 1e-4  # corners this near are one


def planar_parts(item: Item) -> tuple[Item, ...]:
    """An open wall mesh as one item per plane its faces lie in (to a degree and a centimetre).

    A closed wall, a wall of one plane and whatever is no wall come back as they are.
    """
    if item.kind is not ItemKind.WALL or _is_closed(item.surfaces):
        return (item,)
    plane_of_face = plane_of_faces(item.surfaces)
    n = int(plane_of_face.max(initial=0)) + 1
    if not 1 < n <= MAX_PLANES:
        return (item,)
    # Gather the faces of each plane from all surfaces.
    ends = np.cumsum([len(s.faces) for s in item.surfaces])[:-1]
    by_surface = np.split(plane_of_face, ends)
    found = []
    for plane in range(n):
        parts = tuple(
            part_of(s, s.faces[of_face == plane], s.name)
            for s, of_face in zip(item.surfaces, by_surface, strict=True)
            if (of_face == plane).any()
        )
        found.append(replace(item, id=f"{item.id}.{plane}", surfaces=parts, lights=(), box=None))
    return (replace(found[0], lights=item.lights), *found[1:])


def _is_closed(surfaces: Sequence[Surface]) -> bool:
    """Whether every edge has a face on either side, vertices within a tenth of a millimetre one."""
    return closed_edge_share(np.rint(corners_of_surfaces(surfaces) / _WELD_M)) == 1


def plane_of_faces(surfaces: Sequence[Surface]) -> I64:
    """(F,) number of the plane each face lies in, either side up, in order of first appearance."""
    p = corners_of_surfaces(surfaces)
    n = area_vectors(p)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-12)
    # Make the two sides of a plane one: the leading component of its normal is positive.
    leading = np.abs(n).argmax(1)
    n *= np.sign(n[np.arange(len(n)), leading])[:, None]
    offset = np.einsum("ij,ij->i", n, p.mean(1))
    # Equal planes agree in normal to about a degree and in offset to a centimetre.
    key = np.rint(np.column_stack([n * 50, offset * 100]))
    _, first, plane = np.unique(key, axis=0, return_index=True, return_inverse=True)
    # Number planes by first appearance, so that ids are stable.
    order = np.argsort(np.argsort(first))
    return np.asarray(order[plane.reshape(-1)], np.int64)
