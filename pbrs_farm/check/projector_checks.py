"""The dots of an infrared projector, thrown again at some pixels (docs/formats/layer_rules.md). Effects: none."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats, Rays
from pbrs_farm.check.pixel_checks import albedo_of_faces
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView

BESIDE_M = 0.05  # of a camera that is none of a pair
CELL_RAD, DOT_RAD, DOT_SHARE = 0.006, 0.0012, 0.4
FULL_M = 2.5  # from which a white wall shows 255
STEPS = 6  # of 255, by which a dot may differ: its edge is steep
EDGES = 0.02  # of the pixels that are judged: a dot's shadow ends, or a cell does
FEW = 50
REACH_M = 2e-3
_MASK = (1 << 64) - 1


def check_projector(
    view: StoredView,
    stored: NDArray[Any],
    pixels: tuple[NDArray[np.int64], NDArray[np.int64]],
    scene: tuple[Triangles, Rays],
    tally: Tally,
) -> None:
    """Brightness of dots at pixels (rows, columns); up to EDGES of them may lie on an edge, counted as ties."""
    triangles, rays = scene
    rows, columns = pixels
    origin, directions = view.rays(rows, columns)
    face = rays.first(origin, directions)
    hit = face >= 0
    rows, columns, directions, face = rows[hit], columns[hit], directions[hit], face[hit]
    if len(rows) < FEW:
        return
    point = origin + directions * rays.distance(face, origin, directions)[:, None]
    right, down, ahead = view.world_from_camera[:3, :3].T
    partner = view.table.get("partners", {}).get("stereo")
    eye = origin + BESIDE_M * right
    if partner is not None:
        eye = (origin + np.array(partner["world_from_camera_opencv"], np.float64)[:3, 3]) / 2
    to = point - eye
    distance, along = np.linalg.norm(to, axis=1), to @ ahead
    angles = np.arctan2(np.stack([to @ right, -(to @ down)], axis=1), along[:, None])
    light = np.where(along > 0, _pattern(angles), 0.0)
    normal = rays.normal(face, directions)
    cosine = np.abs(np.einsum("ni,ni->n", normal, to)) / np.maximum(distance, 1e-6)
    srgb = albedo_of_faces(view, face, point, triangles).max(axis=1) / 255
    infrared = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    level = np.clip(light * infrared * cosine * (FULL_M / np.maximum(distance, 1e-3)) ** 2, 0, 1)
    expected = 255 * np.where(level <= 0.0031308, 12.92 * level, 1.055 * level ** (1 / 2.4) - 0.055)
    met = rays.first(eye, to)
    t = rays.distance(met, eye, to)
    seen = (met < 0) | ((1 - t) * distance <= REACH_M)
    expected = np.where(seen, expected, 0.0)
    wrong = np.abs(stored[rows, columns] - expected) > STEPS
    n = int(wrong.sum())
    allowed = n <= max(3, EDGES * len(rows))
    tally.add("projector", len(rows), ties=n if allowed else 0)
    if not allowed:
        k = int(np.nonzero(wrong)[0][0])
        tally.fail("projector", view.place, f"row {rows[k]}, column {columns[k]}", n)


def _pattern(angles: Floats) -> Floats:
    """(N,) brightness 0..1 of the dots in directions (N, 2) in rad, right and up."""
    cell = np.floor(angles / CELL_RAD)
    words = cell.astype(np.int64) & 0xFFFF
    mixed = [_splitmix(int(a) << 16 | int(b)) for a, b in words]
    parts = np.array([[m >> s & 0xFFFF for s in (0, 16, 32)] for m in mixed]) / 65535
    middle = (cell + 0.25 + 0.5 * parts[:, 1:]) * CELL_RAD
    squared = ((angles - middle) ** 2).sum(axis=1) / DOT_RAD**2
    return np.where(parts[:, 0] < DOT_SHARE, np.exp(-squared / 2), 0.0)


def _splitmix(value: int) -> int:
    """splitmix64 (Steele, Lea and Flood 2014)."""
    z = (value + 0x9E3779B97F4A7C15) & _MASK
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & _MASK
    z = (z ^ z >> 27) * 0x94D049BB133111EB & _MASK
    return z ^ z >> 31
