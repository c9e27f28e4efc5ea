"""The materials and textures of a house while it is read, each once; state: those met so far."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from pbrs_farm.core.house import Material, Texture
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.textures import texture_from_bytes

PANE_OPACITY: Final = 0.2  # of panes and glass whose source says opaque


class LoadedTexture(NamedTuple):
    """A texture that decodes."""

    texture: Texture
    has_holes: bool  # its alpha falls below one half somewhere


class MaterialLibrary:
    """Numbers materials and decodes every picture once, in the order they first come up.

    The one way in for materials and textures of all formats.
    """

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._materials: dict[Material, int] = {}
        self._loaded: dict[str, LoadedTexture | None] = {}  # by key; None = cannot be used

    @property
    def materials(self) -> tuple[Material, ...]:
        """Every material; a Surface's material is an index into it."""
        return tuple(self._materials)

    @property
    def textures(self) -> dict[str, Texture]:
        """Every texture a material names, by id."""
        used = {name for m in self._materials for name in m.texture_ids}
        found = (loaded.texture for loaded in self._loaded.values() if loaded is not None)
        return {t.id: t for t in found if t.id in used}

    def index(self, material: Material) -> int:
        """The material's index, the same for equal materials."""
        return self._materials.setdefault(material, len(self._materials))

    def texture(
        self, key: str, *, name: str, place: str, load: Callable[[], bytes | None]
    ) -> LoadedTexture | None:
        """The texture of the picture key; None, with a note, where load gives nothing or what it
        gives cannot be decoded."""
        if key not in self._loaded:
            self._loaded[key] = self._load(key, name, place, load)
        return self._loaded[key]

    def _load(
        self, key: str, name: str, place: str, load: Callable[[], bytes | None]
    ) -> LoadedTexture | None:
        data = load()
        shown = key[:120]
        if data is None:
            self._notes.add("missing-texture", place, f"{shown} does not exist; the colour is kept")
            return None
        try:
            return LoadedTexture(*texture_from_bytes(data, name))
        except ValueError as error:
            self._notes.add("unreadable-texture", place, f"{shown}: {error}")
            return None
