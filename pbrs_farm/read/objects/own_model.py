"""A user's mesh in its own frame, in metres: GLB, glTF, OBJ, PLY, STL, OFF.

Effects: reads the file and its pictures. Vertex colours become one colour per triangle, kept in a
small picture, since a surface has one material. Omissions and assumptions are notes of the shape.
"""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.edits import ModelRef
from pbrs_farm.core.errors import BadHouse, BadInput
from pbrs_farm.core.house import Material, Note, Surface, Texture, corners_of_surfaces
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.material_library import MaterialLibrary
from pbrs_farm.read.common.model_materials import MAX_TEXTURE_BYTES
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.objects.model_folders import ObjectModel
from pbrs_farm.read.objects.single_object import model_surfaces, object_companions
from pbrs_farm.regular_files import MAX_SCENE_BYTES, naming_kind, open_regular, read_given

SUFFIXES: Final = (".glb", ".gltf", ".obj", ".ply", ".stl", ".off")
MAX_EXTENT_M: Final = 100.0
"""A model larger than that is a slip of its unit."""
_MIN_EXTENT_M: Final = 1e-4
_PLY_HEADER_BYTES: Final = (
    65_536  # maximum header length; longer headers are not searched for a picture
)


@dataclass(frozen=True, slots=True, eq=False)
class ModelShape:
    """A model in its own frame, metres."""

    surfaces: tuple[Surface, ...]  # materials index into materials
    materials: tuple[Material, ...]
    textures: dict[str, Texture]
    notes: tuple[Note, ...] = ()  # omissions and assumptions; places begin with the file's name

    @property
    def points(self) -> F64:
        """(V, 3) vertices of all surfaces."""
        return np.concatenate([s.positions for s in self.surfaces]).astype(np.float64)

    @property
    def triangles(self) -> F64:
        """(F, 3, 3) corners of all triangles."""
        return corners_of_surfaces(self.surfaces)

    @property
    def bounds(self) -> F64:
        """(2, 3) axis-aligned minimum and maximum, metres."""
        points = self.points
        return np.array([points.min(0), points.max(0)])


@lru_cache(maxsize=256)
def model_shape(model: ModelRef, fields: ReadFields) -> ModelShape:
    """The shape of a model, read once a process.

    Raises BadInput, naming the file: missing, changed since it was named, empty, not finite, larger
    than 100 m or smaller than .1 mm, with more triangles than the recipe allows.
    """
    path = Path(model.path)
    data = read_given(path, MAX_SCENE_BYTES)
    if (keys.sha256(data), companions_digest(path)) != (model.sha256, model.companions):
        raise BadInput(path, "", "changed since the home was loaded", hint="load the home again")
    notes = Notes(path.name, strict=fields.strict)
    read = _from_trimesh if _is_plain(path) else _from_reader
    with naming_kind(path):
        try:
            shape = read(path, data, model, fields, notes)
        except BadHouse as error:
            raise BadInput(path, error.place, error.text, hint=error.hint) from None
    # Its class is the caller's category, whatever its nodes are called.
    kept_notes = [note for note in notes.all() if note.kind != "unmapped-class"]
    shape = replace(shape, notes=tuple(_with_file(note, path.name) for note in kept_notes))
    return _check_shape_limits(path, _scaled(shape, model.scale), fields)


def _with_file(note: Note, file: str) -> Note:
    """The note with the file's name before its place, since a home has notes of several files."""
    return note if note.place.startswith(file) else replace(note, place=f"{file}: {note.place}")


def companions_digest(path: Path) -> str:
    """Digest of the files beside a model that the reader opens, such as pictures; "" for none."""
    files, folder = SourceFiles(), RootFolder(path.parent)
    if _is_plain(path):
        return files.digest(folder, _pictures_of_ply(path))
    model = ObjectModel(path.stem, path.stem, "", 0, path, path.parent)
    return files.digest(folder, object_companions(model, files))


def _is_plain(path: Path) -> bool:
    return path.suffix.lower() in (".ply", ".stl", ".off")


def _pictures_of_ply(path: Path) -> list[str]:
    """Names of the pictures in a PLY's header, as it gives them; [] of every other file."""
    try:
        with open_regular(path, MAX_SCENE_BYTES) as file:
            header, end, _data = file.read(_PLY_HEADER_BYTES).partition(b"end_header")
    except OSError:
        return []  # the reader reports the fault
    if not end or not header.startswith(b"ply"):
        return []
    lines = (line.split(None, 2) for line in header.decode("utf-8", "replace").splitlines())
    return [
        words[2].strip()
        for words in lines
        if len(words) == 3 and words[0] == "comment" and words[1].lower() == "texturefile"
    ]


def _from_reader(
    path: Path, _data: bytes, model: ModelRef, fields: ReadFields, notes: Notes
) -> ModelShape:
    """glTF and OBJ go through the readers that know materials and hostile files."""
    object_model = ObjectModel(model.id, model.id, model.category, model.nyu40, path, path.parent)
    surfaces, library, _sha = model_surfaces(object_model, notes, fields)
    return ModelShape(tuple(surfaces), library.materials, library.textures)


