"""Rooms -> Room nouns, floors and ceilings; later rooms win where two overlap; no effects.

A ceiling is as high as its level or as the tops of the walls around; staircases cut floors and ceilings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, Points2
from pbrs_farm.core.house import Item, ItemKind, Room, Surface
from pbrs_farm.geometry.doorways import door_line, ground_between
from pbrs_farm.geometry.plan_surfaces import counter_clockwise, horizontal, polygons_in
from pbrs_farm.geometry.roofs import level_or_sloped
from pbrs_farm.read.common.house_builder import structure_item
from pbrs_farm.read.sweethome3d.door_cutouts import polygons_from_path
from pbrs_farm.read.sweethome3d.home_file.home_xml import (
    HomePlan,
    HomeRoom,
    Paint,
    PlanLevel,
    PlanPiece,
    level_of,
)
from pbrs_farm.read.sweethome3d.piece_models import HomeMaterials
from pbrs_farm.read.sweethome3d.placement import PieceFrame, frame_of
from pbrs_farm.read.sweethome3d.wall_solids import Outline, picture_uvs, top_heights

TOLERANCE_M = 0.01  # heights that differ less are equal

Cuts = dict[str, shapely.Geometry]


def staircase_cuts(
    plan: HomePlan, materials: HomeMaterials, house_level: dict[str, str]
) -> tuple[Cuts, Cuts]:
    """By level id, what staircases take of its floors and of its ceilings (plan polygons).

    A floor is cut by a staircase that starts below it and reaches it, the ceiling under such a
    floor likewise. A ceiling with no visible level above stays whole, so that no sky looks in.
    """
    floors: dict[str, list[shapely.Geometry]] = {}
    ceilings: dict[str, list[shapely.Geometry]] = {}
    visible = [level for level in plan.levels if level.is_visible]
    for piece in plan.pieces:
        if not piece.staircase_cut_out or piece.staircase_cut_out.lower() == "false":
            continue
        own_level = level_of(plan, piece.level)
        if not own_level.is_visible:
            continue
        # Cut the floors that it leads up to, and the ceilings it passes.
        hole = _hole(piece, frame_of(piece, own_level), materials)
        if hole is None:
            continue
        foot = own_level.elevation + piece.elevation
        top = foot + piece.size[2]
        for level in visible:
            reach = level.elevation - level.reach_down - TOLERANCE_M
            if foot < level.elevation - TOLERANCE_M and top >= reach:
                floors.setdefault(house_level[level.id], []).append(hole)
        for level in visible:
            ceiling = level.elevation + level.height
            has_above = any(x.elevation >= ceiling - TOLERANCE_M for x in visible)
            if foot < ceiling and top >= ceiling - TOLERANCE_M and has_above:
                ceilings.setdefault(house_level[level.id], []).append(hole)
    return _join_cuts(floors), _join_cuts(ceilings)


def _join_cuts(cuts: dict[str, list[shapely.Geometry]]) -> Cuts:
    return {level: shapely.union_all(holes) for level, holes in cuts.items()}


def _hole(piece: PlanPiece, frame: PieceFrame, materials: HomeMaterials) -> shapely.Geometry | None:
    # The cut-out shape is drawn in the unit square, x to the right, y to the front.
    try:
        outlines = polygons_from_path(piece.staircase_cut_out)
    except ValueError as error:
        materials.notes.add(
            "bad-cut-out", piece.place, f"staircaseCutOutShape: {error}; nothing is cut"
        )
        return None
    shapes = []
    for outline in outlines:
        x = (outline[:, 0] - 0.5) * 2 * frame.half[0] * frame.mirror
        z = (outline[:, 1] - 0.5) * 2 * frame.half[2]
        world = frame.world(np.stack([x, np.zeros(len(x)), z], -1))
        polygon = shapely.Polygon(world[:, [0, 2]])
        shapes.append(polygon if polygon.is_valid else shapely.make_valid(polygon))
    return shapely.union_all(shapes) if shapes else None


KINK_M = 0.01  # smaller bends of a ceiling are left out
TIE_M = 1e-3  # walls are equally near within this
CORNER_REACH_M = 0.10  # A wall's corner this near to a room's edge can bend the ceiling there


class CeilingHeights:
    """Ceiling heights above the level, in metres; on the top level they follow the walls."""

    def __init__(self, plan: HomePlan, outlines: dict[str, Outline]) -> None:
        self._top = max((x.index for x in plan.levels), default=0)
        self._wall_height = plan.wall_height
        by_level: dict[str, list[tuple[F64, F64]]] = {}
        # Collect the top edges of all walls of a level: plan segments and heights at their ends.
        for wall in plan.walls:
            if wall.id not in outlines:
                continue
            outline, around = outlines[wall.id], outlines[wall.id].polygon
            along = np.concatenate([outline.along, outline.along[::-1]])
            tops = top_heights(wall, around, along)
            a, b = np.arange(len(around)), np.roll(np.arange(len(around)), -1)
            segments = np.concatenate([around[a], around[b]], 1)
            edges = (segments, np.stack([tops[a], tops[b]], 1))
            by_level.setdefault(level_of(plan, wall.level).id, []).append(edges)
        self._edges = {
            level_id: (np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts]))
            for level_id, parts in by_level.items()
        }

    def heights(self, level: PlanLevel, points: Points2, is_flat: bool) -> F64:
        """(N,) heights over plan points (N, 2)."""
        edges = self._edges.get(level.id)
        # Below the top level the ceiling is flat, at the level's height.
        if level.index != self._top or edges is None:
            height = level.height if level.id else self._wall_height
            return np.full(len(points), height)
        heights = np.array([_nearest_wall_top(p, *edges) for p in points])
        return np.full(len(points), heights.max()) if is_flat else heights

    def highest(self, level: PlanLevel, ring: Points2, *, is_flat: bool) -> float:
        """The height of the ceiling's highest place over an outline (N, 2), a gable's ridge too."""
        bent = self._with_kinks(level, ring, is_flat)
        return float(self.heights(level, bent, is_flat).max())

    def surface(
        self, level: PlanLevel, parts: Sequence[Sequence[Points2]], material: int, *, is_flat: bool
    ) -> Surface:
        """The ceiling over polygons (each an outline and its holes), facing down."""
        bent = [[self._with_kinks(level, ring, is_flat) for ring in rings] for rings in parts]
        heights = [self.heights(level, np.concatenate(rings), is_flat) for rings in bent]
        return level_or_sloped("ceiling", bent, [level.elevation + h for h in heights], material)

    def _with_kinks(self, level: PlanLevel, ring: Points2, is_flat: bool) -> Points2:
        # The ring with the points where the walls' tops beside one of its edges bend.
        edges = self._edges.get(level.id)
        if level.index != self._top or edges is None or is_flat:
            return ring
        corners = np.unique(edges[0][:, :2], axis=0)
        points: list[F64] = []
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            points.append(a)
            d = b - a
            length = float(np.linalg.norm(d))
            # Take the walls' corners that lie along this edge of the room.
            t = (corners - a) @ d / max(length**2, 1e-18)
            gap = np.linalg.norm(a + t[:, None] * d - corners, axis=1)
            inside = (gap < CORNER_REACH_M) & (t * length > KINK_M) & ((1 - t) * length > KINK_M)
            # Keep a corner where the ceiling leaves the straight line between the edge's ends.
            ends = self.heights(level, np.stack([a, b]), False)
            last = 0.0
            for where in np.sort(t[inside]):
                if (where - last) * length < KINK_M:
                    continue
                spot = a + where * d
                straight = ends[0] + where * (ends[1] - ends[0])
                if abs(self.heights(level, spot[None], False)[0] - straight) > KINK_M:
                    points.append(spot)
                    last = float(where)
        return np.array(points)


def _nearest_wall_top(point: Points2, segments: F64, tops: F64) -> float:
    # Height of the top of the wall edge nearest to a plan point, at the nearest spot; the lowest
    # of those equally near, so that no wall ends below the ceiling.
    a, d = segments[:, :2], segments[:, 2:] - segments[:, :2]
    t = ((point - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-18)
    # The nearest spot on each edge, and the height of the wall there.
    t = np.clip(t, 0, 1)
    gap = np.linalg.norm(a + t[:, None] * d - point, axis=1)
    heights = tops[:, 0] + t * (tops[:, 1] - tops[:, 0])
    return float(heights[gap <= gap.min() + TIE_M].min())


MIN_AREA_M2 = 0.01  # smaller rooms are left out
LEAST_ROOM_M2 = 1.0  # a smaller area between walls is a shaft
LEAST_WALL_M = 1.8  # lower walls enclose no room
DOOR_SILL_M = 0.3  # what begins higher is a window
SLIVER_M2 = 1e-4  # smaller pieces come of rounding
MAX_CORNERS = 300  # an outline of more corners is simplified: cost grows with their square


@dataclass(frozen=True, slots=True, eq=False)
class ReadRoom:
    """A room of a visible level with its outline as a simple polygon."""

    id: str
    plan: HomeRoom
    level: PlanLevel
    level_id: str
    outline: shapely.Polygon


def read_rooms(
    plan: HomePlan, materials: HomeMaterials, house_level: dict[str, str]
) -> list[ReadRoom]:
    """The rooms of visible levels, numbered within their level in the file's order.

    house_level: the home's level id -> the house's. An outline that crosses itself is a note, its largest
    part the room; one without area is left out with a note.
    """
    rooms: list[ReadRoom] = []
    counts: dict[str, int] = {}
    for room in plan.rooms:
        level = level_of(plan, room.level)
        if not level.is_visible:
            continue
        outline = _simple(room, materials)
        if outline is None:
            continue
        level_id = house_level[level.id]
        number = counts.get(level_id, 0)
        counts[level_id] = number + 1
        rooms.append(ReadRoom(f"{level_id}_{number}", room, level, level_id, outline))
    return rooms


def rooms_between_walls(plan: HomePlan, outlines: dict[str, Outline]) -> tuple[HomeRoom, ...]:
    """Rooms enclosed by walls of visible levels, up to small gaps and doorways, if no room is drawn."""
    home_rooms: list[HomeRoom] = []
    for level_id in dict.fromkeys(wall.level for wall in plan.walls):
        feet = [
            shapely.make_valid(shapely.Polygon(outlines[wall.id].polygon))
            for wall in plan.walls
            if wall.level == level_id
            and wall.id in outlines
            and max(wall.height, wall.height_end or 0.0) >= LEAST_WALL_M
        ]
        home_rooms += [
            HomeRoom(
                place=f"walls of level {level_id or '0'}",
                level=level_id,
                name="",
                points=_ring(p.exterior),
                has_floor=True,
                has_ceiling=True,
                floor=Paint(),
                ceiling=Paint(),
                is_ceiling_flat=False,
            )
            for p in ground_between(feet, _door_lines(plan, level_id))
            if p.area >= LEAST_ROOM_M2
        ]
    return tuple(home_rooms)


def _door_lines(plan: HomePlan, level_id: str) -> list[shapely.LineString]:
    """The lines across a level that its doors close, and windows down to the floor."""
    return [
        door_line(np.array(p.centre), np.array([np.cos(p.angle), np.sin(p.angle)]), p.size[0])
        for p in plan.pieces
        if p.level == level_id and p.frame is not None and p.elevation < DOOR_SILL_M
    ]


def _simple(room: HomeRoom, materials: HomeMaterials) -> shapely.Polygon | None:
    if len(room.points) < 3:
        materials.notes.add("degenerate-room", room.place, "fewer than three points: left out")
        return None
    polygon = shapely.Polygon(_coarse(room, materials))
    if not polygon.is_valid:
        parts = polygons_in(shapely.make_valid(polygon), SLIVER_M2)
        materials.notes.add(
            "room-crosses-itself", room.place, "its outline crosses itself: largest part kept"
        )
        polygon = max(parts, key=lambda p: p.area) if parts else shapely.Polygon()
        polygon = shapely.Polygon(polygon.exterior) if not polygon.is_empty else polygon
    if polygon.area < MIN_AREA_M2:
        materials.notes.add("degenerate-room", room.place, f"{polygon.area:.4f} m2: left out")
        return None
    return polygon


def _coarse(room: HomeRoom, materials: HomeMaterials) -> Points2:
    """The room's points; of more than MAX_CORNERS those that say most, with a note."""
    points = np.asarray(room.points, np.float64)
    if len(points) <= MAX_CORNERS:
        return points
    # Leave out what moves the outline by less than a step that grows from a millimetre.
    line, step = shapely.LineString(points), 0.001
    while len(points) > MAX_CORNERS:
        points = shapely.get_coordinates(shapely.simplify(line, step, preserve_topology=False))
        step *= 2
    text = f"{len(room.points)} corners, simplified to {len(points)}"
    materials.notes.add("room-simplified", room.place, text)
    return points


