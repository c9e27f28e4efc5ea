"""Stereo pairs: for each view one more, moved to the right along its own x axis; no effects."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera, View


def with_right_views(views: Iterable[View], baseline_m: float) -> tuple[View, ...]:
    """The views, each followed by the right one of its pair; as they are when baseline_m is 0.

    Both have the same intrinsics and axes, so that rows of the two pictures correspond.
    """
    if baseline_m <= 0:
        return tuple(views)
    pairs = ((view, _right(view, baseline_m)) for view in views)
    return tuple(view for pair in pairs for view in pair)


def _right(view: View, baseline_m: float) -> View:
    pose = view.camera.world_from_camera.copy()
    pose[:3, 3] += baseline_m * pose[:3, 0]
    camera = Camera(view.camera.intrinsics, pose)
    return replace(view, id=keys.right_id(view.id), camera=camera, left_id=view.id)
