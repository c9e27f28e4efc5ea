"""A furnished plan as an SVG picture, drawn as an architect would; no effects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import product
from typing import Final

from pbrs_farm.core.svg import Element, element, svg_file, svg_text
from pbrs_farm.generate.floor_plan import (
    OpeningKind,
    PlacedPiece,
    Plan,
    PlanOpening,
    PlanRoom,
    PlanWall,
    Point,
    Rect,
    RoomType,
    Storey,
)
from pbrs_farm.generate.staircase import Stair

_MARGIN_M: Final = 0.6
_PX_PER_M: Final = 60.0
_LIVING, _SLEEPING, _COOKING, _WATER = "#f6eedd", "#efe6f2", "#fbe7d3", "#dcecf4"
_PASSING, _KEEPING, _OUTSIDE = "#eeeeea", "#e6e6e0", "#e2efdd"
_TEXT_M: Final = 0.3  # height of letters
_RAISED_M: Final = 1.2  # height above which furniture is drawn dashed


def plan_svg(storeys: Sequence[Storey], title: str, stair: Stair | None = None) -> str:
    """An SVG of rooms with names and areas, walls, openings, furniture, storeys from left to right."""
    points = [p for storey in storeys for wall in storey.plan.walls for p in wall.corners()]
    x0, z0 = (min(p[k] for p in points) - _MARGIN_M for k in (0, 1))
    x1, z1 = (max(p[k] for p in points) + _MARGIN_M for k in (0, 1))
    spacing = x1 - x0 - _MARGIN_M
    x1 += spacing * (len(storeys) - 1)
    root = svg_file(
        viewBox=f"{x0:.2f} {z0:.2f} {x1 - x0:.2f} {z1 - z0:.2f}",
        width=round((x1 - x0) * _PX_PER_M),
        height=round((z1 - z0) * _PX_PER_M),
        font_family="sans-serif",
    )
    element(root, "title", title)
    element(root, "rect", x=f"{x0:.2f}", y=f"{z0:.2f}", width="100%", height="100%", fill="#ffffff")
    for number, storey in enumerate(storeys):
        group = element(root, "g", transform=f"translate({number * spacing:.2f} 0)")
        _draw_storey(group, storey, stair)
    return svg_text(root)


def _draw_storey(root: Element, storey: Storey, stair: Stair | None) -> None:
    plan = storey.plan
    for room in plan.rooms:
        element(root, "polygon", points=_text(room.polygon), fill=_tint(room.type))
    if stair is not None:
        _draw_stairs(root, stair)
    for piece in sorted(storey.pieces, key=lambda p: p.elevation + p.height):
        _draw_piece(root, piece)
    ends = Counter(end for wall in plan.walls for end in (wall.start, wall.end))
    for wall in plan.walls:
        # Close the corners where two walls end at one point.
        corners = _text(wall.corners(to_start=ends[wall.start] > 1, to_end=ends[wall.end] > 1))
        element(root, "polygon", points=corners, fill="#888" if wall.height else "#333")
    for opening in plan.openings:
        _draw_opening(root, plan, opening)
    for number, room in enumerate(plan.rooms):
        _label(root, room, [p for p in storey.pieces if p.room == number])


def _draw_stairs(root: Element, stair: Stair) -> None:
    """Treads of both flights and the landing behind them."""
    (x, z), (w, d), (fx, fz) = stair.middle, stair.size, stair.front

    def line(a: Point, b: Point) -> None:
        ends = [(x + u * -fz + v * fx, z + u * fx + v * fz) for u, v in (a, b)]
        element(root, "polyline", points=_text(ends), stroke="#999", stroke_width="0.02")

    landing = max(w / 2, 0.9)
    for k in range(9):
        v = d / 2 - (d - landing) * k / 8
        line((-w / 2, v), (w / 2, v))
    line((0.0, landing - d / 2), (0.0, d / 2))


def _tint(type_: RoomType) -> str:
    """The floor colour of a room type."""
    match type_:
        case RoomType.LIVING | RoomType.STUDIO | RoomType.OFFICE | RoomType.DINING:
            return _LIVING
        case RoomType.KITCHEN:
            return _COOKING
        case RoomType.BATHROOM | RoomType.WC:
            return _WATER
        case RoomType.HALL | RoomType.STAIRS:
            return _PASSING
        case RoomType.BALCONY:
            return _OUTSIDE
    return _SLEEPING if type_ is RoomType.BEDROOM else _KEEPING


def _text(points: Sequence[Point]) -> str:
    return " ".join(f"{x:.3f},{z:.3f}" for x, z in points)


def _draw_piece(root: Element, piece: PlacedPiece) -> None:
    is_high = piece.elevation >= _RAISED_M
    element(
        root,
        "polygon",
        points=_text(piece.corners),
        fill="none" if is_high else "#ffffff",
        fill_opacity="0.75",
        stroke="#777",
        stroke_width="0.02",
        stroke_dasharray="0.08 0.06" if is_high else "",
    )
    if not is_high:
        # Mark the front with a line.
        left, right = piece.corners[3], piece.corners[2]
        element(
            root,
            "line",
            x1=f"{left[0]:.3f}",
            y1=f"{left[1]:.3f}",
            x2=f"{right[0]:.3f}",
            y2=f"{right[1]:.3f}",
            stroke="#333",
            stroke_width="0.035",
        )


def _draw_opening(root: Element, plan: Plan, opening: PlanOpening) -> None:
    wall = plan.walls[opening.wall]
    half = opening.width / 2
    start, end = wall.at(opening.along - half), wall.at(opening.along + half)
    hole = PlanWall(start, end, wall.thickness)
    ux, uz = (end[0] - start[0]) / opening.width, (end[1] - start[1]) / opening.width
    away = wall.thickness / 2 + 0.005
    corners = [
        (p[0] - uz * s * away, p[1] + ux * s * away)
        for p, s in ((start, 1), (end, 1), (end, -1), (start, -1))
    ]
    is_window = opening.kind in (OpeningKind.WINDOW, OpeningKind.FRENCH_WINDOW)
    element(
        root,
        "polygon",
        points=_text(corners),
        fill="#cfe6f5" if is_window else "#ffffff",
        stroke="#333" if is_window else "",
        stroke_width="0.02",
    )
    if is_window:
        element(
            root,
            "polyline",
            points=_text((hole.start, hole.end)),
            stroke="#333",
            stroke_width="0.03",
        )
        return
    if opening.kind is OpeningKind.PASSAGE:
        return
    # Draw the leaf open into its room, and its swing as an arc.
    hinge, edge = (start, end) if opening.hinge_at_start else (end, start)
    nx, nz = _into(plan, opening, wall)
    open_at = (hinge[0] + nx * opening.width, hinge[1] + nz * opening.width)
    turn = (edge[0] - hinge[0]) * nz - (edge[1] - hinge[1]) * nx
    element(
        root,
        "path",
        fill="none",
        stroke="#a03c2d" if opening.other is None else "#777",
        stroke_width="0.025",
        d=f"M{hinge[0]:.3f},{hinge[1]:.3f} L{open_at[0]:.3f},{open_at[1]:.3f} "
        f"A{opening.width:g},{opening.width:g} 0 0 {0 if turn > 0 else 1} "
        f"{edge[0]:.3f},{edge[1]:.3f}",
    )


def _into(plan: Plan, opening: PlanOpening, wall: PlanWall) -> Point:
    """The unit normal of the wall that points into the opening's room."""
    nx, nz = wall.normal
    x, z = wall.at(opening.along)
    reach = wall.thickness / 2 + 0.1
    inside = plan.rooms[opening.room].contains((x + nx * reach, z + nz * reach))
    return (nx, nz) if inside else (-nx, -nz)


