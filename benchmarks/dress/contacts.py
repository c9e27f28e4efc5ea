"""Whether dressed things enter others, float, or stand before doors: by Embree's rays, not by the gates' code.

A point is inside a mesh where most rays in 13 directions leave through an odd number of faces; an
edge crosses a face where more than 1 cm of it lies on either side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from pbrs_farm.core.house import House, Item, ItemKind

Floats = NDArray[np.float64]

DEEP_M, GAP_M, RING_M = 0.01, 0.002, 0.003
_NO_WALL_M = 0.05  # half a wall, where none is found beside a door
N_POINTS = 250  # of a thing that are looked for inside another
FLAT = 0.5  # cosine to a face's normal below which an edge only grazes it
_STRUCTURE = (ItemKind.FLOOR, ItemKind.CEILING, ItemKind.GROUND, ItemKind.PERSON)
_OPENINGS = (ItemKind.WALL, ItemKind.WINDOW, ItemKind.DOOR)
_RUG, _CURTAIN, _BLINDS = 20, 16, 13  # NYU40
CLOTHS = ("#duvet", "#throw", "#crumpled_clothes", "#napkin")


@dataclass(eq=False)
class Thing:
    """An item as a mesh, and whether dressing put it there."""

    item: Item
    mesh: Any
    is_new: bool
    bounds: Floats
    _rays: Any = field(default=None)
    _parts: list[Any] | None = field(default=None)

    @property
    def rays(self) -> Any:
        """Embree over its triangles."""
        if self._rays is None:
            self._rays = trimesh.ray.ray_pyembree.RayMeshIntersector(self.mesh, scale_to_box=False)
        return self._rays

    @property
    def parts(self) -> list[Any]:
        """Its connected parts, closed or not."""
        if self._parts is None:
            self._parts = list(self.mesh.split(only_watertight=False)) or [self.mesh]
        return self._parts


def things_of(house: House, source: House) -> list[Thing]:
    """Every item with triangles; new is what the source lacks or has another mesh of."""
    found = []
    for k, item in enumerate(house.items):
        parts = [s.positions[s.faces].astype(np.float64) for s in item.surfaces if len(s.faces)]
        if not parts:
            continue
        corners = np.concatenate(parts)
        was = source.items[k] if k < len(source.items) else None
        old = [s.positions[s.faces].astype(np.float64) for s in was.surfaces] if was else []
        # Walls and floors keep their shape; surfaces may cut their triangles anew.
        is_kept = was is not None and was.kind.is_structure
        is_new = not is_kept and (not old or not _equal(np.concatenate(old), corners))
        faces = np.arange(3 * len(corners)).reshape(-1, 3)
        mesh = trimesh.Trimesh(corners.reshape(-1, 3), faces, process=False)
        mesh.merge_vertices()
        points = corners.reshape(-1, 3)
        found.append(Thing(item, mesh, is_new, np.array([points.min(0), points.max(0)])))
    return found


def _equal(a: Floats, b: Floats) -> bool:
    # Doors are parted into leaf and frame: the same triangles in another order.
    if a.shape != b.shape:
        return False
    rows = [x.reshape(len(x), 9) for x in (a, b)]
    return bool(np.array_equal(*(r[np.lexsort(r.T[::-1])] for r in rows)))


def penetrations(things: Sequence[Thing]) -> list[tuple[str, str, float]]:
    """(thing, thing, metres) of pairs that share more than 1 cm, one of them new."""
    low = np.array([t.bounds[0] for t in things])
    high = np.array([t.bounds[1] for t in things])
    found = []
    for i, a in enumerate(things):
        if not a.is_new or a.item.kind in _STRUCTURE:
            continue
        apart = np.minimum(high[i] - low, high - low[i]).min(1)
        for j in np.flatnonzero(apart > DEEP_M):
            b = things[int(j)]
            if i == j or (b.is_new and j > i) or b.item.kind in _STRUCTURE or _allowed(a, b):
                continue
            depth = max(_deep(a, b), _deep(b, a), _crossing(a, b), _crossing(b, a))
            if depth > DEEP_M and (met := _parts_that_meet(a, b)):
                edges = (max(_crossing(p, q), _crossing(q, p)) for p, q in met)
                depth = max(_deep(a, b), _deep(b, a), *edges)
                if depth > DEEP_M:
                    found.append((a.item.id, b.item.id, round(depth, 4)))
    return found


def _parts_that_meet(a: Thing, b: Thing) -> list[tuple[Thing, Thing]]:
    """Pairs of connected parts that must be moved by more than 1 cm along an axis to be apart.

    An edge that lies in another's face crosses it along its whole length, however shallow that is: a
    cushion that sinks in a seat by half a centimetre crosses the seat's edges by half the seat.
    """
    return [
        (Thing(a.item, p, a.is_new, p.bounds), Thing(b.item, q, b.is_new, q.bounds))
        for p in a.parts
        for q in b.parts
        if np.minimum(p.bounds[1] - q.bounds[0], q.bounds[1] - p.bounds[0]).min() > DEEP_M
    ]


def _allowed(a: Thing, b: Thing) -> bool:
    return any(
        (x.is_new and x.item.nyu40 == _RUG)
        or (x.item.nyu40 in (_CURTAIN, _BLINDS) and y.item.kind in _OPENINGS)
        for x, y in ((a, b), (b, a))
    )


def _deep(a: Thing, b: Thing) -> float:
    """How deep the deepest of some points of a lies inside b, metres."""
    points, _face = trimesh.sample.sample_surface(a.mesh, N_POINTS, seed=1)
    return depth_of_points(np.concatenate([points, a.mesh.vertices[: 4 * N_POINTS]]), b)


def depth_of_points(points: Floats, b: Thing) -> float:
    """How deep the deepest of points (N, 3) lies inside b, metres; 0 where all are outside."""
    points = points[((points > b.bounds[0]) & (points < b.bounds[1])).all(1)]
    if not len(points):
        return 0.0
    around = trimesh.creation.icosphere(subdivisions=0).vertices
    directions = np.vstack([around, np.array([[0.0, 1.0, 0.0]])])
    directions += np.array([0.013, 0.007, -0.011])
    n = len(directions)
    _face, ray = b.rays.intersects_id(
        np.repeat(points, n, 0), np.tile(directions, (len(points), 1)), multiple_hits=True
    )[:2]
    odd = np.bincount(ray, minlength=n * len(points)).reshape(-1, n) % 2 == 1
    inside = points[odd.sum(1) >= 11]
    if not len(inside):
        return 0.0
    return max(float(_nearest(b, point)) for point in inside[:60])


def _nearest(thing: Thing, point: Floats) -> float:
    """The least distance from a point to a thing's faces along 162 directions, metres."""
    ways = trimesh.creation.icosphere(subdivisions=2).vertices
    _face, _ray, where = thing.rays.intersects_id(
        np.tile(point, (len(ways), 1)), ways, multiple_hits=False, return_locations=True
    )
    return float(np.linalg.norm(where - point, axis=1).min(initial=np.inf))


