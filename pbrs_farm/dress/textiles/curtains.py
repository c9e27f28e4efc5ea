"""Curtains and blinds at a window, made to its size; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Piece, Place, Shape
from pbrs_farm.core.classes import BLINDS, CURTAIN
from pbrs_farm.core.house import Item, ItemKind, Material, Surface
from pbrs_farm.dress.models import hanging_piece
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.patterns import Pattern, pattern_material
from pbrs_farm.dress.space import HouseSpace, Passage, RoomSpace
from pbrs_farm.dress.style import Style, mix, shade
from pbrs_farm.dress.textiles.hanging_cloth import Pleats, pleated_panel, round_rail
from pbrs_farm.dress.thing_materials import metal, plain
from pbrs_farm.dress.walls.hanging import GAP_M, next_id
from pbrs_farm.geometry.solids import box, sphere
from pbrs_farm.geometry.swept import Swept, swept_by_item
from pbrs_farm.home.names import RADIATORS, words_of_item

PASS = "textiles"
_FROM_FLOOR_M = 0.015
_OVER_WINDOW_M = 0.12  # height of the rod above the opening
_UNDER_CEILING_M = 0.05
_HIGH_SILL_M = 1.25
_BESIDE_M = (
    0.48,
    0.34,
    0.25,
    0.17,
    0.12,
    0.07,
)  # widths of wall that a panel covers beside a window
_DRAPED_M = (2.0, 1.5, 1.1, 0.8, 0.6)  # the same of one that covers as much of the wall as is free
_MOST_OUT_M = 0.2  # greatest distance of the rod from the wall
_OVER_THINGS_M = 0.4  # gap between a short panel and the furniture below it, metres
_ROD_M = 0.012  # its radius
_FLAT_M = 0.0015  # the wall is flat if it deviates less than this where brackets end


@dataclass(frozen=True, slots=True)
class WindowSide:
    """A window from one room, with the obstacles to cloth before it."""

    window: Passage
    side: int
    origin: F64  # (3,) on the wall's face, middle of the window, at the floor's height
    along: F64  # to the right of who looks at it from the room
    inward: F64
    floor_y: float
    ceiling_y: float
    sticks_out_m: float  # projection of the window's frame and handle from the wall

    @property
    def turn_rad(self) -> float:
        """The turn about +y that brings a piece's front into the room."""
        return float(np.arctan2(self.inward[0], self.inward[2]))

    def bounds(self, x0: float, x1: float, y0: float, y1: float, out: float) -> tuple[F64, F64]:
        """Low and high corner of a box x0..x1 from the middle, world y0..y1, 4 mm to `out` before the wall."""
        ends = [
            self.origin + self.along * x + self.inward * z for x in (x0, x1) for z in (0.004, out)
        ]
        low, high = np.min(ends, 0), np.max(ends, 0)
        low[1], high[1] = y0, y1
        return low, high


def window_side(
    house: MutableHouse, space: HouseSpace, room: RoomSpace, window: Passage
) -> WindowSide | None:
    """The window from the room; None with cloth, below 0.35 m, without space, or of another room."""
    side = window.side_of(room.room.id)
    if side is None or window.width < 0.35:
        return None
    inward = window.inward(side)
    along = np.array([inward[2], 0.0, -inward[0]])
    origin = window.face_point(side)
    origin[1] = room.room.floor_y
    ceiling = float(room.ceiling_y((origin + 0.1 * inward)[None, [0, 2]])[0])
    number = next((n for n, i in enumerate(house.items) if i.id == window.item_id), None)
    sticks_out = 0.0
    if number is not None and len(space.points[number]):
        sticks_out = max(float(((space.points[number] - origin) @ inward).max()), 0.0)
    view = WindowSide(window, side, origin, along, inward, room.room.floor_y, ceiling, sticks_out)
    return None if _is_dressed(house, space, view) else view


