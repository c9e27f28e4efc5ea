"""What a made plan is like, by means of the bench's own: polygons and a raster of 2.5 cm, not the stage's code."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from shapely.geometry import LineString, Point, Polygon

from pbrs_farm.generate.floor_plan import OpeningKind, PlacedPiece, Plan, PlanOpening, RoomType

CELL_M, WAY_M, SWING_M = 0.025, 0.6, 0.8
MEDIANS = {
    RoomType.BEDROOM: 10.9, RoomType.LIVING: 27.2, RoomType.KITCHEN: 9.7, RoomType.BATHROOM: 6.0,
    RoomType.HALL: 9.7,
}  # fmt: skip
"""Square metres, of 65 rooms that people drew (docs/homes.md). Seven of the nine homes have a corridor
(10.0, 8.5, 5.7, 9.7 m2) or a hall (2.7, 11.1, 23.9 m2), none has both; a made home's hall is either."""

MUST_HAVES = {
    "bedroom": ["bed"], "studio": ["bed", "sofa|corner_sofa|armchair|chair"],
    "living": ["sofa|corner_sofa|armchair|chair"], "bathroom": ["toilet", "washbasin"],
    "kitchen": ["sink", "cooker|hob", "fridge"], "wc": ["toilet"],
}  # fmt: skip
_MAY_MEET = [
    {"chair", "dining_table"}, {"chair", "desk"}, {"chair", "coffee_table"}, {"stool", "piano"},
    {"armchair", "dining_table"},
]  # fmt: skip
_WINDOWS = (OpeningKind.WINDOW, OpeningKind.FRENCH_WINDOW)


def measured(plan: Plan, pieces: tuple[PlacedPiece, ...]) -> dict[str, Any]:
    """Areas, aspects, densities, what can be walked, and every rule that is broken, a line each."""
    inside = [r for r in plan.rooms if r.type is not RoomType.BALCONY]
    floor = sum(r.area for r in inside)
    standing = [p for p in pieces if p.elevation < 0.05 and plan.rooms[p.room] in inside]
    walkable, walk_faults = _walk(plan, pieces)
    faults = [*_unreached(plan), *_dark(plan), *_lacking(plan, pieces)]
    faults += [*_at_doors(plan, pieces), *_meeting(plan, pieces), *walk_faults]
    return {
        "areas": [[r.type.value, round(r.area, 3)] for r in inside],
        "aspects": [round(_aspect(r.polygon), 3) for r in inside if r.type is not RoomType.HALL],
        "pieces_per_m2": round(len(standing) / floor, 4),
        "walkable": round(walkable, 4),
        "faults": faults,
        "walls": _wall_rows(plan),
        "family": plan.family,
        "outline": outline(plan),
        "through": _has_room_through_room(plan),
        "height": plan.height,
    }


def outline(plan: Plan) -> str:
    """The shape of its outer wall: a rectangle, an L, a U, or what has other corners."""
    ground = [Polygon(w.corners()) for w in plan.walls if w.height is None]
    ground += [Polygon(r.polygon) for r in plan.rooms if r.type is not RoomType.BALCONY]
    whole: Any = shapely.unary_union(ground).buffer(0.2, join_style="mitre")
    around: Any = Polygon(whole.exterior).buffer(-0.2, join_style="mitre").simplify(0.01)
    n = len(around.exterior.coords) - 1
    # Eight corners are a U where a piece of one side is missing: the convex hull is a rectangle.
    hull: Any = around.convex_hull.simplify(0.01)
    is_u = n == 8 and len(hull.exterior.coords) == 5
    return {4: "rectangle", 6: "L"}.get(n, "U" if is_u else "other")


def _has_room_through_room(plan: Plan) -> bool:
    """Whether a bedroom has a door, and none that opens to the hall."""
    doors = [{o.room, o.other} for o in plan.openings if o.kind not in _WINDOWS]
    halls = {i for i, r in enumerate(plan.rooms) if r.type is RoomType.HALL}
    beds = [i for i, r in enumerate(plan.rooms) if r.type is RoomType.BEDROOM]
    return any(not any(pair & halls for pair in doors if i in pair) for i in beds)


