"""Floor plans: a home's own, and the map of its candidates, why each was rejected, and the winners.

No effects. A map has one panel per level, then a legend with counts and, room by room, the reason of each sector that
has no camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import View
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.mesh import triangle_corners, unit_normals
from pbrs_farm.core.shown_text import shown
from pbrs_farm.geometry.plan_surfaces import room_shape
from pbrs_farm.sample.camera_report import RoomReport, Verdict
from pbrs_farm.sample.camera_source import Sampling
from pbrs_farm.sample.drawing import Drawing, Mark
from pbrs_farm.sample.room_sampler import RoomTrace

# Colour the dots by verdict.
COLOURS: Final = {
    Verdict.OUTSIDE_ROOM: "#d9d9d9",
    Verdict.NEAR_OBSTACLE: "#e6701d",
    Verdict.NOT_ABOVE_FLOOR: "#7b3ff2",
    Verdict.ENCLOSED: "#000000",
    Verdict.FILLED_BY_ONE: "#c2a500",
    Verdict.FEW_OBJECTS: "#d7263d",
    Verdict.BELOW_MIN_SCORE: "#e8a0bf",
    Verdict.NEAR_DUPLICATE: "#8fd3fe",
    Verdict.LOWER_SCORE: "#5aa469",
    Verdict.WINNER: "#0b5fff",
}
_PX_PER_M, _MAX_PX, _MARGIN = 70.0, 1600.0, 30.0  # scale, largest width of a panel, border
_MOST_LETTERS: Final = 200  # of a line of text
_ROW, _LETTERS, _LETTER_WIDTH, _TEXT_PX = 16.0, 12.0, 0.56, 200.0  # px
_GAZE_M = 0.45  # length of the lines of gaze along a walk
_ROOM, _FURNITURE, _WALL, _INK = "#fbf7ee", "#cfd6dd", "#3b3b3b", "#222222"
_EDGE, _LAMP, _LAMP_EDGE = "#9aa5b1", "#ffcc33", "#8a6500"


def camera_map_svg(house: House, sampling: Sampling) -> str:
    """The map as SVG; candidates (sampling.traces) and winners carry titles that a browser shows."""
    return camera_map(house, sampling).svg()


def camera_map_rgb(house: House, sampling: Sampling) -> NDArray[np.uint8]:
    """The map as (H, W, 3) uint8 sRGB, by Pillow and its font: pixels may differ between its versions."""
    return camera_map(house, sampling).rgb()


def camera_map(house: House, sampling: Sampling) -> Drawing:
    """The map, for SVG and pixels, of a house's sampling, levels side by side, x right, z down."""
    marks, right, bottom = _levels_to_draw(house, sampling.views, sampling.traces)
    # Write the legend and the reasons to the right of the last level.
    notes = _notes(sampling)
    marks += [_shift_marks(mark, right) for mark in notes]
    height = max(bottom, *(mark.points[0][1] for mark in notes)) + _MARGIN
    letters = max(len(mark.text) for mark in notes)
    width = right + max(_TEXT_PX, _LETTER_WIDTH * _LETTERS * letters) + _MARGIN
    return Drawing(math.ceil(width), math.ceil(height), tuple(marks))


def plan_svg(house: House, views: Sequence[View] = ()) -> str:
    """A house's plan as SVG: rooms with their names, outlines of items, lamps, and views if given."""
    marks, width, bottom = _levels_to_draw(house, views, (), is_plan=True)
    return Drawing(math.ceil(width), math.ceil(bottom + _MARGIN), tuple(marks)).svg()


def _levels_to_draw(
    house: House, views: Sequence[View], traces: Sequence[RoomTrace], *, is_plan: bool = False
) -> tuple[list[Mark], float, float]:
    """The levels side by side, each at the scale that fits; where they end on the right and below."""
    marks: list[Mark] = []
    right, bottom = _MARGIN, _MARGIN
    for level in house.levels:
        rooms = [room for room in house.rooms if room.level_id == level.id]
        shapes = [s for s in map(room_shape, rooms) if not shapely.is_empty(s)]
        if not shapes:
            continue
        x0, z0, x1, z1 = shapely.total_bounds(shapes)
        scale = min(_PX_PER_M, _MAX_PX / max(x1 - x0, z1 - z0, 1e-6))
        panel = _Panel(right - scale * x0, 2 * _MARGIN - scale * z0, scale)
        marks.append(text_mark(right, _MARGIN, shown(level.name) or f"Level {level.id}", 14.0))
        marks += _level_marks(house, views, traces, level.id, panel, is_plan)
        right += scale * (x1 - x0) + 2 * _MARGIN
        bottom = max(bottom, 2 * _MARGIN + scale * (z1 - z0))
    return marks, right, bottom


