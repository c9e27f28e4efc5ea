"""The part `lamps` of dressing: which rooms lack light, and what lamps they get; no effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Piece, Place, Shape
from pbrs_farm.core.classes import LAMP, NIGHT_STAND, SOFA, TABLE
from pbrs_farm.core.house import ItemKind, LightPart, Material, MaterialKind, Surface
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.space import HouseSpace, RoomSpace, doors_are_joined, floor_bitmap, house_space
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.walls.hanging import WANTS, next_id
from pbrs_farm.geometry.heights import highest_below, lowest_above
from pbrs_farm.geometry.solids import lathe, sphere
from pbrs_farm.geometry.surface_points import item_triangles
from pbrs_farm.home.lamps import flux_for_floor, flux_of_lamps
from pbrs_farm.home.room_use import RoomKind

# Lamps made in code, for homes without a catalogue: an opal dome, a globe, a shade on a cord.


_WARM = (1.0, 0.79, 0.55)  # linear, of a lamp of about 3000 K
_O = np.zeros(3)


def ceiling_dome(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """A flat opal dish under the ceiling that shines as a whole."""
    r = float(rng.uniform(0.16, 0.24))
    plate = lathe("plate", np.array([[0, 0.09], [r + 0.01, 0.09], [r + 0.01, 0.11], [0, 0.11]]), _O, 0, n=40)  # fmt: skip
    t = np.linspace(0, np.pi / 2, 9)
    dish = np.stack([r * np.sin(t), 0.085 * (1 - np.cos(t))], -1)
    dish[0, 0] = 0.0
    opal = lathe("opal", np.concatenate([dish, [[0, 0.085]]]), _O, 1, n=40)
    return _lamp("ceiling_dome", Place.CEILING, (plate, opal), style, emitting=1, at=0.04, radius=r)


def globe_pendant(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """An opal ball on a cord."""
    r, height = float(rng.uniform(0.11, 0.17)), 0.5
    ball = sphere("opal", np.array([0, r, 0]), r, 1, n=32)
    return _lamp("globe_pendant", Place.CEILING, (_cord(2 * r, height), ball), style, emitting=1, at=r, radius=r)  # fmt: skip


def shade_pendant(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """A metal cone on a cord, a bulb in it."""
    r, tall, height = float(rng.uniform(0.15, 0.24)), float(rng.uniform(0.14, 0.2)), 0.55
    outside = np.array([[r, 0.0], [0.7 * r, 0.55 * tall], [0.03, tall]])
    inside = np.array([[0.027, tall - 0.003], [0.7 * r - 0.003, 0.55 * tall], [r - 0.003, 0.0]])
    shell = lathe("shade", np.concatenate([inside, outside, inside[:1]]), _O, 2, n=40)
    bulb = sphere("bulb", np.array([0, 0.3 * tall, 0]), 0.035, 1, n=24)
    parts = (_cord(tall, height), bulb, shell)
    return _lamp("shade_pendant", Place.CEILING, parts, style, emitting=1, at=0.3 * tall, radius=0.035)  # fmt: skip


def floor_lamp(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """A pole with a round foot and an opal ball."""
    height, r = float(rng.uniform(1.45, 1.7)), float(rng.uniform(0.1, 0.14))
    foot = np.array(
        [[0, 0], [0.14, 0], [0.14, 0.015], [0.014, 0.022], [0.012, height], [0, height]]
    )
    pole = lathe("pole", foot, _O, 0, n=32)
    ball = sphere("opal", np.array([0, height + r - 0.01, 0]), r, 1, n=32)
    return _lamp("floor_lamp", Place.FLOOR, (pole, ball), style, emitting=1, at=height + r, radius=r)  # fmt: skip


def table_lamp(rng: np.random.Generator, style: Style) -> tuple[Piece, Shape]:
    """A small foot with an opal ball."""
    r = float(rng.uniform(0.06, 0.085))
    foot = np.array([[0, 0], [0.07, 0], [0.07, 0.012], [0.02, 0.03], [0.02, 0.16], [0, 0.16]])
    body = lathe("foot", foot, _O, 0, n=32)
    ball = sphere("opal", np.array([0, 0.15 + r, 0]), r, 1, n=32)
    return _lamp("table_lamp", Place.SURFACE, (body, ball), style, emitting=1, at=0.15 + r, radius=r)  # fmt: skip


def _cord(low: float, high: float) -> Surface:
    # A thin cord up to a small canopy under the ceiling.
    profile = [
        [0, low],
        [0.005, low],
        [0.005, high - 0.03],
        [0.05, high - 0.02],
        [0.05, high],
        [0, high],
    ]
    return lathe("cord", np.array(profile, np.float64), _O, 0, n=24)


def _lamp(
    family: str, place: Place, surfaces: tuple[Surface, ...], style: Style, *,
    emitting: int, at: float, radius: float,
) -> tuple[Piece, Shape]:  # fmt: skip
    dark = (0.03, 0.03, 0.03)
    metal = Material(
        style.metal.name, diffuse=dark, specular=style.metal.colour, roughness=style.metal.roughness
    )
    r, g, b = (round(float(np.clip(c, 0.05, 0.9)), 3) for c in style.accent)
    enamel = Material("enamel", diffuse=(r, g, b), roughness=0.3)
    opal = Material("opal glass", MaterialKind.BULB)
    light = LightPart(
        (0.0, at, 0.0), radius, 1000.0, PowerUnit.LUMEN, rgb_linear=_WARM, emitting=(emitting,)
    )
    shape = Shape(surfaces, (metal, opal, enamel), lights=(light,))
    w, h, d = (float(x) for x in np.diff(shape.bounds, axis=0)[0])
    group = {Place.CEILING: "ceiling_lamp", Place.FLOOR: "floor_lamp"}.get(place, "table_lamp")
    name = family.replace("_", " ").capitalize()
    piece = Piece(
        f"generated#{family}", name, group, place, LAMP, (w, d, h), ItemKind.LAMP,
        library="generated",
    )  # fmt: skip
    return piece, shape


def with_flux(shape: Shape, flux_lm: float) -> Shape:
    """The shape with its lights giving that luminous flux together."""
    n = max(len(shape.lights), 1)
    lights = tuple(
        replace(light, power=round(flux_lm, 1), unit=PowerUnit.LUMEN, share=1.0 / n)
        for light in shape.lights
    )
    return replace(shape, lights=lights)


# Hangs a lamp from a room's ceiling: over the dining table, else in the middle of what is free.


PART = "lamps"
_HEAD_M = 1.95  # below a lamp over free floor
_TABLE_M = 1.45  # of a lamp over a table, above the floor
_FROM_WALL_M = 0.25  # of a lamp's edge
_MOST_ROOM_M = 3.6  # a higher ceiling is out of a cord's reach
_GRID_M = 0.15
_PLAIN = (RoomKind.BATHROOM, RoomKind.HALL, RoomKind.KITCHEN, RoomKind.STORE)
# Pieces that suit every room, by words of their names; tubes are for rooms where people work.
_TUBES, _NOWHERE = ("fluorescent",), ("spotlight",)
_GAP_M = 0.0005


def hang_from_ceiling(
    draft: Draft, catalogue: Catalogue, style: Style, room_id: str, flux_lm: float,
    rng: np.random.Generator,
) -> bool:  # fmt: skip
    """Hang one lamp of that flux; False, and a reason counted, where there is no place for it."""
    space = house_space(draft)
    room = space.room(room_id)
    choices = _choices(catalogue, style, room, rng)
    for place, top_y, low_y in _places(draft, space, room):
        for piece, ready in choices:
            # Load a model when it is its turn: most rooms take the first.
            shape = ready or catalogue.shape(piece)
            factor = _factor(shape, top_y - low_y) if shape and shape.lights else None
            if (
                shape is None
                or factor is None
                or not _is_free(space, room, place, top_y, shape, factor)
            ):
                continue
            height = float(shape.bounds[1, 1]) * factor
            at = np.array([place[0], top_y - height - _GAP_M, place[1]])
            lit = with_flux(shape, flux_lm)
            turn = float(rng.choice([0.0, np.pi / 2]))
            item = draft.placed(
                piece, lit, at, turn, item_id=next_id(draft, PART), room_id=room_id,
                level_id=room.room.level_id, scale=factor,
            )  # fmt: skip
            draft.add(item, PART, piece)
            return True
    draft.refused[f"{PART}: no place under the ceiling"] += 1
    return False


def _choices(
    catalogue: Catalogue, style: Style, room: RoomSpace, rng: np.random.Generator
) -> list[tuple[Piece, Shape | None]]:
    """Lamps that suit the room, in a drawn order; a flat dome last, which fits nearly everywhere.

    The shape of a piece of the catalogue is not loaded yet: None.
    """
    made: list[tuple[Piece, Shape | None]] = [
        ceiling_dome(rng, style),
        globe_pendant(rng, style),
        shade_pendant(rng, style),
    ]
    if room.kind in _PLAIN and rng.random() < 0.6:
        return made
    # Leave out lamps of other places, those too wide, and tubes outside kitchen and store.
    found = []
    for piece in catalogue.of("ceiling_lamp"):
        name = piece.name.lower()
        is_tube = any(word in name for word in _TUBES)
        if any(word in name for word in _NOWHERE) or max(piece.size[:2]) > 0.45 * _least_side(room):
            continue
        if is_tube and room.kind not in (RoomKind.KITCHEN, RoomKind.STORE):
            continue
        found.append(piece)
    # Up to three of the catalogue and our own pendants, mixed; the dome last.
    drawn = [found[int(k)] for k in rng.permutation(len(found))][:3]
    own = [made[1], made[2]] if rng.random() < 0.5 else [made[2], made[1]]
    some: list[tuple[Piece, Shape | None]] = [(piece, None) for piece in drawn]
    if rng.random() < 0.35:
        some = [own[0], *some]
    return [*some, *own, made[0]]


def _least_side(room: RoomSpace) -> float:
    x0, z0, x1, z1 = room.area.bounds
    return float(min(x1 - x0, z1 - z0))


def _factor(shape: Shape, height_m: float) -> float | None:
    """How much smaller the shape must be to be no taller than height_m; None = too much."""
    tall = float(shape.bounds[1, 1])
    factor = min(1.0, height_m / tall)
    return factor if factor > 0.6 else None


def _places(draft: Draft, space: HouseSpace, room: RoomSpace) -> list[tuple[F64, float, float]]:
    """Plan places, the ceiling's y and the lowest y of a lamp there; best first."""
    floor = room.room.floor_y
    places, lows = [], []
    for number in room.items:
        item, (low, high) = draft.items[number], space.bounds[number]
        size = high - low
        if item.nyu40 == TABLE and size[1] > 0.6 and min(size[0], size[2]) > 0.7:
            places.append(((low + high) / 2)[[0, 2]])
            lows.append(floor + _TABLE_M)
    grid = _grid(room)
    places += list(grid)
    lows += [floor + _HEAD_M] * len(grid)
    if not places:
        return []
    points = np.array(places)
    tops = lowest_above(points, room.above, floor + 0.5)
    ok = np.isfinite(tops) & (tops < floor + _MOST_ROOM_M)
    return [(points[k], float(tops[k]), lows[k]) for k in np.flatnonzero(ok)]


