"""The small repairs: persons and plants out, default walls white, faces sound, boxes of meshes; no effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import F32, I32, Bools
from pbrs_farm.core.house import Box, House, Item, ItemKind, Surface, corners_of_surfaces
from pbrs_farm.core.mesh import faces_with_area, numbered_points, triangle_corners, unit_normals
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.geometry.connected import connected_places
from pbrs_farm.repair.repair_report import FacesReport, Removed
from pbrs_farm.repair.structure.added_ceilings import with_ceilings
from pbrs_farm.repair.structure.slivers import MIN_AREA_M2
from pbrs_farm.repair.structure.walls import BASEBOARD

_SQUARE = 1e-6  # axes of a box whose products differ more from 0 and 1 are no frame


def without_persons_and_plants(house: House, fields: RepairFields) -> tuple[House, list[Removed]]:
    """Remove persons and plants, each if the recipe says so (paper section 3); also the removed items."""
    kinds = set()
    if fields.remove_persons:
        kinds.add(ItemKind.PERSON)
    if fields.remove_plants:
        kinds.add(ItemKind.PLANT)
    removed = [
        Removed(item_id=i.id, name=i.name, reason=str(i.kind))
        for i in house.items
        if i.kind in kinds
    ]
    return house.with_items(i for i in house.items if i.kind not in kinds), removed


def with_rooms_closed(house: House, fields: RepairFields) -> House:
    """Add tagged ceilings over walled rooms without one, if the recipe asks for it."""
    return with_ceilings(house) if fields.add_ceilings else house


def with_white_walls(house: House, rgb: tuple[float, float, float]) -> tuple[House, int]:
    """Walls of no colour in the source painted rgb (sRGB), and their number without baseboards."""
    materials = list(house.materials)
    white: dict[int, int] = {}  # material as read -> its white copy
    items: list[Item] = []
    n = 0
    for item in house.items:
        if item.kind is not ItemKind.WALL:
            items.append(item)
            continue
        surfaces = []
        for s in item.surfaces:
            # Keep a colour that the source gives; baseboards and walls share one white material.
            material = materials[s.material]
            if not material.is_default or (material.diffuse == rgb and material.texture_id is None):
                surfaces.append(s)
                continue
            if s.material not in white:
                white[s.material] = len(materials)
                materials.append(
                    replace(material, name=f"{material.name}_wall", diffuse=rgb, texture_id=None)
                )
            surfaces.append(replace(s, material=white[s.material]))
        # Count walls, not surfaces; a baseboard is part of its wall.
        is_board = BASEBOARD in item.tags
        n += not is_board and any(house.materials[s.material].is_default for s in item.surfaces)
        items.append(replace(item, surfaces=tuple(surfaces)))
    return replace(house, items=tuple(items), materials=tuple(materials)), n


def with_sound_faces(house: House) -> tuple[House, FacesReport]:
    """Drop faces without area or with NaN (emptied surfaces stay), and turn those against their normals."""
    n_dropped = n_turned = 0
    items = []
    for item in house.items:
        surfaces = []
        for surface in item.surfaces:
            sound, dropped, turned = _sound(surface)
            n_dropped += dropped
            n_turned += turned
            surfaces.append(sound)
        items.append(replace(item, surfaces=tuple(surfaces)))
    return house.with_items(items), FacesReport(n_degenerate_dropped=n_dropped, n_turned=n_turned)


def _sound(surface: Surface) -> tuple[Surface, int, int]:
    faces = surface.faces
    # Drop faces without area before their normals are asked for.
    keep = faces_with_area(triangle_corners(surface.positions, faces), MIN_AREA_M2)
    faces = faces[keep]
    against = _against_normals(surface, faces)
    if against.any() and not against.all():
        against &= ~_in_closed_shells(surface.positions, faces)
    n_dropped, n_turned = int((~keep).sum()), int(against.sum())
    if n_dropped + n_turned == 0:
        return surface, 0, 0  # the same object, so that sound meshes stay as read
    # Swap two corners: the face turns round, its first corner stays.
    faces = np.where(against[:, None], faces[:, [0, 2, 1]], faces)
    return replace(surface, faces=np.ascontiguousarray(faces, np.int32)), n_dropped, n_turned


def _against_normals(surface: Surface, faces: I32) -> Bools:
    if surface.normals is None or not len(faces):
        return np.zeros(len(faces), np.bool_)
    # Compare with the mean of the corner normals; its length does not matter.
    mean = surface.normals[faces].astype(np.float64).sum(1)
    normals = unit_normals(triangle_corners(surface.positions, faces))
    return np.asarray((mean * normals).sum(1) < -1e-6)


def _in_closed_shells(positions: F32, faces: I32) -> Bools:
    """(F,) true for faces of closed, consistently wound parts, which a single turned face would open."""
    _, welded = numbered_points(positions[faces.ravel()].astype(np.float64))
    corners = welded.reshape(-1, 3)
    starts, ends = corners.ravel(), np.roll(corners, -1, 1).ravel()
    n = int(corners.max()) + 1
    forward, backward = starts.astype(np.int64) * n + ends, ends.astype(np.int64) * n + starts
    edges, counts = np.unique(forward, return_counts=True)
    is_paired = np.isin(backward, edges[counts == 1]) & np.isin(forward, edges[counts == 1])
    open_corners = np.unique(corners[~is_paired.reshape(-1, 3).all(1)])
    part = connected_places(corners, n)
    return np.asarray(~np.isin(part[corners[:, 0]], part[open_corners]))


def with_boxes_of_meshes(house: House) -> House:
    """Every item's box, along its own axes, taken from its triangles."""
    return house.with_items(map(_with_box_of_mesh, house.items))


def _with_box_of_mesh(item: Item) -> Item:
    corners = corners_of_surfaces(item.surfaces).reshape(-1, 3)
    if not len(corners):
        return item
    axes = np.eye(3) if item.box is None else item.box.axes
    if np.abs(axes.T @ axes - np.eye(3)).max() > _SQUARE:
        axes = np.eye(3)
    # Measure along the axes, which are columns.
    local = corners @ axes
    low, high = local.min(0), local.max(0)
    # Vertices that no triangle has are in no box.
    if item.box is None and np.array_equal(item.bounds, np.array([low, high])):
        return item
    return replace(item, box=Box(axes @ ((low + high) / 2), (high - low) / 2, axes))
