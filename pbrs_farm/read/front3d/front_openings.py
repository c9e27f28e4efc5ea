"""Doors and windows in the holes of a 3D-FRONT house: by door list, titles, hole meshes; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.read.common.doors_and_windows import Hole, Style, merge_holes
from pbrs_farm.read.common.given_classes import given_class
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.front3d.front_file import FrontFile, FrontPiece
from pbrs_farm.read.front3d.front_walls import WallPiece

HOLE_TYPES: Final = ("Door", "Window", "Hole", "BayWindow")
_NEAR_M: Final = 0.4  # maximum distance from a hole to its piece, metres
_LEAST_SILL_M: Final = 0.25
_FLAT_M: Final = 0.1  # a lower hole mesh is a threshold
_MAX_NAMED: Final = 2_000  # doors and windows of a house; a home has a dozen
_WIDE_M: Final = 1.6  # a wider untold hole to the outside is a window


@dataclass(frozen=True, slots=True, eq=False)
class _NamedOpening:
    at: F64  # (3,) its middle
    kind: Literal["door", "window", "open"]
    title: str
    rank: int  # the lowest goes first
    is_entry: bool = False
    hinge: str = ""
    is_mirrored: bool = False
    box: F64 | None = None  # (2, 3) of a hole mesh


def is_opening(piece: FrontPiece) -> bool:
    """Whether a piece of furniture is a door or a window: their models were never released."""
    title_class = given_class("3dfront-title", piece.title)
    return title_class is not None and title_class.kind in ("door", "window")


def holes_with_names(
    house: FrontFile, holes: Sequence[tuple[Hole, WallPiece]], notes: Notes
) -> list[Hole]:
    """Every hole once, with kind, style and hinge; openings in the furniture without a hole become notes."""
    named = _openings_by_name(house)[:_MAX_NAMED]
    results = []
    for hole, piece in holes:
        results.append(_kinded(hole, piece, _best(hole, named)))
    results = merge_holes(sorted(results, key=lambda h: h.kind == "open"))
    # A hole mesh without a gap behind it cuts the wall itself.
    extra = []
    for opening in named:
        if opening.box is not None and not any(_stands_in(opening, hole) for hole in results):
            extra.append(_of_mesh(opening, named))
    merged = merge_holes([*results, *extra])
    for opening in named:
        if opening.box is None and not any(_stands_in(opening, hole) for hole in merged):
            x, y, z = (round(float(v), 2) for v in opening.at)
            text = f"{opening.title} is in no hole of a wall; it is left out"
            notes.add("opening-without-wall", f"({x}, {y}, {z})", text)
    return merged


def _openings_by_name(house: FrontFile) -> list[_NamedOpening]:
    doors = {ref: door for door in house.doors for ref in door.refs}
    named_openings = []
    for mesh in house.meshes:
        low, high = mesh.points.min(0), mesh.points.max(0)
        if mesh.kind not in HOLE_TYPES or high[1] - low[1] < _FLAT_M:
            continue
        door = doors.get(mesh.uid)
        kind: Literal["door", "window", "open"] = "window"
        if door is not None or mesh.kind in ("Door", "Hole"):
            kind = "door" if door is not None or mesh.kind == "Door" else "open"
        named_openings.append(
            _NamedOpening(
                (low + high) / 2,
                kind,
                mesh.kind,
                2 if door is None else 0,
                door is not None and door.is_entry,
                "" if door is None else door.hinge,
                box=None if mesh.kind == "BayWindow" else np.array([low, high]),
            )
        )
    for piece in house.pieces:
        if not is_opening(piece) and piece.uid not in doors:
            continue
        title_class = given_class("3dfront-title", piece.title)
        height = (piece.size[1] if piece.size else 2.0) * float(abs(piece.scale[1]))
        middle = piece.world_from_model[:3, 3] + np.array([0.0, height / 2, 0.0])
        door = doors.get(piece.uid)
        is_window = title_class is not None and title_class.kind == "window"
        named_openings.append(
            _NamedOpening(
                middle,
                "window" if is_window else "door",
                piece.title,
                0 if door else 1,
                bool(door and door.is_entry) or "entry" in piece.title,
                door.hinge if door else "",
                is_mirrored=bool(piece.scale[0] < 0),
            )
        )
    return named_openings


def _best(hole: Hole, named: Sequence[_NamedOpening]) -> _NamedOpening | None:
    """The best source for a hole: the door list, a title, a mesh; else the nearest piece with a title."""
    near = [t for t in named if _stands_in(t, hole)]
    best = min(near, key=lambda t: (t.rank, _away(t, hole)), default=None)
    titled = min(
        (t for t in near if "/" in t.title), key=lambda t: (t.rank, _away(t, hole)), default=None
    )
    if best is None or titled is None:
        return best
    hinge = best.hinge or titled.hinge
    return replace(best, title=titled.title, is_mirrored=titled.is_mirrored, hinge=hinge)


def _local(named: _NamedOpening, hole: Hole) -> F64:
    return np.asarray(np.abs((named.at - hole.centre) @ hole.axes), np.float64)


def _stands_in(named: _NamedOpening, hole: Hole) -> bool:
    along, up, across = _local(named, hole)
    half = np.array(hole.size) / 2
    return bool(along < half[0] + 0.1 and up < half[1] + 0.5 and across < half[2] + _NEAR_M)


def _away(named: _NamedOpening, hole: Hole) -> float:
    return float(np.linalg.norm(_local(named, hole)[[0, 2]]))


def _kinded(hole: Hole, piece: WallPiece, named: _NamedOpening | None) -> Hole:
    width, _, _ = hole.size
    sill = float(hole.centre[1] - hole.size[1] / 2 - piece.sheet.bounds[1])
    if named is not None:
        return _with_name_of(hole, named)
    if sill > _LEAST_SILL_M:
        return replace(hole, kind="window", source_class="Window")
    if piece.is_outside:
        return replace(hole, kind="door" if width < _WIDE_M else "window")
    return replace(hole, source_class="Hole")


def _with_name_of(hole: Hole, named: _NamedOpening) -> Hole:
    title = named.title.lower()
    style: Style = "swing"
    if "sliding" in title:
        style = "sliding"
    elif "folding" in title:
        style = "folding"
    elif "double" in title:
        style = "double"
    name = named.kind if named.kind != "door" else "front door" if named.is_entry else "door"
    return replace(
        hole,
        kind=named.kind,
        name=name,
        source_class=named.title,
        style=style,
        is_glazed="sliding" in title or "door window" in title or "glass" in title,
        is_hinged_right=named.hinge.endswith("Right") != named.is_mirrored,
    )


def _of_mesh(named: _NamedOpening, every: Sequence[_NamedOpening]) -> Hole:
    """The hole framed by a mesh of jambs: its thinner horizontal side is across the wall."""
    assert named.box is not None
    low, high = named.box
    width, height, depth = (float(v) for v in high - low)
    axes = np.eye(3)
    if width < depth:
        axes = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        width, depth = depth, width
    hole = Hole(
        f"jambs_{named.at[0]:.2f}_{named.at[2]:.2f}",
        "open",
        (low + high) / 2,
        (width, height, depth),
        axes,
    )
    return _with_name_of(hole, _best(hole, every) or named)