def _aspect(polygon: Any) -> float:
    around: Any = shapely.minimum_rotated_rectangle(Polygon(polygon))
    sides = LineString(around.exterior.coords[:3])
    (a, b), (c, d), (e, f) = sides.coords
    short, long = sorted((math.dist((a, b), (c, d)), math.dist((c, d), (e, f))))
    return long / short


def _wall_rows(plan: Plan) -> list[list[float]]:
    # Walls from the corner of the outline, so that a plan is compared and not its place.
    ends = np.array([[*w.start, *w.end] for w in plan.walls])
    ends = ends - np.tile(ends.reshape(-1, 2).min(0), 2)
    return sorted(np.round(ends, 2).tolist())


def _unreached(plan: Plan) -> list[str]:
    """Rooms that no way of doors and open sides joins with the hall."""
    joined = [(o.room, o.other) for o in plan.openings if o.other is not None and _is_way(plan, o)]
    shapes = [Polygon(r.polygon) for r in plan.rooms]
    for i, a in enumerate(shapes):
        for j in range(i):
            if a.buffer(0.01).intersection(shapes[j].buffer(0.01)).length > 1.5:
                joined.append((i, j))
    # One comes into an upper storey by the stairs.
    entrance = next((o.room for o in plan.openings if o.kind is OpeningKind.ENTRANCE), None)
    stairs = next((i for i, r in enumerate(plan.rooms) if r.type is RoomType.STAIRS), None)
    seen = {stairs if entrance is None else entrance}
    while new := {b for pair in joined for a, b in (pair, pair[::-1]) if a in seen} - seen:
        seen |= new
    return [f"{r.name}: not reached" for i, r in enumerate(plan.rooms) if i not in seen]


def _is_way(plan: Plan, opening: PlanOpening) -> bool:
    to_balcony = RoomType.BALCONY in {
        plan.rooms[r].type for r in (opening.room, opening.other or 0)
    }
    return opening.kind not in _WINDOWS or to_balcony


def _dark(plan: Plan) -> list[str]:
    """Rooms to live in without an outer wall with glass of an eighth of their floor."""
    found = []
    for number, room in enumerate(plan.rooms):
        if not room.type.is_habitable:
            continue
        own = [o for o in plan.openings if o.kind in _WINDOWS and number in (o.room, o.other)]
        glass = sum(o.width * o.height for o in own if plan.walls[o.wall].is_outer)
        if glass < 0.95 * room.area / 8:
            found.append(f"{room.name}: {glass:.2f} m2 of glass for {room.area:.1f} m2")
    return found


def _lacking(plan: Plan, pieces: tuple[PlacedPiece, ...]) -> list[str]:
    found = []
    for number, room in enumerate(plan.rooms):
        has = {p.piece.group for p in pieces if p.room == number}
        for one in MUST_HAVES.get(room.type.value, []):
            if not has & set(one.split("|")):
                found.append(f"{room.name}: no {one}")
        lit = any("lamp" in group for group in has)
        if room.type not in (RoomType.BALCONY, RoomType.STAIRS) and not lit:
            found.append(f"{room.name}: no lamp")
    return found


def _at_doors(plan: Plan, pieces: tuple[PlacedPiece, ...]) -> list[str]:
    """What stands in the quarter that a door's leaf sweeps, or within 0.8 m before either side."""
    found = []
    shapes = [Polygon(p.corners) for p in pieces]
    for opening in plan.openings:
        if opening.kind in _WINDOWS:
            continue
        wall = plan.walls[opening.wall]
        half = opening.width / 2
        a, b = np.array(wall.at(opening.along - half)), np.array(wall.at(opening.along + half))
        along = (b - a) / opening.width
        normal = np.array([-along[1], along[0]])
        for way in (normal, -normal):
            face = (wall.thickness / 2 + 0.01) * way
            front = Polygon(
                [a + face, b + face, b + face + SWING_M * way, a + face + SWING_M * way]
            )
            zones = [front.buffer(-0.02)]
            if Polygon(plan.rooms[opening.room].polygon).contains(Point((a + b) / 2 + face * 1.5)):
                hinge = a if opening.hinge_at_start else b
                zones.append(Point(hinge + face).buffer(opening.width - 0.03).intersection(
                    Polygon([a + face, b + face, b + face + 2 * way, a + face + 2 * way])))  # fmt: skip
            zone = shapely.unary_union(zones)
            for piece, shape in zip(pieces, shapes, strict=True):
                if piece.elevation < 1.95 and zone.intersection(shape).area > 1e-4:
                    found.append(f"{piece.piece.name} before {opening.kind.value} {opening.wall}")
    return found


