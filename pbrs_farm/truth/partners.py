"""The views that a view is matched with: the next and previous frame, the other of a stereo pair; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera, View
from pbrs_farm.core.frames import opencv_world_from_camera

Relation = Literal["next", "previous", "stereo"]


def partners_of(view: View, views: Mapping[str, View]) -> dict[Relation, View]:
    """The partners that a view has among the views of its house (id -> view)."""
    found: dict[Relation, View] = {}
    # The other of a pair: the right view knows the left one, whose id names the right one.
    other = views.get(view.left_id or keys.right_id(view.id))
    if other is not None and (view.left_id or other.left_id == view.id):
        found["stereo"] = other
    if view.frame is None:
        return found
    # Frames are numbered; the right views of a sequence are a sequence of their own.
    neighbours: tuple[tuple[Relation, int], ...] = (("next", 1), ("previous", -1))
    for relation, step in neighbours:
        left = keys.frame_id(view.frame + step)
        neighbour = views.get(keys.right_id(left) if view.left_id else left)
        if neighbour is not None:
            found[relation] = neighbour
    return found


def partner_table(
    partners: Mapping[Relation, View], cameras: Mapping[Relation, Camera]
) -> dict[str, Any]:
    """Relation -> id, K, pose and time of the partner, for view.json; cameras: at the picture's size."""
    return {
        relation: {
            "view": view.id,
            "time_s": view.time_s,
            "K": cameras[relation].intrinsics.k.tolist(),
            "world_from_camera_opencv": opencv_world_from_camera(
                cameras[relation].world_from_camera
            ).tolist(),
        }
        for relation, view in sorted(partners.items())
    }
