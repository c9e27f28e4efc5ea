"""Assembly of parts into a piece of the catalogue and its shape; no effects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Piece, Place, Shape
from pbrs_farm.core.classes import OTHERPROP
from pbrs_farm.core.frames import affine
from pbrs_farm.core.house import Material, Surface, Texture
from pbrs_farm.core.joints import Joint

Part = tuple[Surface, Material]
Model = tuple[Piece, Shape]

GENERATED = "generated#"  # before the family, in the id of a generated piece


def standing_piece(
    family: str,
    parts: Sequence[Part],
    *,
    group: str = "",
    nyu40: int = OTHERPROP,
    place: Place = Place.SURFACE,
    textures: Iterable[Texture] = (),
    joints: Sequence[Joint] = (),
) -> Model:
    """One piece from parts, base centred at the origin, a surface per material and moving part."""
    materials: list[Material] = []
    gathered: dict[tuple[int, bool, str], list[Surface]] = {}
    for surface, material in parts:
        if material not in materials:
            materials.append(material)
        key = (materials.index(material), surface.normals is None, surface.part)
        gathered.setdefault(key, []).append(surface)
    joined = [_one_surface(surfaces, key[0]) for key, surfaces in gathered.items()]
    # Stand the whole on its base.
    points = np.concatenate([s.positions for s in joined]).astype(np.float64)
    low, high = points.min(0), points.max(0)
    base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2], np.float64)
    moved = tuple(replace(s, positions=(s.positions - base).astype(np.float32)) for s in joined)
    width, height, depth = (float(v) for v in high - low)
    piece = Piece(
        f"{GENERATED}{family}",
        family.replace("_", " ").capitalize(),
        group or family,
        place,
        nyu40,
        (width, depth, height),
        library="generated",
    )
    to_base = affine(np.eye(3), -base)
    shape = Shape(
        moved,
        tuple(materials),
        {t.id: t for t in textures},
        joints=tuple(joint.placed(to_base) for joint in joints),
    )
    return piece, shape


def hanging_piece(
    family: str,
    group: str,
    nyu40: int,
    parts: Sequence[Part],
    textures: Sequence[Texture] = (),
    place: Place = Place.WALL,
    joints: Sequence[Joint] = (),
) -> Model:
    """A hanging piece and its shape; it keeps the origin of its parts."""
    materials = tuple(dict.fromkeys(m for _s, m in parts))
    surfaces = tuple(replace(s, material=materials.index(m)) for s, m in parts)
    shape = Shape(surfaces, materials, {t.id: t for t in textures}, joints=tuple(joints))
    w, h, d = (float(x) for x in np.diff(shape.bounds, axis=0)[0])
    name = family.replace("_", " ").capitalize()
    return Piece(f"{GENERATED}{family}", name, group, place, nyu40, (w, d, h)), shape


def transformed(surface: Surface, matrix: F64, offset: Sequence[float] = (0, 0, 0)) -> Surface:
    """The surface turned by a rotation (3, 3) and then moved, metres."""
    positions = surface.positions.astype(np.float64) @ matrix.T + np.asarray(offset, np.float64)
    normals = surface.normals
    if normals is not None:
        normals = (normals.astype(np.float64) @ matrix.T).astype(np.float32)
    return replace(surface, positions=positions.astype(np.float32), normals=normals)


def _one_surface(surfaces: list[Surface], material: int) -> Surface:
    # Shift each part's faces by the number of points before it.
    starts = np.cumsum([0, *(len(s.positions) for s in surfaces)])
    faces = np.concatenate([s.faces + n for s, n in zip(surfaces, starts[:-1], strict=True)])
    uvs = [s.uvs if s.uvs is not None else np.zeros((len(s.positions), 2)) for s in surfaces]
    normals = None
    if surfaces[0].normals is not None:
        normals = np.concatenate([s.normals for s in surfaces if s.normals is not None])
    return Surface(
        surfaces[0].name,
        np.concatenate([s.positions for s in surfaces]).astype(np.float32),
        faces.astype(np.int32),
        material,
        np.concatenate(uvs).astype(np.float32),
        normals,
        surfaces[0].part,
    )
