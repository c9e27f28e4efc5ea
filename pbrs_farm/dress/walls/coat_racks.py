"""Rows of hooks with coats, bags and bathrobes on them; no effects but on the draft."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.classes import CLOTHES
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.generated.assembly import (
    Made,
    Part,
    any_colour,
    hung,
    metal,
    plain,
    transformed,
)
from pbrs_farm.dress.generated.turned import slab, smooth
from pbrs_farm.dress.space.room_kinds import RoomKind, is_cooked_in
from pbrs_farm.dress.style import Rgb, Style, mix
from pbrs_farm.dress.walls.hanging import Hanging

_HOOKS_M: Final = 1.68  # of the board's lower edge above the floor
_BEFORE_M: Final = 0.55
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
            for s in face.starts(width + 0.1, bottom + float(low[1]), bottom + 0.12, _BEFORE_M)
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
