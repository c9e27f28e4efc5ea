"""A library's entry -> its Shape: the model turned to its front, scaled, on its base; no effects
but reading the model from its archive.
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import TypeAdapter

from pbrs_farm.assets.debian import write_whole
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.catalogue import Place, Shape
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import LightPart, Material, Surface, Texture
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.read.catalogue.library_files import Entry, LibraryNotes
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import Resources
from pbrs_farm.read.sweethome3d.home_file.home_xml import PlanPiece
from pbrs_farm.read.sweethome3d.home_materials import HomeMaterials
from pbrs_farm.read.sweethome3d.piece_models import PieceModels, piece_material
from pbrs_farm.read.sweethome3d.placement import (
    PieceFrame,
    light_parts,
    local_from_model,
    placed_surface,
)

# A shape with fewer triangles: vertices that lie close together become one.
# Vertex clustering (Rossignac and Borrel 1993): a grid's cell keeps one vertex, at the mean of
# those in it. All surfaces share the cells, so that what touched still touches.


FINEST: Final = 1 / 500  # of the longest side: the first cell that is tried
_STEP: Final = 1.3
_NORMAL_STEPS: Final = 2.0  # normals that round to the same multiple of 1/2 are one
_UV_STEPS: Final = 16.0
_MIN_AREA_M2: Final = 1e-10


def lighter_shape(shape: Shape, most: int, coarsest: float) -> Shape:
    """The shape with at most `most` triangles where a fine grid can do it.

    coarsest: the largest cell, as a part of the longest side. Its bounds stay; a shape that has
    few enough comes back as it is, one that cannot be made so light as light as it gets.
    """
    n_faces = sum(len(s.faces) for s in shape.surfaces)
    if n_faces <= most:
        return shape
    low, high = shape.bounds
    longest = float((high - low).max())
    # Begin with cells that a plain sheet of that area would fill twice over.
    area = sum(
        float(face_areas(triangle_corners(s.positions, s.faces)).sum()) for s in shape.surfaces
    )
    cell = min(max(FINEST * longest, 0.7 * (2 * area / most) ** 0.5), coarsest * longest)
    lighter = _clustered(shape, cell)
    while sum(len(s.faces) for s in lighter.surfaces) > most and cell < coarsest * longest:
        cell = min(_STEP * cell, coarsest * longest)
        lighter = _clustered(shape, cell)
    return lighter


def _clustered(shape: Shape, cell: float) -> Shape:
    points = np.concatenate([s.positions for s in shape.surfaces]).astype(np.float64)
    # One position a cell: the mean of the vertices in it.
    _, cluster = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_inverse=True)
    cluster = cluster.ravel()
    count = np.bincount(cluster)
    mean = np.stack([np.bincount(cluster, points[:, k]) / count for k in range(3)], -1)
    # Stretch the whole back to its bounds.
    low, high = shape.bounds
    mean_low, mean_high = mean.min(0), mean.max(0)
    stretch = (high - low) / np.where(mean_high > mean_low, mean_high - mean_low, 1.0)
    mean = (mean - mean_low) * np.where(mean_high > mean_low, stretch, 1.0) + low
    # Take the surfaces apart again.
    surfaces, first = [], 0
    for surface in shape.surfaces:
        own = cluster[first : first + len(surface.positions)]
        first += len(surface.positions)
        # What is smaller than a cell stays as it is: lights count surfaces by their place.
        surfaces.append(_surface(surface, own, mean) or surface)
    return replace(shape, surfaces=tuple(surfaces))


def _surface(surface: Surface, cluster: I64, mean: F64) -> Surface | None:
    # Drop faces that fell together, and the second of two equal ones.
    corners = cluster[surface.faces]
    is_whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])
    is_whole &= corners[:, 2] != corners[:, 0]
    faces = surface.faces[is_whole]
    _, kept = np.unique(np.sort(corners[is_whole], axis=1), axis=0, return_index=True)
    faces = faces[np.sort(kept)]
    if not len(faces):
        return None
    # Vertices of one cell stay apart where normals or texture coordinates differ much.
    keys = [cluster]
    if surface.normals is not None:
        keys += list(np.rint(surface.normals * _NORMAL_STEPS).astype(np.int64).T)
    if surface.uvs is not None:
        keys += list(np.rint(surface.uvs * _UV_STEPS).astype(np.int64).T)
    used = np.unique(faces)
    _, first, number = np.unique(
        np.stack(keys, -1)[used], axis=0, return_index=True, return_inverse=True
    )
    renumbered = np.zeros(len(cluster), np.int32)
    renumbered[used] = number.ravel()
    vertex = used[first]
    positions = mean[cluster[vertex]].astype(np.float32)
    faces = renumbered[faces]
    faces = faces[face_areas(triangle_corners(positions, faces)) > _MIN_AREA_M2]
    if not len(faces):
        return None
    return replace(
        surface,
        positions=positions,
        faces=np.ascontiguousarray(faces, np.int32),
        uvs=None if surface.uvs is None else surface.uvs[vertex],
        normals=None if surface.normals is None else surface.normals[vertex],
    )


# A library's entry -> its Shape.


MAX_TRIANGLES: Final = 200_000  # of a model that is read
SMALL: Final = (3_000, 1 / 48)  # triangles of what stands on furniture, and how coarse it may get
MEDIUM: Final = (5_000, 1 / 100)  # of chairs, which come in sixes
LARGE: Final = (10_000, 1 / 110)
MEDIUM_M: Final = 1.15  # the longest side of what is medium
TOO_MANY: Final = 30_000  # what cannot be made lighter than this stays out
MAX_TEXTURE_PX: Final = 512  # of a piece's picture: more shows in no view of a room
_JPEG_QUALITY: Final = 92


def library_shape(
    entry: Entry, place: Place, turn_deg: float, contents: Resources, notes: LibraryNotes
) -> Shape | None:
    """The shape of a library's piece; None, with a note, where its model cannot be used.

    turn_deg: about the vertical, of a model that faces another way than its library says.
    """
    own = Notes(entry.id, strict=False)
    materials = HomeMaterials(contents, own)
    piece = entry.piece
    try:
        model = PieceModels(materials, entry.id, MAX_TRIANGLES).get(piece.model, entry.id)
    except BadHouse as error:
        notes.add("unusable-model", entry.id, error.message)
        return None
    if model is None:
        for note in own.all():
            notes.add(note.kind, entry.id, note.text)
        return None
    piece = turned(piece, turn_deg)
    matrix = local_from_model(piece, model)
    width, depth, height = piece.size
    half = np.array([width, height, depth]) / 2
    frame = PieceFrame(_origin(place, half), np.eye(3), half, 1.0)
    # Keep every mesh that can be seen, with its material.
    surfaces: list[Surface] = []
    emitting: list[int] = []
    for mesh in model.meshes:
        painted = piece_material(piece, mesh, model, materials)
        if painted is None or not len(mesh.faces):
            continue
        if painted.emits:
            emitting.append(len(surfaces))
        local = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        surfaces.append(placed_surface(mesh, painted, frame, local, matrix))
    if not surfaces:
        notes.add("empty-model", entry.id, "nothing to see in it")
        return None
    lights = light_parts(piece, frame, tuple(emitting))
    library = materials.library
    shape = Shape(tuple(surfaces), library.materials, library.textures, lights)
    return fitted_shape(shape, place, entry.id, notes)


def fitted_shape(shape: Shape, place: Place, piece_id: str, notes: LibraryNotes) -> Shape | None:
    """The shape as light as a home can bear it, its pictures no larger than they show.

    None, with a note, where it cannot be made lighter than TOO_MANY triangles.
    """
    longest = float(np.ptp(shape.bounds, axis=0).max())
    most, coarsest = SMALL if place is Place.SURFACE else MEDIUM if longest < MEDIUM_M else LARGE
    lighter = lighter_shape(shape, most, coarsest)
    if sum(len(s.faces) for s in lighter.surfaces) > TOO_MANY:
        notes.add("heavy-model", piece_id, f"more than {TOO_MANY} triangles: left out")
        return None
    return _with_small_textures(lighter)


def turned(piece: PlanPiece, turn_deg: float) -> PlanPiece:
    """The piece with its model turned about the vertical in its box, by a multiple of 90 degrees."""
    n = round(turn_deg / 90) % 4
    if not n:
        return piece
    model = np.eye(3) if piece.rotation is None else np.array(piece.rotation).reshape(3, 3)
    width, depth, height = piece.size
    # A lamp's sources go round with it: right, back, left, front.
    lights = piece.lights
    for _ in range(n):
        lights = tuple(replace(x, at=(1 - x.at[1], x.at[0], x.at[2])) for x in lights)
    return replace(
        piece,
        rotation=tuple(float(v) for v in (rotation_y(n * math.pi / 2) @ model).ravel()),
        size=(depth, width, height) if n % 2 else piece.size,
        lights=lights,
    )


def _origin(place: Place, half: F64) -> F64:
    # The box's middle when its base is on the origin; what hangs has its back there.
    return np.array([0.0, half[1], half[2] if place is Place.WALL else 0.0])


def _with_small_textures(shape: Shape) -> Shape:
    small = {name: small_texture(t, MAX_TEXTURE_PX) for name, t in shape.textures.items()}
    materials = tuple(
        replace(m, texture_id=small[m.texture_id].id) if m.texture_id else m
        for m in shape.materials
    )
    return replace(shape, materials=materials, textures={t.id: t for t in small.values()})


def small_texture(texture: Texture, edge_px: int) -> Texture:
    """The texture with no edge above edge_px; JPEG where nothing is cut out of it, else PNG."""
    picture: Image.Image = Image.open(io.BytesIO(texture.data))
    if max(picture.size) <= edge_px:
        return texture
    # Cut-outs (leaves, lace) need alpha; palettes carry it in their info.
    has_alpha = picture.mode in ("RGBA", "LA", "PA") or "transparency" in picture.info
    picture = picture.convert("RGBA" if has_alpha else "RGB")
    picture.thumbnail((edge_px, edge_px), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    if has_alpha:
        picture.save(buffer, "PNG")
    else:
        picture.save(buffer, "JPEG", quality=_JPEG_QUALITY)
    data = buffer.getvalue()
    kind = "image/png" if has_alpha else "image/jpeg"
    return Texture(keys.sha256(data)[:16], texture.name, kind, data)


# Shapes that were read before, kept on disk: parsing a model takes a hundred times as long.
# Effects: reads and writes files of one folder. A file that cannot be read is made anew, a folder
# that cannot be written is done without.


FORMAT: Final = 1


@dataclass(frozen=True, slots=True)
class _Described:
    # What of a shape is no array.
    names: tuple[str, ...]  # of the surfaces
    numbers: tuple[int, ...]  # of their materials
    materials: tuple[Material, ...]
    textures: tuple[tuple[str, str, str], ...]  # id, name, media type
    lights: tuple[LightPart, ...]


_DESCRIBED: Final = TypeAdapter(_Described)


class ShapeStore:
    """Shapes by what they are made from."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def shape(self, key: tuple[str | int, ...], make: Callable[[], Shape | None]) -> Shape | None:
        """The shape stored under key, else what make gives, which is stored; None is, too."""
        path = self._folder / f"{keys.digest(FORMAT, *key)}.npz"
        with suppress(OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError):
            return _read(path)
        shape = make()
        with suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole(path, _packed(shape))
        return shape


