"""The leak meter: rays in closed spaces, openings plugged; none may reach the sky. No effects.

The sky's radiance is 1 and everything else is black, so a ray that hits nothing is light that
leaks in. Rays follow diffuse bounces, so that a crack which is not straight counts too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import shapely

from pbrs_farm.core.arrays import F32, F64, I32
from pbrs_farm.core.house import House, Item, ItemKind, Surface, geometry_from_house
from pbrs_farm.core.mesh import dots, triangle_corners, unit_normals, unit_vectors
from pbrs_farm.repair.measure.enclosure import Space
from pbrs_farm.repair.measure.room_interiors import RoomInterior
from pbrs_farm.repair.repair_report import Leak, LeakReport, SpaceLeaks
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.plan_geometry import Shape
from pbrs_farm.repair.structure.prisms import Plane, lifted, polygons_of

WITHIN_M = 0.005  # how near to an edge rays start
_MAX_LEAKS = 50  # of a space, kept with their rays


class Occluder(Protocol):
    """First hits of rays with the triangles of one house (faces as in geometry_from_house)."""

    def first_hit(
        self, origins: F32, directions: F32, max_distance: float = ...
    ) -> tuple[F32, I32]:
        """Distance (N,) in metres, inf = a miss, and face index (N,), -1 = a miss, of rays (N, 3)."""
        ...


@dataclass(frozen=True, slots=True)
class LeakMeter:
    """How closely the meter looks."""

    step_m: float = 0.025  # between starts, along edges where walls, floor and ceiling meet
    per_start: int = 48  # rays from each
    n_inside: int = 1000  # random points per space
    per_inside: int = 48  # rays from each
    n_bounces: int = 2  # after the first flight


def leaks_of_house(
    house: House,
    spaces: Sequence[Space],
    interiors: Mapping[str, Sequence[RoomInterior]],
    plugs: Sequence[Surface],
    occluder_from: Callable[[House], Occluder],
    meter: LeakMeter | None = None,
) -> LeakReport:
    """Rays of each closed space that reach the sky through structure and plugs of a repaired house."""
    meter = LeakMeter() if meter is None else meter
    # Trace rays against the structure alone, its openings filled.
    shell = plugged_shell(house, plugs)
    geometry = geometry_from_house(shell)
    normals = unit_normals(triangle_corners(geometry.positions, geometry.faces))
    closed = [s for s in spaces if s.is_closed]
    occluder = occluder_from(shell) if closed else None
    rng = np.random.default_rng(0)  # fixed: the report is a function of the house
    measured = []
    for space in closed:
        inside = [a for r in (*space.rooms, *space.wells) for a in interiors[r]]
        origins, directions = _rays(inside, meter, rng)
        assert occluder is not None
        measured.append(_measure_space(space, origins, directions, normals, occluder, meter, rng))
    areas = {r.id: float(shapely.area(plan.polygon_of_room(r.polygon))) for r in house.rooms}
    in_closed = sum(areas[r] for s in closed for r in s.rooms)
    return LeakReport(
        spaces=tuple(measured),
        n_rays=sum(s.n_rays for s in measured),
        n_blind=sum(s.n_blind for s in measured),
        n_sky=sum(s.n_sky for s in measured),
        closed_share=round(in_closed / max(sum(areas.values()), 1e-9), 4),
    )


def plugged_shell(house: House, plugs: Sequence[Surface]) -> House:
    """The structure of a house, without the ground, its openings filled with plugs; for measurements."""
    items = [i for i in house.items if i.kind.is_structure and i.kind is not ItemKind.GROUND]
    plug = Item("plugs", "plugs", ItemKind.WALL, house.levels[0].id, tuple(plugs))
    return replace(house, items=(*items, plug))


def _rays(
    interiors: Sequence[RoomInterior], meter: LeakMeter, rng: np.random.Generator
) -> tuple[F64, F64]:
    if not interiors:
        return np.zeros((0, 3)), np.zeros((0, 3))
    # Start densely along edges, where leaks are, and by area inside.
    edges = np.concatenate([_edge_starts(a, meter.step_m, rng) for a in interiors])
    areas = np.array([a.area.area for a in interiors])
    shares = rng.multinomial(meter.n_inside, areas / areas.sum())
    inside = np.concatenate(
        [_points_in_interior(a, int(n), rng) for a, n in zip(interiors, shares, strict=True)]
    )
    origins = np.concatenate(
        [np.repeat(edges, meter.per_start, 0), np.repeat(inside, meter.per_inside, 0)]
    )
    return origins, unit_vectors(rng.normal(size=origins.shape))


def _edge_starts(interior: RoomInterior, step_m: float, rng: np.random.Generator) -> F64:
    """Points within 5 mm of the edges where walls, floor and ceiling meet, in the interior."""
    inset = 0.5 * WITHIN_M
    knee = interior.low.raised(interior.foot_m + inset)  # top of the baseboards
    point_sets = [
        *_points_along_edges(interior.foot, interior.low.raised(inset), step_m, rng),
        *_points_along_edges(interior.area, interior.high.raised(-inset), step_m, rng),
        *_points_on_sides(interior.area, knee, interior.high.raised(-inset), step_m, rng),
    ]
    if interior.foot_m > 0:
        point_sets += _points_on_sides(
            interior.foot, interior.low.raised(inset), knee.raised(-2 * inset), step_m, rng
        )
    # Scatter the starts, but less than their distance from the edge.
    points = np.concatenate([np.zeros((0, 3)), *point_sets])
    return np.asarray(points + rng.uniform(-0.4, 0.4, points.shape) * WITHIN_M)


def _inner_rings(area: Shape) -> list[shapely.LinearRing]:
    # Draw the outline back from the walls by half that distance.
    inner = shapely.buffer(area, -0.5 * WITHIN_M, join_style="mitre", mitre_limit=2.0)
    return [r for p in polygons_of(inner) for r in (p.exterior, *p.interiors)]


def _points_along_edges(
    area: Shape, plane: Plane, step_m: float, rng: np.random.Generator
) -> list[F64]:
    points_by_edge = []
    for ring in _inner_rings(area):
        n = max(int(ring.length / step_m), 8)
        steps = ring.length * (np.arange(n) + rng.random()) / n  # stratified, one random shift
        points = shapely.get_coordinates(shapely.line_interpolate_point(ring, steps))
        points_by_edge.append(lifted(points, plane.at(points)))
    return points_by_edge


def _points_on_sides(
    area: Shape, low: Plane, high: Plane, step_m: float, rng: np.random.Generator
) -> list[F64]:
    points_by_side = []
    for ring in _inner_rings(area):
        corners = np.asarray(ring.coords)[:-1]
        for corner, y0, y1 in zip(corners, low.at(corners), high.at(corners), strict=True):
            n = max(int((y1 - y0) / step_m), 2)
            y = y0 + (np.arange(n) + rng.random()) / n * (y1 - y0)
            points_by_side.append(lifted(np.tile(corner, (n, 1)), y))
    return points_by_side


def _points_in_interior(interior: RoomInterior, n: int, rng: np.random.Generator) -> F64:
    area = shapely.buffer(interior.foot, -0.02)
    if n == 0 or shapely.is_empty(area):
        return np.zeros((0, 3))
    x0, z0, x1, z1 = area.bounds
    inside = np.zeros((0, 2))
    # Reject points of the box outside the room.
    while len(inside) < n:
        points = rng.uniform((x0, z0), (x1, z1), (4 * n, 2))
        inside = np.concatenate([inside, points[shapely.contains_xy(area, *points.T)]])
    inside = inside[:n]
    low, high = interior.low.at(inside) + 0.02, interior.high.at(inside) - 0.02
    return lifted(inside, low + rng.random(n) * (high - low))


def _measure_space(
    space: Space,
    origins: F64,
    directions: F64,
    normals: F64,
    occluder: Occluder,
    meter: LeakMeter,
    rng: np.random.Generator,
) -> SpaceLeaks:
    n_sky = n_blind = 0
    leaks: list[Leak] = []
    p, d = origins, directions
    for flight in range(meter.n_bounces + 1):
        distance, face = occluder.first_hit(p.astype(np.float32), d.astype(np.float32))
        # Count the rays that meet nothing and keep the first of them.
        gone = ~np.isfinite(distance)
        n_sky += int(gone.sum())
        leaks += [
            Leak(origin=_triple(a), direction=_triple(b))
            for a, b in zip(p[gone][: _MAX_LEAKS - len(leaks)], d[gone], strict=False)
        ]
        # Go on from the front of faces; absorb rays that see a back, inside a solid.
        hits = np.flatnonzero(~gone)
        n, towards = normals.take(face[hits], 0), d.take(hits, 0)
        is_front = dots(towards, n) < 0
        if flight == 0:
            n_blind = len(hits) - int(is_front.sum())
        front, n = hits[is_front], n[is_front]
        reached = p[front] + towards[is_front] * distance[front, None].astype(np.float64)
        # Bounce diffusely: a point on a unit sphere that touches the face.
        d = unit_vectors(unit_vectors(rng.normal(size=n.shape)) + n)
        p = reached + 1e-4 * n
    return SpaceLeaks(
        rooms=space.rooms,
        n_rays=len(origins),
        n_blind=n_blind,
        n_sky=n_sky,
        leaks=tuple(leaks[:_MAX_LEAKS]),
    )


def _triple(v: F64) -> tuple[float, float, float]:
    return round(float(v[0]), 5), round(float(v[1]), 5), round(float(v[2]), 5)