def _grid(room: RoomSpace) -> F64:
    """(N, 2) places well inside the room, those farthest from its walls first; at most 60."""
    area = shapely.difference(room.area, room.walls)
    shrunk = shapely.buffer(area, -_FROM_WALL_M)
    inner = area if shrunk.is_empty else shrunk
    if inner.is_empty:
        return np.zeros((0, 2))
    x0, z0, x1, z1 = inner.bounds
    axes = [np.arange(a, b + 1e-9, _GRID_M) for a, b in ((x0, x1), (z0, z1))]
    grid = np.stack([g.ravel() for g in np.meshgrid(*axes)], -1)
    grid = grid[shapely.contains_xy(inner, grid[:, 0], grid[:, 1])]
    if not len(grid):
        return np.zeros((0, 2))
    edge = shapely.distance(shapely.points(grid), area.boundary)
    # Of places equally far from walls take the middle one.
    middle = np.linalg.norm(grid - grid.mean(0), axis=1)
    order = np.lexsort((middle, -np.round(edge, 1)))
    return np.asarray(grid[order[:60]])


def _is_free(
    space: HouseSpace, room: RoomSpace, place: F64, top_y: float, shape: Shape, factor: float
) -> bool:
    """Whether nothing else is where the lamp would hang, and the ceiling is flat over its canopy."""
    low, high = shape.bounds * factor
    radius = float(np.abs([low[0], high[0], low[2], high[2]]).max()) + 0.03
    if not shapely.contains(room.area, shapely.Point(place).buffer(radius)):
        return False
    ring = place + 0.05 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    if np.abs(lowest_above(ring, room.above, room.room.floor_y + 0.5) - top_y).max() > 0.001:
        return False
    bottom = top_y - float(high[1]) - 0.05
    if bottom < max((d.top_y for d in room.doors), default=-np.inf) + 0.05:
        sides = [(d, d.side_of(room.room.id)) for d in room.doors]
        before = [d.before(s).union(d.swing(s)) for d, s in sides if s is not None]
        if shapely.intersects(shapely.union_all(before), shapely.Point(place).buffer(radius)):
            return False
    return space.is_free(
        np.array([place[0] - radius, bottom, place[1] - radius]),
        np.array([place[0] + radius, top_y, place[1] + radius]),
    )


