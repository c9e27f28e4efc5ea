"""How the light of a view differs from its labels: its camera is blurred, its pilot and its noise may be a film's.

Blur comes from the recipe, a walk's poses and what the picture's middle shows. Frames of a walk share a
pilot, since neighbours in time see nearly the same lamps, and a seed, so that noise stays on surfaces. No effects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.camera import Camera, CameraBlur, View
from pbrs_farm.core.recipe import BlurFields
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.transport.light_scene import Pilot
from pbrs_farm.transport.surface_noise import NoiseAnchors

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
    whole_s = fields.shutter_s + fields.rolling_s
    rolling_share = fields.rolling_s / whole_s if fields.rolling_s > 0 else 0.0
    blur = CameraBlur(
        aperture_radius_m=fields.aperture_mm / 2000,
        focus_m=focus or 1.0,
        velocity_m=triple(velocity * whole_s),
        turn_rad=triple(turn * whole_s),
        open_share=1.0 - rolling_share,
        rolling_share=rolling_share,
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
    # Of the same camera of a rig, the frames before and after, as far as there are any.
    frames = {v.frame: v for v in views.values() if v.eye == view.eye}
    before, after = frames.get(view.frame - 1, view), frames.get(view.frame + 1, view)
    time_s = (after.time_s or 0.0) - (before.time_s or 0.0)
    if time_s <= 0:
        return np.zeros(3), np.zeros(3)
    a, b = (v.camera.world_from_camera[:3, :3] for v in (before, after))
    turn = Rotation.from_matrix(b @ a.T).as_rotvec()
    return (after.camera.eye - before.camera.eye) / time_s, np.asarray(turn) / time_s


FRAMES_A_PILOT: Final = 10
FRAMES_AN_ANCHOR: Final = 20  # from one frame whose pixels name the noise to the next


def pilot_view(view: View, views: Mapping[str, View]) -> View:
    """The first of each ten frames for all of them, each camera of a rig apart; a view that is none itself.

    views: of the house, by id. Which frame is rendered first changes no picture.
    """
    if view.frame is None:
        return view
    first = keys.frame_id(view.frame - view.frame % FRAMES_A_PILOT)
    return views.get(keys.rig_view_id(first, view.eye), view)


def light_seed(view: View, house_id: str, digest: str) -> int:
    """The seed of a view's light; all frames that one camera takes have the same.

    digest: of the recipe's groups that light uses. What parts the pixels of these frames are their
    streams (`noise_anchors`).
    """
    name = view.id
    if view.frame is not None:
        name = keys.rig_view_id(keys.take_id(view.id), view.eye)
    return keys.seed(house_id, name, "light", digest)


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
    seed = light_seed(lead, house_id, digest)
    return Pilot(lead.camera.with_size(*size), seed, lead.time_s)


def noise_anchors(view: View, views: Mapping[str, View], camera: Camera) -> NoiseAnchors | None:
    """The frames whose pixels name the noise of a film's frame; None for a view that is none.

    views: of the house, by id; which of them are rendered changes nothing. camera: the view's, at
    the picture's size. Where the film ends before the later frame, its last one stands for that.
    """
    if view.frame is None:
        return None
    film = {v.frame: v for v in views.values() if v.eye == view.eye}
    last = max(frame for frame in film if frame is not None)
    first = view.frame - view.frame % FRAMES_AN_ANCHOR
    numbers = first, min(first + FRAMES_AN_ANCHOR, last)
    size = camera.intrinsics.width_px, camera.intrinsics.height_px
    early, late = (film.get(number, view).camera.with_size(*size) for number in numbers)
    return NoiseAnchors((early, late), numbers, (view.frame - first) / FRAMES_AN_ANCHOR)
