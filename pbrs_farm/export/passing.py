"""Pairs of bodies that do not collide: a door and its frame, a drawer and its neighbours' fronts; no effects.

Fronts are millimetres apart, and convex parts reach up to 5 mm beyond their items. A contact along a
part's way that does not stop the part must not stop it in a simulation either.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.joints import Joint
from pbrs_farm.export.home_bodies import BODY
from pbrs_farm.export.home_pieces import ExportedHome
from pbrs_farm.geometry.opened import free_value, part_triangles
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.surface_points import surface_points

_TOUCHES_M: Final = (
    0.015  # maximum distance of touching points; convex parts reach 5 mm beyond their items
)
_SPACING_M: Final = 0.012
_STEPS: Final = 8  # samples of a part's way

End: TypeAlias = tuple[int, str]  # of a pair: the piece's number and its part


def passing_pairs(home: ExportedHome) -> tuple[tuple[End, End], ...]:
    """Pairs of bodies, one of them a part, that pass through each other; each pair once.

    A part and its body are always a pair. A part is also paired with another part of its item, or a fixed
    body, if it touches that in its pose or along its free way (`geometry.opened.free_value`).
    """
    scene = SceneTriangles(home.house.items)
    pairs: dict[tuple[End, End], None] = {}
    for number, piece in enumerate(home.pieces):
        for body in piece.bodies[1:]:
            pairs[((number, BODY), (number, body.part))] = None
            for end in _touched(home, scene, number, body.part):
                first, second = sorted([(number, body.part), end])
                pairs[(first, second)] = None
    return tuple(pairs)


def _touched(home: ExportedHome, scene: SceneTriangles, number: int, part: str) -> Iterator[End]:
    item = home.pieces[number].item
    joint = next(j for j in item.joints if j.part == part)
    corners = part_triangles(item, part)
    free, stopped_by = free_value(scene, number, part, joint.upper)
    points_now = surface_points(corners, _SPACING_M)
    points = _on_way(joint, points_now, free)
    # An obstacle that stops the part counts only if it touches the part's current pose.
    trees = {False: cKDTree(points), True: cKDTree(points_now)}
    tree = trees[False]
    low, high = points.min(0) - _TOUCHES_M, points.max(0) + _TOUCHES_M
    box = np.array([low, high])
    for k in scene.items_in(low, high):
        piece = home.pieces[k]
        if k == number:
            for sibling in piece.bodies[1:]:
                sibling_corners = part_triangles(item, sibling.part)
                if sibling.part != part and _meets(tree, sibling_corners, box):
                    yield (k, sibling.part)
        elif piece.is_fixed and _meets(trees[piece.item.id == stopped_by], scene.of_item(k), box):
            yield from ((k, body.part) for body in piece.bodies)


def _on_way(joint: Joint, points: F64, free: float) -> F64:
    values = np.linspace(joint.value, free, _STEPS)
    return np.concatenate([transform_points(joint.motion(float(v)), points) for v in values])


def _meets(tree: cKDTree[None], corners: F64, box: F64) -> bool:
    points = surface_points(corners, _SPACING_M, box)
    if not len(points):
        return False
    near, _ = tree.query(points, distance_upper_bound=_TOUCHES_M)
    return bool(np.isfinite(near).any())