def _meeting(plan: Plan, pieces: tuple[PlacedPiece, ...]) -> list[str]:
    """Boxes that share more than 1 cm a way, and those that stand in walls."""
    found = []
    shapes = [Polygon(p.corners).buffer(-0.005, join_style="mitre") for p in pieces]
    for piece, shape in zip(pieces, shapes, strict=True):
        room = Polygon(plan.rooms[piece.room].polygon).buffer(0.01, join_style="mitre")
        if shape.difference(_with_open(plan, room)).area > 1e-3:
            found.append(f"{piece.piece.name} in a wall of {plan.rooms[piece.room].name}")
    pairs = shapely.STRtree(shapes).query(shapes, predicate="intersects").T
    for i, j in pairs[pairs[:, 0] < pairs[:, 1]].tolist():
        a, b = pieces[i], pieces[j]
        shared = min(a.elevation + a.height, b.elevation + b.height) - max(a.elevation, b.elevation)
        groups = {a.piece.group, b.piece.group}
        if shared > 0.01 and groups not in _MAY_MEET and not ("tv" in groups and shared < 0.3):
            found.append(f"{a.piece.name} and {b.piece.name} share {shared:.2f} m")
    return found


def _with_open(plan: Plan, room: Any) -> Any:
    # The rooms that no wall parts from this one.
    near = [Polygon(r.polygon).buffer(0.01) for r in plan.rooms]
    return shapely.unary_union([room, *(n for n in near if n.intersection(room).area > 0.02)])


def _walk(plan: Plan, pieces: tuple[PlacedPiece, ...]) -> tuple[float, list[str]]:
    """(share of the floor that a way 0.6 m wide reaches, doors that it does not)."""
    inside = [r for r in plan.rooms if r.type is not RoomType.BALCONY]
    rooms = [Polygon(r.polygon) for r in inside]
    x0, z0, x1, z1 = shapely.unary_union(rooms).buffer(0.5).bounds
    xs, zs = np.arange(x0, x1, CELL_M) + CELL_M / 2, np.arange(z0, z1, CELL_M) + CELL_M / 2
    gx, gz = np.meshgrid(xs, zs)

    def mask(shape: Any) -> NDArray[np.bool_]:
        shapely.prepare(shape)
        return np.asarray(shapely.contains_xy(shape, gx, gz))

    floor = mask(shapely.unary_union([r.buffer(1e-3) for r in rooms]))
    ways = [_gap(plan, o) for o in plan.openings if o.other is not None and o.kind not in _WINDOWS]
    free = floor | mask(shapely.unary_union(ways)) if ways else floor.copy()
    standing = [Polygon(p.corners) for p in pieces if p.elevation < 0.4 and p.height > 0.05]
    if standing:
        free &= ~mask(shapely.unary_union(standing))
    middle = ndimage.distance_transform_edt(free) * CELL_M >= WAY_M / 2 - CELL_M
    parts, n = ndimage.label(middle)
    if n == 0:
        return 0.0, ["nowhere to walk"]
    largest = parts == 1 + np.argmax(np.bincount(parts.ravel())[1:])
    reach = (ndimage.distance_transform_edt(~largest) * CELL_M <= WAY_M / 2) & free & floor
    faults = []
    for opening in plan.openings:
        if opening.kind not in _WINDOWS:
            before = mask(_gap(plan, opening).buffer(0.25, join_style="mitre")) & floor
            if not (before & reach).any():
                faults.append(f"{opening.kind.value} {opening.wall}: not joined by a way")
    return float(reach.sum() / floor.sum()), faults


def _gap(plan: Plan, opening: PlanOpening) -> Polygon:
    """The hole of an opening in its wall, with a centimetre on either side."""
    wall, half = plan.walls[opening.wall], opening.width / 2
    line = LineString([wall.at(opening.along - half), wall.at(opening.along + half)])
    return line.buffer(wall.thickness / 2 + 0.01, cap_style="flat")
