"""A library's entry -> its Shape: the model turned, scaled, on its base, lighter. Reads the archive."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from typing import Final

import numpy as np
from PIL import Image

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.catalogue import Place, Shape
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import rotation_y, transform_points
from pbrs_farm.core.house import Surface, Texture
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.read.catalogue.library_files import Entry
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import Resources
from pbrs_farm.read.sweethome3d.home_file.home_xml import PlanPiece
from pbrs_farm.read.sweethome3d.piece_materials import piece_material
from pbrs_farm.read.sweethome3d.piece_models import HomeMaterials, PieceModels
from pbrs_farm.read.sweethome3d.placement import (
    PieceFrame,
    light_parts,
    local_from_model,
    placed_surface,
)

MAX_TRIANGLES: Final = 200_000  # a model of more is left out unread
SMALL: Final = (
    3_000,
    1 / 48,
)  # maximum triangles and coarseness of small items, which are placed on furniture
MEDIUM: Final = (5_000, 1 / 100)  # of chairs, which come in sixes
LARGE: Final = (10_000, 1 / 110)
MEDIUM_M: Final = 1.15  # maximum longest side of a medium item, metres
TOO_MANY: Final = 30_000  # a model that stays heavier than this is left out
MAX_TEXTURE_PX: Final = 512  # edge of a piece's picture; more would show in no view of a room
_JPEG_QUALITY: Final = 92


def library_shape(
    entry: Entry, place: Place, turn_deg: float, contents: Resources, notes: Notes
) -> Shape | None:
    """The shape of a library's piece, turned about the vertical; None, with a note, for an unusable model."""
    shape_notes = Notes(entry.id, strict=False)
    materials = HomeMaterials(contents, shape_notes)
    piece = entry.piece
    try:
        model = PieceModels(materials, entry.id, MAX_TRIANGLES).get(piece.model, entry.id)
    except BadHouse as error:
        notes.add("unusable-model", entry.id, error.message)
        return None
    if model is None:
        for note in shape_notes.all():
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
        local = transform_points(matrix, mesh.positions)
        surfaces.append(placed_surface(mesh, painted, frame, local, matrix))
    if not surfaces:
        notes.add("empty-model", entry.id, "nothing to see in it")
        return None
    lights = light_parts(piece, frame, tuple(emitting))
    library = materials.library
    shape = Shape(tuple(surfaces), library.materials, library.textures, lights)
    return fitted_shape(shape, place, entry.id, notes)


def fitted_shape(shape: Shape, place: Place, piece_id: str, notes: Notes) -> Shape | None:
    """A lighter shape with smaller pictures; None, with a note, if TOO_MANY triangles remain."""
    longest = float(np.ptp(shape.bounds, axis=0).max())
    most, coarsest = SMALL if place is Place.SURFACE else MEDIUM if longest < MEDIUM_M else LARGE
    lighter = lighter_shape(shape, most, coarsest)
    if sum(len(s.faces) for s in lighter.surfaces) > TOO_MANY:
        notes.add("heavy-model", piece_id, f"more than {TOO_MANY} triangles: left out")
        return None
    return _with_small_textures(lighter)


def turned(piece: PlanPiece, turn_deg: float) -> PlanPiece:
    """The piece with model and lamps turned within its box, by the nearest multiple of 90 degrees."""
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
    """The texture scaled to at most edge_px; JPEG if it is opaque, else PNG.

    Returns the same object if it is small enough. Pillow's errors are passed on for data that is not
    a picture.
    """
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


FINEST: Final = 1 / 500  # size of the first grid cell to try, as a share of the longest side
_STEP: Final = 1.3
_NORMAL_STEPS: Final = 2.0  # normals that round to the same multiple of 1/2 are one
_UV_STEPS: Final = 16.0
_MIN_AREA_M2: Final = 1e-10


def lighter_shape(shape: Shape, most: int, coarsest: float) -> Shape:
    """Reduce a shape to at most `most` triangles by clustering vertices in a grid.

    coarsest: the largest cell, as a share of the longest side. The bounds are kept; a shape with few
    enough triangles is returned unchanged, and one that needs a coarser grid as light as possible.
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
        clusters = cluster[first : first + len(surface.positions)]
        first += len(surface.positions)
        # Keep surfaces smaller than a cell: lights refer to surfaces by index.
        surfaces.append(_lighter_surface(surface, clusters, mean) or surface)
    return replace(shape, surfaces=tuple(surfaces))


def _lighter_surface(surface: Surface, cluster: I64, mean: F64) -> Surface | None:
    # Drop faces that fell together, and the second of two equal ones.
    corners = cluster[surface.faces]
    is_whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])
    is_whole &= corners[:, 2] != corners[:, 0]
    faces = surface.faces[is_whole]
    _, first_of_equals = np.unique(np.sort(corners[is_whole], axis=1), axis=0, return_index=True)
    faces = faces[np.sort(first_of_equals)]
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