def _crossing(a: Thing, b: Thing) -> float:
    """The most of an edge of a that lies on either side of a face of b which it crosses."""
    start, end = (a.mesh.vertices[a.mesh.edges_unique[:, k]] for k in (0, 1))
    length = np.linalg.norm(end - start, axis=1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    near = (length > 2 * DEEP_M) & ((low < b.bounds[1]) & (high > b.bounds[0])).all(1)
    start, end, length = start[near], end[near], length[near]
    if not len(start):
        return 0.0
    along = (end - start) / length[:, None]
    face, ray, where = b.rays.intersects_id(start, along, multiple_hits=True, return_locations=True)
    if not len(face):
        return 0.0
    t = ((where - start[ray]) * along[ray]).sum(1)
    steep = np.abs((b.mesh.face_normals[face] * along[ray]).sum(1)) > FLAT
    either = np.minimum(t, length[ray] - t)
    return float(either[steep].max(initial=0.0))


def floating(things: Sequence[Thing]) -> list[tuple[str, float]]:
    """(thing, gap in metres) of new things that touch nothing within 2 mm where they should."""
    scene = _Scene(things)
    found = []
    for k, thing in enumerate(things):
        if not thing.is_new or thing.item.kind in _STRUCTURE:
            continue
        # A cloth's hem hangs beside what it lies on.
        ring_m = np.inf if thing.item.source_class.endswith(CLOTHS) else RING_M
        gap = min((scene.gap(k, ways, ring_m) for ways in _ways_of(thing)), key=abs, default=np.inf)
        if gap > GAP_M:
            found.append((thing.item.id, round(float(gap), 4)))
    return found


_DOWN, _UP = np.array([[0.0, -1.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])
_TURNS = np.linspace(0, 2 * np.pi, 16, endpoint=False)
_ACROSS = np.stack([np.cos(_TURNS), np.zeros(16), np.sin(_TURNS)], 1)


def _ways_of(thing: Thing) -> list[Floats]:
    """Where a thing may be held: what stands, below; what hangs, at a wall or a ceiling."""
    part = thing.item.id.split("-")[1] if thing.item.id.startswith("dress-") else "swap"
    if part in ("clutter", "dress"):
        return [_DOWN]
    return [_DOWN, _ACROSS, _UP]


class _Scene:
    # All things, and the triangles near one of them.
    def __init__(self, things: Sequence[Thing]) -> None:
        self._things = things
        self._low = np.array([t.bounds[0] for t in things])
        self._high = np.array([t.bounds[1] for t in things])

    def gap(self, k: int, ways: Floats, ring_m: float) -> float:
        """The least distance from vertices to another thing's face, along any of ways.

        ring_m: how far behind the outermost vertex that way the others may lie.
        """
        others = self._others(k)
        if others is None:
            return float("inf")
        vertices = self._things[k].mesh.vertices
        best, back = np.inf, 0.03
        for way in ways:
            reach = vertices @ way
            outer = vertices[reach > reach.max() - ring_m]
            outer = outer[:: max(1, len(outer) // (40 if np.isfinite(ring_m) else 400))]
            _face, ray, where = others.intersects_id(
                outer - back * way, np.tile(way, (len(outer), 1)), multiple_hits=True,
                return_locations=True,
            )  # fmt: skip
            distance = np.abs(((where - outer[ray]) * way).sum(1))
            best = min(best, float(distance.min(initial=np.inf)))
        return best

    def _others(self, k: int) -> Any:
        """Embree over what is near the thing, without it: a second hit within 1 mm would be lost."""
        low, high = self._things[k].bounds[0] - 0.05, self._things[k].bounds[1] + 0.05
        near = ((self._low < high) & (self._high > low)).all(1)
        near[k] = False
        corners = [self._things[int(j)].mesh.triangles for j in np.flatnonzero(near)]
        if not corners:
            return None
        points = np.concatenate(corners).reshape(-1, 3)
        mesh = trimesh.Trimesh(points, np.arange(len(points)).reshape(-1, 3), process=False)
        return trimesh.ray.ray_pyembree.RayMeshIntersector(mesh, scale_to_box=False)


def blocked_doors(house: House, things: Sequence[Thing]) -> list[tuple[str, str]]:
    """(door, thing) of new bodies within 0.8 m of a door or in its swing, by rays across that space."""
    found = []
    new = [t for t in things if t.is_new and t.item.nyu40 not in (_RUG, _CURTAIN, _BLINDS)]
    walls = [t for t in things if t.item.kind is ItemKind.WALL]
    floors = [room.floor_y for room in house.rooms]
    for opening in house.openings:
        quad = np.asarray(opening.quad, np.float64)
        if opening.is_window or np.ptp(quad[:, 1]) < 1.6:
            continue
        normal = np.asarray(opening.normal) * [1, 0, 1]
        normal /= np.linalg.norm(normal)
        along = np.array([normal[2], 0, -normal[0]])
        centre, s = quad.mean(0), quad @ along
        width, bottom = float(np.ptp(s)), float(quad[:, 1].min())
        floor = min(floors, key=lambda y, b=bottom: abs(y - b))
        for out in (normal, -normal):
            face = half_wall(walls, centre, along, out, width)
            starts = centre + out * (face + 0.03)
            places = [
                starts + along * x + np.array([0, y - centre[1], 0])
                for x in np.arange(-width / 2 + 0.02, width / 2 - 0.01, 0.04)
                for y in np.arange(floor + 0.04, floor + 2.0, 0.08)
            ]
            for thing in new:
                middle, size = thing.bounds.mean(0), np.ptp(thing.bounds, axis=0)
                if np.linalg.norm((middle - starts)[[0, 2]]) > np.linalg.norm(size) / 2 + 1.6:
                    continue
                t = _first(thing, np.array(places), out)
                if (t < max(0.8, min(width, 1.0)) - 0.03).any():
                    found.append((opening.id, thing.item.id))
    return found


def half_wall(
    walls: Sequence[Thing], centre: Floats, along: Floats, out: Floats, width: float
) -> float:
    """How far the wall reaches on one side of a door's middle plane, beside the door."""
    beside = []
    for x in (-width / 2 - 0.08, width / 2 + 0.08):
        place = centre + along * x
        # The wall that the place lies in is left through a face that looks out.
        beside += [t for wall in walls if 0 < (t := _way_out(wall, place, out)) < 0.6]
    # At a corner one place lies in the wall across, which reaches farther than the door's own.
    return min(beside, default=_NO_WALL_M)


def _way_out(wall: Thing, place: Floats, way: Floats) -> float:
    """How far the wall's first face along the way is, 0 where it is met from outside."""
    face, _ray, where = wall.rays.intersects_id(
        place[None], way[None], multiple_hits=False, return_locations=True
    )
    if not len(face) or float(wall.mesh.face_normals[face[0]] @ way) <= 0:
        return 0.0
    return float((where[0] - place) @ way)


def _first(thing: Thing, places: Floats, way: Floats) -> Floats:
    face, ray, where = thing.rays.intersects_id(
        places, np.tile(way, (len(places), 1)), multiple_hits=False, return_locations=True
    )
    t = np.full(len(places), np.inf)
    if len(face):
        t[ray] = ((where - places[ray]) * way).sum(1)
    return t
