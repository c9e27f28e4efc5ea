"""Planar floors and ceilings as read: plan area, plane and texture of each; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import shapely
from manifold3d import Manifold

from pbrs_farm.core.arrays import F64, I32, I64
from pbrs_farm.core.house import House, Item, ItemKind, Opening, Surface
from pbrs_farm.core.mesh import unit_normals
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import Patch, Tag, TagTable, bounds
from pbrs_farm.repair.structure.closed_shells import shells_from_item
from pbrs_farm.repair.structure.prisms import (
    MAX_UV_OFF,
    Plane,
    UvMap,
    UvPart,
    affine_uv_map,
    level_plane,
    plane_of_points,
    uv_parts,
)

Faces = TypeVar("Faces", I32, I64)

_SAME_FACING = 1.0 - 1e-6  # cosine between normals of one plane
_LEVEL_M = 0.01  # an underside that rises less is level
_MOST_FACETS = (
    200  # of a ceiling's underside; of more (a vault in small faces) its lowest height counts
)
_JOINT_M = 0.01  # by which the pane of a roof window overlaps the roof
_UP = 0.05  # y of the normal of a face that is not upright, at least


@dataclass(frozen=True, slots=True, eq=False)
class PlanarSurface:
    """The coplanar faces of a planar floor or ceiling, as an area and that plane, for slabs.py."""

    item: int  # index into House.items
    room_id: str | None
    is_ceiling: bool
    area: plan.Shape  # covered area, seen from above
    plane: Plane
    uv: UvMap | None  # of the whole; None: metres in plan, save where uv_parts are
    uv_parts: tuple[UvPart, ...]  # parts with different texture mappings
    material: int
    name: str  # of the surface it comes from

    def tag(self, surface: str) -> Tag:
        """The tag of a surface that repair adds to this floor or ceiling."""
        return Tag(self.item, surface, self.material)


@dataclass(frozen=True, slots=True, eq=False)
class Cover:
    """The face of a floor or ceiling that closes rooms: plan area and plane."""

    is_ceiling: bool
    area: plan.Shape
    plane: Plane

    @property
    def is_roof(self) -> bool:
        """It is a ceiling that slopes, and may come down to the floor."""
        return self.is_ceiling and (self.plane.a, self.plane.b) != (0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class FloorsAndCeilings:
    """All floors and ceilings of a house, sorted by what they are made of."""

    planar: list[PlanarSurface]
    solid: dict[int, list[Manifold]]  # item -> its closed shells
    left: dict[int, str]  # item -> reason why it is unchanged
    covers: list[Cover]  # inner faces of the solid ones


def floors_and_ceilings_from_house(house: House, table: TagTable) -> FloorsAndCeilings:
    """Floors, ceilings and solid ground: planar, solid, or neither, with the reason."""
    surfaces = FloorsAndCeilings([], {}, {}, [])
    for index, item in enumerate(house.items):
        if item.kind not in (ItemKind.FLOOR, ItemKind.CEILING, ItemKind.GROUND):
            continue
        shells = shells_from_item(item, index, table)
        if shells is not None:
            surfaces.solid[index] = [solid for solid, _ in shells]
            if item.kind is not ItemKind.GROUND:
                for solid, patches in shells:
                    surfaces.covers.extend(_covers_of_solid(item, solid, patches))
        # Leave the ground around the house alone, unless it is solid.
        elif item.kind is ItemKind.GROUND:
            continue
        else:
            planar = list(_planar_surfaces(item, index))
            if planar:
                surfaces.planar.extend(planar)
            elif item.surfaces:
                surfaces.left[index] = "it is not a closed solid and has no horizontal face"
    return surfaces


def _covers_of_solid(item: Item, solid: Manifold, patches: Sequence[Patch]) -> list[Cover]:
    # Take the side that looks into the room: a ceiling's lowest, a floor's highest.
    low, high = bounds(solid)
    is_ceiling = item.kind is ItemKind.CEILING
    sloped = _sloped_undersides(patches) if is_ceiling else []
    if sloped:
        return sloped
    area = plan.union(plan.polygon_of_triangles(p.positions, p.faces) for p in patches)
    return [Cover(is_ceiling, area, level_plane(float(low[1] if is_ceiling else high[1])))]


def covers_of_roof_windows(openings: Sequence[Opening]) -> list[Cover]:
    """The panes of windows in roofs, at the underside of the roof around them."""
    covers = []
    for opening in openings:
        up = opening.normal * np.sign(opening.normal[1])
        if up[1] > _UP:
            depth = opening.cutter.positions.astype(np.float64) @ up
            quad = opening.quad + (depth.min() - opening.quad[0] @ up) * up
            plane = plane_of_points(quad)
            area = shapely.Polygon(quad[:, [0, 2]]).buffer(_JOINT_M, join_style="mitre")
            covers += [Cover(True, area, plane)] if plane is not None else []
    return covers


def _sloped_undersides(patches: Sequence[Patch]) -> list[Cover]:
    """The planes of the underside of a roof; none where it is level, or made of very many faces."""
    covers = []
    for p in patches:
        down = p.faces[unit_normals(p.positions[p.faces])[:, 1] < -_UP]
        for faces in facets(p.positions, down):
            plane = plane_of_points(p.positions[np.unique(faces)])
            area = plan.polygon_of_triangles(p.positions, faces)
            if plane is not None and not shapely.is_empty(area):
                covers.append(Cover(True, area, plane))
    heights = [c.plane.at(shapely.get_coordinates(c.area)) for c in covers]
    if not covers or len(covers) > _MOST_FACETS or np.ptp(np.concatenate(heights)) < _LEVEL_M:
        return []
    return covers


def _planar_surfaces(item: Item, index: int) -> Iterator[PlanarSurface]:
    for surface in item.surfaces:
        positions = surface.positions.astype(np.float64)
        for faces in facets(positions, surface.faces):
            corners = positions[np.unique(faces)]
            plane = plane_of_points(corners)
            area = plan.polygon_of_triangles(positions, faces)
            if plane is None or shapely.is_empty(area):
                continue
            uv, parts = _uv_maps(surface, faces)
            yield PlanarSurface(
                item=index,
                room_id=item.room_id,
                is_ceiling=item.kind is ItemKind.CEILING,
                area=area,
                plane=plane,
                uv=uv,
                uv_parts=parts,
                material=surface.material,
                name=surface.name,
            )


def facets(positions: F64, faces: Faces) -> list[Faces]:
    """The faces (F, 3) grouped by their plane, in order of first face, up or down alike; upright ones left out."""
    normals = unit_normals(positions[faces])
    normals = normals * np.where(normals[:, 1:2] < 0, -1.0, 1.0)
    offsets = (normals * positions[faces[:, 0]]).sum(1)
    groups: list[tuple[F64, float, list[int]]] = []  # normal, offset along it, faces
    for k in np.flatnonzero(normals[:, 1] > _UP):
        for normal, offset, members in groups:
            if normals[k] @ normal > _SAME_FACING and abs(offsets[k] - offset) < 1e-3:
                members.append(int(k))
                break
        else:
            groups.append((normals[k], float(offsets[k]), [int(k)]))
    return [faces[members] for _, _, members in groups]


def _uv_maps(surface: Surface, faces: I32) -> tuple[UvMap | None, tuple[UvPart, ...]]:
    # Fit the texture by an affine map of the plan, so that it carries on where the slab grows.
    if surface.uvs is None:
        return None, ()
    positions, uvs = surface.positions.astype(np.float64), surface.uvs.astype(np.float64)
    used = np.unique(faces)
    uv, off = affine_uv_map(positions[used], uvs[used])
    return (uv, ()) if off <= MAX_UV_OFF else (None, uv_parts(positions, faces, uvs))
