"""A Sweet Home 3D home -> House: the order of reading; no effects."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath
from typing import Final, TypeVar
from xml.etree.ElementTree import Element

import numpy as np
import shapely

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import MAX_INSTANCES, House, Item, Level, Opening, Source, StoredCamera
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.core.shown_text import shown
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.rooms import HINT, check_outlines
from pbrs_farm.read.common.source_files import Resources
from pbrs_farm.read.sweethome3d.door_cutouts import StandingWall
from pbrs_farm.read.sweethome3d.home_file.container import Container, open_container
from pbrs_farm.read.sweethome3d.home_file.home_xml import (
    HomePlan,
    HomeRoom,
    HomeWall,
    Paint,
    PlanLevel,
    PlanPiece,
    level_of,
)
from pbrs_farm.read.sweethome3d.home_file.parse_home import parse_plan
from pbrs_farm.read.sweethome3d.home_rooms import (
    CeilingHeights,
    ReadRoom,
    plane_items,
    read_rooms,
    room_nouns,
    rooms_between_walls,
    staircase_cuts,
)
from pbrs_farm.read.sweethome3d.open_doors import StandingPiece, opened_doors
from pbrs_farm.read.sweethome3d.piece_items import piece_item, piece_opening
from pbrs_farm.read.sweethome3d.piece_models import HomeMaterials, PieceModels
from pbrs_farm.read.sweethome3d.wall_solids import Outline, outlines_of, wall_items

MAX_WALLS: Final = 3_000
MAX_PIECES: Final = 10_000
MAX_CROSSINGS: Final = 500
"""Pairs of walls of a level whose centre lines cross; a home has a dozen."""

_Drawn = TypeVar("_Drawn", HomeRoom, HomeWall, PlanPiece)
_NO_ROOMS = "no walls enclose any; draw rooms (Plan > Create rooms) and save the home again"
_HIDDEN_ROOMS = "every room is on a level saved as hidden: --set read.hidden_levels=true"
SAME_LEVEL_M = 0.1  # levels no farther apart in height are versions of one
ETEKS_ATTRIBUTION = "home and models: E. and V. Puybaret / eTeks, CC-BY 3.0, modified"


def stored_cameras(plan: HomePlan) -> tuple[StoredCamera, ...]:
    """The author's viewpoints: direction (-sin yaw cos pitch, -sin pitch, cos yaw cos pitch)."""
    cameras = []
    for c in plan.cameras:
        x, y, z = c.at
        # Yaw turns from +y of the plan, which is +z of the world; pitch is positive downwards.
        level, down = math.cos(c.pitch), math.sin(c.pitch)
        towards = np.array([-math.sin(c.yaw) * level, -down, math.cos(c.yaw) * level])
        cameras.append(StoredCamera(c.name, np.array([x, z, y]), towards, c.hfov))
    return tuple(cameras)


def check_plan_bounds(plan: HomePlan, file: str) -> None:
    """Raise BadHouse for a plan whose visible levels have too many parts or excessive overlaps."""
    walls = _by_level(plan, plan.walls)
    pieces = [p for drawn in _by_level(plan, plan.pieces).values() for p in drawn]
    n_walls = sum(map(len, walls.values()))
    if n_walls > MAX_WALLS:
        raise BadHouse(file, "", f"{n_walls} walls, at most {MAX_WALLS} are read", hint=HINT)
    if len(pieces) > MAX_PIECES:
        text = f"{len(pieces)} pieces, at most {MAX_PIECES} are read{_commonest(pieces)}"
        raise BadHouse(file, "", text, hint=HINT)
    n_crossings = sum(_crossings(drawn) for drawn in walls.values())
    if n_crossings > MAX_CROSSINGS:
        text = f"walls cross {n_crossings} times, at most {MAX_CROSSINGS} crossings are built"
        raise BadHouse(file, "walls", text, hint=HINT)
    rooms = _by_level(plan, plan.rooms)
    check_outlines({level: [r.points for r in drawn] for level, drawn in rooms.items()}, file)


def _by_level(plan: HomePlan, drawn: Sequence[_Drawn]) -> dict[str, list[_Drawn]]:
    """Drawn elements of each visible level."""
    by_level: dict[str, list[_Drawn]] = {}
    for element in drawn:
        by_level.setdefault(element.level, []).append(element)
    return {level: ones for level, ones in by_level.items() if level_of(plan, level).is_visible}


def _commonest(pieces: Sequence[PlanPiece]) -> str:
    # Pieces duplicated by a program by the thousand share one name.
    name, n = max(Counter(p.name for p in pieces).items(), key=lambda row: row[1])
    return f"; {n} of them are called {shown(name)!r}" if 2 * n > len(pieces) else ""


