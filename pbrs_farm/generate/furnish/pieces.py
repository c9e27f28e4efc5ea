"""Pieces of a catalogue by group and size, in one order of preference per home; no effects but caches.

The depth that a chair fits under a table follows from depth maps of both along the direction of motion: per cell of
8 mm, how far the chair extends and where the table begins. They touch at the minimum difference, for any position along the
edge, so each side of a table is rendered once.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.catalogue import Catalogue, Piece, Shape
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import corners_of_surfaces
from pbrs_farm.core.mesh import triangle_corners
from pbrs_farm.generate.furnish.template import Liking, PieceSlot, Template
from pbrs_farm.geometry.surface_points import surface_points

STYLES: Final = {
    "mixed": "",
    "nordic": "simple clear white wooden wood oak beige mid century junior nordic pastel",
    "modern": "modern glass metal black led flat office design table4 bed3 grey loft",
    "classic": "winchester antique iron oak cushion tablecloth grand chandelier captains armchair3 classic country elegant",
    "vintage": "mid century thonet iron leather burlap osaka wood bohemian mediterranean",
}
"""Style -> words of pieces that such a home likes."""

_LIKED: Final = 0.6  # how far up the order of preference (0 to 1) a word of the style moves a piece

_UNFIT: Final = frozenset(
    [
        "eTeks#loftBed140x190",
        "eTeks#cornerBunkBed90x190",
        "Scopia#mezzanine-bed",  # a house's own frame round them
        "Scopia#day_bed_frame",  # without a mattress
        "Scopia#futon",
        "BlendSwap-CC-0#babyRockingBed",
        "BlendSwap-CC-0#technicalTable1",  # a drawing board
        "Scopia#chest-freezer",
        "BlendSwap-CC-BY#bunkBed",  # its model cannot be read
    ]
)
"""Pieces that templates cannot use, each looked at."""
MAX_CHOICES = 6  # preferred pieces of a kind to try at every place


def style_of(name: str, rng: np.random.Generator) -> str:
    """The style of that name, or one by seed (drawn in any case); BadInput for an unknown one."""
    if name and name not in STYLES:
        raise BadInput("--style", name, "no such style", hint=f"one of {', '.join(STYLES)}")
    drawn = sorted(STYLES)[int(rng.integers(len(STYLES)))]
    return name or drawn


class Shelf:
    """A catalogue in the order of one home's preference."""

    def __init__(self, catalogue: Catalogue, rng: np.random.Generator, style: str = "") -> None:
        self.catalogue = catalogue
        liked = set(STYLES.get(style, "").split())
        self._order: dict[str, float] = {}
        for piece, key in zip(
            catalogue.pieces, rng.random(len(catalogue.pieces)).tolist(), strict=True
        ):
            words = set(re.findall(r"[a-z0-9]+", f"{piece.id} {piece.name}".lower()))
            self._order[piece.id] = key - _LIKED * bool(words & liked)
        self._tops: dict[str, float] = {}

    def of(
        self,
        *groups: str,
        width: tuple[float, float] = (0.0, 9.0),
        depth: tuple[float, float] = (0.0, 9.0),
        height: tuple[float, float] = (0.0, 9.0),
        without: str = "",
    ) -> list[Piece]:
        """Pieces of the catalogue of some groups and sizes, the preferred one first.

        groups: of the catalogue, `bed`, `wardrobe`. width, depth, height: (least, most) metres, both
        included. without: words with blanks between that neither id nor name may hold. Two calls with equal
        arguments give equal lists: a home has one order of preference.
        """
        ranges = width, depth, height
        aside = set(without.split())
        pieces = [
            p
            for p in self.catalogue.of(*groups)
            if p.id not in _UNFIT
            and all(low <= x <= high for (low, high), x in zip(ranges, p.size, strict=True))
            and not aside & set(re.findall(r"[a-z0-9]+", f"{p.id} {p.name}".lower()))
        ]
        return sorted(pieces, key=lambda p: (self._order[p.id], p.id))

    def likes(self, piece: Piece, share: float) -> bool:
        """Whether the home is of the share that likes a piece."""
        return self._order[piece.id] < share

    def top(self, piece: Piece) -> float:
        """Height of the supporting surface in a piece's centre above its base, metres."""
        if piece.id not in self._tops:
            self._tops[piece.id] = self._top(piece)
        return self._tops[piece.id]

    def under_m(self, chair: Piece, table: Piece, at: float, turns: int, most_m: float) -> float:
        """Depth that a chair can be pushed under an edge of a table, at most most_m.

        at: offset of its centre from that of the edge, metres along the chair's width. turns: quarter
        turns of the chair to the left relative to the table, as in slot. Returns most_m if either has no
        shape.
        """
        seat, top = self.catalogue.shape(chair), self.catalogue.shape(table)
        if seat is None or top is None:
            return most_m
        return way_under_m(seat, top, at, turns, most_m)

    def _top(self, piece: Piece) -> float:
        shape = self.catalogue.shape(piece)
        if shape is None:
            return piece.size[2]
        corners = np.concatenate([triangle_corners(s.positions, s.faces) for s in shape.surfaces])
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(normals, axis=1)
        level = normals[:, 1] > 0.95 * np.maximum(size, 1e-12)
        # Take the highest level that covers a fifth of the piece's ground.
        heights, areas = corners[level].mean(1)[:, 1], size[level] / 2
        order = np.argsort(-heights)
        top_area = 0.2 * piece.size[0] * piece.size[1]
        for k in order:
            is_level = np.abs(heights - heights[k]) < 0.005
            if areas[is_level].sum() >= top_area:
                return float(heights[k])
        return piece.size[2]


