"""Whose pilot the light of a frame takes: neighbours in time see nearly the same lamps; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera, View
from pbrs_farm.transport.light_scene import Pilot

FRAMES_A_PILOT: Final = 10


def pilot_view(view: View, views: Mapping[str, View]) -> View:
    """The first of each ten frames for all of them, left and right apart; a view that is none itself.

    views: of the house, by id. Which frame is rendered first changes no picture.
    """
    if view.frame is None:
        return view
    left = keys.frame_id(view.frame - view.frame % FRAMES_A_PILOT)
    return views.get(keys.right_id(left) if view.left_id else left, view)


def pilot_of_view(
    view: View, views: Mapping[str, View], camera: Camera, house_id: str, digest: str
) -> Pilot | None:
    """The pilot that the light of a view takes over, None for its own.

    camera: the view's, at the picture's size. digest: of the recipe's groups that light uses.
    """
    lead = pilot_view(view, views)
    if lead is view:
        return None
    size = camera.intrinsics.width_px, camera.intrinsics.height_px
    seed = keys.seed(house_id, lead.id, "light", digest)
    return Pilot(lead.camera.with_size(*size), seed)
