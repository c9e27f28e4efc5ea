"""OBJ models of a folder, parsed once each. Effect: reads OBJ and MTL."""

from __future__ import annotations

from dataclasses import dataclass

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.root_folder import RootFolder
from pbrs_farm.read.common.source_files import read_mtl
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