class _Panel:
    """Plan metres to pixels of one level's panel."""

    def __init__(self, x: float, y: float, scale: float) -> None:
        self.x, self.y, self.scale = x, y, scale

    def __call__(self, x: float, z: float) -> tuple[float, float]:
        return self.x + self.scale * float(x), self.y + self.scale * float(z)


def _level_marks(
    house: House,
    views: Sequence[View],
    traces: Sequence[RoomTrace],
    level_id: str,
    panel: _Panel,
    is_plan: bool,
) -> list[Mark]:
    rooms = {room.id: room for room in house.rooms if room.level_id == level_id}
    marks = [
        Mark("polygon", tuple(panel(x, z) for x, z in room.polygon), _ROOM, title=shown(room.name))
        for room in rooms.values()
        if len(room.polygon) >= 3
    ]
    # Draw from the floor up: rooms, furniture and walls, candidates, names, winners.
    items = [item for item in house.items if item.level_id == level_id]
    for item in items:
        marks += _footprint(item, panel, is_plan)
    if is_plan:
        marks += [mark for item in items for mark in _lamp_marks(item, panel)]
    for trace in traces:
        if trace.room_id in rooms:
            for eye, verdict in zip(trace.candidates.eye, trace.verdict, strict=True):
                kind = Verdict(verdict)
                if kind is not Verdict.WINNER:
                    point = panel(eye[0], eye[2])
                    marks.append(Mark("dot", (point,), COLOURS[kind], 1.4, title=kind.label))
    marks += [
        text_mark(*panel(*_middle(room.polygon)), f"{room.id} {shown(room.name)}", _LETTERS)
        for room in rooms.values()
        if len(room.polygon)
    ]
    # A walk is one line; of its frames a few say where they look.
    level_views = [view for view in views if view.room_id in rooms and not view.shot.eye]
    frames = [view for view in level_views if view.frame is not None]
    marks += _walk(frames, panel)
    for view in level_views:
        if view.frame is None:
            marks += _winner(view, panel)
    return marks


