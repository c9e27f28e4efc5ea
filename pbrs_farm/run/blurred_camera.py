"""The blur of a view's light from the recipe, a walk's poses and what its middle shows; no effects of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.camera import Camera, CameraBlur, View
from pbrs_farm.core.recipe import BlurFields
from pbrs_farm.raycast.caster import Caster

_FARTHEST_M = 100.0  # of the focus where the middle shows nothing


def blurred(
    camera: Camera, view: View, views: Mapping[str, View], fields: BlurFields, caster: Caster
) -> Camera:
    """The camera with an aperture and a shutter; of a walk's frame, moving as between its neighbours.

    views: those of the house, by id. caster: for what the middle of the picture shows.
    """
    velocity, turn = _speed_on_walk(view, views) or _speed_of_fields(camera, fields)
    focus = fields.focus_m
    if fields.aperture_mm > 0 and focus == 0:
        t, _face = caster.first_hit(camera.eye[None], camera.towards[None])
        focus = float(t[0]) if np.isfinite(t[0]) else _FARTHEST_M
    blur = CameraBlur(
        aperture_radius_m=fields.aperture_mm / 2000,
        focus_m=focus or 1.0,
        velocity_m=triple(velocity * fields.shutter_s),
        turn_rad=triple(turn * fields.shutter_s),
    )
    return replace(camera, blur=blur)


def _speed_of_fields(camera: Camera, fields: BlurFields) -> tuple[F64, F64]:
    """(3,) m/s and (3,) rad/s in the world."""
    axes = camera.world_from_camera[:3, :3]
    velocity = axes @ np.array([fields.right_mps, fields.up_mps, -fields.forward_mps])
    # Panning to the right turns about -y, tilting up about x, rolling clockwise about -z.
    turn = axes @ np.radians([fields.tilt_dps, -fields.pan_dps, -fields.roll_dps])
    return np.asarray(velocity), np.asarray(turn)


def _speed_on_walk(view: View, views: Mapping[str, View]) -> tuple[F64, F64] | None:
    """(3,) m/s and (3,) rad/s in the world between the frames around a view; None off a walk."""
    if view.frame is None:
        return None
    # Of the same eye of a stereo pair, the frames before and after, as far as there are any.
    frames = {v.frame: v for v in views.values() if bool(v.left_id) == bool(view.left_id)}
    before, after = frames.get(view.frame - 1, view), frames.get(view.frame + 1, view)
    time_s = (after.time_s or 0.0) - (before.time_s or 0.0)
    if time_s <= 0:
        return np.zeros(3), np.zeros(3)
    a, b = (v.camera.world_from_camera[:3, :3] for v in (before, after))
    turn = Rotation.from_matrix(b @ a.T).as_rotvec()
    return (after.camera.eye - before.camera.eye) / time_s, np.asarray(turn) / time_s
