"""Materials of OBJ models by their MTL, under overrides of those who place them. Reads pictures."""

from __future__ import annotations

import posixpath
from dataclasses import replace
from typing import Final

from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.read.common.json_values import Override
from pbrs_farm.read.common.material_library import (
    LoadedTexture,
    MaterialLibrary,
    picture_with_alpha,
)
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.root_folder import RootFolder
from pbrs_farm.read.mesh.mtl import ObjMaterial

MAX_TEXTURE_BYTES: Final = 64_000_000
GREY: Final = (0.8, 0.8, 0.8)
WHITE: Final = (1.0, 1.0, 1.0)
BLACK: Final = (0.0, 0.0, 0.0)
DEFAULT_WALLS: Final = ("wallp_0", "wallp_1_1", "wallp_1_2")
"""Papers that the published pictures show white, whatever colour they have (docs/spec/suncg.md section 6)."""


class ModelMaterials:
    """Resolves the materials of one house's models, walls and slabs into its material library."""

    def __init__(self, folder: RootFolder, notes: Notes) -> None:
        self._folder = folder
        self.library = MaterialLibrary(notes)

    def material(
        self, mtl: ObjMaterial | None, override: Override | None, *, place: str, clear: MaterialKind
    ) -> Material:
        """A model's material (grey without an MTL) as a node overrides it. clear: the kind if d < 1."""
        base = mtl or ObjMaterial("")
        diffuse, reference = base.kd, base.map_kd
        if override is not None and override.texture is not None:
            reference = self._override_texture(override.texture)
            diffuse = override.diffuse or WHITE
        elif override is not None and override.diffuse is not None:
            diffuse = override.diffuse
        elif reference and base.kd in (GREY, BLACK):  # no Kd, or one that would hide the picture
            diffuse = WHITE
        loaded = self._texture(reference, base.map_d, place) if reference or base.map_d else None
        if reference and loaded is None and diffuse == WHITE:
            diffuse = GREY
        return Material(
            name=(override.name if override is not None else "") or base.name,
            kind=clear if base.d < 1 else MaterialKind.OPAQUE,
            diffuse=diffuse,
            specular=base.ks,
            shininess=base.ns,
            opacity=base.d,
            texture_id=loaded.texture.id if loaded else None,
            alpha_cutout=bool(loaded and loaded.has_holes()),
        )

    def wall_material(
        self, mtl: ObjMaterial | None, override: Override | None, *, place: str
    ) -> Material:
        """A wall's material; without a colour, or with a default paper, white and marked as default."""
        material = self.material(mtl, override, place=place, clear=MaterialKind.GLASS)
        picture = mtl.map_kd if mtl is not None else ""
        is_unpainted = mtl is None or (not picture and mtl.kd == GREY)
        if override is not None:
            picture = override.texture or picture
            is_unpainted &= override.texture is None and override.diffuse is None
        if posixpath.splitext(posixpath.basename(picture))[0] in DEFAULT_WALLS:
            return replace(material, diffuse=WHITE, texture_id=None, is_default=True)
        return replace(material, is_default=is_unpainted)

    def _override_texture(self, name: str) -> str:
        png = f"texture/{name}.png"
        return png if self._folder.path(png) is not None else f"texture/{name}.jpg"

    def _texture(self, name: str, opacity: str, place: str) -> LoadedTexture | None:
        """The colour picture ("" = none), with the alpha of the opacity picture if the two differ."""
        if opacity and opacity != name:
            mask = self._picture(opacity)
            if mask is not None:
                return self.library.texture(
                    f"{name} with the alpha of {opacity}",
                    name=posixpath.basename(name or opacity),
                    place=place,
                    load=lambda: picture_with_alpha(self._picture(name) if name else None, mask),
                )
            self.library.texture(opacity, name="", place=place, load=lambda: None)  # its note
        return self.library.texture(
            name, name=posixpath.basename(name), place=place, load=lambda: self._picture(name)
        )

    def _picture(self, name: str) -> bytes | None:
        return self._folder.read(name, max_bytes=MAX_TEXTURE_BYTES)
