"""The part `walls` of dressing: everything that hangs on walls, room by room; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.classes import CABINET, CLOTHES, COUNTER, OTHERFURNITURE, SHELVES, SINK
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.space import HouseSpace, house_space
from pbrs_farm.dress.style import Rgb, Style, mix
from pbrs_farm.dress.things.assembly import (
    Made,
    Part,
    any_colour,
    hung,
    metal,
    plain,
    slab,
    smooth,
    transformed,
)
from pbrs_farm.dress.walls.fittings import (
    fit_switches,
    hang_clock,
    hang_mirrors,
    hang_radiators,
    wants_radiators,
)
from pbrs_farm.dress.walls.hanging import Hanging, faces_behind
from pbrs_farm.dress.walls.hung_things import Fronts, open_box, tool_rail, wall_cupboard
from pbrs_farm.dress.walls.pictures import Gallery, hang_pictures, hang_pin_board
from pbrs_farm.dress.walls.wall_furniture import hang_cloth, hang_shelves
from pbrs_farm.home.names import words_of_item
from pbrs_farm.home.room_use import RoomKind, is_cooked_in

# Cupboards, open boxes and rails over the worktops of kitchens that have none but on the draft.


_WORKTOPS: Final = frozenset({CABINET, COUNTER, OTHERFURNITURE, SINK})
_TOP_M: Final = (0.7, 1.15)  # heights of worktops
_OVER_M: Final = 1.42  # above the floor: the lower edge of cupboards
_BEFORE_M: Final = 0.38
_HOT: Final = frozenset({"cooker", "stove", "hob", "oven"})  # nothing hangs over them
_CHANCE, _RAIL, _OPEN = 0.75, 0.6, 0.3
_LEAST_M: Final = 0.35


def hang_kitchen(hanging: Hanging, space: HouseSpace, style: Style, share: float) -> None:
    """Cupboards over a kitchen's worktops, as far as the wall is free, and a rail below or instead."""
    rng = hanging.draft.rng("kitchen wall", hanging.room.room.id)
    if hanging.room.kind is not RoomKind.KITCHEN or rng.random() >= share:
        return
    runs = _runs(hanging, space)
    if not _has_cupboards(hanging, space) and rng.random() < _CHANCE:
        _hang_cupboards(hanging, runs, style, rng)
    if rng.random() < _RAIL:
        _hang_rail(hanging, runs, style, rng)


def _has_cupboards(hanging: Hanging, space: HouseSpace) -> bool:
    return any(
        hanging.draft.items[n].nyu40 in (CABINET, SHELVES)
        and space.bounds[n][0, 1] > hanging.floor_y + 1.2
        for n in hanging.room.items
    )


def _runs(hanging: Hanging, space: HouseSpace) -> list[tuple[int, float, float]]:
    """(face, s0, s1) of the wall behind each stretch of worktops that join."""
    pieces: dict[int, list[tuple[float, float]]] = {}
    for number in hanging.room.items:
        item, (low, high) = hanging.draft.items[number], space.bounds[number]
        is_top = _TOP_M[0] < high[1] - hanging.floor_y < _TOP_M[1] and item.nyu40 in _WORKTOPS
        if is_top and not words_of_item(item) & _HOT:
            for k, s0, s1 in faces_behind(hanging.room, low, high)[:1]:
                pieces.setdefault(k, []).append((s0, s1))
    runs: list[tuple[int, float, float]] = []
    for k in sorted(pieces):
        # Join what stands side by side.
        for s0, s1 in sorted(pieces[k]):
            if runs and runs[-1][0] == k and s0 < runs[-1][2] + 0.05:
                runs[-1] = (k, runs[-1][1], max(s1, runs[-1][2]))
            else:
                runs.append((k, s0, s1))
    return runs


