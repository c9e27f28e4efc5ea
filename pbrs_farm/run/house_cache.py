"""The house that a process works on: geometry, caster, GL and light scenes, made once.

Effects: reads the store, holds a GL context and Mitsuba scenes; one house at a time.
"""

from __future__ import annotations

import gc
from collections import OrderedDict
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.assets.skies import fetch_skies
from pbrs_farm.core import keys
from pbrs_farm.core.camera import View
from pbrs_farm.core.errors import BadInput, BadRecipe
from pbrs_farm.core.house import Geometry, House, Texture, geometry_from_house
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.formats.cameras_json import views_from_json
from pbrs_farm.geometry.moving import MovingHouse
from pbrs_farm.prepare.finished_house import HouseBeforeEdits
from pbrs_farm.regular_files import fault_of, read_regular
from pbrs_farm.store.object_store import Store

if TYPE_CHECKING:
    from pbrs_farm.raster import Rasterizer
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.transport.light_scene import LightScene
    from pbrs_farm.transport.scene_tables.sky import Sky


_TIMES: Final = 3  # cached times of a moving house: a frame and its neighbours


@dataclass(frozen=True)
class Moment:
    """A house at one time, as labels see it."""

    house: House
    geometry: Geometry
    caster: Caster


class CachedHouse:
    """A repaired house from the store, and its scenes, each built at its first use."""

    def __init__(self, store: Store, recipe: Recipe, house_id: str, digest: str) -> None:
        """digest: of the house step's marker; another digest means another CachedHouse."""
        self.store = store
        self.recipe = recipe
        self.house_id = house_id
        self._views: tuple[str, dict[str, View]] | None = None  # cameras digest, views by id
        self._moments: OrderedDict[float, Moment] = OrderedDict()

    @cached_property
    def house(self) -> House:
        """The house as its bundle holds it, loaded once; BadHouse for damage, StoreFailed without it."""
        from pbrs_farm.formats.house_bundle import house_from_bundle

        get = self.store.get
        return house_from_bundle(
            get(keys.house_key(self.house_id, "house.glb")),
            get(keys.house_key(self.house_id, "house.json")),
        )

    @cached_property
    def geometry(self) -> Geometry:
        """All triangles, panes included."""
        return geometry_from_house(self.house)

    @cached_property
    def textures(self) -> dict[str, NDArray[np.uint8]]:
        """Texture id -> (H, W, 3 or 4) uint8 sRGB; those that cannot be read are left out."""
        return decoded_textures(self.house)[0]

    @cached_property
    def caster(self) -> Caster:
        """The ray caster of labels and item buffers."""
        from pbrs_farm.raycast.caster import Caster

        return Caster.of_house(self.house, self.geometry)

    def forget_caster(self) -> None:
        """Free the caster's trees; the next use builds those that it needs."""
        self.__dict__.pop("caster", None)

    @cached_property
    def moving(self) -> MovingHouse:
        """The house split into static and moving parts."""
        return MovingHouse(self.house, self.geometry)

    def at(self, time_s: float | None) -> Moment:
        """The house at a time in seconds (None: at rest), static parts shared; the last few are cached."""
        if time_s is None or not self.house.motions:
            return Moment(self.house, self.geometry, self.caster)
        if time_s not in self._moments:
            house, geometry = self.moving.at(time_s)
            caster = self.caster.at(geometry, self.moving.moving_faces)
            self._moments[time_s] = Moment(house, geometry, caster)
            while len(self._moments) > _TIMES:
                self._moments.popitem(last=False)
        return self._moments[time_s]

    @cached_property
    def rasterizer(self) -> Rasterizer:
        """The GL renderer, with a GL context of this thread: use and close it in the thread that asked first."""
        from pbrs_farm.raster import Rasterizer

        return Rasterizer(self.house, DecodedOnDemand(self.house.textures), self.recipe.raster)

    def rasterizer_at(self, time_s: float | None) -> Rasterizer:
        """The GL renderer of the house at a time; the same object for all times."""
        if self.house.motions:
            self.rasterizer.draw_house(self.at(time_s).house)
        return self.rasterizer

    @cached_property
    def light_scene(self) -> LightScene:
        """The scene that carries light; loading Mitsuba, geometry and textures takes seconds."""
        from pbrs_farm.transport.light_scene import LightScene

        # The scene holds its own texels: do not keep these for it.
        return LightScene.load(self.house, self._textures_once, self.recipe, self.sky)

    def _textures_once(
        self, names: Container[str | None] | None = None
    ) -> dict[str, NDArray[np.uint8]]:
        """As `textures`, of some names if given, but not kept unless they are already."""
        cached = self.__dict__.get("textures")
        return decoded_textures(self.house, names)[0] if cached is None else cached

    def light_scene_at(self, time_s: float | None) -> LightScene:
        """The scene that carries light, of the house at a time; the same object for all times."""
        self.light_scene.move_to(time_s)
        return self.light_scene

    @cached_property
    def sky(self) -> Sky:
        """The sky over this house; BadRecipe when the recipe's panoramas cannot be had."""
        from pbrs_farm.transport.scene_tables.sky import sky_for_house

        # Choose the panorama by the house's id, so that all its views have one sky.
        panorama = panorama_for_house(self.recipe, self.house_id)
        return sky_for_house(self.recipe, self.house_id, panorama=panorama)

    def view(self, view_id: str, cameras_digest: str) -> View:
        """The view with an id, read again if the digest of the cameras step changes; BadInput without it."""
        views = self.views(cameras_digest)
        if view_id not in views:
            key = keys.house_key(self.house_id, "cameras.json")
            raise BadInput(key, view_id, "no such view", hint=f"of {', '.join(views) or 'none'}")
        return views[view_id]

    def views(self, cameras_digest: str) -> Mapping[str, View]:
        """All views of the house by id, in the order of cameras.json; cameras_digest as for view."""
        if self._views is None or self._views[0] != cameras_digest:
            key = keys.house_key(self.house_id, "cameras.json")
            self._views = (cameras_digest, views_from_json(self.store.get(key), key))
        return self._views[1]

    def forget_views(self) -> None:
        """Read cameras.json again when a view is next asked for."""
        self._views = None

    def close(self) -> None:
        """Free the resources of the GPU and Mitsuba. The object loads them again when it is used."""
        # Drop each cached property by name: scenes before the arrays they refer to.
        rasterizer = self.__dict__.pop("rasterizer", None)
        if rasterizer is not None:
            rasterizer.close()
        self._moments.clear()
        for name in ("light_scene", "caster", "moving", "geometry", "house", "textures"):
            self.__dict__.pop(name, None)
        gc.collect()


