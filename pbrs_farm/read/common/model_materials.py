"""OBJ models of a folder, parsed once each, and their materials under overrides. Reads OBJ, MTL, pictures."""

from __future__ import annotations

import posixpath
from dataclasses import dataclass, replace
from typing import Final

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.json_values import Override
from pbrs_farm.read.common.material_library import (
    LoadedTexture,
    MaterialLibrary,
    picture_with_alpha,
)
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder, read_mtl
from pbrs_farm.read.mesh.mtl import ObjMaterial, laid
from pbrs_farm.read.mesh.obj import Mesh, parse_obj

_BYTES_PER_TRIANGLE = 150


@dataclass(frozen=True, slots=True, eq=False)
class ParsedModel:
    """Meshes with their materials."""

    meshes: tuple[Mesh, ...]
    slots: tuple[int, ...]  # per mesh its position in mtl, -1 = unknown
    mtl: tuple[ObjMaterial, ...]

    @property
    def n_faces(self) -> int:
        """Triangles over all meshes."""
        return sum(len(m.faces) for m in self.meshes)


class DamagedModel(BadHouse):
    """An OBJ of the library that cannot be read; one that an object places is left out."""


class ModelCache:
    """Parses every model once and remembers it for the nodes that place it again."""

    def __init__(self, folder: RootFolder, notes: Notes, fields: ReadFields) -> None:
        self._folder = folder
        self._notes = notes
        self._max_triangles = fields.max_model_triangles
        self._known: dict[tuple[str, str], ParsedModel | None] = {}

    def model(self, obj_name: str, mtl_name: str) -> ParsedModel | None:
        """The meshes and materials of an OBJ below the root, parsed once; None if there is no such OBJ.

        obj_name, mtl_name: below the root, with "/". Raises DamagedModel for an OBJ that cannot be read, and
        BadHouse for one beyond read.max_model_triangles. A missing MTL is a note, its model grey.
        """
        key = (obj_name, mtl_name)
        if key not in self._known:
            self._known[key] = self._parse(obj_name, mtl_name)
        return self._known[key]

    def _parse(self, obj_name: str, mtl_name: str) -> ParsedModel | None:
        data = self._folder.read(
            obj_name,
            max_bytes=self._max_triangles * _BYTES_PER_TRIANGLE,
            limit="read.max_model_triangles",
        )
        if data is None:
            return None
        try:
            parsed = parse_obj(data, obj_name, max_triangles=self._max_triangles)
        except BadHouse as error:
            if error.hint:  # a limit of the recipe: the house is refused
                raise
            raise DamagedModel(obj_name, "", error.message.removeprefix(f"{obj_name}: ")) from None
        meshes = parsed.meshes
        if parsed.is_cut:
            text = "ends within a line, or with vertices of no face: cut short? The rest is kept"
            self._notes.add("cut-short", obj_name, text)
        mtl = self._mtl(mtl_name)
        names = {m.name: i for i, m in reversed(list(enumerate(mtl)))}
        for name in {m.material: None for m in meshes}:
            if mtl and name not in names:
                text = f"usemtl {name[:60]!r} is not in {mtl_name}; it is grey"
                self._notes.add("unknown-material", obj_name, text)
        slots = tuple(names.get(m.material, -1) for m in meshes)
        used = {slot: mtl[slot] for slot in slots if slot >= 0}
        for material in used.values():
            if material.unread:
                text = f"{material.name[:60]}: {', '.join(material.unread)} not read"
                self._notes.add("unread-map", mtl_name, text)
        meshes = tuple(laid(m, used.get(k)) for m, k in zip(meshes, slots, strict=True))
        return ParsedModel(meshes, slots, mtl)

    def _mtl(self, name: str) -> tuple[ObjMaterial, ...]:
        materials = read_mtl(self._folder, name)
        if materials is None:
            self._notes.add("missing-materials", name, "does not exist; the model is grey")
        elif not materials:
            self._notes.add("missing-materials", name, "holds no material; the model is grey")
        return materials or ()


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