# Floor lamps beside sofas and lamps on nightstands, where there is room for them.


_BY_SOFA, _BY_BED = 0.75, 0.75  # how often
_FLOOR_LM, _TABLE_LM = 900.0, 400.0
_STANDING_FROM_WALL_M = (
    0.6  # of a floor lamp's edge, at most: no lamp stands in the middle of a room
)


def stand_by_sofas(
    draft: Draft, catalogue: Catalogue, style: Style, room_id: str, rng: np.random.Generator
) -> None:
    """A floor lamp at one end of a sofa, where the floor is free and every way stays open."""
    space = house_space(draft)
    room = space.room(room_id)
    has_one = any(
        draft.items[n].kind is ItemKind.LAMP and _stands(space, room, n) for n in room.items
    )
    sofas = [n for n in room.items if draft.items[n].nyu40 == SOFA]
    if has_one or not sofas or rng.random() >= _BY_SOFA:
        return
    piece, shape = _drawn(catalogue, "floor_lamp", rng) or floor_lamp(rng, style)
    radius = float(np.abs(shape.bounds[:, [0, 2]]).max())
    for number in sofas:
        # Try each end; take the lamp away again where it closes a way.
        for place in _ends(space, room, number, radius):
            if _floor_is_free(space, room, place, radius, float(shape.bounds[1, 1])):
                at = np.array([place[0], room.room.floor_y, place[1]])
                _stand(draft, room, piece, with_flux(shape, _FLOOR_LM), at, 0.0)
                if _ways_are_open(draft, room_id):
                    return
                draft.items.pop()
                draft.done[f"{PART}: {piece.group}"] -= 1
    draft.refused[f"{PART}: no floor beside a sofa"] += 1


