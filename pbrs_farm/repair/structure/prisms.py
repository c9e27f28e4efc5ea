"""Vertical prisms between two planes over a plan polygon: slabs, joints, plugs; no effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import manifold3d
import numpy as np
import shapely
from manifold3d import Manifold
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import Patch, Tag, TagTable, solid_from_patches

UvMap = Callable[[F64], F64]
"""Texture coordinates (N, 2) of positions (N, 3)."""

_ON_PLANE_M = 1e-3  # points of a plane lie no farther from it
MAX_UV_OFF = 1e-3
"""Texture widths; beyond it a texture is no affine map of the plan."""
FACE_M = 0.02
"""Thickness of the layer with the visible face, where a solid is a layer before a base."""
BASE_BEHIND_M = 0.01
"""The base begins this far behind the face, inside that layer."""
_MOST_UV_PARTS = 200  # maximum parts with different texture mappings, one solid each
# Half the width of what parts rings; the next where one is too small.
_CRUMBS_M = (1e-5, 1e-4, 1e-3)


@dataclass(frozen=True, slots=True)
class Plane:
    """The heights y = a x + b z + c of a plane that is not upright; metres."""

    a: float
    b: float
    c: float

    def at(self, plan: F64) -> F64:
        """(N,) heights in metres above plan points (N, 2), anywhere on the infinite plane."""
        return np.asarray(self.a * plan[:, 0] + self.b * plan[:, 1] + self.c)

    def raised(self, by_m: float) -> Plane:
        """The plane moved up."""
        return Plane(self.a, self.b, self.c + by_m)


def level_plane(y: float) -> Plane:
    """The horizontal plane at height y."""
    return Plane(0.0, 0.0, y)


def plane_of_points(points: F64) -> Plane | None:
    """The plane through points (N >= 3, 3) within _ON_PLANE_M; None if not coplanar, or vertical."""
    # Answer exactly for a level surface: least squares would tilt it.
    low, high = float(points[:, 1].min()), float(points[:, 1].max())
    if high - low <= 1e-6:
        return level_plane(high)
    # Fit y = a x + b z + c and see how far off the points lie.
    (a, b, c), _, rank, _ = np.linalg.lstsq(_affine_columns(points), points[:, 1], rcond=None)
    plane = Plane(float(a), float(b), float(c))
    off = np.abs(plane.at(points[:, [0, 2]]) - points[:, 1]).max()
    return plane if rank == 3 and off <= _ON_PLANE_M else None


def affine_uv_map(positions: F64, uvs: F64) -> tuple[UvMap, float]:
    """The affine map of x and z that fits uvs (N, 2) best, and its largest error, in uv."""
    affine = np.linalg.lstsq(_affine_columns(positions), uvs, rcond=None)[0]

    def uv(positions: F64) -> F64:
        return np.asarray(_affine_columns(positions) @ affine)

    return uv, float(np.abs(uv(positions) - uvs).max())


@dataclass(frozen=True, slots=True, eq=False)
class UvPart:
    """A part of a flat surface over which one map lays its texture."""

    area: plan.Shape
    uv: UvMap


def uv_parts(positions: F64, faces: NDArray[np.integer], uvs: F64) -> tuple[UvPart, ...]:
    """Parts of a flat surface with one affine texture mapping each; empty if there are too many."""
    parts: list[UvPart] = []
    remaining = faces
    while len(remaining):
        if len(parts) == _MOST_UV_PARTS:
            return ()
        corners = np.unique(remaining)
        uv, off = affine_uv_map(positions[corners], uvs[corners])
        if off > MAX_UV_OFF:
            # Not one map for all: that of the largest face, for all faces that it fits.
            largest = remaining[np.argmax(_plan_areas(positions, remaining))]
            uv, _ = affine_uv_map(positions[largest], uvs[largest])
        # Pictures repeat: tiles that all begin at 0 lie as one floor whose picture goes on.
        off_by = (uv(positions) - uvs)[remaining]
        whole = np.rint(off_by)
        mine = (np.abs(off_by - whole) <= MAX_UV_OFF).all((1, 2)) & (
            np.ptp(whole, axis=1) == 0
        ).all(1)
        if not mine.any():
            return ()
        parts.append(UvPart(plan.polygon_of_triangles(positions, remaining[mine]), uv))
        remaining = remaining[~mine]
    return tuple(parts)


def _plan_areas(positions: F64, faces: NDArray[np.integer]) -> F64:
    a, b, c = (positions[faces[:, k]][:, [0, 2]] for k in range(3))
    u, v = b - a, c - a
    return np.asarray(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))


def _affine_columns(positions: F64) -> F64:
    return np.stack([positions[:, 0], positions[:, 2], np.ones(len(positions))], 1)


def polygons_of(shape: plan.Shape, *, min_area_m2: float = 1e-6) -> list[shapely.Polygon]:
    """The polygons of a shape, larger than min_area_m2, by bounds and area, so that repair is deterministic."""
    polygons = [
        p
        for p in shapely.get_parts(shapely.get_parts(shape)).tolist()
        if isinstance(p, shapely.Polygon) and p.area > min_area_m2
    ]
    return sorted(polygons, key=lambda p: (p.bounds, p.area))


def prism(
    polygon: shapely.Polygon,
    low: Plane,
    high: Plane,
    tags: tuple[Tag, Tag, Tag],
    uv: UvMap | None = None,
) -> list[Patch]:
    """Patches bottom, top and sides of the closed prism, with their tags; uv: of bottom and top, else metres."""
    # Triangulate the outline with its holes, corners shared by bottom, top and sides.
    polygon = shapely.orient_polygons(_with_rings_apart(polygon))
    rings = [np.asarray(r.coords)[:-1] for r in (polygon.exterior, *polygon.interiors)]
    plan = np.concatenate(rings)
    triangles = np.asarray(manifold3d.triangulate(rings), np.int64).reshape(-1, 3)
    lows, highs = lifted(plan, low.at(plan)), lifted(plan, high.at(plan))
    bottom_tag, top_tag, side_tag = tags
    return [
        # Turn the top round: both triangulations look down.
        _patch(bottom_tag, lows, triangles, lows[:, [0, 2]] if uv is None else uv(lows)),
        _patch(
            top_tag, highs, triangles[:, [0, 2, 1]], highs[:, [0, 2]] if uv is None else uv(highs)
        ),
        _sides(side_tag, rings, lows, highs),
    ]


def _with_rings_apart(polygon: shapely.Polygon) -> shapely.Polygon:
    # Lay crumbs where rings touch: four sides would share an edge there, and manifold3d leans them.
    for crumb_m in _CRUMBS_M:
        rings = (polygon.exterior, *polygon.interiors)
        points = np.concatenate([np.asarray(r.coords)[:-1] for r in rings])
        places, counts = np.unique(points, axis=0, return_counts=True)
        if counts.max() == 1:
            break
        low, high = places[counts > 1] - crumb_m, places[counts > 1] + crumb_m
        crumbs = [shapely.box(*corners) for corners in np.concatenate([low, high], 1).tolist()]
        crumbed = plan.union([polygon, *crumbs])
        polygon = max(polygons_of(crumbed, min_area_m2=0.0), key=lambda p: p.area)
    return polygon


def solid_prisms(
    polygons: Iterable[shapely.Polygon],
    low: Plane,
    high: Plane,
    tags: tuple[Tag, Tag, Tag],
    table: TagTable,
    uv: UvMap | None = None,
) -> list[Manifold]:
    """The prisms over polygons between two planes as solids, without empty ones; arguments as of prism."""
    solids = (solid_from_patches(prism(p, low, high, tags, uv), table) for p in polygons)
    return [s for s in solids if s is not None]


def lifted(plan: F64, y: F64) -> F64:
    """(N, 3) plan points (N, 2) at the heights y (N,)."""
    return np.stack([plan[:, 0], y, plan[:, 1]], 1)


def _sides(tag: Tag, rings: list[F64], lows: F64, highs: F64) -> Patch:
    quads, uvs, first = [], [], 0
    for ring in rings:
        # Raise a quad over every edge, u running along the ring.
        i = np.arange(len(ring)) + first
        j = np.roll(i, -1)
        quads.append(np.stack([lows[i], highs[i], highs[j], lows[j]], 1))
        steps = np.linalg.norm(np.roll(ring, -1, 0) - ring, axis=1)
        start = np.concatenate([[0.0], np.cumsum(steps)[:-1]])
        u = np.stack([start, start, start + steps, start + steps], 1)
        uvs.append(np.stack([u, quads[-1][:, :, 1]], -1))
        first += len(ring)
    corners = np.concatenate(quads)
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(corners))[:, None, None]
    return _patch(
        tag, corners.reshape(-1, 3), faces.reshape(-1, 3), np.concatenate(uvs).reshape(-1, 2)
    )


def _patch(tag: Tag, positions: F64, faces: I64, uvs: F64) -> Patch:
    return Patch(tag, positions, faces, uvs, np.zeros_like(positions))
