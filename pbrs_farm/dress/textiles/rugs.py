"""Lays rugs under sofas, beds and tables, mats before doors and in bathrooms; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import BATHTUB, BED, FLOOR_MAT, SINK, SOFA, TABLE
from pbrs_farm.core.house import Item, ItemKind, Material, Surface
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model, Part, hanging_piece
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import HouseSpace, RoomSpace, house_space
from pbrs_farm.dress.style import Style, room_style, shade
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.dress.walls.hanging import next_id
from pbrs_farm.dress.walls.hung_things import jpeg_texture
from pbrs_farm.geometry.bodies import hoop, loft
from pbrs_farm.geometry.outlines import Triple, gathered, oval, rect
from pbrs_farm.geometry.solids import boxes_surface
from pbrs_farm.home.room_use import RoomKind

# fmt: off
PASS = "textiles"
RUG_TAG = "rug"
_FROM_WALL_M = 0.3
_BORDERED = ("bordered", "plain", "sisal", "diamonds", "faded")
_RUG_FORMS = ("sharp", "rounded", "fringed", "long fringe", "tassels", "bound", "rope", "stitched",
    "scalloped", "octagon", "oval", "oval rope", "hide")
_MAT_FORMS = ("sharp", "rounded", "oval", "bound", "rope", "stitched", "scalloped", "octagon")
_DOOR_MAT_FORMS = ("sharp", "rounded", "half", "bound", "stitched", "octagon")
_STRAIGHT = ("sharp", "fringed", "tassels", "bound", "rope", "stitched")  # forms with square corners
_FLEECES = ("shag", "plain", "bobbles")  # patterns of hides
_GAP_M = 0.0005  # gap between the floor and the rug's back
_SIZES = ((1.6, 2.3), (1.7, 2.4), (2.0, 3.0), (2.0, 2.9), (1.4, 2.0), (1.2, 1.7))
_LEAST_M, _MOST_M = 0.3, 6.0  # least and greatest side of a rug


def rug(rng: np.random.Generator, width: float, length: float, style: Style,
    patterns: Sequence[str] = (), forms: Sequence[str] = _RUG_FORMS) -> Model:
    """A rug along x, back at y = 0, of one of the patterns and forms (its edge; half is half an oval)."""
    patterns = patterns or content().rugs
    pattern, form = str(rng.choice(list(patterns))), str(rng.choice(list(forms)))
    # A border runs along straight sides, rings along round ones.
    if pattern in _BORDERED and form not in _STRAIGHT:
        form = str(rng.choice(_STRAIGHT))
    elif pattern == "rings":
        form = str(rng.choice(("oval", "oval rope")))
    elif form == "hide" and pattern not in _FLEECES:
        form = "bound"
    thick = float(rng.uniform(0.008, 0.0095))
    pixels = content().rug_pixels(rng, width, length, style, pattern)
    texture = jpeg_texture(f"rug {pattern}", pixels)
    shown = Material(f"rug {texture.id[:8]}", texture_id=texture.id, roughness=1.0)
    # The back and the edge take the mean colour of the face.
    r, g, b = (round(float(c) / 255, 2) for c in pixels.reshape(-1, 3).mean(0))
    edge = plain("rug edge", (r, g, b), 1.0)
    inset, trimmings = _trimmings(rng, width, length, form, edge, style)
    size = (length - 2 * inset[0], width - 2 * inset[1])
    face, back = _slab(_rug_outline(rng, *size, form), thick, size)
    parts = [(face, shown), (back, edge), *trimmings]
    return hanging_piece("rug", "rug", FLOOR_MAT, parts, [texture], Place.FLOOR)


def _rug_outline(
    rng: np.random.Generator, length: float, width: float, form: str
) -> list[tuple[float, float]]:
    match form:
        case "oval" | "oval rope":
            return oval(length, width, n=40)
        case "half":
            # The straight side is at the door.
            t = np.pi * np.arange(25) / 24
            return [(float(length / 2 * np.cos(a)), float(width * (0.5 - np.sin(a)))) for a in t]
        case "octagon":
            return rect(length, width, 0.22 * width, n=1)
        case "scalloped":
            return gathered(length - 0.03, width - 0.03, float(rng.uniform(0.07, 0.13)), 0.015)
        case "hide":
            # Legs at the corners, uneven sides.
            t = -2 * np.pi * (np.arange(48) + 0.5) / 48
            r = 0.86 + 0.1 * np.cos(4 * t + np.pi) + sum(
                0.02 * rng.normal() * np.cos(k * t + rng.uniform(0, 6)) for k in range(2, 7))
            ring = r * np.stack([np.cos(t), np.sin(t)])
            low, high = ring.min(1), ring.max(1)
            x, z = ((ring.T - (low + high) / 2) / (high - low) * [length, width]).T
            return [(float(a), float(b)) for a, b in zip(x, z, strict=True)]
        case "rounded":
            return rect(length, width, 0.08)
    return rect(length, width, 0.0005)


def _trimmings(rng: np.random.Generator, width: float, length: float, form: str, edge: Material,
    style: Style) -> tuple[tuple[float, float], list[Part]]:
    """The distances of a rug's body from its ends and sides, and the parts between."""
    yarn = plain("fringe", (0.8, 0.76, 0.68), 1.0)
    colour = style.textiles[int(rng.integers(len(style.textiles)))]
    dyed = plain("rug border", shade(colour, 0.7), 1.0)
    end, side = length / 2, width / 2
    match form:
        case "fringed":
            return (0.05, 0.0), [(_fringe(rng, side, end, 0.05, 0.025), yarn)]
        case "long fringe":
            cord = yarn if rng.random() < 0.6 else edge
            return (0.1, 0.0), [(_fringe(rng, side, end, 0.1, 0.05), cord)]
        case "tassels":
            boxes: list[tuple[Triple, Triple]] = []
            for x, z in product((-1.0, 1.0), (-side, side - 0.03)):
                spans = [(0.045, 0.062, z, 0.03, 0.009)]
                spans += [(0.0, 0.05, z + 0.011 * k, 0.008, 0.003) for k in range(3)]
                for near, far, low, wide, thick in spans:
                    x0, x1 = sorted((x * (end - near), x * (end - far)))
                    boxes.append(((x0, 0.0, low), (x1, thick, low + wide)))
            return (0.06, 0.0), [(boxes_surface("tassels", boxes, 0), dyed)]
        case "bound":
            t, high = float(rng.uniform(0.02, 0.05)), 0.0098
            tape = [((-end, 0.0, -side), (end, high, t - side)),
                ((-end, 0.0, side - t), (end, high, side)),
                ((-end, 0.0, t - side), (t - end, high, side - t)),
                ((end - t, 0.0, t - side), (end, high, side - t))]
            return (t, t), [(boxes_surface("tape", tape, 0), dyed)]
        case "rope" | "oval rope":
            along, across = length - 0.012, width - 0.012
            path = rect(along, across, 0.02) if form == "rope" else oval(along, across, n=48)
            return (0.006, 0.006), [(hoop(path, 0.0049, 0.0049), dyed)]
        case "stitched":
            return (0.004, 0.004), [(_stitches(side, end, float(rng.uniform(0.04, 0.07))), dyed)]
    return (0.0, 0.0), []


