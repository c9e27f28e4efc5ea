"""The dots of a projector against its pattern, cast at some pixels. Effects: none."""

from __future__ import annotations

import numpy as np

from pbrs_farm.check.axes import dot
from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import linear_from_srgb, srgb_from_linear
from pbrs_farm.check.embree_caster import is_visible
from pbrs_farm.check.pixel_checks import albedo_of
from pbrs_farm.core.arrays import F64

_BESIDE_M = 0.05  # distance of the projector from a camera without a partner
_FULL_M = 2.5  # distance at which a white wall has brightness 255
_DOT_STEPS = 6  # of 255: a dot's edge is steep
_DOT_EDGES = 0.02  # share of pixels that may be at the edge of a dot's shadow or of a cell
_FEW_HITS = 50  # fewer pixels are not judged
_REACH_M = 2e-3
_MASK = (1 << 64) - 1
_CELL_RAD, _DOT_RAD, _DOT_SHARE = 0.006, 0.0012, 0.4


def check_projector(case: ViewCase) -> None:
    """Brightness of dots at some pixels; up to _DOT_EDGES of them may be at an edge, counted as ties."""
    view, rays = case.view, case.now.rays
    cast = case.cast(*case.pixels)
    cast = cast.some(cast.face >= 0)
    if len(cast) < _FEW_HITS:
        return
    point, origin = cast.point, cast.origin
    right, down, ahead = view.world_from_camera[:3, :3].T
    partner = view.table.get("partners", {}).get("stereo")
    eye = origin + _BESIDE_M * right
    if partner is not None:
        eye = (origin + np.array(partner["world_from_camera_opencv"], np.float64)[:3, 3]) / 2
    to = point - eye
    distance, along = np.linalg.norm(to, axis=1), to @ ahead
    angles = np.arctan2(np.stack([to @ right, -(to @ down)], axis=1), along[:, None])
    light = np.where(along > 0, _dot_pattern(angles), 0.0)
    cosine = np.abs(dot(cast.normal, to)) / np.maximum(distance, 1e-6)
    infrared = linear_from_srgb(albedo_of(view, cast).max(axis=1) / 255)
    level = np.clip(light * infrared * cosine * (_FULL_M / np.maximum(distance, 1e-3)) ** 2, 0, 1)
    expected = np.where(is_visible(rays, eye, point, _REACH_M), 255 * srgb_from_linear(level), 0.0)
    wrong = np.abs(case.arrays["projector"][cast.rows, cast.columns] - expected) > _DOT_STEPS
    k = int(np.argmax(wrong))
    place = f"row {cast.rows[k]}, column {cast.columns[k]}"
    most = max(3, _DOT_EDGES * len(cast))
    case.tally.tolerate("projector", case.place, len(cast), int(wrong.sum()), most, place)


def _dot_pattern(angles: F64) -> F64:
    """(N,) brightness 0..1 of the dots in directions (N, 2) in rad, right and up."""
    cell = np.floor(angles / _CELL_RAD)
    words = cell.astype(np.int64) & 0xFFFF
    mixed = [_splitmix(int(a) << 16 | int(b)) for a, b in words]
    parts = np.array([[m >> s & 0xFFFF for s in (0, 16, 32)] for m in mixed]) / 65535
    middle = (cell + 0.25 + 0.5 * parts[:, 1:]) * _CELL_RAD
    squared = ((angles - middle) ** 2).sum(axis=1) / _DOT_RAD**2
    return np.where(parts[:, 0] < _DOT_SHARE, np.exp(-squared / 2), 0.0)


def _splitmix(value: int) -> int:
    """Splitmix64 (Steele, Lea and Flood 2014)."""
    z = (value + 0x9E3779B97F4A7C15) & _MASK
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & _MASK
    z = (z ^ z >> 27) * 0x94D049BB133111EB & _MASK
    return z ^ z >> 31


CHECKS = (Check("projector", "view", check_projector, 18, ("projector",)),)
