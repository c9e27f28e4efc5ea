"""Portals: the openings that daylight enters by, as rectangles to sample, and their panes; no effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Material, MaterialKind, Surface, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors, face_areas, faces_with_area

MAX_PORTALS: Final = 6  # sampled for one view
_BESIDE_M: Final = 0.35  # from a pane to a point on its side: beyond the wall's face


def portals_of_house(house: House) -> F64:
    """(K, 4, 3) rectangles through which daylight enters: windows, and doors with panes."""
    # Count a door as a portal when one of its surfaces is a pane.
    glazed = {
        item.id
        for item in house.items
        if any(house.materials[s.material].kind is MaterialKind.PANE for s in item.surfaces)
    }
    quads = [
        np.asarray(o.quad, np.float64)
        for o in house.openings
        if (o.is_window or o.item_id in glazed) and _is_rectangle(np.asarray(o.quad))
    ]
    return np.array(quads).reshape(-1, 4, 3)


def panes_of_house(house: House) -> House | None:
    """The house's window panes alone, mirrors between rooms, else clear glass; None without panes."""
    is_pane = [m.kind is MaterialKind.PANE for m in house.materials]
    clear = Material("pane", kind=MaterialKind.GLASS, opacity=0.0)
    inner, between = len(house.materials), Material("inner pane", kind=MaterialKind.MIRROR)

    def panes_of(surfaces: tuple[Surface, ...]) -> tuple[Surface, ...]:
        panes = (s for s in surfaces if is_pane[s.material])
        return tuple(
            replace(s, material=inner) if _is_between_rooms(house, s) else s for s in panes
        )

    items = [replace(i, surfaces=panes_of(i.surfaces), lights=()) for i in house.items]
    materials = [clear if p else m for m, p in zip(house.materials, is_pane, strict=True)]
    panes = replace(
        house.with_items(i for i in items if i.surfaces), materials=(*materials, between)
    )
    has_area = any(
        faces_with_area(corners_of_surfaces(i.surfaces), 1e-6).any() for i in panes.items
    )
    return panes if has_area else None


def _is_between_rooms(house: House, pane: Surface) -> bool:
    """True if a room with a ceiling is on either side of a pane."""
    corners = corners_of_surfaces([pane])
    normal = area_vectors(corners)
    normal = normal[(normal**2).sum(1).argmax()] if len(normal) else np.zeros(3)
    length = float(np.linalg.norm(normal))
    if length == 0:
        return False
    middle = corners.reshape(-1, 3).mean(0)
    sides = [middle + sign * _BESIDE_M * normal / length for sign in (-1, 1)]
    rooms = [room for room in house.rooms if room.has_ceiling]
    return all(
        any(
            room.floor_y <= y <= room.ceiling_y
            and shapely.contains_xy(shapely.Polygon(room.polygon), x, z)
            for room in rooms
        )
        for x, y, z in sides
    )


def nearest_portals(portals: F64, eye: F64) -> F64:
    """At most MAX_PORTALS of them, those of the largest solid angle from eye (3,), roughly."""
    if len(portals) <= MAX_PORTALS:
        return portals
    area = 2 * face_areas(portals[:, [0, 1, 3]])
    distance = np.linalg.norm(portals.mean(1) - eye, axis=1)
    order = np.argsort(-area / np.maximum(distance, 0.1) ** 2, kind="stable")
    return np.asarray(portals[np.sort(order[:MAX_PORTALS])])


def _is_rectangle(quad: NDArray[np.floating]) -> bool:
    # Ask for an area, a right angle, and a fourth corner that closes a parallelogram.
    if quad.shape != (4, 3) or not np.isfinite(quad).all():
        return False
    a, b = quad[1] - quad[0], quad[3] - quad[0]
    size = np.linalg.norm(a) * np.linalg.norm(b)
    closes = np.linalg.norm(quad[0] + a + b - quad[2]) < 1e-3 * (1 + np.sqrt(size))
    return bool(size > 1e-4 and abs(a @ b) < 1e-2 * size and closes)