def _is_dressed(house: MutableHouse, space: HouseSpace, side: WindowSide) -> bool:
    # A curtain or blind of the source, or of the window's other neighbour, hangs there.
    half = side.window.width / 2
    low, high = side.bounds(-half, half, side.window.bottom_y, side.window.top_y, 0.3)
    low, high = low - 0.1, high + 0.1
    return any(
        house.items[n].nyu40 in (CURTAIN, BLINDS)
        and (space.bounds[n][0] < high).all()
        and (space.bounds[n][1] > low).all()
        for n in range(len(house.items))
    )


def hang_curtains(
    house: MutableHouse,
    space: HouseSpace,
    room: RoomSpace,
    side: WindowSide,
    cloth: Cloth,
    rng: np.random.Generator,
) -> bool:
    """Add a rod and two panels (both or none); False, counted, if they do not fit. Ask the space anew."""
    window = side.window
    highest = side.ceiling_y - _UNDER_CEILING_M
    rod_y = highest if cloth.is_draped else min(window.top_y + _OVER_WINDOW_M, highest)
    depth = float(rng.uniform(0.026, 0.038))
    rod_z = max(side.sticks_out_m + 1.3 * depth + 0.015, 0.075)
    if rod_y < window.top_y + 0.02 or rod_z > _MOST_OUT_M:
        house.refused[f"{PASS}: no place for a curtain rod"] += 1
        return False
    out = rod_z + 1.4 * depth
    panels = []
    cover = float(rng.uniform(0.15, 0.25)) * window.width * (1.5 if cloth.is_draped else 1.0)
    for sign in (-1, 1):
        widths = _DRAPED_M + _BESIDE_M if cloth.is_draped else _BESIDE_M
        panel = _panel_place(space, room, side, sign, (cover, widths), rod_y, out, house)
        if panel is not None:
            panels.append(panel)
    # One panel alone looks as if the other had been stolen.
    if len(panels) < 2:
        house.refused[f"{PASS}: no room on both sides of a window"] += 1
        return False
    # Both panels end at one height.
    bottom = max(p[2] for p in panels)
    piece, shape, middle = _curtain_set(side, panels, bottom, rod_y, rod_z, depth, cloth, rng)
    _add_at_window(house, room, piece, shape, side, middle, bottom)
    return True


def _panel_place(
    space: HouseSpace,
    room: RoomSpace,
    side: WindowSide,
    sign: int,
    spans: tuple[float, Sequence[float]],
    rod_y: float,
    out: float,
    house: MutableHouse,
) -> tuple[float, float, float] | None:
    """x0, x1 and lowest y of a panel at one end; spans: of window and wall, tried in order; or None."""
    cover, widths = spans
    half = side.window.width / 2
    sill = side.window.bottom_y
    without = [n for n, i in enumerate(house.items) if i.kind is ItemKind.WINDOW]
    heaters = [n for n, i in enumerate(house.items) if words_of_item(i) & RADIATORS]
    free = shapely.difference(room.area, room.walls)
    swept = [s for n in room.items for s in swept_by_item(house.items[n])]
    for beyond in widths:
        inner, outer = sign * (half - cover), sign * (half + beyond)
        x0, x1 = min(inner, outer), max(inner, outer)
        corner = side.origin + side.along * (outer + sign * 0.04) + side.inward * out / 2
        # A bracket 3 cm from the panel's end must meet the wall: a round one bends away.
        if not shapely.contains_xy(free, corner[0], corner[2]) or not is_flat(
            free, side, outer - sign * 0.03
        ):
            continue
        # Before a window high in the wall only short ones hang.
        is_high = sill > side.floor_y + _HIGH_SILL_M
        full = (side.floor_y + _FROM_FLOOR_M,) if not is_high else ()
        for bottom in (*full, sill - 0.15, sill - 0.05):
            if bottom > sill or bottom < side.floor_y:
                continue
            # It hangs down to the floor, or over a radiator or nothing: not onto a worktop.
            low, high = side.bounds(x0, x1, bottom, rod_y + 0.02, out)
            if _is_opened_into(swept, low, high):
                continue
            least = low.copy()
            least[1] = max(side.floor_y + _FROM_FLOOR_M, bottom - _OVER_THINGS_M)
            if space.is_free(low, high, without=without) and space.is_free(
                least, high, without=[*without, *heaters]
            ):
                return x0, x1, bottom
    return None