def room_nouns(rooms: list[ReadRoom], ceilings: CeilingHeights) -> tuple[Room, ...]:
    """The Room of each; its polygon without what later rooms take, if that leaves one piece."""
    nouns = []
    for k, room in enumerate(rooms):
        taken = [r.outline for r in _later(rooms, k)]
        rest = polygons_in(shapely.difference(room.outline, shapely.union_all(taken)), SLIVER_M2)
        outline = rest[0] if len(rest) == 1 and not rest[0].interiors else room.outline
        polygon = counter_clockwise(_ring(outline.exterior))
        height = ceilings.highest(room.level, polygon, is_flat=room.plan.is_ceiling_flat)
        nouns.append(
            Room(
                id=room.id,
                name=room.plan.name,
                level_id=room.level_id,
                polygon=polygon,
                floor_y=room.level.elevation,
                ceiling_y=room.level.elevation + height,
                types=(room.plan.name,) if room.plan.name else (),
                has_floor=room.plan.has_floor,
                has_ceiling=room.plan.has_ceiling,
            )
        )
    return tuple(nouns)


def _later(rooms: list[ReadRoom], k: int) -> list[ReadRoom]:
    # The rooms of the same level that come after the k-th and touch it.
    after = [r for r in rooms[k + 1 :] if r.level_id == rooms[k].level_id]
    touch = shapely.intersects(rooms[k].outline, [r.outline for r in after])
    return [r for r, touches in zip(after, touch, strict=True) if touches]


