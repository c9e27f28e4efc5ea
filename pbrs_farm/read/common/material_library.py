"""The materials and textures of a house while it is read, each once; state: what came up so far."""

from __future__ import annotations

from collections.abc import Callable

from pbrs_farm.core.house import Material, Texture
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.textures import texture_from_bytes


class Palette:
    """Numbers materials and tries every picture once, in the order they first come up."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._materials: dict[Material, int] = {}
        self._tried: dict[str, tuple[Texture, bool] | None] = {}

    @property
    def materials(self) -> tuple[Material, ...]:
        """Every material; a Surface's material is an index into it."""
        return tuple(self._materials)

    @property
    def textures(self) -> dict[str, Texture]:
        """Every texture a material names, by id."""
        used = {m.texture_id for m in self._materials}
        found = (t[0] for t in self._tried.values() if t is not None)
        return {t.id: t for t in found if t.id in used}

    def index(self, material: Material) -> int:
        """The material's index, the same for equal materials."""
        return self._materials.setdefault(material, len(self._materials))

    def texture(
        self, key: str, *, name: str, place: str, load: Callable[[], bytes | None]
    ) -> tuple[Texture, bool] | None:
        """(the texture, whether its alpha has holes) of the picture key; None, with a note, where
        load gives nothing or what it gives cannot be decoded."""
        if key not in self._tried:
            self._tried[key] = self._read(key, name, place, load)
        return self._tried[key]

    def _read(
        self, key: str, name: str, place: str, load: Callable[[], bytes | None]
    ) -> tuple[Texture, bool] | None:
        data = load()
        if data is None:
            self._notes.add("missing-texture", place, f"{key} does not exist; the colour is kept")
            return None
        try:
            return texture_from_bytes(data, name)
        except ValueError as error:
            self._notes.add("unreadable-texture", place, f"{key}: {error}")
            return None