def _stitches(side: float, end: float, step: float) -> Surface:
    """Stitches over the edge all round."""
    ends = product(np.arange(step / 2 - end, end - 0.004, step), (0.011 - side, side - 0.011))
    sides = product((0.011 - end, end - 0.011), np.arange(step - side, side - step / 2, step))
    rows = [(x, z, 0.003, 0.011) for x, z in ends] + [(x, z, 0.011, 0.003) for x, z in sides]
    stitches = [((x - a, 0.0, z - b), (x + a, 0.0099, z + b)) for x, z, a, b in rows]
    return boxes_surface("stitches", stitches, 0)


def _slab(
    outline: list[tuple[float, float]], thick: float, size: tuple[float, float]
) -> tuple[Surface, Surface]:
    """A slab with an outline: its upper face with a picture's coordinates, and the rest."""
    whole = loft([(outline, 0.0), (outline, thick)])
    is_top = np.isclose(whole.positions[whole.faces][:, :, 1], thick).all(1)
    uvs = whole.positions[:, [0, 2]] / [size[0], -size[1]] + 0.5
    face = replace(whole, faces=whole.faces[is_top], uvs=uvs.astype(np.float32))
    return face, replace(whole, faces=whole.faces[~is_top])


def _fringe(rng: np.random.Generator, w: float, end: float, long: float, step: float) -> Surface:
    """Tassels at both ends of a rug."""
    tassels = []
    for z in np.arange(-w + 0.01, w - 0.01, step):
        for side in (-1.0, 1.0):
            tip = end - float(rng.uniform(0.0, 0.012))
            x0, x1 = sorted((side * (end - long), side * tip))
            tassels.append(((x0, 0.0, float(z)), (x1, 0.003, float(z) + 0.012)))
    return boxes_surface("fringe", tassels, 0)