def _crossings(walls: Sequence[HomeWall]) -> int:
    lines = [shapely.LineString([w.start, w.end]) for w in walls]
    pairs = shapely.STRtree(lines).query(lines, predicate="crosses")
    return int((pairs[0] < pairs[1]).sum())


def read_home(
    data: bytes,
    name: str,
    *,
    resources: Resources | None = None,
    fields: ReadFields | None = None,
    package: str = "",
    package_note: str = "",
) -> House:
    """Read a .sh3d archive or a bare Home.xml, unrepaired; deterministic.

    name: the file's, for messages and the house's id. resources: the program's own models, for
    files that refer to them. package: origin of the file; package_note: its irregularities
    (homes_package.Package). Raises BadHouse, naming the file and the place.
    """
    container = open_container(data, PurePath(name).name, resources)
    sha256, fields = keys.sha256(data), fields or ReadFields()
    return house_from_container(
        container, name, sha256, fields, package=package, package_note=package_note
    )


def house_from_container(
    container: Container,
    name: str,
    sha256: str,
    fields: ReadFields,
    *,
    package: str = "",
    package_note: str = "",
) -> House:
    """Like read_home, for an opened home file; sha256: identity of the home."""
    file = PurePath(name).name
    notes = Notes(file, strict=fields.strict)
    plan = _read_plan(container.root, file, fields, notes)
    if package_note:
        notes.add("package-version", package, package_note)
    # Read walls and rooms in plan; without a room there is nothing to render.
    materials = HomeMaterials(container.contents, notes)
    house_level = _house_levels(plan, notes)
    outlines = outlines_of(plan.walls)
    rooms = read_rooms(plan, materials, house_level)
    if not rooms and not plan.rooms:
        # Nobody drew rooms: they are what walls enclose.
        plan = replace(plan, rooms=rooms_between_walls(plan, outlines))
        rooms = read_rooms(plan, materials, house_level)
        if rooms:
            notes.add("rooms-from-walls", file, f"no rooms are drawn: {len(rooms)} between walls")
    if not rooms:
        raise BadHouse(file, "", "no rooms", hint=_why_no_rooms(plan))
    # Build walls, floors and ceilings; staircases cut the last two.
    ceilings = CeilingHeights(plan, outlines)
    cuts = staircase_cuts(plan, materials, house_level)  # of floors, of ceilings
    structure = wall_items(plan, outlines, materials, house_level)
    structure += plane_items(rooms, ceilings, materials, *cuts)
    # Place the furniture last: it needs rooms, and cuts walls.
    models = PieceModels(materials, file, fields.max_model_triangles, container.parsed)
    pieces, openings = _read_pieces(
        plan, models, materials, outlines, rooms, house_level, file, fields
    )
    items = _numbered((*structure, *pieces), file)
    stem = PurePath(file).stem
    return House(
        id=keys.house_id(stem, sha256),
        name=PurePath(plan.name).stem or stem,
        source=_source_of_plan(plan, file, sha256, package),
        levels=_levels_of_plan(plan, house_level),
        rooms=room_nouns(rooms, ceilings),
        items=items,
        materials=materials.library.materials,
        textures=materials.library.textures,
        openings=openings,
        cameras=stored_cameras(plan),
        notes=notes.all(),
    )


def _read_plan(root: Element, file: str, fields: ReadFields, notes: Notes) -> HomePlan:
    """The plan without hidden levels; implausible plans are rejected."""
    plan = _shown(parse_plan(root, file, fields.max_extent_m), fields, notes)
    check_plan_bounds(plan, file)
    return plan


def _numbered(items: tuple[Item, ...], file: str) -> tuple[Item, ...]:
    """The items; BadHouse for more than there are instance ids."""
    if len(items) > MAX_INSTANCES:
        raise BadHouse(file, "", f"{len(items)} items, at most {MAX_INSTANCES} have instance ids")
    return items


def _shown(plan: HomePlan, fields: ReadFields, notes: Notes) -> HomePlan:
    """The plan with hidden levels made visible: all if the recipe says so, else those between.

    A level between shown ones was hidden to draw, or to look below it: the rooms under it would
    have no ceiling. Hidden levels at either end (roofs, foundations) stay hidden, and so do second
    versions of a shown level at its height.
    """
    shown = [x.elevation for x in plan.levels if x.is_visible]

    def is_between(x: PlanLevel) -> bool:
        is_apart = all(abs(x.elevation - y) > SAME_LEVEL_M for y in shown)
        return bool(shown) and min(shown) < x.elevation < max(shown) and is_apart

    levels = []
    for level in plan.levels:
        is_added = not level.is_visible and (fields.hidden_levels or is_between(level))
        if is_added and not fields.hidden_levels:
            text = "not visible, but between levels that are: read"
            notes.add("hidden-level", _place_of(level), text)
        levels.append(replace(level, is_visible=level.is_visible or is_added))
    return replace(plan, levels=tuple(levels))