def _packed(shape: Shape | None) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **({} if shape is None else _arrays(shape)))  # type: ignore[arg-type]
    return buffer.getvalue()


def _arrays(shape: Shape) -> dict[str, NDArray[Any]]:
    textures = tuple(shape.textures.values())
    described = _Described(
        tuple(s.name for s in shape.surfaces),
        tuple(s.material for s in shape.surfaces),
        shape.materials,
        tuple((t.id, t.name, t.media_type) for t in textures),
        shape.lights,
    )
    arrays: dict[str, NDArray[Any]] = {"described": _bytes(_DESCRIBED.dump_json(described))}
    for k, s in enumerate(shape.surfaces):
        parts = {"p": s.positions, "f": s.faces, "u": s.uvs, "n": s.normals}
        arrays |= {f"{name}{k}": part for name, part in parts.items() if part is not None}
    return arrays | {f"t{k}": _bytes(t.data) for k, t in enumerate(textures)}


def _bytes(data: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(data, np.uint8)


def _read(path: Path) -> Shape | None:
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    if not arrays:
        return None
    d = _DESCRIBED.validate_json(arrays["described"].tobytes())
    surfaces = tuple(
        Surface(
            name, arrays[f"p{k}"], arrays[f"f{k}"], number, arrays.get(f"u{k}"), arrays.get(f"n{k}")
        )
        for k, (name, number) in enumerate(zip(d.names, d.numbers, strict=True))
    )
    textures = {
        i: Texture(i, name, kind, arrays[f"t{k}"].tobytes())
        for k, (i, name, kind) in enumerate(d.textures)
    }
    return Shape(surfaces, d.materials, textures, d.lights)
