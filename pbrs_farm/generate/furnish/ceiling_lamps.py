"""A lamp at each room's ceiling. No effects."""

from __future__ import annotations

from typing import Final

from shapely.geometry import Polygon, box

from pbrs_farm.core.catalogue import Piece
from pbrs_farm.generate.floor_plan import PlacedPiece, RoomType
from pbrs_farm.generate.furnish.pieces import Shelf
from pbrs_farm.generate.furnish.room_space import FurnishSpace
from pbrs_farm.generate.plan_walls import largest_rectangle

_HEAD_M: Final = 1.95  # the lowest point of a lamp
_LARGE_M2: Final = 22.0  # rooms above have two
_LONG: Final = 2.6  # and halls of this aspect
_SHORTEST: Final = 0.35  # minimum scale of a lamp, as a share of its original size
_STEPS: Final = (0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6, 0.9, -0.9)


def ceiling_lamps(
    space: FurnishSpace, type_: RoomType, standing: list[PlacedPiece], shelf: Shelf
) -> list[PlacedPiece]:
    """One lamp in the room's middle, two in large and in long rooms; none where none is to be had."""
    if type_ in (RoomType.BALCONY, RoomType.STAIRS):
        return []
    piece = _choose_lamp(shelf, type_)
    if piece is None:
        return []
    lamp_pieces = []
    for x, z in _middles(space, type_):
        lamp = _hung(piece, x, z, space, standing)
        if lamp is not None:
            lamp_pieces.append(lamp)
    return lamp_pieces


def _choose_lamp(shelf: Shelf, type_: RoomType) -> Piece | None:
    lamps = [p for p in shelf.of("ceiling_lamp") if max(p.size[:2]) > 0.15]
    is_plain = not type_.is_habitable or type_ is RoomType.KITCHEN
    # Low or wide pendant lamps belong in living areas.
    fitting = [p for p in lamps if (p.size[2] < 0.2) == is_plain] or lamps
    if is_plain:
        fitting = [p for p in fitting if "track" not in p.id and "strip" not in p.id] or fitting
    return fitting[0] if fitting else None


def _middles(space: FurnishSpace, type_: RoomType) -> list[tuple[float, float]]:
    """The middle of the room's largest rectangle; two points along it where it is large."""
    rect = largest_rectangle(space.polygon)
    x0, z0, x1, z1 = rect
    w, d = x1 - x0, z1 - z0
    is_long = type_ is RoomType.HALL and max(w, d) > max(_LONG * min(w, d), 3.6)
    if not (is_long or space.area > _LARGE_M2):
        return [((x0 + x1) / 2, (z0 + z1) / 2)]
    if w >= d:
        return [(x0 + w / 4, (z0 + z1) / 2), (x1 - w / 4, (z0 + z1) / 2)]
    return [((x0 + x1) / 2, z0 + d / 4), ((x0 + x1) / 2, z1 - d / 4)]


def _hung(
    piece: Piece, x: float, z: float, space: FurnishSpace, standing: list[PlacedPiece]
) -> PlacedPiece | None:
    w, d, h = piece.size
    # Make it smaller where it would hang in the way.
    scale = min(1.0, (space.height - _HEAD_M) / h)
    scale = max(scale, _SHORTEST)
    w, d, h = w * scale, d * scale, h * scale
    low = space.height - h
    tall = [_ground_polygon(p) for p in standing if p.elevation + p.height > low - 0.05]
    for dx in _STEPS:
        for dz in _STEPS:
            ground = box(x + dx - w / 2, z + dz - d / 2, x + dx + w / 2, z + dz + d / 2)
            free = not any(ground.intersects(t) for t in tall)
            if free and space.polygon.contains(ground):
                return PlacedPiece(
                    piece,
                    round(x + dx, 4),
                    round(z + dz, 4),
                    round(low, 4),
                    0.0,
                    round(w, 4),
                    round(d, 4),
                    round(h, 4),
                    space.number,
                )
    return None


def _ground_polygon(piece: PlacedPiece) -> Polygon:
    xs, zs = [p[0] for p in piece.corners], [p[1] for p in piece.corners]
    return box(min(xs), min(zs), max(xs), max(zs))