def plane_items(
    rooms: list[ReadRoom],
    ceilings: CeilingHeights,
    materials: HomeMaterials,
    floor_cuts: dict[str, shapely.Geometry],
    ceiling_cuts: dict[str, shapely.Geometry],
) -> list[Item]:
    """Floor and ceiling of each room as an item, horizontal or, below a roof, sloped.

    Where rooms overlap, the floor belongs to the later one. floor_cuts, ceiling_cuts: areas of staircases
    by level id.
    """
    items = []
    for k, room in enumerate(rooms):
        later = _later(rooms, k)
        if room.plan.has_floor:
            floors = [r.outline for r in later if r.plan.has_floor]
            items += _floor_items(room, _left_of(room, floors, floor_cuts), materials)
        if room.plan.has_ceiling:
            covers = [r.outline for r in later if r.plan.has_ceiling]
            items += _ceiling(room, _left_of(room, covers, ceiling_cuts), ceilings, materials)
    return items


def _left_of(
    room: ReadRoom, later: list[shapely.Polygon], cuts: dict[str, shapely.Geometry]
) -> list[shapely.Polygon]:
    # The room's outline minus later rooms and the level's staircases.
    taken = [*later, cuts.get(room.level_id, shapely.Polygon())]
    return polygons_in(shapely.difference(room.outline, shapely.union_all(taken)), SLIVER_M2)