def _why_no_rooms(plan: HomePlan) -> str:
    is_hidden = any(not level_of(plan, room.level).is_visible for room in plan.rooms)
    return _HIDDEN_ROOMS if is_hidden else _NO_ROOMS


def _place_of(level: PlanLevel) -> str:
    return f"level {level.id} '{level.name}'"


def _levels_of_plan(plan: HomePlan, house_level: dict[str, str]) -> tuple[Level, ...]:
    if not plan.levels:
        return (Level("0", "", 0.0, plan.wall_height),)
    return tuple(
        Level(house_level[x.id], x.name, x.elevation, x.height, x.floor_thickness)
        for x in plan.levels
        if x.is_visible
    )


def _house_levels(plan: HomePlan, notes: Notes) -> dict[str, str]:
    """The home's level id -> the House's; hidden levels are noted and left out."""
    for level in plan.levels:
        if not level.is_visible:
            text = "not visible: left out (read.hidden_levels)"
            notes.add("hidden-level", _place_of(level), text)
    visible = [level for level in plan.levels if level.is_visible]
    return {level.id: str(k) for k, level in enumerate(visible)} | {"": "0"}


def _read_pieces(
    plan: HomePlan,
    models: PieceModels,
    materials: HomeMaterials,
    outlines: dict[str, Outline],
    rooms: list[ReadRoom],
    house_level: dict[str, str],
    file: str,
    fields: ReadFields,
) -> tuple[list[Item], tuple[Opening, ...]]:
    walls = _standing_walls(plan, outlines)
    cutter_material = materials.painted(Paint(), "cut", "")
    placed_pieces: list[StandingPiece] = []
    openings: list[Opening] = []
    n_faces = n_pieces = 0
    for number, piece in enumerate(plan.pieces):
        level = level_of(plan, piece.level)
        if not level.is_visible:
            continue
        n_pieces += 1
        ids = (f"piece_{number}", house_level[level.id])
        placed = piece_item(piece, level, models, materials, ids, rooms)
        if placed is None:
            continue
        item, frame = placed
        # Stop at the limit of triangles rather than at the end of memory.
        n_faces += item.n_faces
        if n_faces > fields.max_triangles:
            raise BadHouse(
                file,
                piece.place,
                f"more than {fields.max_triangles} triangles in the house",
                hint="raise read.max_triangles",
            )
        placed_pieces.append(StandingPiece(piece, level, item, frame))
        opening = piece_opening(piece, item, frame, walls, materials, cutter_material)
        if opening is not None:
            openings.append(opening)
    # A home that lost all its models is no home to render.
    missing = materials.notes.count("missing-model")
    if n_pieces and missing and not placed_pieces:
        raise BadHouse(
            file,
            "",
            f"none of its {n_pieces} models can be found",
            hint="save the home as .sh3d with its contents, or fetch the program's: pbrs-farm homes",
        )
    if fields.doors == "open":
        return opened_doors(placed_pieces, models, materials, rooms, walls), tuple(openings)
    return [placed.item for placed in placed_pieces], tuple(openings)


def _standing_walls(plan: HomePlan, outlines: dict[str, Outline]) -> list[StandingWall]:
    walls = []
    for wall in plan.walls:
        level = level_of(plan, wall.level)
        if wall.id not in outlines or not level.is_visible:
            continue
        # Tell doors of the wall's plan, its heights and its baseboard.
        polygon = shapely.make_valid(shapely.Polygon(outlines[wall.id].polygon))
        board = max((b.thickness for b in wall.baseboards), default=0.0)
        top = level.elevation + max(wall.height, wall.height_end or 0.0)
        walls.append(StandingWall(wall, polygon, level.elevation - level.reach_down, top, board))
    return walls


def _source_of_plan(plan: HomePlan, file: str, sha: str, package: str) -> Source:
    author = plan.properties.get("Author", "")
    licence = plan.properties.get("License", "")
    owner = f"{author} {plan.properties.get('Copyright', '')}".lower()
    if "puybaret" in owner and "CC-BY" in licence:
        attribution = ETEKS_ATTRIBUTION
    else:
        attribution = ", ".join(x for x in (author, licence) if x)
    return Source("sweethome3d", file, sha, package, author, licence, attribution)