def _is_opened_into(swept: Sequence[Swept], low: F64, high: F64) -> bool:
    """Whether a door or drawer of furniture would open into the box low..high (3,)."""
    ground = shapely.box(low[0], low[2], high[0], high[2])
    return any(
        s.low_y < high[1] and s.high_y > low[1] and shapely.intersects(s.area, ground)
        for s in swept
    )


def is_flat(free: BaseGeometry, side: WindowSide, x: float) -> bool:
    """True if the wall's face at x is where it is at the window, as a rod's ends need; free: without walls."""
    position = side.origin + side.along * x
    before, behind = position + side.inward * _FLAT_M, position - side.inward * _FLAT_M
    return bool(
        shapely.contains_xy(free, before[0], before[2])
        and not shapely.contains_xy(free, behind[0], behind[2])
    )


@dataclass(frozen=True, slots=True)
class Cloth:
    """A room's cloth and the metal it hangs from."""

    material: Material
    tile_m: float
    fold_m: float
    rod: Material
    is_draped: bool = False  # from the ceiling down, over as much of the wall as is free


def room_cloth(
    house: MutableHouse, style: Style, room: RoomSpace, rng: np.random.Generator
) -> Cloth:
    """Cloth of a room's curtains: calm, light colours more often than loud ones."""
    tint = style.textiles[
        int(min(rng.integers(len(style.textiles)), rng.integers(len(style.textiles))))
    ]
    if rng.random() < 0.45:
        tint = mix(tint, (0.93, 0.91, 0.87), float(rng.uniform(0.5, 0.85)))
    family = "weave" if rng.random() < 0.6 else "twill"
    pattern = pattern_material(house, Pattern(family, int(rng.integers(4)), (_round_colour(tint),)))
    return Cloth(
        house.materials[pattern.number],
        pattern.size_m[0],
        float(rng.uniform(0.12, 0.18)),
        metal(style) if rng.random() < 0.6 else plain("rod", style.wood.mean, 0.4),
    )


def _curtain_set(
    side: WindowSide,
    panels: list[tuple[float, float, float]],
    bottom: float,
    rod_y: float,
    rod_z: float,
    depth: float,
    cloth: Cloth,
    rng: np.random.Generator,
) -> tuple[Piece, Shape, float]:
    """The panels with their rod; and where their middle is across the window."""
    height = rod_y - bottom
    x0, x1 = min(p[0] for p in panels), max(p[1] for p in panels)
    middle = (x0 + x1) / 2
    parts: list[tuple[Surface, Material]] = []
    for a, b, _low in panels:
        folds = Pleats(cloth.fold_m, depth, float(rng.uniform(0, 6)), float(rng.uniform(0.1, 0.6)))
        sheet = pleated_panel("curtain", b - a, height, rod_z, folds, cloth.tile_m)
        parts.append((_shift_surface(sheet, (a - middle, 0.0, 0.0)), cloth.material))
    # The rod passes over the panels and rests on two brackets.
    half, y = (x1 - x0) / 2 + 0.03, height + _ROD_M
    parts.append((round_rail("rod", -half, half, y, rod_z, _ROD_M), cloth.rod))
    for sign in (-1, 1):
        parts.append((sphere("finial", np.array([sign * half, y, rod_z]), 0.022, 0), cloth.rod))
        arm = np.array([sign * (half - 0.06), y - _ROD_M - 0.004, rod_z / 2])
        parts.append((box("bracket", arm, np.array([0.008, 0.006, rod_z / 2]), 0), cloth.rod))
    piece, shape = hanging_piece("curtains", "curtain", CURTAIN, parts)
    return piece, shape, middle