def slot(
    piece: Piece,
    u: float,
    v: float,
    *,
    turns: int = 0,
    elevation: float = 0.0,
    size: tuple[float, float, float] | None = None,
) -> PieceSlot:
    """A piece in the frame of a template, with the middle of its ground at (u, v).

    u: along the wall to the right, v: away from it, metres; turns: quarter turns of the piece to the
    left; elevation: of its lower edge; size: (width, depth, height) where it is another than its own.
    """
    w, d, h = size or piece.size
    return PieceSlot(piece, u, v, w, d, h, elevation, turns)


def backed(
    piece: Piece,
    u: float = 0.0,
    *,
    gap: float = 0.02,
    elevation: float = 0.0,
    size: tuple[float, float, float] | None = None,
) -> PieceSlot:
    """A piece with its back at the wall of a template.

    u: of its middle along the wall; gap: between its back and the wall, metres; the rest as in slot.
    """
    depth = (size or piece.size)[1]
    return slot(piece, u, gap + depth / 2, elevation=elevation, size=size)


def single(
    piece: Piece,
    *,
    before: float = 0.6,
    corner: float = 0.3,
    rank: float = 0.0,
    daylight: float = 0.0,
    size: tuple[float, float, float] | None = None,
    gap: float = 0.02,
    elevation: float = 0.0,
    beside: float = 0.0,
) -> Template:
    """A template of one piece with its back at a wall and `before` metres free in front.

    before: 0 = nothing need be free; from 0.4 on somebody must be able to walk there. corner, daylight:
    how much it likes a corner, and a window, -1 to 1. rank: added to the score of each of its places.
    beside: metres that stay free at either side. gap, elevation, size: as in backed.
    """
    w, d, _ = size or piece.size
    half, front = w / 2 + beside, d + gap
    clear = ((-half, gap if beside else front, half, front + before),) if before else ()
    reach = ((-w / 2, front + 0.05, w / 2, front + max(before, 0.6)),) if before >= 0.4 else ()
    return Template(
        piece.group,
        (backed(piece, gap=gap, elevation=elevation, size=size),),
        clear,
        reach,
        rank=rank,
        liking=Liking(corner=corner, daylight=daylight),
    )


_CELL_M: Final = 0.008
_SPACING_M: Final = 0.008  # of points: a leg covers cells enough where one of them is empty
_QUARTER: Final = np.array([1.0, 1.0, -1.0])
_APART_M: Final = 0.004  # at which a chair stops before the table


class _Depths(NamedTuple):
    """Depths in metres by cells across the way: x, then height. Where nothing is they are infinite."""

    first: tuple[int, int]  # number of the first cell
    depths: F64
    inner: Bools  # cells that count: a chair's rim may graze


def way_under_m(chair: Shape, table: Shape, at: float, turns: int, most_m: float) -> float:
    """Metres, at most most_m, that a chair's front goes beyond a table's edge; turns: quarters to the left."""
    return min(_way_m(chair, table, round(at / _CELL_M), turns % 4, most_m), most_m)


@lru_cache(maxsize=65536)
def _way_m(chair: Shape, table: Shape, at: int, turns: int, most_m: float) -> float:
    front, near = _front(chair), _near(table, turns, most_m)
    # Cells that both have, counted from the chair's middle.
    begins = np.array(near.first) - [at, 0]
    low = np.maximum(front.first, begins)
    high = np.minimum(
        np.array(front.first) + front.depths.shape, begins + np.array(near.depths.shape)
    )
    if (low >= high).any():
        return np.inf
    a, b = (tuple(map(slice, low - first, high - first)) for first in (front.first, begins))
    distances = np.where(front.inner[a], near.depths[b] - front.depths[a], np.inf)
    return max(float(distances.min()) - _APART_M, 0.0)


@lru_cache(maxsize=512)
def _front(chair: Shape) -> _Depths:
    """Extent of a chair relative to its front, at most 0: chairs face +z."""
    corners = corners_of_surfaces(chair.surfaces)
    points = surface_points(corners, _SPACING_M)
    first, depths = _greatest(points, points[:, 2] - corners[..., 2].max())
    covered = ndimage.binary_closing(np.isfinite(depths))
    return _Depths(first, depths, ndimage.binary_erosion(covered) & np.isfinite(depths))


@lru_cache(maxsize=512)
def _near(table: Shape, turns: int, most_m: float) -> _Depths:
    """Where a table begins behind an edge, seen by a chair there, mostly cells within most_m."""
    corners = corners_of_surfaces(table.surfaces)
    box = np.stack([corners.min((0, 1)), corners.max((0, 1))])
    # Take the points near the edge alone.
    end, axis = ((0, 2), (1, 0), (1, 2), (0, 0))[turns]
    slab = box + np.array([[-1.0], [1.0]])
    reach = most_m + _APART_M + _CELL_M
    slab[1 - end, axis] = box[end, axis] + (-reach if end else reach)
    points = surface_points(corners, _SPACING_M, slab)
    for _ in range(turns):
        # A quarter turn, without a rounding: z takes the place of x, -x that of z.
        points, box = (rows[:, [2, 1, 0]] * _QUARTER for rows in (points, box))
    first, depths = _greatest(points, box[:, 2].min() - points[:, 2])
    return _Depths(first, -depths, np.isfinite(depths))


def _greatest(points: F64, values: F64) -> tuple[tuple[int, int], F64]:
    """The first cell and the greatest value in each; an empty rim of two cells around them."""
    cells = np.floor(points[:, :2] / _CELL_M).astype(np.int64)
    first = cells.min(0) - 2
    greatest = np.full(tuple(cells.max(0) - first + 3), -np.inf)
    # One index: numpy's fast way.
    np.maximum.at(greatest.reshape(-1), (cells - first) @ [greatest.shape[1], 1], values)
    return (int(first[0]), int(first[1])), greatest
