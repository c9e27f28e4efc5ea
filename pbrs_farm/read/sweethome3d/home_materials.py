"""Materials of a Sweet Home 3D home; holds the material library and notes while it is read."""

from __future__ import annotations

import posixpath

from pbrs_farm.core.house import Material
from pbrs_farm.read.common.material_library import LoadedTexture, MaterialLibrary
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.resources import Resources
from pbrs_farm.read.sweethome3d.home_file.home_xml import Paint

SHININESS_SCALE = 128.0  # Phong exponent of the program's shininess 1


class HomeMaterials:
    """Resolves paints and textures of one home (or of the program) into its material library."""

    def __init__(self, contents: Resources, notes: Notes) -> None:
        self.contents = contents
        self.notes = notes
        self.library = MaterialLibrary(notes)

    def texture(self, name: str, place: str) -> LoadedTexture | None:
        """The texture of that content name, or None with a note if it cannot be used."""
        return self.library.texture(
            name,
            name=posixpath.basename(name),
            place=place,
            load=lambda: self.contents.read(posixpath.normpath(name)),
        )

    def painted(self, paint: Paint, name: str, place: str) -> int:
        """Index of a paint's material: its picture, else its colour, else white marked as default."""
        # A picture that can be used goes before the colour.
        loaded = None
        if paint.picture is not None:
            loaded = self.texture(paint.picture.image, place)
        shine = min(max(paint.shininess or 0.0, 0.0), 1.0)
        colour = paint.colour if loaded is None else None
        return self.library.index(
            Material(
                name=name,
                diffuse=colour or (1.0, 1.0, 1.0),
                specular=(shine, shine, shine),
                shininess=shine * SHININESS_SCALE,
                texture_id=None if loaded is None else loaded.texture.id,
                is_default=loaded is None and paint.colour is None,
            )
        )
