"""A view as its steps render it: camera, time, blur, pilot and noise anchors. Effects: reads the store.

Frames of a film share a pilot, since neighbouring frames see nearly the same lamps, and a seed, so that
noise stays on surfaces. Which frames have been rendered changes no picture.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.camera import Camera, CameraBlur, View
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Room
from pbrs_farm.core.recipe import BlurFields
from pbrs_farm.formats.marker import Marker, read_marker
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import CachedHouse, Moment
from pbrs_farm.run.step_cache import Work

if TYPE_CHECKING:
    from pbrs_farm.transport.light_scene import Pilot
    from pbrs_farm.transport.surface_noise import NoiseAnchors

FRAMES_A_PILOT: Final = 10
FRAMES_AN_ANCHOR: Final = 20  # between two anchors, the frames at which streams of noise begin
_DEFAULT_FOCUS_M: Final = 100.0  # where the centre of the picture shows nothing


@dataclass(frozen=True)
class ViewSetup:
    """One view of a house, with the settings that follow from the recipe and the other views.

    views: all views of the house by id. Each property is computed at its first use.
    """

    house: CachedHouse
    view: View
    views: Mapping[str, View]

    @cached_property
    def camera(self) -> Camera:
        """The sharp camera at the picture's size."""
        return self.at_size(self.view)

    @property
    def now(self) -> Moment:
        """The house at the time of the view."""
        return self.house.at(self.view.time_s)

    @property
    def room(self) -> Room | None:
        """The room of the view; None for a camera outside every room, or around an object."""
        rooms = self.house.house.rooms
        return next((room for room in rooms if room.id == self.view.room_id), None)

    @cached_property
    def light_digest(self) -> str:
        """Digest of the recipe's groups that change the light."""
        return self.house.recipe.picture_digest(*plan.STEPS["light"].groups)

    def light_seed(self, view: View) -> int:
        """Seed of the light of a view of the house, shared by all frames of one camera.

        Streams (`anchors`) separate the pixels of these frames.
        """
        return view.shot.seed(self.house.house_id, "light", self.light_digest, per="eye")

    @cached_property
    def blur(self) -> CameraBlur | None:
        """Aperture and shutter; the camera of a film's frame moves as between its neighbours."""
        fields = self.house.recipe.blur
        if not fields.is_on:
            return None
        velocity, turn = self._speed_in_film() or _speed_of_fields(self.camera, fields)
        focus = fields.focus_m
        if fields.aperture_mm > 0 and focus == 0:
            t, _face = self.now.caster.first_hit(self.camera.eye[None], self.camera.towards[None])
            focus = float(t[0]) if np.isfinite(t[0]) else _DEFAULT_FOCUS_M
        duration_s = fields.shutter_s + fields.rolling_s
        rolling_share = fields.rolling_s / duration_s if fields.rolling_s > 0 else 0.0
        return CameraBlur(
            aperture_radius_m=fields.aperture_mm / 2000,
            focus_m=focus or 1.0,
            velocity_m=triple(velocity * duration_s),
            turn_rad=triple(turn * duration_s),
            open_share=1.0 - rolling_share,
            rolling_share=rolling_share,
        )

    @cached_property
    def pilot(self) -> Pilot | None:
        """The pilot that the view's light takes over: that of the first of ten frames; None for its own."""
        from pbrs_farm.transport.light_scene import Pilot

        if self.view.frame is None:
            return None
        lead = self._neighbour(-(self.view.frame % FRAMES_A_PILOT))
        if lead.id == self.view.id:
            return None
        return Pilot(self.at_size(lead), self.light_seed(lead), lead.time_s)

    @cached_property
    def anchors(self) -> NoiseAnchors | None:
        """The frames that define a frame's noise; None for a still."""
        from pbrs_farm.transport.surface_noise import FilmFrame, NoiseAnchors

        number, shot = self.view.frame, self.view.shot
        if number is None:
            return None
        later = number - number % FRAMES_AN_ANCHOR
        first = max(later - FRAMES_AN_ANCHOR, 0)
        frames = tuple(
            FilmFrame(n, self.at_size(view), view.time_s)
            for n in range(first, number + 1)
            if (view := self.views.get(shot.partner(n - number).id)) is not None
        )
        share = (number - later) / FRAMES_AN_ANCHOR if later else 0.0
        return NoiseAnchors(frames, first, later - first, share, shot.eye)

    def at_size(self, view: View) -> Camera:
        """The camera of a view of the house at the picture's size."""
        image = self.house.recipe.image
        return view.camera.with_size(image.width_px, image.height_px)

    def earlier_frames(self, most_s: float) -> list[tuple[float, View]]:
        """(time relative to the view, frame of the same camera), the earliest first; [] for a still."""
        now_s, eye = self.view.time_s, self.view.shot.eye
        if now_s is None:
            return []
        film = (view for view in self.views.values() if view.shot.eye == eye)
        times = [(view.time_s - now_s, view) for view in film if view.time_s is not None]
        return sorted((row for row in times if -most_s <= row[0] < 0), key=lambda row: row[0])

    def _neighbour(self, frames: int) -> View:
        """The view of the same camera so many frames later; the view itself beyond the film's ends."""
        return self.views.get(self.view.shot.partner(frames).id, self.view)

    def _speed_in_film(self) -> tuple[F64, F64] | None:
        """(3,) m/s and (3,) rad/s in the world between the neighbouring frames; None for a still."""
        if self.view.frame is None:
            return None
        from scipy.spatial.transform import Rotation

        before, after = self._neighbour(-1), self._neighbour(1)
        time_s = (after.time_s or 0.0) - (before.time_s or 0.0)
        if time_s <= 0:
            return np.zeros(3), np.zeros(3)
        a, b = (v.camera.world_from_camera[:3, :3] for v in (before, after))
        turn = Rotation.from_matrix(b @ a.T).as_rotvec()
        return (after.camera.eye - before.camera.eye) / time_s, np.asarray(turn) / time_s


def _speed_of_fields(camera: Camera, fields: BlurFields) -> tuple[F64, F64]:
    """(3,) m/s and (3,) rad/s in the world."""
    axes = camera.world_from_camera[:3, :3]
    velocity = axes @ np.array([fields.right_mps, fields.up_mps, -fields.forward_mps])
    # Panning to the right turns about -y, tilting up about x, rolling clockwise about -z.
    turn = axes @ np.radians([fields.tilt_dps, -fields.pan_dps, -fields.roll_dps])
    return np.asarray(velocity), np.asarray(turn)


def cached_house(work: Work) -> CachedHouse:
    """The house of this process, loaded anew when its house step was done anew."""
    digest = work.inputs.get("house") or marker_of_house(work, "house").digest
    return work.house_cache.get(work.store, work.recipe, work.house_id, digest)


def marker_of_house(work: Work, step: str) -> Marker:
    """The marker of a step of the house; BadInput where it has not been done."""
    marker = read_marker(work.store, keys.marker_key(work.house_id, step))
    if marker is None:
        raise BadInput(work.house_id, step, "is not done yet", hint="pbrs-farm step")
    return marker


def view_setup(work: Work) -> ViewSetup:
    """The view of a step under way. Raises BadInput for a view that the house has not."""
    house = cached_house(work)
    digest = work.inputs.get("cameras") or marker_of_house(work, "cameras").digest
    return ViewSetup(house, house.view(work.view_id or "", digest), house.views(digest))
