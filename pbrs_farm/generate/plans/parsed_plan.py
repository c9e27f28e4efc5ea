"""A home as read from a plan file, before walls are built: storeys of rooms, openings, items; frozen values.

Plans of other programs have various frames; here x runs to the right, z downwards on the page, in
metres, as in a Plan. Angles are about +y: at 0 a front faces +z.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry import MultiPolygon, Polygon

from pbrs_farm.generate.plan_walls import largest_rectangle
from pbrs_farm.generate.plans.wall_tops import WallTop

MAX_THINGS: Final = 3_000
_FILLED: Final = 0.85  # a shape that fills less of its rectangle is made of several boxes
_MOST_CORNERS: Final = 12  # maximum corners of a shape cut into boxes
_LEAST_BOX_M2: Final = 0.08


class Thing(NamedTuple):
    """Something of which a file gives name and box alone."""

    vocabulary: str  # whose word the name is (read/common/given_classes.csv)
    name: str
    x: float  # of its middle
    z: float
    low: float  # its lower edge above the storey's floor
    width: float
    depth: float
    height: float
    turn_rad: float
    is_front_given: bool = False


@dataclass(frozen=True)
class ParsedStorey:
    """A storey in the form of this project's plan JSON, and its items."""

    value: dict[str, Any]
    things: tuple[Thing, ...] = ()
    name: str = ""
    tops: tuple[WallTop, ...] = ()  # of all walls where one is sloped, below a roof; () = level


@dataclass(frozen=True)
class ParsedPlan:
    """All storeys from below, and notes about omitted content, one line each."""

    storeys: tuple[ParsedStorey, ...]
    left_out: tuple[str, ...] = ()


@dataclass
class LeftOut:
    """Collects notes about omitted content, grouped by kind; state: its counts."""

    counts: dict[str, int] = field(default_factory=dict)
    first: dict[str, str] = field(default_factory=dict)

    def add(self, what: str, place: str = "") -> None:
        """Record an omission at a place of the file; equal sentences become one line with a count."""
        self.counts[what] = self.counts.get(what, 0) + 1
        self.first.setdefault(what, place)

    def lines(self) -> tuple[str, ...]:
        """A line a kind, with the first place."""
        texts = []
        for text, n in self.counts.items():
            place = f"{self.first[text]}: " if self.first[text] and n == 1 else ""
            texts.append(f"{place}{text}" + (f" ({n} times)" if n > 1 else ""))
        return tuple(texts)


class Footprint(NamedTuple):
    """A rectangle on the floor: width along the direction that turn_rad gives its right side."""

    x: float
    z: float
    width: float
    depth: float
    turn_rad: float


def footprint(shape: Polygon) -> Footprint:
    """Middle, sizes (the longer first), angle about +y of the least rectangle around a shape; zeros without area."""
    corners = shapely.get_coordinates(shape.minimum_rotated_rectangle)
    if len(corners) < 4:
        x, z = shape.centroid.coords[0]
        return Footprint(x, z, 0.0, 0.0, 0.0)
    a, b = corners[1] - corners[0], corners[2] - corners[1]
    long, short = (a, b) if np.hypot(*a) >= np.hypot(*b) else (b, a)
    middle = corners[:4].mean(0)
    # The right side of an item rotated by t points to (cos t, -sin t).
    turn = math.atan2(-float(long[1]), float(long[0]))
    return Footprint(
        float(middle[0]), float(middle[1]), float(np.hypot(*long)), float(np.hypot(*short)), turn
    )


def footprints(shape: Polygon) -> list[Footprint]:
    """The one to four rectangles of a shape, such as an L or a U; its own if nearly full or very complex."""
    whole = footprint(shape)
    ground = largest_part(shape.simplify(0.03)) or shape
    area = whole.width * whole.depth
    if area <= 0 or shape.area > _FILLED * area or len(ground.exterior.coords) > _MOST_CORNERS:
        return [whole]
    # Rotate it upright, and repeatedly take the largest rectangle of the remainder.
    upright: Polygon | None = largest_part(
        affinity.rotate(ground, whole.turn_rad, (0, 0), use_radians=True)
    )
    boxes: list[Footprint] = []
    while len(boxes) < 4 and upright is not None and upright.area > _LEAST_BOX_M2:
        x0, z0, x1, z1 = largest_rectangle(upright)
        if (x1 - x0) * (z1 - z0) < _LEAST_BOX_M2:
            break
        back = affinity.rotate(
            shapely.box(x0, z0, x1, z1), -whole.turn_rad, (0, 0), use_radians=True
        )
        boxes.append(footprint(back))
        upright = largest_part(upright.difference(shapely.box(x0, z0, x1, z1).buffer(1e-6)))
    return boxes or [whole]


def largest_part(shape: object) -> Polygon | None:
    """The largest polygon of a shape; None if it has none."""
    if isinstance(shape, Polygon):
        return None if shape.is_empty else shape
    parts = getattr(shape, "geoms", ())
    polygons = [p for p in parts if isinstance(p, Polygon | MultiPolygon)]
    flat = [q for p in polygons for q in (p.geoms if isinstance(p, MultiPolygon) else [p])]
    return max(flat, key=lambda p: p.area, default=None)


def ring_of(shape: Polygon) -> list[list[float]]:
    """The corners of a polygon as a plan's JSON has them."""
    return [[float(x), float(z)] for x, z, *_ in shape.exterior.coords[:-1]]


def opening(
    shape: Footprint, kind: str, *, sill: float | None = None, height: float | None = None
) -> dict[str, Any]:
    """The row of a door or window by its ground, the longer side its width; missing sill or height left out."""
    row: dict[str, Any] = {"at": [shape.x, shape.z], "width": shape.width, "kind": kind}
    if height is not None:
        row["height"] = height
    if sill is not None:
        row["sill"] = sill
    return row


def value_of(
    rooms: Sequence[dict[str, Any]],
    openings: Iterable[dict[str, Any]],
    height: float,
    walls: Sequence[dict[str, Any]] = (),
) -> dict[str, Any]:
    """A storey as this project's plan JSON; height clamped to 2 to 6 m, or 2.6 m if not a number."""
    rows = list(openings)
    glazed = ("window", "french_window")
    return {
        "height": min(max(height, 2.0), 6.0) if math.isfinite(height) else 2.6,
        "rooms": list(rooms),
        "walls": list(walls),
        "doors": [row for row in rows if row["kind"] not in glazed],
        "windows": [row for row in rows if row["kind"] in glazed],
    }