def _label(root: Element, room: PlanRoom, pieces: Iterable[PlacedPiece]) -> None:
    """Write a room's name and area at the place with the least furniture below."""
    lines = room.name, f"{room.area:.1f} m²"
    x0, z0, x1, z1 = room.bounds
    size = min(_TEXT_M, (x1 - x0) / max(len(room.name), 4) * 1.5)
    half = 0.3 * size * max(len(text) for text in lines), 1.1 * size
    grounds = [_around(piece) for piece in pieces if piece.elevation < _RAISED_M]

    def cost(x: float, z: float) -> float:
        box = x - half[0], z - half[1], x + half[0], z + half[1]
        corners = [(box[k], box[m]) for k in (0, 2) for m in (1, 3)]
        off_middle = abs(x - (x0 + x1) / 2) + abs(z - (z0 + z1) / 2)
        covered = sum(_shared(box, ground) for ground in grounds)
        return covered + 0.05 * off_middle + 2 * sum(not room.contains(c) for c in corners)

    # Try places a quarter of a metre apart.
    xs, zs = (
        [(a + b) / 2 + k * 0.25 for k in range(-int((b - a) * 2), int((b - a) * 2) + 1)]
        for a, b in ((x0, x1), (z0, z1))
    )
    x, z = min(product(xs, zs), key=lambda at: cost(*at))
    for line, text in enumerate(lines):
        element(
            root,
            "text",
            text,
            x=f"{x:.2f}",
            y=f"{z + (line - 0.1) * size * 1.1:.2f}",
            font_size=f"{size:.2f}",
            text_anchor="middle",
            fill="#222",
            stroke="#ffffff",
            stroke_width="0.08",
            stroke_linejoin="round",
            paint_order="stroke",
        )


def _around(piece: PlacedPiece) -> Rect:
    xs, zs = [p[0] for p in piece.corners], [p[1] for p in piece.corners]
    return min(xs), min(zs), max(xs), max(zs)


def _shared(a: Rect, b: Rect) -> float:
    """Area of the intersection of two rectangles, square metres."""
    width, depth = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    return max(width, 0.0) * max(depth, 0.0)