def decoded_textures(
    house: House, names: Container[str | None] | None = None
) -> tuple[dict[str, NDArray[np.uint8]], list[str]]:
    """(H, W, 3 or 4) uint8 sRGB by id, and the ids of unreadable ones, whose surfaces stay plain.

    names: ids of the wanted ones; None = all.
    """
    pictures = DecodedOnDemand(house.textures)
    chosen = [name for name in pictures if names is None or name in names]
    tried = {name: pictures.get(name) for name in chosen}
    decoded = {name: picture for name, picture in tried.items() if picture is not None}
    return decoded, [name for name in tried if name not in decoded]


class DecodedOnDemand(Mapping[str, NDArray[np.uint8]]):
    """Pictures by texture id as of `decoded_textures`, each decoded when it is looked up.

    An unreadable one is a key, but looking it up raises KeyError.
    """

    def __init__(self, textures: Mapping[str, Texture]) -> None:
        self._textures = textures

    def __getitem__(self, name: str) -> NDArray[np.uint8]:
        from pbrs_farm.images import decode_texture

        texture = self._textures[name]
        try:
            return decode_texture(texture.data, texture.name, texture.media_type)
        except BadInput:
            raise KeyError(name) from None

    def __contains__(self, name: object) -> bool:
        return name in self._textures

    def __iter__(self) -> Iterator[str]:
        return iter(self._textures)

    def __len__(self) -> int:
        return len(self._textures)


class HouseCache:
    """The last house of this process, and the last before its edits, which outlasts those made from it."""

    def __init__(self) -> None:
        self.before_edits = HouseBeforeEdits()
        self._held: tuple[tuple[str, str, str, str], CachedHouse] | None = None

    def get(self, store: Store, recipe: Recipe, house_id: str, digest: str) -> CachedHouse:
        """The loaded house, the same while its inputs are; another one closes the cached house."""
        # Scenes depend on the recipe, too.
        key = (store.url, house_id, digest, recipe.digest())
        if self._held is None or self._held[0] != key:
            self.clear()
            self._held = (key, CachedHouse(store, recipe, house_id, digest))
        return self._held[1]

    def clear(self) -> None:
        """Let go of the held house."""
        if self._held is not None:
            self._held[1].close()
            self._held = None


SUFFIXES = (".exr", ".hdr")


def panorama_for_house(recipe: Recipe, house_id: str) -> tuple[str, NDArray[np.floating]] | None:
    """(name, (H, W, 3) linear radiance) of a house's sky; None when the recipe wants no panorama.

    Without a folder in the recipe those of Debian's blender-data are taken (skies.py).

    Raises BadRecipe when the folder is missing or holds no outdoor panorama.
    """
    if recipe.sky.kind != "panorama":
        return None
    from pbrs_farm.images import decode_radiance
    from pbrs_farm.transport.scene_tables.sky import choose_panorama

    folder = Path(recipe.sky.panoramas) if recipe.sky.panoramas else fetch_skies()
    if folder.is_file():
        return folder.name, decode_radiance(_bytes(folder), folder.name)
    if not folder.is_dir():
        hint = "`pbrs-farm skies` fetches four; or --set sky.kind=sunsky"
        raise BadRecipe(f"sky.panoramas: {folder} is not a folder of panoramas", hint=hint)
    # Choose by name and house, not by the folder's order: each machine takes the same.
    files = {p.name: p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES}
    name = choose_panorama(list(files), house_id, recipe.seed)
    return name, decode_radiance(_bytes(files[name]), name)


def _bytes(file: Path) -> bytes:
    try:
        return read_regular(file)
    except OSError as error:
        raise BadRecipe(f"sky.panoramas: {file} {fault_of(error)}") from None