def _hang_cupboards(
    hanging: Hanging, runs: list[tuple[int, float, float]], style: Style, rng: np.random.Generator
) -> None:
    height, low = float(rng.uniform(0.58, 0.74)), hanging.floor_y + _OVER_M
    tone = mix((0.9, 0.9, 0.88), style.palette[2], float(rng.choice([0.0, 0.0, 0.5])))
    white = plain("kitchen front", tone, 0.35)
    wood = plain(f"kitchen {style.wood.name}", style.wood.mean, 0.45)
    front = wood if rng.random() < 0.35 else white
    fronts = Fronts(white if rng.random() < 0.6 else front, front, metal(style))
    for k, s0, s1 in runs:
        face, s = hanging.faces[k], max(s0, 0.0)
        width = float(rng.choice([0.45, 0.5, 0.6, 0.8]))
        while s < min(s1, face.length) - _LEAST_M:
            w = min(width, min(s1, face.length) - s - 0.004)
            # Go on in small steps where something is in the way.
            if face.free_m(s, s + w, low - 0.02, low + height + 0.02) < _BEFORE_M:
                s += 0.05
                continue
            is_open = rng.random() < _OPEN
            made = (
                open_box(fronts, w, height)
                if is_open
                else wall_cupboard(fronts, w, height, 2 if w > 0.62 else 1)
            )
            tags = ("support",) if is_open else ()
            hanging.hang(*made, k, s + w / 2, low, margin_m=0.0, tags=tags)
            s += w + 0.001


def _hang_rail(
    hanging: Hanging, runs: list[tuple[int, float, float]], style: Style, rng: np.random.Generator
) -> None:
    width = float(rng.uniform(0.55, 0.95))
    piece, shape = tool_rail(rng, style, metal(style), width)
    bottom = float(shape.bounds[0, 1])
    low = hanging.floor_y + 0.97 - bottom
    for k, s0, s1 in runs:
        middle = (s0 + s1) / 2
        for shift in (0.0, 0.3, -0.3, 0.6, -0.6):
            s = middle + shift
            is_there = s0 - 0.05 < s - width / 2 and s + width / 2 < s1 + 0.05
            top = low + float(shape.bounds[1, 1]) + 0.02
            if (
                is_there
                and hanging.faces[k].free_m(s - width / 2, s + width / 2, low + bottom, top) > 0.15
            ):
                hanging.hang(piece, shape, k, s, low)
                return
    hanging.draft.refused["walls: no free wall for a kitchen rail"] += 1


# Rows of hooks with coats, bags and bathrobes on them but on the draft.


_HOOKS_M: Final = 1.68  # of the board's lower edge above the floor
_RACK_BEFORE_M: Final = 0.55
_RACKS: Final = {
    RoomKind.HALL: 0.85,
    RoomKind.BEDROOM: 0.4,
    RoomKind.BATHROOM: 0.45,
    RoomKind.OFFICE: 0.25,
}
_MOST: Final = {RoomKind.HALL: 4, RoomKind.BEDROOM: 2, RoomKind.BATHROOM: 2, RoomKind.OFFICE: 1}


def hang_coats(hanging: Hanging, style: Style, share: float) -> None:
    """Hooks with what the room's people take off there, on a free stretch of wall."""
    kind = hanging.room.kind
    rng = hanging.draft.rng("coats", hanging.room.room.id)
    if rng.random() >= _RACKS.get(kind, 0.0) * share:
        return
    # Nobody hangs coats where it smells of cooking.
    items = hanging.draft.items
    if is_cooked_in(items[k] for k in hanging.room.items if k < len(items)):
        return
    for n in range(_MOST[kind], 0, -1):
        piece, shape = coat_rack(rng, style, n, is_bath=kind is RoomKind.BATHROOM)
        low, high = shape.bounds
        width, bottom = float(high[0] - low[0]), hanging.floor_y + _HOOKS_M
        places = [
            (k, float(s))
            for k, face in enumerate(hanging.faces)
            for s in face.starts(width + 0.1, bottom + float(low[1]), bottom + 0.12, _RACK_BEFORE_M)
        ]
        if places:
            k, s = places[int(rng.integers(len(places)))]
            hanging.hang(piece, shape, k, s + 0.05 + width / 2, bottom)
            return
    hanging.draft.refused["walls: no free wall for a coat rack"] += 1


def coat_rack(rng: np.random.Generator, style: Style, n: int, *, is_bath: bool) -> Made:
    """A board with hooks 0.3 m apart and garments on most; its lower edge at y = 0."""
    step = 0.3
    half = n * step / 2
    board = plain(f"rack {style.wood.name}", style.wood.mean, 0.4)
    white = plain("rack white", (0.9, 0.9, 0.88), 0.4)
    steel = metal(style)
    parts: list[Part] = [
        (slab((-half, 0.0, 0.0), (half, 0.09, 0.018)), board if rng.random() < 0.6 else white)
    ]
    # A hook is an arm out of the board and a tip that turns up.
    for k in range(n):
        x = -half + (k + 0.5) * step
        parts.append((slab((x - 0.008, 0.035, 0.018), (x + 0.008, 0.05, 0.06)), steel))
        parts.append((slab((x - 0.008, 0.05, 0.048), (x + 0.008, 0.07, 0.06)), steel))
        if n == 1 or rng.random() < 0.85:
            parts += _garment(rng, style, x, is_bath=is_bath)
    return hung("coat_rack", "clothes", CLOTHES, parts)


