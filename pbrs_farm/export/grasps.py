"""Grasps of small items for two fingers: antipodal pairs of contacts; no effects.

A pair is the outermost two points on a line through the item, and the line is within the cones of
friction of both (Nguyen, Constructing force-closure grasps, 1988). Obstacles around the item are ignored.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.house import corners_of_surfaces
from pbrs_farm.core.mesh import unit_normals, unit_vectors
from pbrs_farm.export.home_files import z_up_points
from pbrs_farm.export.home_pieces import ExportedHome, Piece
from pbrs_farm.geometry.surface_points import spread_points

GRASPS: Final = "grasps.json"
LARGEST_M: Final = 0.12  # maximum of an item's second largest side, and of the fingers' span
FRICTION: Final = 0.3
_LEAST_M: Final = 0.002  # minimum distance between the fingers
_MOST: Final = 32  # maximum pairs of an item
_TRIES: Final = 256
_SPACING_M: Final = 0.004
_PAIRS: Final = 2_000_000  # maximum pairs of line and triangle in memory
_EDGE: Final = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Grasps:
    """Pairs of contacts on an item, metres."""

    points: F64  # (N, 2, 3)
    normals: F64  # (N, 2, 3) unit, outwards

    @property
    def widths_m(self) -> F64:
        """(N,) distances between the two contacts."""
        return np.asarray(np.linalg.norm(self.points[:, 0] - self.points[:, 1], axis=1))


def antipodal_pairs(triangles: F64, seed: int, *, most: int = _MOST) -> Grasps:
    """Pairs of contacts for two fingers on a mesh (F, 3, 3), at most 12 cm apart.

    Lines start at points drawn by the seed, along the normal or near it; the outermost crossings of a line
    are a pair.
    """
    points, which = spread_points(triangles, _SPACING_M)
    if not len(points):
        return Grasps(np.zeros((0, 2, 3)), np.zeros((0, 2, 3)))
    rng = np.random.default_rng(seed)
    drawn = rng.permutation(len(points))[:_TRIES]
    normals = unit_normals(triangles)
    along = normals[which[drawn]]
    # Tilt every other line within the cone of friction, for tapered items.
    aside = unit_vectors(np.cross(along, rng.normal(size=along.shape)))
    tilt = np.arange(len(along)) % 2 * FRICTION * rng.random(len(along))
    along = unit_vectors(along + tilt[:, None] * aside)
    ways, faces = _outermost(points[drawn], along, triangles)
    width = ways[:, 1] - ways[:, 0]
    cosine = (normals[faces] * along[:, None]).sum(2)
    # Outwards is away from the second contact, whatever the winding of the faces.
    outwards = normals[faces] * (np.sign(cosine) * [-1.0, 1.0])[..., None]
    holds = (np.abs(cosine) >= np.cos(np.arctan(FRICTION))).all(1)
    holds &= (width > _LEAST_M) & (width <= LARGEST_M)
    chosen = np.flatnonzero(holds)[:most]
    pairs = points[drawn][chosen, None] + ways[chosen, :, None] * along[chosen, None]
    return Grasps(pairs, outwards[chosen])


def _outermost(points: F64, along: F64, triangles: F64) -> tuple[F64, I64]:
    """(N, 2) metres from points along lines to the first and last crossed triangle, and their numbers."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    ways, faces = np.zeros((len(points), 2)), np.zeros((len(points), 2), np.int64)
    step = max(1, _PAIRS // len(triangles))
    for k in range(0, len(points), step):
        part = slice(k, k + step)
        # Moeller and Trumbore, 1997, for every line and triangle.
        p = np.cross(along[part, None], v)
        scale = (p * u).sum(2)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = points[part, None] - a
            first = (s * p).sum(2) / scale
            q = np.cross(s, u)
            second = (q * along[part, None]).sum(2) / scale
            way = (q * v).sum(2) / scale
            meets = (first >= -_EDGE) & (second >= -_EDGE) & (first + second <= 1 + _EDGE)
        for end, (fill, pick) in enumerate(((np.inf, np.argmin), (-np.inf, np.argmax))):
            row = np.where(meets, way, fill)
            faces[part, end] = pick(row, axis=1)
            ways[part, end] = np.take_along_axis(row, faces[part, end, None], 1)[:, 0]
    return ways, faces


def grasps_json(home: ExportedHome, up: str) -> bytes:
    """Pairs of every loose item whose second largest side is below 12 cm, in its frame.

    up: "z" or "y", the up axis of the items' frames; the origin is the middle of the bottom of an item's
    box.
    """
    things = {}
    for piece in home.things:
        if piece.surfaces and not piece.is_fixed and np.sort(piece.size)[1] < LARGEST_M:
            things[piece.name] = _row(piece, up)
    document = {"unit": "metres", "up": up, "friction": FRICTION, "things": things}
    return json.dumps(document, indent=1, allow_nan=False).encode()


def _row(piece: Piece, up: str) -> dict[str, Any]:
    triangles = corners_of_surfaces(piece.surfaces)
    grasps = antipodal_pairs(triangles, keys.seed("grasps", piece.class_name))
    turned = (lambda x: x) if up == "y" else z_up_points
    rows = [
        {
            "points": turned(points).round(5).tolist(),
            "normals": turned(normals).round(4).tolist(),
            "width_m": round(float(width), 5),
        }
        for points, normals, width in zip(
            grasps.points, grasps.normals, grasps.widths_m, strict=True
        )
    ]
    return {"class": piece.class_name, "grasps": rows}