def lay_rugs(
    house: MutableHouse, room_id: str, style: Style, rng: np.random.Generator, share: float
) -> None:
    """The rugs and mats of one room."""
    space = house_space(house)
    room = space.room(room_id)
    lay = {RoomKind.LIVING: _by_sofa, RoomKind.BEDROOM: _by_bed, RoomKind.DINING: _by_table,
        RoomKind.BATHROOM: _bath_mat, RoomKind.HALL: _runner,
        RoomKind.OTHER: _by_sofa}.get(room.kind)
    likely = {RoomKind.DINING: 0.45, RoomKind.HALL: 0.6}.get(room.kind, 0.8)
    if lay is not None and rng.random() < likely * share:
        lay(house, space, room, style, rng)
    if rng.random() < 0.8 * share:
        _doormats(house, space, room, style, rng)


def _by_sofa(
    house: MutableHouse, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    sofas = _furniture_of_class(house, room, SOFA)
    if not sofas:
        if room.kind is RoomKind.LIVING:
            _by_table(house, space, room, style, rng)
        return
    box = max((house.items[n].oriented_box for n in sofas), key=lambda b: float(b.half[0]))
    front = box.axes[:, 2] * [1, 0, 1]
    # In front of the sofa, its feet on the rug, round the table there.
    middle = box.centre + front * (float(box.half[2]) + 0.65)
    tables = [house.items[n].oriented_box.centre for n in _furniture_of_class(house, room,
        TABLE) if np.linalg.norm((house.items[n].oriented_box.centre - middle)[[0, 2]]) < 1.0]
    if tables:
        middle = np.mean([middle, *tables[:1]], axis=0)
    turn = float(np.arctan2(front[0], front[2]))
    _lay_largest(house, space, room, style, rng, middle, turn, _shuffled(rng))


def _by_bed(
    house: MutableHouse, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    beds = _furniture_of_class(house, room, BED)
    if not beds:
        return
    box = max((house.items[n].oriented_box for n in beds), key=lambda b: float(b.half[0]))
    front, right = box.axes[:, 2] * [1, 0, 1], box.axes[:, 0] * [1, 0, 1]
    half = box.half
    turn = float(np.arctan2(front[0], front[2]))
    # Across the bed under its foot, else a runner along a side or at the foot.
    if half[0] > 0.6 and rng.random() < 0.65:
        wide = 2 * float(half[0]) + float(rng.uniform(0.7, 1.1))
        position = box.centre + front * float(half[2]) * 0.45
        narrow = 2 * float(half[0]) + 0.3
        sizes = [(w, min(long, 3.0)) for long in (wide, narrow) for w in (2.0, 1.7, 1.4)]
        if _lay_largest(house, space, room, style, rng, position, turn, sizes, from_wall=0.1):
            return
    for sign in (1.0, -1.0):
        position = box.centre + right * sign * (float(half[0]) + 0.42)
        if _lay_largest(house, space, room, style, rng, position, turn + np.pi / 2,
            [(0.7, 1.5), (0.6, 1.1)], from_wall=0.05):
            return
    position = box.centre + front * (float(half[2]) + 0.45)
    _lay_largest(house, space, room, style, rng, position, turn, [(0.7, 1.4), (0.6, 1.0)], from_wall=0.1)


def _by_table(
    house: MutableHouse, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    boxes = [house.items[n].oriented_box for n in _furniture_of_class(house, room, TABLE)]
    large = [b for b in boxes if min(b.half[0], b.half[2]) > 0.35]
    if not large:
        return
    box = max(large, key=lambda b: float(b.half[0] * b.half[2]))
    # The rug follows the table's longer side, 0.35 to 0.6 m larger for chairs.
    axis = 0 if box.half[0] >= box.half[2] else 2
    along = box.axes[:, axis]
    turn = float(np.arctan2(-along[2], along[0]))
    sizes = [
        (2 * float(box.half[2 - axis]) + more, 2 * float(box.half[axis]) + more)
        for more in (1.2, 1.0, 0.7)
    ]
    _lay_largest(house, space, room, style, rng, box.centre, turn, sizes, from_wall=0.2)


def _bath_mat(
    house: MutableHouse, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    for nyu40 in (BATHTUB, SINK):
        for number in _furniture_of_class(house, room, nyu40):
            box = house.items[number].oriented_box
            for axis, sign in ((2, 1.0), (0, 1.0), (0, -1.0)):
                out = box.axes[:, axis] * sign * [1, 0, 1]
                position = box.centre + out * (float(box.half[axis]) + 0.3)
                turn = float(np.arctan2(out[0], out[2]))
                if _lay_largest(house, space, room, style, rng, position, turn,
                    [(0.5, 0.8), (0.45, 0.65)], from_wall=0.02, patterns=content().bath_mats,
                    forms=_MAT_FORMS, bare=True):
                    return


def _runner(
    house: MutableHouse, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    inner = room.area.representative_point()
    x, z = float(inner.x), float(inner.y)
    x0, z0, x1, z1 = room.area.bounds
    turn = 0.0 if x1 - x0 >= z1 - z0 else np.pi / 2
    sizes = [(0.8, 2.6), (0.8, 2.0), (0.7, 1.5), (0.6, 1.0)]
    _lay_largest(house, space, room, style, rng, np.array([x, 0.0, z]), turn, sizes, from_wall=0.12)


def _doormats(
    house: MutableHouse, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    # Inside every door that leads out of the home.
    for door in room.doors:
        side = door.side_of(room.room.id)
        if side is None or None not in door.room_ids or door.width > 1.4:
            continue
        position = door.face_point(side) + door.inward(side) * 0.38
        out = door.inward(side)
        turn = float(np.arctan2(out[0], out[2]))
        _lay_largest(house, house_space(house), room, style, rng, position, turn,
            [(0.45, 0.75), (0.4, 0.6)], from_wall=0.05, patterns=content().door_mats,
            forms=_DOOR_MAT_FORMS, bare=True, at_doors=True)


def _furniture_of_class(house: MutableHouse, room: RoomSpace, nyu40: int) -> list[int]:
    # Toys of the class are on tables; furniture is on the floor.
    floor = room.room.floor_y
    return [n for n in room.items if house.items[n].nyu40 == nyu40 and house.items[n].bounds[0,
        1] < floor + 0.3]


def _shuffled(rng: np.random.Generator) -> list[tuple[float, float]]:
    # A size drawn among the large ones, smaller ones after it.
    first = int(rng.integers(0, 4))
    return [_SIZES[first], *_SIZES[first + 1 :], _SIZES[1], *_SIZES[4:]]


def _lay_largest(house: MutableHouse, space: HouseSpace, room: RoomSpace, style: Style,
    rng: np.random.Generator, middle: F64, turn: float, sizes: list[tuple[float, float]], *,
    from_wall: float = _FROM_WALL_M, patterns: Sequence[str] = (),
    forms: Sequence[str] = _RUG_FORMS, bare: bool = False, at_doors: bool = False) -> bool:
    """Lay the first fitting size (width, length across the front) near the place. bare: off furniture."""
    free = shapely.buffer(shapely.difference(room.area, room.walls), -from_wall, join_style="mitre")
    taken = _floor_mats(house, space, room)
    if not at_doors:
        swings = [d.swing(s) for d in room.doors if (s := d.side_of(room.room.id)) is not None]
        taken = shapely.union_all([taken, *swings])
    for width, length in sizes:
        for shift in ((0.0, 0.0), (0.15, 0.0), (-0.15, 0.0), (0.3, 0.0), (-0.3, 0.0), (0.0, 0.15),
            (0.0, -0.15)):
            position = middle + _offset(turn, shift)
            area = _rug_area(position, turn, width, length)
            if not shapely.contains(free, area) or shapely.intersects(taken, area):
                continue
            if bare and not _is_bare(space, room, area):
                continue
            piece, shape = rug(rng, width, length, style, tuple(patterns), forms)
            where = np.array([position[0], room.room.floor_y + _GAP_M, position[2]])
            item: Item = house.placed(piece, shape, where, turn, item_id=next_id(house, PASS),
                room_id=room.room.id, level_id=room.room.level_id, tags=(RUG_TAG,))
            house.add(item, PASS, piece)
            return True
    house.refused[f"{PASS}: no floor for a rug"] += 1
    return False


def _offset(turn: float, shift: tuple[float, float]) -> F64:
    c, s = np.cos(turn), np.sin(turn)
    return np.array([shift[0] * c + shift[1] * s, 0.0, -shift[0] * s + shift[1] * c])


def _rug_area(at: F64, turn: float, width: float, length: float) -> BaseGeometry:
    corners = [
        (at + _offset(turn, (sx * length / 2, sz * width / 2)))[[0, 2]]
        for sx, sz in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return shapely.Polygon(corners)


def _floor_mats(house: MutableHouse, space: HouseSpace, room: RoomSpace) -> BaseGeometry:
    """The plan area of rugs in the room, and of low items that a rug would cut."""
    shapes = []
    for n in room.items:
        low, high = space.bounds[n]
        if house.items[n].nyu40 == FLOOR_MAT or high[1] < room.room.floor_y + 0.05:
            shapes.append(shapely.box(low[0], low[2], high[0], high[2]))
    return shapely.union_all(shapes)


def _is_bare(space: HouseSpace, room: RoomSpace, area: BaseGeometry) -> bool:
    x0, z0, x1, z1 = area.bounds
    low = np.array([x0, room.room.floor_y + 0.002, z0])
    high = np.array([x1, room.room.floor_y + 0.1, z1])
    return space.is_free(low, high)


def cover_drawn_rugs(house: MutableHouse, style: Style, share: float) -> None:
    """Give a share of the source's plain rugs a picture of the room's style; pictures stay."""
    for index, item in enumerate(house.items[: len(house.source.items)]):
        if item.kind is not ItemKind.OBJECT or item.nyu40 != FLOOR_MAT or not item.n_faces:
            continue
        if any(house.materials[s.material].texture_id for s in item.surfaces):
            continue
        rng = house.rng(PASS, "drawn rug", item.id)
        if rng.random() < share:
            taste = room_style(style, house.rng(PASS, item.room_id or "", "style"))
            covered = _covered(house, item, taste, rng)
            if covered is not None:
                house.change(index, covered, PASS)
                house.done[f"{PASS}: drawn rug"] += 1


def _covered(
    house: MutableHouse, item: Item, style: Style, rng: np.random.Generator
) -> Item | None:
    box = item.oriented_box
    sides = 2 * box.half
    along, across = (0, 2) if sides[0] >= sides[2] else (2, 0)
    if sides[across] < _LEAST_M or sides[along] > _MOST_M:
        return None
    pattern = str(rng.choice(content().rugs))
    pixels = content().rug_pixels(rng, float(sides[across]), float(sides[along]), style, pattern)
    texture = jpeg_texture(f"rug {pattern}", pixels)
    shown = Material(f"rug {texture.id[:8]}", texture_id=texture.id, roughness=1.0)
    number = house.material(shown, [texture])
    # Lay the picture over the plan: its edges show at the sides, which are a centimetre high.
    surfaces = []
    for surface in item.surfaces:
        local = (surface.positions.astype(np.float64) - box.centre) @ box.axes
        uvs = local[:, [along, across]] / sides[[along, across]] + 0.5
        surfaces.append(
            replace(surface, material=number, uvs=np.clip(uvs, 0.002, 0.998).astype(np.float32))
        )
    return replace(item, surfaces=tuple(surfaces))