def stand_by_beds(
    draft: Draft, catalogue: Catalogue, style: Style, room_id: str, rng: np.random.Generator
) -> None:
    """The same lamp on every nightstand of the room that is free."""
    space = house_space(draft)
    room = space.room(room_id)
    stands = [n for n in room.items if draft.items[n].nyu40 == NIGHT_STAND]
    if not stands or rng.random() >= _BY_BED:
        return
    piece, shape = _drawn(catalogue, "table_lamp", rng) or table_lamp(rng, style)
    for number in stands:
        low, high = space.bounds[number]
        middle = ((low + high) / 2)[[0, 2]]
        at = _top(draft, space, number, middle, shape)
        if at is None:
            draft.refused[f"{PART}: no free nightstand"] += 1
            continue
        turn = draft.items[number].oriented_box.axes[:, 2]
        _stand(
            draft, room, piece, with_flux(shape, _TABLE_LM), at, float(np.arctan2(turn[0], turn[2]))
        )


def _drawn(
    catalogue: Catalogue, group: str, rng: np.random.Generator
) -> tuple[Piece, Shape] | None:
    """A lamp of the catalogue that shines and is not too large to stand; None = make one."""
    fit = [p for p in catalogue.of(group) if p.size[2] < (0.55 if group == "table_lamp" else 1.95)]
    if not fit or rng.random() < 0.15:
        return None
    piece = fit[int(rng.integers(len(fit)))]
    shape = catalogue.shape(piece)
    return (piece, shape) if shape is not None and shape.lights else None


def _stand(
    draft: Draft, room: RoomSpace, piece: Piece, shape: Shape, at: F64, turn_rad: float
) -> None:
    item = draft.placed(
        piece, shape, at, turn_rad, item_id=next_id(draft, PART), room_id=room.room.id,
        level_id=room.room.level_id,
    )  # fmt: skip
    draft.add(item, PART, piece)


def _stands(space: HouseSpace, room: RoomSpace, number: int) -> bool:
    # A lamp that reaches from the floor to a man's chest.
    low, high = space.bounds[number][:, 1] - room.room.floor_y
    return bool(low < 0.1 and high > 1.0)


