"""The part `textiles_large` of dressing: curtains, blinds, rugs, towels, room by room; no effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.catalogue import Catalogue, Place
from pbrs_farm.core.classes import SINK, TOWEL
from pbrs_farm.core.house import Material, Surface
from pbrs_farm.dress.models import Model, hanging_piece
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.patterns import Pattern, pattern_material
from pbrs_farm.dress.space import HouseSpace, RoomSpace, house_space
from pbrs_farm.dress.style import Style, mix, room_style
from pbrs_farm.dress.textiles.curtains import hang_blind, hang_curtains, room_cloth, window_side
from pbrs_farm.dress.textiles.hanging_cloth import round_rail, towel_over_rail
from pbrs_farm.dress.textiles.rugs import cover_drawn_rugs, lay_rugs
from pbrs_farm.dress.thing_materials import metal
from pbrs_farm.dress.walls.hanging import WANTS, Hanging
from pbrs_farm.geometry.solids import box, sphere
from pbrs_farm.home.room_use import RoomKind

PASS = "textiles"
_RAIL_M = 1.25  # height of a towel rail above the floor
_DRAPED = 0.4  # share of rooms with curtains from the ceiling down, along the wall
_DRAPED_ROOMS = (
    RoomKind.LIVING,
    RoomKind.DINING,
    RoomKind.BEDROOM,
    RoomKind.OFFICE,
    RoomKind.OTHER,
)
_FAR_M = 2.5  # greatest distance of a towel from the basin


def hang_towels(
    house: MutableHouse,
    catalogue: Catalogue,
    style: Style,
    room_id: str,
    rng: np.random.Generator,
    share: float,
) -> None:
    """A towel or two in a bathroom without towels, on the free wall nearest to the basin."""
    space = house_space(house)
    room = space.room(room_id)
    has = any(house.items[n].nyu40 == TOWEL for n in room.items)
    if room.kind is not RoomKind.BATHROOM or has or rng.random() >= 0.85 * share:
        return
    hanging = Hanging(house, room, PASS)
    for _ in range(int(rng.integers(1, 3))):
        piece, shape = _draw_rail(catalogue, rng) or towel_rail(house, style, rng)
        (x0, _y0, _z0), (x1, y1, z1) = shape.bounds
        width, height, depth = float(x1 - x0), float(y1), float(z1)
        low = room.room.floor_y + _RAIL_M - height
        spot = _spot_near_basin(hanging, space, room, house, width, (low, low + height), depth)
        if spot is None:
            house.refused[f"{PASS}: no free wall for a towel"] += 1
            return
        hanging.hang(piece, shape, spot[0], spot[1] + width / 2, low)


def _draw_rail(catalogue: Catalogue, rng: np.random.Generator) -> Model | None:
    pieces = [p for p in catalogue.of("towel") if p.place is Place.WALL and p.size[0] < 0.7]
    if not pieces or rng.random() < 0.5:
        return None
    piece = pieces[int(rng.integers(len(pieces)))]
    shape = catalogue.shape(piece)
    return (piece, shape) if shape is not None else None


def towel_rail(house: MutableHouse, style: Style, rng: np.random.Generator) -> Model:
    """One or two bars with one or two towels over the inner one, some with balls at their ends."""
    n_towels, n_bars, has_balls = (
        1 + int(rng.random() < 0.3),
        1 + int(rng.random() < 0.25),
        rng.random() < 0.35,
    )
    width = float(rng.uniform(0.4, 0.6)) * (1 + 0.5 * (n_towels - 1))
    towel = width / n_towels * float(rng.uniform(0.6, 0.85))
    drop, z, out = float(rng.uniform(0.45, 0.7)), 0.07, 0.07 + 0.06 * (n_bars - 1)
    tint = mix(
        style.textiles[int(rng.integers(len(style.textiles)))],
        (0.93, 0.92, 0.9),
        float(rng.choice([0.0, 0.4, 0.85])),
    )
    r, g, b = (round(c, 2) for c in tint)
    pattern = pattern_material(house, Pattern("loop carpet", int(rng.integers(3)), ((r, g, b),)))
    steel = metal(style)
    parts: list[tuple[Surface, Material]] = []
    for k in range(n_towels):
        cloth = towel_over_rail(towel, drop, z, rng)
        x = np.float32((k - (n_towels - 1) / 2) * width / n_towels)
        moved = replace(cloth, positions=cloth.positions + np.array((x, 0, 0), np.float32))
        parts.append((moved, house.materials[pattern.number]))
    for bar_z in (z, out)[:n_bars]:
        parts.append((round_rail("rail", -width / 2, width / 2, drop, bar_z, 0.009), steel))
    for sign in (-1, 1):
        arm = np.array([sign * (width / 2 - 0.01), drop, out / 2])
        parts.append((box("arm", arm, np.array([0.008, 0.008, out / 2]), 0), steel))
        if has_balls:
            parts.append((sphere("ball", np.array([sign * width / 2, drop, z]), 0.014, 0), steel))
    return hanging_piece("towel_rail", "towel", TOWEL, parts)


def _spot_near_basin(
    hanging: Hanging,
    space: HouseSpace,
    room: RoomSpace,
    house: MutableHouse,
    width: float,
    heights: tuple[float, float],
    depth: float,
) -> tuple[int, float] | None:
    """(face, s) of the free place nearest to a basin of the room, within reach; None = none."""
    basins = [space.bounds[n].mean(0) for n in room.items if house.items[n].nyu40 == SINK]
    best: tuple[float, int, float] | None = None
    for k, face in enumerate(hanging.faces):
        for s in face.starts(width + 0.06, heights[0], heights[1] + 0.05, depth + 0.15):
            position = face.point(float(s) + width / 2, heights[1])
            away = min((float(np.linalg.norm((position - b)[[0, 2]])) for b in basins), default=0.0)
            if away < _FAR_M and (best is None or away < best[0]):
                best = (away, k, float(s) + 0.03)
    return None if best is None else (best[1], best[2])


def add_textiles(house: MutableHouse, catalogue: Catalogue, style: Style, share: float) -> None:
    """Hang curtains, blinds and towels, lay rugs. share: 0..1 of the full number."""
    cover_drawn_rugs(house, style, share)
    for room_id in [r.room.id for r in house_space(house).rooms]:
        room = house_space(house).room(room_id)
        if room.kind in (RoomKind.OUTDOOR, RoomKind.STORE) or room.area.is_empty:
            continue
        taste = room_style(style, house.rng("textiles", room_id, "style"))
        _dress_windows(house, room, taste, house.rng("textiles", room_id, "windows"), share)
        if room.room.has_floor:
            lay_rugs(house, room_id, taste, house.rng("textiles", room_id, "rugs"), share)
        hang_towels(
            house, catalogue, taste, room_id, house.rng("textiles", room_id, "towels"), share
        )


def _dress_windows(
    house: MutableHouse, room: RoomSpace, style: Style, rng: np.random.Generator, share: float
) -> None:
    """All windows of a room alike: people buy one cloth."""
    if not room.windows:
        return
    curtains = rng.random() < WANTS[room.kind].curtains * share
    blinds = rng.random() < WANTS[room.kind].blinds * share
    cloth = room_cloth(house, style, room, rng) if curtains else None
    is_draped = house.rng(PASS, room.room.id, "draped").random() < _DRAPED
    if cloth is not None and is_draped and room.kind in _DRAPED_ROOMS:
        cloth = replace(cloth, is_draped=True)
    look = int(rng.integers(1 << 30))
    for window in room.windows:
        # Inner windows between two rooms stay bare.
        if None not in window.room_ids and not _looks_out(house, window.room_ids):
            continue
        space = house_space(house)
        side = window_side(house, space, space.room(room.room.id), window)
        if side is None:
            continue
        cloth_rng = np.random.default_rng(look)
        done = cloth is not None and hang_curtains(house, space, room, side, cloth, cloth_rng)
        # Where no cloth fits beside it, people still want to close it.
        if not done and (blinds or cloth is not None):
            hang_blind(house, space, room, side, style, cloth_rng)


def _looks_out(house: MutableHouse, room_ids: tuple[str | None, str | None]) -> bool:
    # A balcony or a terrace is outdoors, too.
    space = house_space(house)
    return any(i is None or space.room(i).kind is RoomKind.OUTDOOR for i in room_ids)