def hang_blind(
    house: MutableHouse,
    space: HouseSpace,
    room: RoomSpace,
    side: WindowSide,
    style: Style,
    rng: np.random.Generator,
) -> bool:
    """A roller blind or slats before the window, let down a little to half."""
    window = side.window
    z = max(side.sticks_out_m + 0.012, 0.012)
    top = min(window.top_y + 0.06, side.ceiling_y - 0.01)
    half = window.width / 2 + 0.03
    drop = float(rng.uniform(0.12, 0.5)) * (window.top_y - window.bottom_y) + top - window.top_y
    low, high = side.bounds(-half, half, top - drop, top, z + 0.07)
    window_items = [n for n, i in enumerate(house.items) if i.id == window.item_id]
    free = shapely.difference(room.area, room.walls)
    if not (is_flat(free, side, half) and is_flat(free, side, -half)):
        house.refused[f"{PASS}: the wall bends beside a window"] += 1
        return False
    if z > 0.1 or top < window.top_y + 0.01 or not space.is_free(low, high, without=window_items):
        house.refused[f"{PASS}: no place for a blind"] += 1
        return False
    calm = mix(style.textiles[0], (0.92, 0.91, 0.88), float(rng.uniform(0.3, 0.9)))
    parts = _slats(half, drop, z, calm) if rng.random() < 0.4 else _roller(half, drop, z, calm)
    # Two holders reach back to the wall.
    white = plain("blind holder", (0.85, 0.85, 0.84), 0.4)
    for sign in (-1, 1):
        arm = np.array([sign * (half - 0.004), drop - 0.03, (z + 0.02) / 2])
        parts.append((box("holder", arm, np.array([0.004, 0.02, (z + 0.02) / 2]), 0), white))
    piece, shape = hanging_piece("blind", "blinds", BLINDS, parts)
    _add_at_window(house, room, piece, shape, side, 0.0, top - drop)
    return True


def _roller(
    half: float, drop: float, z: float, colour: tuple[float, float, float]
) -> list[tuple[Surface, Material]]:
    cloth = plain("blind cloth", colour, 0.9)
    roll = round_rail("roll", -half + 0.01, half - 0.01, drop - 0.03, z + 0.03, 0.024)
    sheet = np.array([0.0, (drop - 0.03) / 2, z + 0.008])
    weight = round_rail("weight", -half + 0.01, half - 0.01, 0.008, z + 0.008, 0.008)
    return [
        (roll, cloth),
        (box("sheet", sheet, np.array([half - 0.015, (drop - 0.03) / 2, 0.0008]), 0), cloth),
        (weight, plain("blind weight", shade(colour, 0.8), 0.5)),
    ]


def _slats(
    half: float, drop: float, z: float, colour: tuple[float, float, float]
) -> list[tuple[Surface, Material]]:
    slat = plain("slat", colour, 0.45)
    parts = [
        (
            box("rail", np.array([0.0, drop - 0.02, z + 0.02]), np.array([half, 0.018, 0.018]), 0),
            slat,
        )
    ]
    # Slats 25 mm deep, 22 mm apart, half open (0.6 rad about x), below a rail.
    c, s = np.cos(0.6), np.sin(0.6)
    turn = np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])
    for y in np.arange(0.015, drop - 0.045, 0.022):
        size = np.array([half - 0.006, 0.0006, 0.0125])
        parts.append((box("slat", np.array([0.0, y, z + 0.02]), size, 0, axes=turn), slat))
    return parts


def _add_at_window(
    house: MutableHouse,
    room: RoomSpace,
    piece: Piece,
    shape: Shape,
    side: WindowSide,
    x: float,
    y: float,
) -> Item:
    position = side.origin + side.along * x + side.inward * GAP_M
    position[1] = y
    placed = replace(piece, place=Place.WALL)
    item = house.placed(
        placed,
        shape,
        position,
        side.turn_rad,
        item_id=next_id(house, PASS),
        room_id=room.room.id,
        level_id=room.room.level_id,
    )
    house.add(item, PASS, placed)
    return item


def _shift_surface(surface: Surface, offset: tuple[float, float, float]) -> Surface:
    return replace(surface, positions=(surface.positions + np.array(offset)).astype(np.float32))


def _round_colour(colour: tuple[float, float, float]) -> tuple[float, float, float]:
    r, g, b = (round(c, 2) for c in colour)
    return (r, g, b)
