"""Which bodies of a home pass through each other: a door and its frame, a drawer and its neighbours' fronts; no effects.

Fronts stand millimetres apart, and convex parts keep to their things within 5 mm: what a part
touches along its way, without being stopped by it, must not stop it in a simulation.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.joints import Joint
from pbrs_farm.export.home_links import BODY
from pbrs_farm.export.home_pieces import ExportedHome
from pbrs_farm.geometry.opened import free_value, part_triangles
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.surface_points import surface_points

_TOUCHES_M: Final = 0.015  # between points on both: convex parts reach 5 mm beyond their things
_SPACING_M: Final = 0.012
_STEPS: Final = 8  # of a way

End: TypeAlias = tuple[int, str]  # of a pair: the piece's number and its part


def passing_pairs(home: ExportedHome) -> tuple[tuple[End, End], ...]:
    """Pairs of bodies, one of them a part, that pass through each other; each pair once.

    A part and its body always; parts of one thing, and what stands still, where the part touches
    them as it stands, or along its way and `geometry.opened.free_value` lets it pass.
    """
    scene = SceneTriangles(home.house.items)
    found: dict[tuple[End, End], None] = {}
    for number, piece in enumerate(home.pieces):
        for link in piece.links[1:]:
            found[((number, BODY), (number, link.part))] = None
            for other in _touched(home, scene, number, link.part):
                pair = sorted([(number, link.part), other])
                found[(pair[0], pair[1])] = None
    return tuple(found)


def _touched(home: ExportedHome, scene: SceneTriangles, number: int, part: str) -> Iterator[End]:
    item = home.pieces[number].item
    joint = next(j for j in item.joints if j.part == part)
    corners = part_triangles(item, part)
    free, stopped_by = free_value(scene, number, part, joint.upper)
    standing = surface_points(corners, _SPACING_M)
    points = _on_way(joint, standing, free)
    # What stops it counts where it touches the part as it stands.
    trees = {False: cKDTree(points), True: cKDTree(standing)}
    tree = trees[False]
    low, high = points.min(0) - _TOUCHES_M, points.max(0) + _TOUCHES_M
    box = np.array([low, high])
    for k in scene.items_in(low, high):
        other = home.pieces[k]
        if k == number:
            for sibling in other.links[1:]:
                own = part_triangles(item, sibling.part)
                if sibling.part != part and _meets(tree, own, box):
                    yield (k, sibling.part)
        elif other.is_fixed and _meets(trees[other.item.id == stopped_by], scene.of_item(k), box):
            yield from ((k, link.part) for link in other.links)


def _on_way(joint: Joint, points: F64, free: float) -> F64:
    values = np.linspace(joint.value, free, _STEPS)
    return np.concatenate([transform_points(joint.motion(float(v)), points) for v in values])


def _meets(tree: cKDTree[None], corners: F64, box: F64) -> bool:
    points = surface_points(corners, _SPACING_M, box)
    if not len(points):
        return False
    near, _ = tree.query(points, distance_upper_bound=_TOUCHES_M)
    return bool(np.isfinite(near).any())
