"""What furniture rooms usually have beside the largest pieces, and of which sizes; no effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from pbrs_farm.core.classes import BED, BOOKSHELF, CABINET, DESK, DRESSER, NIGHT_STAND, SHELVES
from pbrs_farm.dress.generated import case_goods, tables
from pbrs_farm.dress.generated.assembly import Made
from pbrs_farm.dress.generated.carcass import Boards, Size
from pbrs_farm.dress.space.room_kinds import RoomKind

Maker = Callable[[np.random.Generator, Boards, Size], Made]
Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of furniture that stands at a wall."""

    make: Maker
    width: Range
    height: Range
    depth: Range
    before_m: float = 0.55  # free floor in front of it
    alike: tuple[int, ...] = ()  # NYU40 ids: a room that has one wants less of it
    groups: tuple[str, ...] = ()  # of the catalogue
    beside: int | None = None  # it stands beside a thing of that class


def _nightstand(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    return case_goods.chest(rng, boards, size, nyu40=NIGHT_STAND)


def _cubes(rng: np.random.Generator, boards: Boards, size: Size) -> Made:
    columns = max(1, int(size[0] / 0.36))
    rows = min(max(1, int(size[1] / 0.36)), 5 if columns > 1 else 4)
    return case_goods.cube_shelf(boards, columns, rows)


KINDS: Final[Mapping[str, Kind]] = MappingProxyType({
    "bookcase": Kind(case_goods.bookcase, (0.4, 1.7), (1.7, 2.15), (0.24, 0.31), 0.25, (BOOKSHELF,), ("bookcase",)),
    "low bookcase": Kind(case_goods.bookcase, (0.45, 1.4), (0.8, 1.15), (0.24, 0.31), 0.25, (BOOKSHELF, SHELVES)),
    "cubes": Kind(_cubes, (0.45, 1.5), (0.75, 1.9), (0.38, 0.38), 0.3, (SHELVES,)),
    "rack": Kind(case_goods.rack, (0.4, 1.1), (1.5, 1.95), (0.27, 0.38), 0.25, (SHELVES,), ("shelves",)),
    "chest": Kind(case_goods.chest, (0.5, 1.3), (0.74, 1.05), (0.38, 0.47), 0.35, (DRESSER,), ("dresser",)),
    "sideboard": Kind(case_goods.sideboard, (0.9, 1.8), (0.7, 0.88), (0.36, 0.44), 0.4, (CABINET, DRESSER)),
    "wardrobe": Kind(case_goods.wardrobe, (0.8, 1.9), (1.9, 2.2), (0.5, 0.6), 0.45, (CABINET,), ("wardrobe",)),
    "tall cabinet": Kind(case_goods.tall_cabinet, (0.3, 0.45), (1.6, 1.95), (0.26, 0.34), 0.3, (CABINET,)),
    "shoe cabinet": Kind(case_goods.shoe_cabinet, (0.5, 1.0), (0.8, 1.15), (0.18, 0.26), 0.4),
    "console": Kind(tables.console, (0.6, 1.2), (0.74, 0.82), (0.26, 0.36), 0.35),
    "bench": Kind(tables.bench, (0.7, 1.3), (0.44, 0.48), (0.32, 0.4), 0.35),
    "desk": Kind(tables.desk, (0.8, 1.4), (0.73, 0.75), (0.5, 0.64), 0.5, (DESK,)),
    "nightstand": Kind(_nightstand, (0.36, 0.5), (0.45, 0.6), (0.34, 0.42), 0.15, (NIGHT_STAND,), ("nightstand",), BED),
})  # fmt: skip

# Kind of furniture and how likely a room of that use has it, the most wanted first.
WANTED: Final[Mapping[RoomKind, tuple[tuple[str, float], ...]]] = MappingProxyType({
    RoomKind.LIVING: (("bookcase", 0.95), ("sideboard", 0.65), ("cubes", 0.45), ("bookcase", 0.6), ("console", 0.3), ("rack", 0.35), ("desk", 0.25), ("low bookcase", 0.4), ("tall cabinet", 0.3)),
    RoomKind.BEDROOM: (("nightstand", 0.9), ("nightstand", 0.7), ("wardrobe", 0.6), ("desk", 0.55), ("chest", 0.7), ("bookcase", 0.5), ("low bookcase", 0.35), ("rack", 0.3), ("tall cabinet", 0.3), ("bench", 0.2)),
    RoomKind.DINING: (("sideboard", 0.85), ("bookcase", 0.5), ("console", 0.3), ("cubes", 0.3)),
    RoomKind.KITCHEN: (("rack", 0.6), ("sideboard", 0.35), ("tall cabinet", 0.4), ("bench", 0.2)),
    RoomKind.HALL: (("shoe cabinet", 0.75), ("wardrobe", 0.35), ("console", 0.4), ("bookcase", 0.4), ("bench", 0.35), ("chest", 0.25)),
    RoomKind.OFFICE: (("bookcase", 0.95), ("bookcase", 0.75), ("cubes", 0.5), ("chest", 0.4), ("rack", 0.4), ("bookcase", 0.4)),
    RoomKind.BATHROOM: (("tall cabinet", 0.75), ("rack", 0.4)),
    RoomKind.STORE: (("rack", 0.9), ("rack", 0.8), ("wardrobe", 0.3), ("rack", 0.5)),
    RoomKind.OTHER: (("bookcase", 0.7), ("chest", 0.5), ("sideboard", 0.4), ("desk", 0.3), ("cubes", 0.3)),
})  # fmt: skip