def _from_trimesh(
    path: Path, data: bytes, _model: ModelRef, _fields: ReadFields, notes: Notes
) -> ModelShape:
    import trimesh

    library = MaterialLibrary(notes)
    picture = _picture_of_ply(path, library, notes)
    try:
        with _quiet_trimesh():
            # Its pictures are ours to open: they may be missing, or lead out of the folder.
            loaded: Any = trimesh.load(
                io.BytesIO(data),
                file_type=path.suffix[1:].lower(),
                force="mesh",
                process=False,
                skip_materials=True,
            )
            points = np.asarray(loaded.vertices, np.float64)
            faces = np.asarray(loaded.faces, np.int64)
    except Exception as error:  # noqa: BLE001  whatever the library meets in a foreign file
        raise BadInput(path, "", f"cannot be read as a mesh: {type(error).__name__}") from None
    if not len(points) or not len(faces):
        raise BadInput(path, "", "has no triangle")
    if faces.min() < 0 or faces.max() >= len(points):
        raise BadInput(path, "", "a face names a vertex that does not exist")
    if data.lstrip()[:4] == b"COFF":
        notes.add("unread-part", path.name, "its colours are not read: it is grey")
    surface = Surface(path.stem, points.astype(np.float32), faces.astype(np.int32), 0)
    normals = _normals_of(loaded, data)
    if normals is not None:
        surface = replace(surface, normals=normals)
    surface = _coloured(surface, loaded.visual, picture, library, path)
    return ModelShape((surface,), library.materials, library.textures)


@contextmanager
def _quiet_trimesh() -> Iterator[None]:
    """Without what trimesh logs and NumPy warns of in a foreign file: what matters of it is raised."""
    log = logging.getLogger("trimesh")
    was = log.disabled
    log.disabled = True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        log.disabled = was


def _picture_of_ply(path: Path, library: MaterialLibrary, notes: Notes) -> Image.Image | None:
    """The picture that a PLY is covered with; None, with a note, where it cannot be read."""
    names = _pictures_of_ply(path)
    if not names:
        return None
    if len(names) > 1:
        text = f"names {len(names)} pictures; all of it has the last, {names[-1]}"
        notes.add("unread-part", path.name, text)
    name, folder = names[-1], RootFolder(path.parent)
    picture = library.texture(
        name,
        name=name,
        place=path.name,
        load=lambda: folder.read(name, max_bytes=MAX_TEXTURE_BYTES),
    )
    return None if picture is None else Image.open(io.BytesIO(picture.texture.data))


def _normals_of(mesh: Any, data: bytes) -> Any:
    """Vertex normals where the file has them; None = flat."""
    if b"property float nx" not in data[:4096] and b"property double nx" not in data[:4096]:
        return None
    normals = np.asarray(mesh.vertex_normals, np.float64)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    if (
        normals.shape != mesh.vertices.shape
        or not np.isfinite(normals).all()
        or (length == 0).any()
    ):
        return None
    return (normals / length).astype(np.float32)


def _coloured(
    surface: Surface, visual: Any, picture: Image.Image | None, library: MaterialLibrary, path: Path
) -> Surface:
    """The surface with its picture, its vertex colours as one, or a plain grey."""
    uvs = getattr(visual, "uv", None)
    if picture is not None and uvs is not None and np.isfinite(uvs).all():
        texture = _add_vertex_colours(library, picture.convert("RGB"), path.stem)
        material = Material(path.stem, texture_id=texture)
        return replace(
            surface, uvs=np.asarray(uvs, np.float32)[:, :2], material=library.index(material)
        )
    if getattr(visual, "kind", None) in ("vertex", "face"):
        return _with_colour_a_face(surface, np.asarray(visual.face_colors)[:, :3], library, path)
    grey = Material(path.stem, diffuse=(0.7, 0.7, 0.7))
    return replace(surface, material=library.index(grey))


def _with_colour_a_face(
    surface: Surface, rgb: Any, library: MaterialLibrary, path: Path
) -> Surface:
    """Each triangle its own texel: vertices are parted, so that no colour runs into another."""
    colours = np.unique(rgb.astype(np.uint8), axis=0)
    if len(colours) == 1:
        r, g, b = (float(v) / 255 for v in colours[0])
        return replace(surface, material=library.index(Material(path.stem, diffuse=(r, g, b))))
    uv, texture = library.colours_of_faces(rgb.astype(np.uint8), path.stem)
    corners = surface.faces.reshape(-1)
    return replace(
        surface,
        positions=surface.positions[corners],
        normals=None if surface.normals is None else surface.normals[corners],
        uvs=uv.repeat(3, 0).astype(np.float32),
        faces=np.arange(len(corners), dtype=np.int32).reshape(-1, 3),
        material=library.index(Material(path.stem, texture_id=texture)),
    )


def _add_vertex_colours(library: MaterialLibrary, picture: Image.Image, name: str) -> str:
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    loaded = library.texture(name, name=f"{name}.png", place=name, load=buffer.getvalue)
    if loaded is None:
        raise BadInput(name, "", "its picture cannot be decoded")
    return loaded.texture.id


def _scaled(shape: ModelShape, scale: float) -> ModelShape:
    if scale == 1.0:
        return shape
    surfaces = tuple(
        replace(s, positions=(s.positions.astype(np.float64) * scale).astype(np.float32))
        for s in shape.surfaces
    )
    return replace(shape, surfaces=surfaces)


def _check_shape_limits(path: Path, shape: ModelShape, fields: ReadFields) -> ModelShape:
    if not np.isfinite(shape.points).all():
        raise BadInput(path, "", "a coordinate is not finite")
    n_faces = sum(len(s.faces) for s in shape.surfaces)
    if not n_faces:
        raise BadInput(path, "", "has no triangle")
    if n_faces > fields.max_model_triangles:
        raise BadInput(path, "", f"has {n_faces} triangles", hint="read.max_model_triangles")
    extent = float(np.ptp(shape.bounds, axis=0).max())
    if not _MIN_EXTENT_M <= extent <= MAX_EXTENT_M:
        hint = "is its unit millimetres? pf.model(path, unit='mm'), or size_m=..."
        raise BadInput(path, "", f"is {extent:g} m large", hint=hint)
    return shape
