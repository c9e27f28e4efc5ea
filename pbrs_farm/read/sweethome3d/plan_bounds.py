"""What a plan may hold, so that its repair ends within seconds; no effects.

A home has some dozen rooms and walls; what is far beyond it, or drawn over itself a hundred times,
is refused by a line before any of it is built.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final, TypeVar

import shapely

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.shown_text import shown
from pbrs_farm.read.common.room_bounds import HINT, check_outlines
from pbrs_farm.read.sweethome3d.home_file.home_xml import (
    Plan,
    PlanPiece,
    PlanRoom,
    PlanWall,
    level_of,
)

MAX_WALLS: Final = 3_000
MAX_PIECES: Final = 10_000
MAX_CROSSINGS: Final = 500
"""Pairs of walls of a level whose centre lines cross; a home has a dozen."""

_Drawn = TypeVar("_Drawn", PlanRoom, PlanWall, PlanPiece)


def check_plan_bounds(plan: Plan, file: str) -> None:
    """Raise BadHouse, naming the file, for a plan of too many parts, or drawn over itself.

    Levels that are left out count for nothing.
    """
    walls = _by_level(plan, plan.walls)
    pieces = [p for found in _by_level(plan, plan.pieces).values() for p in found]
    n_walls = sum(map(len, walls.values()))
    if n_walls > MAX_WALLS:
        raise BadHouse(file, "", f"{n_walls} walls, at most {MAX_WALLS} are read", hint=HINT)
    if len(pieces) > MAX_PIECES:
        text = f"{len(pieces)} pieces, at most {MAX_PIECES} are read{_commonest(pieces)}"
        raise BadHouse(file, "", text, hint=HINT)
    n_crossings = sum(_crossings(found) for found in walls.values())
    if n_crossings > MAX_CROSSINGS:
        text = f"walls cross {n_crossings} times, at most {MAX_CROSSINGS} crossings are built"
        raise BadHouse(file, "walls", text, hint=HINT)
    rooms = _by_level(plan, plan.rooms)
    check_outlines({level: [r.points for r in found] for level, found in rooms.items()}, file)


def _by_level(plan: Plan, drawn: Sequence[_Drawn]) -> dict[str, list[_Drawn]]:
    """What is drawn on each level that is shown."""
    found: dict[str, list[_Drawn]] = {}
    for one in drawn:
        found.setdefault(one.level, []).append(one)
    return {level: ones for level, ones in found.items() if level_of(plan, level).is_visible}


def _commonest(pieces: Sequence[PlanPiece]) -> str:
    # What a program copied by the thousand bears one name.
    name, n = max(Counter(p.name for p in pieces).items(), key=lambda row: row[1])
    return f"; {n} of them are called {shown(name)!r}" if 2 * n > len(pieces) else ""


def _crossings(walls: Sequence[PlanWall]) -> int:
    lines = [shapely.LineString([w.start, w.end]) for w in walls]
    pairs = shapely.STRtree(lines).query(lines, predicate="crosses")
    return int((pairs[0] < pairs[1]).sum())