def _garment(rng: np.random.Generator, style: Style, x: float, *, is_bath: bool) -> list[Part]:
    """A coat that hangs from its collar at (x, 0.04), before the board."""
    long = float(rng.uniform(0.95, 1.15) if is_bath else rng.uniform(0.65, 1.05))
    wide = float(rng.uniform(0.2, 0.27))
    if is_bath:
        colour: Rgb = mix((0.92, 0.91, 0.89), any_colour(rng, style), 0.3)
    else:
        usual = [(0.09, 0.1, 0.13), (0.2, 0.2, 0.2), (0.35, 0.28, 0.2), (0.16, 0.2, 0.16)]
        colour = usual[int(rng.integers(4))] if rng.random() < 0.6 else any_colour(rng, style)
    cloth = plain("coat", colour, 0.95)
    phase = float(rng.uniform(0, 6))
    body = _draped(wide, long, 0.075, phase)
    parts: list[Part] = [(transformed(body, np.eye(3), (x, 0.045, 0.105)), cloth)]
    # Sleeves hang at both sides, a little behind.
    for sign in (-1.0, 1.0):
        sleeve = _draped(0.07, min(0.62, 0.8 * long), 0.055, phase + sign)
        at = (x + sign * (wide / 2 - 0.015), 0.02, 0.085)
        parts.append((transformed(sleeve, np.eye(3), at), cloth))
    return parts


def _draped(wide: float, long: float, deep: float, phase: float) -> Surface:
    """A closed hanging bag of cloth, its top at y = 0: pinched above, folded below."""
    n, rows = 22, 9
    angles = 2 * np.pi * np.arange(n) / n
    v = np.linspace(0, 1, rows)
    # Widen from the collar to the shoulders, then slowly to the hem.
    grow = np.interp(v, [0.0, 0.06, 0.14, 0.5, 1.0], [0.25, 0.62, 0.9, 0.85, 1.0])
    fold = 1 + 0.22 * v[:, None] * np.sin(5 * angles + phase + 0.8 * v[:, None])
    x = wide / 2 * grow[:, None] * np.cos(angles)
    z = deep / 2 * np.minimum(grow + 0.1, 1.0)[:, None] * np.sin(angles) * fold
    y = np.broadcast_to(-long * v[:, None], x.shape)
    ring = np.stack([x, y, z], -1).reshape(-1, 3)
    points = np.concatenate([ring, [[0.0, 0.0, 0.0]], [[0.0, -long, 0.0]]])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    faces = [np.stack([np.full(n, rows * n), after, k], -1)]
    for r in range(rows - 1):
        a, b = r * n, (r + 1) * n
        faces += [
            np.stack([a + k, a + after, b + after], -1),
            np.stack([a + k, b + after, b + k], -1),
        ]
    last = (rows - 1) * n
    faces.append(np.stack([np.full(n, rows * n + 1), last + k, last + after], -1))
    return smooth("coat", points, np.concatenate(faces).astype(np.int32))


# The part `walls` of dressing.


PART = "walls"


def walls(draft: Draft, catalogue: Catalogue, style: Style, share: float) -> None:
    """Hang mirrors, radiators, switches, coats, shelves, pictures, clocks and sockets in the rooms of the draft.

    share: 0..1 of what a room would get.
    """
    space = house_space(draft)
    is_heated = wants_radiators(draft)
    gallery = Gallery(draft, catalogue, style)
    for room in space.rooms:
        if not room.faces or room.kind is RoomKind.OUTDOOR:
            continue
        hanging = Hanging(draft, room, PART)
        # What has one right place comes first.
        hang_mirrors(hanging, space, style, share)
        if is_heated:
            hang_radiators(hanging, style, share)
        fit_switches(hanging, catalogue, style, share)
        hang_kitchen(hanging, space, style, share)
        hang_coats(hanging, style, share)
        hang_pin_board(hanging, space, style, share)
        hang_shelves(hanging, style, share)
        hang_pictures(hanging, space, gallery, style, share)
        hang_cloth(hanging, style, share)
        hang_clock(hanging, style, share)
