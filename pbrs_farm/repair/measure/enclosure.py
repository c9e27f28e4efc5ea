"""Which rooms are closed, which are connected, and why others are open; no effects.

A room is closed if full-height walls, or rooms that it opens into, bound its polygon, and it has a
floor and a ceiling, or shares those of the space it opens into (stairwell, hall).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import Room
from pbrs_farm.geometry.connected import connected_nodes
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.planar_surfaces import Cover
from pbrs_farm.repair.structure.prisms import polygons_of
from pbrs_farm.repair.structure.slabs import GAP_M
from pbrs_farm.repair.structure.walls import Wall

_STEP_M = 0.05  # between samples of a room's edge
_OPEN_EDGE_M = 0.075  # a shorter open edge is a fault of the drawing
_OPEN_AREA_M2 = 0.02  # so is a smaller hole in a floor or ceiling
_STOREY_GAP_M = 0.8  # thickest floor between two storeys
_LEAST_M = 0.1  # above the floor: what hangs lower is no ceiling
_PROBES_M = (0.02, 0.12, 0.24)  # out of an edge, to meet the next room behind a thin wall


@dataclass(frozen=True, slots=True)
class Space:
    """Rooms that open into each other."""

    rooms: tuple[str, ...]  # ids
    reasons: tuple[tuple[str, str], ...]  # (room id, why it is open), empty if closed
    wells: tuple[str, ...] = ()  # ids of the stairwells without a room that belong to it

    @property
    def is_closed(self) -> bool:
        """All its rooms are bounded."""
        return not self.reasons

    def explain(self, room_id: str) -> str:
        """Why that room is open: its own reason, or the room it opens into; "" for a closed space."""
        reason_of_room = dict(self.reasons).get(room_id)
        if reason_of_room is not None or not self.reasons:
            return reason_of_room or ""
        room, reason = self.reasons[0]
        return f"it opens into {room}: {reason}"


def spaces_of_rooms(
    real: Sequence[Room], wells: Sequence[Room], walls: Sequence[Wall], covers: Sequence[Cover]
) -> tuple[Space, ...]:
    """Rooms that open into each other, and wells beside them, grouped in the order of their first room."""
    rooms = (*real, *wells)
    areas = [plan.polygon_of_room(r.polygon) for r in rooms]
    links: list[tuple[int, int]] = []  # rooms that open into each other, by index
    reasons: dict[int, str] = {}
    for i in range(len(rooms)):
        openings = [
            # Look sideways, down and up.
            _open_sides_of_room(i, rooms, areas, walls, covers),
            _open_above_or_below(i, rooms, areas, covers, above=False),
            _open_above_or_below(i, rooms, areas, covers, above=True),
        ]
        links += [(i, j) for linked, _ in openings for j in linked]
        why = [reason for _, reason in openings if reason]
        if why:
            reasons[i] = "; ".join(why)
    # Connect the rooms by their links.
    from_room, to_room = np.array(links, int).reshape(-1, 2).T
    labels = connected_nodes(from_room, to_room, len(rooms))
    members = [np.flatnonzero(labels == k).tolist() for k in dict.fromkeys(labels.tolist())]
    return tuple(
        Space(
            tuple(rooms[i].id for i in group if i < len(real)),
            tuple((rooms[i].id, reasons[i]) for i in group if i in reasons),
            tuple(rooms[i].id for i in group if i >= len(real)),
        )
        for group in members
        if group[0] < len(real)
    )


def _open_sides_of_room(
    i: int,
    rooms: Sequence[Room],
    areas: Sequence[plan.Shape],
    walls: Sequence[Wall],
    covers: Sequence[Cover],
) -> tuple[list[int], str]:
    """Rooms that room i opens into through its edge, and why the edge is open, or ""."""
    room = rooms[i]
    # Find samples of the edge without a full-height wall behind.
    points, outward = edge_samples(areas[i])
    floor = np.full(len(points), room.floor_y)
    ceiling = _ceiling_at(points, room, covers)
    bare = ~_walled(points + 0.01 * outward, floor, ceiling, walls)
    for step in _PROBES_M[1:]:
        # A roof that comes down to the middle of the wall closes the gap over its inner edge.
        behind = points + step * outward
        lower = _ceiling_at(behind, room, covers)
        bare &= (lower >= ceiling) | ~_walled(behind, floor, lower, walls)
    linked = []
    for j in plan.near_to(areas[i], range(len(rooms)), areas.__getitem__, 2 * max(_PROBES_M)):
        neighbour = rooms[j]
        if (
            j == i
            or neighbour.floor_y > room.ceiling_y - GAP_M
            or neighbour.ceiling_y < room.floor_y + GAP_M
        ):
            continue
        # Step out of the bare samples until another room of this height is met.
        near = plan.grown(areas[j], GAP_M)
        reached = np.zeros(len(points), np.bool_)
        for step in _PROBES_M:
            reached |= bare & shapely.contains_xy(near, *(points + step * outward).T)
        if reached.any():
            linked.append(j)
            bare &= ~reached
    # Measure what opens into nothing.
    open_m = float(bare.sum() * _STEP_M)
    reason = f"{open_m:.1f} m of its edge have no full-height wall" if open_m > _OPEN_EDGE_M else ""
    return linked, reason


def edge_samples(area: plan.Shape) -> tuple[F64, F64]:
    """Points (N, 2) along the edges of area, holes too, _STEP_M apart, and unit vectors out of it."""
    points, outward = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for polygon in polygons_of(area):
        oriented = shapely.orient_polygons(polygon)
        for ring in (oriented.exterior, *oriented.interiors):
            corners = np.asarray(ring.coords)
            # Sample each side at the centres of equal steps; outside is to the right.
            for a, b in pairwise(corners):
                length = float(np.linalg.norm(b - a))
                n = max(round(length / _STEP_M), 1)
                t = (np.arange(n) + 0.5) / n
                points.append(a + t[:, None] * (b - a))
                normal = np.array([b[1] - a[1], a[0] - b[0]]) / max(length, 1e-12)
                outward.append(np.tile(normal, (n, 1)))
    return np.concatenate(points), np.concatenate(outward)


def _ceiling_at(points: F64, room: Room, covers: Sequence[Cover]) -> F64:
    # Take the lowest ceiling above each point that belongs to this room's height.
    y = np.full(len(points), room.ceiling_y)
    area = plan.polygon_of_room(room.polygon)
    for cover in plan.near_to(area, covers, lambda c: c.area, 0.0):
        if not cover.is_ceiling:
            continue
        heights = cover.plane.at(points)
        # No wall is needed where a roof comes down to the floor.
        least_y = room.floor_y + (-GAP_M if cover.is_roof else _LEAST_M)
        inside = shapely.contains_xy(plan.grown(cover.area, 0.01), points[:, 0], points[:, 1])
        y = np.where(inside & (heights < y) & (heights > least_y), heights, y)
    return y


def _walled(points: F64, low: F64, high: F64, walls: Sequence[Wall]) -> Bools:
    """True if walls cover each point from low to high, within GAP_M sideways."""
    reached = low + 2 * GAP_M  # a wall may begin a little above the floor
    spans = []
    around: plan.Shape = shapely.MultiPoint(points).envelope
    for wall in plan.near_to(around, walls, lambda w: w.footprint, 4 * GAP_M):
        inside = shapely.contains_xy(plan.grown(wall.footprint, GAP_M), points[:, 0], points[:, 1])
        if inside.any():
            spans.append((inside, wall.bottom_y, wall.top_at(points)))
    # Stack walls from the lowest up, as over a window in three parts.
    for inside, bottom, top in sorted(spans, key=lambda s: s[1]):
        grows = inside & (bottom <= reached + GAP_M)
        reached = np.where(grows, np.maximum(reached, top), reached)
    return np.asarray(reached >= high - GAP_M)


def _open_above_or_below(
    i: int,
    rooms: Sequence[Room],
    areas: Sequence[plan.Shape],
    covers: Sequence[Cover],
    *,
    above: bool,
) -> tuple[list[int], str]:
    """Rooms that room i opens into upwards (or downwards), and why it has no cover there, or ""."""
    # Take away what covers the room, then what opens into the next storey.
    beside = plan.near_to(areas[i], covers, lambda c: c.area, 2 * GAP_M)
    near = _covers_of(rooms[i], beside, above=above)
    bare = plan.without(areas[i], *(plan.grown(a, GAP_M) for a in near))
    linked = []
    for j in _storey_next(rooms[i], rooms, above=above):
        if plan.common(bare, areas[j]).area > _OPEN_AREA_M2:
            linked.append(j)
            bare = plan.without(bare, plan.grown(areas[j], GAP_M))
    part = "ceiling" if above else "floor"
    if bare.area <= _OPEN_AREA_M2:
        return linked, ""
    # Report the area that no cover reaches, without the slack of GAP_M.
    exact = plan.common(plan.without(areas[i], *near), plan.grown(bare, 2 * GAP_M))
    return linked, f"{exact.area:.1f} m2 of it have no {part}"


def bare_area(
    room: Room, rooms: Sequence[Room], covers: Sequence[Cover], *, above: bool
) -> plan.Shape:
    """Plan area of a room with neither cover nor a room of the next storey above (or below), small gaps aside."""
    bare = plan.without(plan.polygon_of_room(room.polygon), *_covers_of(room, covers, above=above))
    beyond = [rooms[j].polygon for j in _storey_next(room, rooms, above=above)]
    return plan.without(bare, *(plan.grown(plan.polygon_of_room(p), GAP_M) for p in beyond))


def _covers_of(room: Room, covers: Sequence[Cover], *, above: bool) -> list[plan.Shape]:
    return [cover.area for cover in covers if _closes(room, cover, above=above)]


def _storey_next(room: Room, rooms: Sequence[Room], *, above: bool) -> list[int]:
    # List the rooms one storey up (or down), wherever they lie in plan.
    gaps = [
        storey_room.floor_y - room.ceiling_y if above else room.floor_y - storey_room.ceiling_y
        for storey_room in rooms
    ]
    return [
        j for j, gap in enumerate(gaps) if rooms[j] is not room and -GAP_M <= gap <= _STOREY_GAP_M
    ]


def _closes(room: Room, cover: Cover, *, above: bool) -> bool:
    # Count a ceiling, or the floor of the storey above, upwards; and the other way round.
    area = cover.area
    if cover.is_roof:
        # Its eaves hang lower, outside.
        area = plan.common(area, plan.polygon_of_room(room.polygon))
    corners = shapely.get_coordinates(area)
    if not len(corners):
        return False
    heights = cover.plane.at(corners)
    if above:
        if cover.is_roof:
            return bool(
                heights.max() > room.floor_y + _LEAST_M
                and heights.min() < room.ceiling_y + _STOREY_GAP_M
            )
        if cover.is_ceiling:
            return bool(
                heights.min() > room.floor_y + _LEAST_M
                and heights.min() < room.ceiling_y + _STOREY_GAP_M
            )
        return bool(-GAP_M <= heights.min() - room.ceiling_y <= _STOREY_GAP_M)
    if cover.is_ceiling:
        return bool(-GAP_M <= room.floor_y - heights.max() <= _STOREY_GAP_M)
    return bool(abs(heights.max() - room.floor_y) < 2 * GAP_M)