def _floor_items(
    room: ReadRoom, parts: list[shapely.Polygon], materials: HomeMaterials
) -> list[Item]:
    if not parts:
        return []
    material = materials.painted(room.plan.floor, "floor", f"{room.plan.place} floor")
    rings = [_rings_of_polygon(p) for p in parts]
    surface = horizontal("floor", rings, room.level.elevation, material, up=True)
    surface = _textured(surface, room.plan.floor)
    return [_item(room, ItemKind.FLOOR, surface)]


def _ceiling(
    room: ReadRoom, parts: list[shapely.Polygon], ceilings: CeilingHeights, materials: HomeMaterials
) -> list[Item]:
    if not parts:
        return []
    material = materials.painted(room.plan.ceiling, "ceiling", f"{room.plan.place} ceiling")
    surface = ceilings.surface(
        room.level,
        [_rings_of_polygon(p) for p in parts],
        material,
        is_flat=room.plan.is_ceiling_flat,
    )
    return [_item(room, ItemKind.CEILING, _textured(surface, room.plan.ceiling))]


def _item(room: ReadRoom, kind: ItemKind, surface: Surface) -> Item:
    return structure_item(
        f"{kind}_{room.id}",
        kind,
        [surface],
        name=f"{kind.capitalize()} of {room.plan.name or 'room ' + room.id}",
        level_id=room.level_id,
        source_class=kind.value,
        room_id=room.id,
    )


def _textured(surface: Surface, paint: Paint) -> Surface:
    if paint.picture is None or surface.uvs is None:
        return surface
    uvs = picture_uvs(surface.uvs.astype(np.float64), paint.picture).astype(np.float32)
    return replace(surface, uvs=uvs)


def _rings_of_polygon(polygon: shapely.Polygon) -> list[Points2]:
    return [_ring(polygon.exterior), *(_ring(r) for r in polygon.interiors)]


def _ring(ring: shapely.LinearRing) -> Points2:
    return np.asarray(shapely.get_coordinates(ring)[:-1], np.float64)
