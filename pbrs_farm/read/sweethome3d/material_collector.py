"""Collects a house's materials and textures, each once; holds state while a house is read."""

from __future__ import annotations

import posixpath

from pbrs_farm.core import keys
from pbrs_farm.core.house import Material, Note, Texture
from pbrs_farm.read.common.resources import Resources, media_type
from pbrs_farm.read.sweethome3d.home_xml import Paint

SHININESS_SCALE = 128.0


class Looks:
    """Materials by index and textures by id; the only state of reading a house, with the notes."""

    def __init__(self, contents: Resources) -> None:
        self.contents = contents
        self.textures: dict[str, Texture] = {}
        self.notes: list[Note] = []
        self._materials: dict[Material, int] = {}
        self._ids: dict[str, str | None] = {}

    @property
    def materials(self) -> tuple[Material, ...]:
        """All materials in the order of their indices."""
        return tuple(self._materials)

    def note(self, kind: str, place: str, text: str) -> None:
        """Record a recoverable fault once."""
        note = Note(kind, place, text)
        if note not in self.notes:
            self.notes.append(note)

    def index(self, material: Material) -> int:
        """The index of an equal material."""
        return self._materials.setdefault(material, len(self._materials))

    def texture_id(self, name: str, place: str) -> str | None:
        """The texture of that content name, or None with a note if it cannot be used."""
        if name not in self._ids:
            self._ids[name] = self._load(name, place)
        return self._ids[name]

    def has_alpha(self, texture_id: str | None) -> bool:
        """Whether the texture is a PNG with an alpha channel or transparent colours."""
        texture = self.textures.get(texture_id or "")
        if texture is None or texture.media_type != "image/png":
            return False
        header = texture.data[:33]
        return header[25:26] in (b"\x04", b"\x06") or b"tRNS" in texture.data[33:4096]

    def _load(self, name: str, place: str) -> str | None:
        data = self.contents.read(posixpath.normpath(name))
        if data is None:
            self.note("missing-texture", place, f"no content {name[:120]!r}")
            return None
        kind = media_type(data)
        if not kind:
            self.note("unreadable-texture", place, f"{name[:120]!r} is neither PNG nor JPEG")
            return None
        texture = Texture(keys.sha256(data)[:16], posixpath.basename(name), kind, data)
        self.textures.setdefault(texture.id, texture)
        return texture.id

    def painted(self, paint: Paint, name: str, place: str) -> int:
        """Index of the material a wall's or room's finish makes."""
        texture = None
        if paint.picture is not None:
            texture = self.texture_id(paint.picture.image, place)
        shine = min(max(paint.shininess or 0.0, 0.0), 1.0)
        colour = paint.colour if texture is None else None
        return self.index(
            Material(
                name=name,
                diffuse=colour or (1.0, 1.0, 1.0),
                specular=(shine, shine, shine),
                shininess=shine * SHININESS_SCALE,
                texture_id=texture,
                is_default=texture is None and paint.colour is None,
            )
        )