def _walk(frames: list[View], panel: _Panel) -> list[Mark]:
    """The way of a sequence's frames, a short line of gaze every tenth of it, its first and last frame."""
    if not frames:
        return []
    colour, gaze = COLOURS[Verdict.WINNER], COLOURS[Verdict.NEAR_OBSTACLE]
    places = [(float(v.camera.eye[0]), float(v.camera.eye[2])) for v in frames]
    marks = [Mark("line", tuple(panel(x, z) for x, z in places), colour, 2.5)]
    for view, (x, z) in list(zip(frames, places, strict=True))[:: max(len(frames) // 20, 1)]:
        dx, dz = view.camera.towards[0], view.camera.towards[2]
        line = panel(x, z), panel(x + _GAZE_M * dx, z + _GAZE_M * dz)
        title = f"{view.id}: {view.time_s or 0:.2f} s"
        marks += [Mark("line", line, gaze, 1.5, title=title), Mark("dot", line[:1], gaze, 2.0)]
    for view, place, text in ((frames[0], places[0], "start"), (frames[-1], places[-1], "end")):
        marks.append(Mark("dot", (panel(*place),), colour, 5.0, title=view.id))
        marks.append(text_mark(panel(*place)[0] + 8, panel(*place)[1], text, _LETTERS, colour))
    return marks


def _footprint(item: Item, panel: _Panel, has_edge: bool) -> list[Mark]:
    """Furniture: its hull seen from above. Walls: their level faces, tops and bottoms."""
    if item.kind in (ItemKind.FLOOR, ItemKind.CEILING, ItemKind.GROUND) or not item.n_faces:
        return []
    if item.kind is ItemKind.WALL:
        marks = []
        for surface in item.surfaces:
            # Take faces nearer to level than 60 degrees.
            corners = triangle_corners(surface.positions, surface.faces)
            for triangle in corners[np.abs(unit_normals(corners)[:, 1]) > 0.5]:
                points = tuple(panel(x, z) for x, _y, z in triangle)
                marks.append(Mark("polygon", points, _WALL))
        return marks
    # Draw anything else as its convex hull in plan.
    plan = np.concatenate([s.positions[:, [0, 2]] for s in item.surfaces])
    hull = shapely.convex_hull(shapely.multipoints(plan))
    if not isinstance(hull, shapely.Polygon):
        return []
    points = tuple(panel(x, z) for x, z in hull.exterior.coords)
    inside = Mark("polygon", points, _FURNITURE, title=shown(item.name))
    return [inside, Mark("line", points, _EDGE)] if has_edge else [inside]


def _lamp_marks(item: Item, panel: _Panel) -> list[Mark]:
    """A dot at each light source."""
    marks = []
    for light in item.lights:
        point = (panel(light.position[0], light.position[2]),)
        title = f"lamp: {shown(item.name)}"
        marks += [Mark("dot", point, _LAMP_EDGE, 4.0), Mark("dot", point, _LAMP, 3.0, title=title)]
    return marks


def _winner(view: View, panel: _Panel) -> list[Mark]:
    """A wedge of the camera's field of view, half a metre long, and the view's id."""
    camera = view.camera
    # Span the wedge by the horizontal field of view.
    half = math.atan(0.5 * camera.intrinsics.width_px / camera.intrinsics.fx)
    heading = math.atan2(camera.towards[2], camera.towards[0])
    x, _y, z = camera.eye
    wedge = [panel(x, z)]
    for angle in (heading - half, heading + half):
        wedge.append(panel(x + 0.5 * math.cos(angle), z + 0.5 * math.sin(angle)))
    title = f"{view.id}: score {view.score:.0f}"
    colour = COLOURS[Verdict.WINNER]
    label = panel(x + 0.6 * math.cos(heading), z + 0.6 * math.sin(heading))
    return [
        Mark("line", (*wedge, wedge[0]), colour, 2.0, title=title),
        Mark("dot", (wedge[0],), colour, 4.0, title=title),
        text_mark(*label, view.id.removeprefix(f"{view.room_id}_"), _LETTERS, colour),
    ]


def _notes(sampling: Sampling) -> list[Mark]:
    """Legend and reasons, as marks whose x counts from 0."""
    # Count verdicts over all rooms.
    counts = np.zeros(len(Verdict), np.int64)
    for trace in sampling.traces:
        counts += np.bincount(trace.verdict, minlength=len(Verdict))
    # List the verdicts with their colours, then rooms, then notes.
    rows: list[tuple[str, str | None]] = []
    for verdict in Verdict if sampling.traces else ():
        text = f"{verdict.label.replace('_', ' ')}: {counts[verdict]}"
        rows.append((text, COLOURS[verdict]))
    rows.append(("", None))
    for room in sampling.report.rooms:
        rows += [(line, None) for line in _room_lines(room)]
    rows += [(note, None) for note in sampling.report.notes]
    marks = []
    for k, (text, colour) in enumerate(rows):
        y = _MARGIN + k * _ROW
        if colour:
            marks.append(Mark("dot", ((6.0, y),), colour, 4.0))
        marks.append(text_mark(16.0 if colour else 0.0, y, text, _LETTERS))
    return marks


def _room_lines(room: RoomReport) -> list[str]:
    name = f"{room.room_id} {shown(room.name)}".strip()
    if room.reason:
        return [f"{name}: no camera: {room.reason}"]
    views = sum(len(s.views) for s in room.sectors)
    lines = [f"{name}: {views} views of {sum(s.n_candidates for s in room.sectors)} candidates"]
    lines += [f"    sector {s.sector}: {s.reason}" for s in room.sectors if s.reason]
    return lines


def _middle(polygon: F64) -> tuple[float, float]:
    """Where a room's name begins: a little left of its box's middle."""
    x, z = (polygon.min(0) + polygon.max(0)) / 2
    return float(x) - 0.4, float(z)


def text_mark(x: float, y: float, text: str, size: float = _LETTERS, colour: str = _INK) -> Mark:
    # Ids are strangers' words, too, and a line end stops the drawing.
    return Mark("text", ((x, y),), colour, size, text=shown(text, _MOST_LETTERS))


def _shift_marks(mark: Mark, dx: float) -> Mark:
    points = tuple((x + dx, y) for x, y in mark.points)
    return Mark(mark.shape, points, mark.colour, mark.size, mark.text, mark.title)