def _ends(space: HouseSpace, room: RoomSpace, number: int, radius: float) -> list[F64]:
    """Places beyond the two ends of a thing's longer side, near its back and near its middle."""
    low, high = space.bounds[number]
    middle, half = ((low + high) / 2)[[0, 2]], ((high - low) / 2)[[0, 2]]
    long = int(np.argmax(half))
    found = []
    for across in (0.5, -0.5, 0.0):
        for sign in (1.0, -1.0):
            offset = np.zeros(2)
            offset[long] = sign * (half[long] + radius + 0.06)
            offset[1 - long] = across * half[1 - long]
            found.append(middle + offset)
    # Corners are where lamps stand: nearest to the room's edge first, none far from it.
    edge = room.area.boundary
    away = [float(shapely.distance(shapely.Point(p), edge)) for p in found]
    order = sorted(range(len(found)), key=lambda k: away[k])
    return [found[k] for k in order if away[k] < radius + _STANDING_FROM_WALL_M]


def _floor_is_free(
    space: HouseSpace, room: RoomSpace, place: F64, radius: float, height: float
) -> bool:
    disc = shapely.Point(place).buffer(radius + 0.02)
    free = shapely.difference(room.area, room.walls)
    if not shapely.contains(free, disc):
        return False
    for door in room.doors:
        side = door.side_of(room.room.id)
        if side is not None and (door.before(side).intersects(disc) or door.swing(side).intersects(disc)):  # fmt: skip
            return False
    around = radius + 0.02
    low = np.array([place[0] - around, room.room.floor_y + 0.02, place[1] - around])
    return space.is_free(low, low + np.array([2 * around, height + 0.03, 2 * around]))


def _ways_are_open(draft: Draft, room_id: str) -> bool:
    space = house_space(draft)
    room = space.room(room_id)
    last = len(draft.items) - 1
    before = doors_are_joined(floor_bitmap(space, room, without=(last,)), room)
    return not before or doors_are_joined(floor_bitmap(space, room), room)


def _top(draft: Draft, space: HouseSpace, number: int, place: F64, shape: Shape) -> F64 | None:
    """(3,) where the shape stands on the thing's flat and free top; None where it cannot."""
    low, high = shape.bounds
    radius = float(np.abs([low[[0, 2]], high[[0, 2]]]).max())
    foot = [s.positions for s in shape.surfaces]
    base = np.concatenate(foot)
    base = base[base[:, 1] < 0.02][:, [0, 2]]
    reach = float(np.abs(base).max()) if len(base) else radius
    ring = [
        place + reach * 0.95 * np.array([np.cos(a), np.sin(a)]) for a in np.arange(8) * np.pi / 4
    ]
    triangles = item_triangles(draft.items[number])
    heights = highest_below(np.array([place, *ring]), triangles)
    if not np.isfinite(heights).all() or np.ptp(heights) > 0.001:
        return None
    y = float(heights.max())
    # Nothing else stands there.
    a = np.array([place[0] - radius, y + 0.004, place[1] - radius])
    b = np.array([place[0] + radius, y + float(high[1]) + 0.02, place[1] + radius])
    return np.array([place[0], y, place[1]]) if space.is_free(a, b) else None


# The part `lamps` of dressing.


_WEAK_LX = 20  # a room with less gets a lamp beside those it has
_LEAST_M2 = 0.8
_FLUX_LM = (500.0, 9000.0)  # of one lamp


def lamps(draft: Draft, catalogue: Catalogue, style: Style, share: float) -> None:
    """Hang a lamp in rooms without one or with too little light; stand some by sofas and beds.

    share: of such rooms, 0..1.
    """
    for room_id in [room.room.id for room in house_space(draft).rooms]:
        rng = draft.rng("lamps", room_id)
        room = house_space(draft).room(room_id)
        if room.area.area < _LEAST_M2 or room.kind is RoomKind.OUTDOOR or not room.room.has_floor:
            continue
        if rng.random() < share:
            area, has = float(room.area.area), flux_of_lamps(draft.items[k] for k in room.items)
            wanted = flux_for_floor(area, WANTS[room.kind].lux)
            if has < flux_for_floor(area, _WEAK_LX):
                flux = min(max(wanted - has, _FLUX_LM[0]), _FLUX_LM[1])
                hang_from_ceiling(draft, catalogue, style, room_id, flux, rng)
        if rng.random() < share:
            stand_by_beds(draft, catalogue, style, room_id, rng)
            stand_by_sofas(draft, catalogue, style, room_id, rng)
