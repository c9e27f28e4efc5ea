"""The views that light is measured in: stored cameras of four example homes, bare and dressed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.run.house_cache import decoded_textures
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sky_for_house

HOMES: Final = ("Studio", "2BedroomApartment", "3BedroomApartment", "3BedroomHouseWithMezzanine")
DRESS_SEED: Final = 1


@dataclass(frozen=True, slots=True)
class MeasuredView:
    """A stored camera of a home."""

    home: str
    camera: int
    dress_seed: int = 0  # 0 = bare

    @property
    def key(self) -> str:
        """Its part of a figure's name."""
        dressed = "_dressed" if self.dress_seed else ""
        return f"{self.home.lower()}_{self.camera}{dressed}"


EIGHT: Final = tuple(
    MeasuredView(home, camera, seed) for home in HOMES for camera, seed in ((0, 0), (1, DRESS_SEED))
)


def loaded(
    views: tuple[MeasuredView, ...], recipe: Recipe, size: tuple[int, int]
) -> Iterator[tuple[MeasuredView, LightScene, Camera]]:
    """Each view with the scene of its house and its camera; one scene at a time is held.

    Views of one house that follow each other share its scene.
    """
    held: tuple[str, int] | None = None
    for view in views:
        if held != (view.home, view.dress_seed):
            house, scene = _loaded_house(view, recipe)
            held = view.home, view.dress_seed
        stored = house.cameras[view.camera]
        intrinsics = Intrinsics.from_hfov(*size, stored.hfov_rad)
        yield view, scene, Camera.look(intrinsics, stored.eye, stored.towards)


def _loaded_house(view: MeasuredView, recipe: Recipe) -> tuple[House, LightScene]:
    (source,) = variants(resolve(view.home), [view.dress_seed])
    house, _report = repaired_house(source, recipe)
    textures, _unreadable = decoded_textures(house)
    # The sky of the bare home, so that dressing changes no light from outdoors.
    sky = sky_for_house(recipe, resolve(view.home).house_id)
    scene = LightScene.load(house, textures, recipe, sky)
    return house, scene
