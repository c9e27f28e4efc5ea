"""The emitters of a scene, prepared for one view after another. Effects: holds and fills device buffers.

They are built once per scene; then each view sets its portals and the probabilities of its emitters. Each step
depends on the previous ones, so their order is defined only here:

    build   1. lamps and sky, with equal weights
            2. the light emitted by lampshades, measured with these
            3. targets of guided rays, from 2.: with the scene's faces, then with the emitters
            4. the outdoor surroundings and their light
    view    5. the portals near it, all emitters with equal weights
            6. the weights measured by a pilot of the view, and the cells of the sun's plane by its paths
            7. with lamps and `path`: the weights measured by a trial of the view, guided rays or not
"""

from __future__ import annotations

from functools import cached_property
from typing import Final

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters, EmitterWeights
from pbrs_farm.transport.kernels.outside import Outside
from pbrs_farm.transport.lampshade_exitance import guiding_targets, pdfs_by_face
from pbrs_farm.transport.pilot import (
    pilot_weights,
    trial_weights,
    uniform_weights,
    weights_by_distance,
)
from pbrs_farm.transport.scene_tables.portals import nearest_portals
from pbrs_farm.transport.scene_tables.scene_tables import SceneTables, bounding_spheres
from pbrs_farm.transport.scene_tables.sky import Sky

_PILOT_SEED: Final = 0x5EED  # parts the pilot's random stream from the picture's
_TRIAL_SEED: Final = 0x7A1A1  # and that of the trial of guided rays


class ViewEmitters:
    """The emitters of one scene, which every method configures for a view or a position.

    There is one `Emitters`: results of earlier calls have the weights of the last call.

    portals: (P, 3, 3) of the whole house. outside: surroundings of its windows, with their tables.
    """

    def __init__(
        self,
        scene: DeviceScene,
        tables: SceneTables,
        sky: Sky,
        portals: F64,
        outside: tuple[House, SceneTables] | None,
    ) -> None:
        self._scene, self._tables, self._sky = scene, tables, sky
        self._portals, self._outside = portals, outside
        self._built: Emitters | None = None  # at the first view
        self._piloted: tuple[object, EmitterWeights] | None = None  # the last pilot and its weights

    @property
    def is_built(self) -> bool:
        """Whether steps 1 to 4 are done: for a house with motions they are done at rest."""
        return self._built is not None

    def build(self, place: F64) -> None:
        """Do steps 1 to 4, where that was not done. place: (3,) of any view."""
        self._set_view(*self._alike(place))

    def _alike(self, place: F64) -> tuple[F64, EmitterWeights]:
        portals = nearest_portals(self._portals, place)
        return portals, uniform_weights(len(self._tables.lamps), len(portals))

    def measure(
        self, camera: Camera, fields: LightFields, seed: int
    ) -> tuple[Emitters, EmitterWeights]:
        """The emitters weighted by what each brings to a camera's view, and those weights."""
        portals = nearest_portals(self._portals, camera.eye)
        n = len(self._tables.lamps), len(portals)
        weights = uniform_weights(*n)
        emitters = self._set_view(portals, weights)
        if fields.pilot_spp > 0:
            weights = pilot_weights(self._scene, emitters, camera, *n, fields, seed ^ _PILOT_SEED)
            emitters.set_weights(weights)
            emitters.sunlit.choose_cells(self._scene, emitters.sun)
            # Guide the rays where that pays; Metropolis always guides its own.
            if n[0] > 0 and fields.integrator == "path":
                weights = trial_weights(
                    self._scene, emitters, camera, weights, fields, seed ^ _TRIAL_SEED
                )
            emitters.set_weights(weights)
        return emitters, weights

    def knows(self, camera: Camera, fields: LightFields, seed: int, time_s: float | None) -> bool:
        """Whether `of_pilot` would measure nothing."""
        return self._piloted is not None and self._piloted[0] == _key(camera, fields, seed, time_s)

    def of_pilot(
        self, camera: Camera, fields: LightFields, seed: int, time_s: float | None = None
    ) -> tuple[Emitters, EmitterWeights]:
        """As measure, but measured only where an argument differs from the call before."""
        key = _key(camera, fields, seed, time_s)
        if self._piloted is None or self._piloted[0] != key:
            emitters, weights = self.measure(camera, fields, seed)
            self._piloted = key, weights
            return emitters, weights
        weights = self._piloted[1]
        return self._set_view(nearest_portals(self._portals, camera.eye), weights), weights

    def at_place(self, place: F64) -> Emitters:
        """The emitters weighted by their distance from a place (3,), where no pilot renders a view."""
        portals = nearest_portals(self._portals, place)
        return self._set_view(portals, weights_by_distance(self._spheres, place, len(portals)))

    @cached_property
    def _spheres(self) -> F64:
        return bounding_spheres(self._tables)

    def _set_view(self, portals: F64, weights: EmitterWeights) -> Emitters:
        if self._built is None:
            self._built = self._build(portals)
        self._built.set_view(portals, weights)
        return self._built

    def _build(self, portals: F64) -> Emitters:
        """Steps 1 to 4. portals: of the first view, which do not affect the measurements."""
        uniform = uniform_weights(len(self._tables.lamps), len(portals))
        emitters = Emitters(self._tables, self._sky, portals, uniform)
        # Measure with rays that are not guided yet and every lamp alike: whichever view or room is
        # first changes no picture.
        targets = guiding_targets(self._scene, emitters, self._tables, 0)
        self._scene.set_guiding_targets(*pdfs_by_face(targets))
        emitters.set_targets(targets)
        if self._outside is not None:
            beyond, tables = self._outside
            outside = Outside(tables, beyond, self._sky)
            emitters.set_outside(outside, outside.light_dome(self._scene, self._portals))
        return emitters


def _key(camera: Camera, fields: LightFields, seed: int, time_s: float | None) -> object:
    return seed, camera.intrinsics, camera.world_from_camera.tobytes(), fields, time_s
