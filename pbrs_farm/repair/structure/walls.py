"""Walls as closed solids with their footprint and height; planar ones thickened. No effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from manifold3d import Manifold

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.mesh import unit_normals, unit_vectors
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import (
    Patch,
    Tag,
    TagTable,
    bounds,
    solid_from_patches,
    unite,
)
from pbrs_farm.repair.structure.closed_shells import flat_patch, shells_from_item
from pbrs_farm.repair.structure.planar_surfaces import facets
from pbrs_farm.repair.structure.prisms import (
    BASE_BEHIND_M,
    FACE_M,
    MAX_UV_OFF,
    Plane,
    UvMap,
    affine_uv_map,
    level_plane,
    plane_of_points,
    polygons_of,
    prism,
    uv_parts,
)

REVEAL = "reveal"
ADDED_SURFACES = frozenset({REVEAL, "joint", "hidden", "back", "rim"})
"""Names of the surfaces repair adds to structure items."""

_BESIDE_M = 0.05  # a point so far beside a gable's slope is under it

BASEBOARD = "baseboard"
"""Tag of baseboards among wall items."""


def with_metric_uv(patch: Patch) -> Patch:
    """The patch with uv in metres if repair added it: v height or world z, u across it in the face's plane."""
    if patch.tag.surface not in ADDED_SURFACES:
        return patch
    # Span each face's plane by u across and v up (or along z if horizontal).
    corners = patch.positions[patch.faces]
    normals = unit_normals(corners)
    up = np.where(np.abs(normals[:, 1:2]) < 0.7, [[0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0]])
    u = unit_vectors(np.cross(up, normals))
    v = np.cross(normals, u)
    uvs = np.stack([np.einsum("fki,fi->fk", corners, axis) for axis in (u, v)], -1)
    # Give each face separate vertices: neighbours have other axes.
    n = len(patch.faces)
    return replace(
        patch,
        positions=corners.reshape(-1, 3),
        faces=np.arange(3 * n).reshape(n, 3),
        uvs=uvs.reshape(-1, 2),
        normals=np.zeros((3 * n, 3)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """A wall's solid before openings are cut, one per shell of its item, with its footprint and heights."""

    item: int  # index into House.items
    solid: Manifold
    footprint: plan.Shape
    bottom_y: float  # lowest point
    high_y: float  # highest point
    top: Plane  # its upper edge, sloped under a roof; of a gable its lowest height
    material: int  # of parts that repair adds
    slopes: tuple[
        tuple[plan.Shape, Plane], ...
    ] = ()  # of a gable: area and plane of its upper edges
    thickened: bool = False  # it was planar
    is_board: bool = False  # a baseboard: bounds no room, is joined to nothing
    room_id: str | None = None  # the one room it belongs to, if it does

    def tag(self, surface: str) -> Tag:
        """The tag of a surface that repair adds to this wall."""
        return Tag(self.item, surface, self.material)

    def top_at(self, points: F64) -> F64:
        """(N,) heights of its upper edge at plan points (N, 2), a gable's slopes followed."""
        y = self.top.at(points)
        for area, plane in self.slopes:
            inside = shapely.contains_xy(area, points[:, 0], points[:, 1])
            y = np.where(inside, np.maximum(y, plane.at(points)), y)
        return y


def walls_from_house(
    house: House, table: TagTable, rooms: plan.Shape, thickness_m: float
) -> tuple[list[Wall], dict[int, str]]:
    """A Wall for every closed shell of every wall item, and item index -> reason why it is unchanged.

    rooms: plan area of all rooms; planar walls are thickened away from it.
    """
    walls: list[Wall] = []
    unchanged: dict[int, str] = {}
    for index, item in enumerate(house.items):
        if item.kind is not ItemKind.WALL or not item.surfaces:
            continue
        shells = shells_from_item(item, index, table)
        if shells is not None:
            walls += [_wall_of_solid(item, index, solid, patches) for solid, patches in shells]
            continue
        # Thicken planar items, and leave the others.
        thick = _thickened(item, index, table, rooms, thickness_m)
        if thick is None:
            unchanged[index] = "its surfaces are neither a closed solid nor in one plane"
        else:
            walls.append(thick)
    return walls, unchanged


def _wall_of_solid(
    item: Item, index: int, solid: Manifold, patches: Sequence[Patch], *, thickened: bool = False
) -> Wall:
    # The first surface of a name counts.
    named = {s.name: s.material for s in reversed(item.surfaces)}
    low, high = bounds(solid)
    footprint, top, slopes = _footprint_and_top(patches, float(high[1]))
    return Wall(
        item=index,
        solid=solid,
        footprint=footprint,
        bottom_y=float(low[1]),
        high_y=float(high[1]),
        top=top,
        material=named.get(REVEAL, named.get("left", item.surfaces[0].material)),
        slopes=slopes,
        thickened=thickened,
        is_board=BASEBOARD in item.tags,
        room_id=item.room_id,
    )


def _footprint_and_top(
    patches: Sequence[Patch], high_y: float
) -> tuple[plan.Shape, Plane, tuple[tuple[plan.Shape, Plane], ...]]:
    """Plan area of upward faces, the top's plane (level if it covers half the plan), a gable's slopes."""
    footprint, level_top, points, upward = [], [], [], []
    for p in patches:
        faces = p.faces[unit_normals(p.positions[p.faces])[:, 1] > 0.05]
        at_top = (p.positions[faces][:, :, 1] > high_y - 1e-3).all(1)
        footprint.append(plan.polygon_of_triangles(p.positions, faces))
        level_top.append(plan.polygon_of_triangles(p.positions, faces[at_top]))
        points.append(p.positions[faces].reshape(-1, 3))
        upward.append((p.positions, faces))
    # Trust a level top that covers half the plan, else fit the sloped edge.
    whole, ends = plan.union(footprint), np.concatenate(points)
    if plan.union(level_top).area > 0.5 * whole.area or not len(ends):
        return whole, level_plane(high_y), ()
    plane = plane_of_points(ends)
    if plane is not None:
        return whole, plane, ()
    slopes = [
        (plan.grown(plan.polygon_of_triangles(positions, facet), _BESIDE_M), slope)
        for positions, faces in upward
        for facet in facets(positions, faces)
        if (slope := plane_of_points(positions[np.unique(facet)])) is not None
    ]
    return whole, level_plane(float(ends[:, 1].min())), tuple(slopes)


def _thickened(
    item: Item, index: int, table: TagTable, rooms: plan.Shape, thickness_m: float
) -> Wall | None:
    """A planar, upright wall made a solid of thickness_m, away from the rooms."""
    flat = flat_patch(item, index)
    if flat is None or abs(flat.normal[1]) > 0.2:
        return None
    # Look which side of the wall is in a room, 5 cm off its middle.
    normal = flat.normal / np.linalg.norm(flat.normal)
    middle = flat.patch.positions.mean(0)[[0, 2]]
    side = normal[[0, 2]] * 0.05
    if not rooms.contains(shapely.Point(middle + side)) and rooms.contains(
        shapely.Point(middle - side)
    ):
        normal = -normal
    patches = extrude(flat.patch, normal, thickness_m)
    if patches is None:
        return None
    solid = _with_texture_in_parts(flat.patch, normal, thickness_m, table)
    if solid is None:
        solid = solid_from_patches(patches, table)
    return None if solid is None else _wall_of_solid(item, index, solid, patches, thickened=True)


def _with_texture_in_parts(
    patch: Patch, normal: F64, thickness_m: float, table: TagTable
) -> Manifold | None:
    """A solid from a flat patch with several texture mappings, a layer each before one base; or None."""
    local, _axes = _in_frame_of_wall(patch, normal)
    if affine_uv_map(local, patch.uvs)[1] <= MAX_UV_OFF:
        return None
    layers = []
    for part in uv_parts(local, patch.faces, patch.uvs):
        solid = _prism_behind(patch, normal, part.area, (0.0, FACE_M), part.uv)
        layers.append(solid_from_patches(solid, table))
    if not layers:
        return None
    whole = plan.polygon_of_triangles(local, patch.faces)
    base = _prism_behind(patch, normal, whole, (BASE_BEHIND_M, thickness_m), None)
    return unite(s for s in (solid_from_patches(base, table), *layers) if s is not None)


def extrude(patch: Patch, normal: F64, thickness_m: float) -> list[Patch] | None:
    """The flat patch as a solid: its own face and one thickness_m behind it, against the unit normal."""
    local, _axes = _in_frame_of_wall(patch, normal)
    # Carry the texture on by the affine map that fits it.
    uv, _ = affine_uv_map(local, patch.uvs)
    whole = plan.polygon_of_triangles(local, patch.faces)
    return _prism_behind(patch, normal, whole, (0.0, thickness_m), uv) or None


def _in_frame_of_wall(patch: Patch, normal: F64) -> tuple[F64, F64]:
    """(V, 3) positions along the wall, out of its face and up, from the first; (3, 3) those axes as rows."""
    along = np.cross([0.0, 1.0, 0.0], normal)
    if np.linalg.norm(along) < 1e-6:
        along = np.array([1.0, 0.0, 0.0])
    along = along / np.linalg.norm(along)
    axes = np.stack([along, normal, np.cross(along, normal)])
    return (patch.positions - patch.positions[0]) @ axes.T, axes


def _prism_behind(
    patch: Patch, normal: F64, area: plan.Shape, behind_m: tuple[float, float], uv: UvMap | None
) -> list[Patch]:
    """The patches of prisms over an area in the wall's frame, between two depths behind its face."""
    _local, axes = _in_frame_of_wall(patch, normal)
    tags = (
        Tag(patch.tag.item, "back", patch.tag.material),
        patch.tag,
        Tag(patch.tag.item, "rim", patch.tag.material),
    )
    near, far = (level_plane(-depth) for depth in behind_m)
    parts = [p for q in polygons_of(area) for p in prism(q, far, near, tags, uv)]
    origin = patch.positions[0]
    return [Patch(p.tag, p.positions @ axes + origin, p.faces, p.uvs, p.normals) for p in parts]
