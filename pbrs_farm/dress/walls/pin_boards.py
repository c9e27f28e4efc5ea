"""Boards of cork with what a household pins to them; no effects but on the draft."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.classes import DESK, TABLE, WHITEBOARD
from pbrs_farm.dress.generated.assembly import Made, Part, any_colour, hung, plain
from pbrs_farm.dress.generated.turned import slab
from pbrs_farm.dress.space import HouseSpace
from pbrs_farm.dress.space.room_kinds import RoomKind
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.walls.hanging import IN_FRONT_M, Hanging, faces_behind
from pbrs_farm.dress.walls.hung_things import frame_material, ring

_BOARDS: Final = {
    RoomKind.OFFICE: 0.75, RoomKind.BEDROOM: 0.35, RoomKind.KITCHEN: 0.4, RoomKind.HALL: 0.2,
}  # fmt: skip
_LOW_M: Final = 1.2


def hang_pin_board(hanging: Hanging, space: HouseSpace, style: Style, share: float) -> None:
    """A pin board over the room's desk, else on any free wall of a kitchen, hall or study."""
    kind = hanging.room.kind
    rng = hanging.draft.rng("pin board", hanging.room.room.id)
    if rng.random() >= _BOARDS.get(kind, 0.0) * share:
        return
    width, height = float(rng.uniform(0.55, 0.95)), float(rng.uniform(0.42, 0.65))
    made = pin_board(rng, style, width, height)
    low = hanging.floor_y + _LOW_M
    places = _over_desks(hanging, space)
    if kind is not RoomKind.BEDROOM:
        places += [
            (k, float(s) + width / 2 + 0.05)
            for k, face in enumerate(hanging.faces)
            for s in face.starts(width + 0.1, low - 0.05, low + height + 0.05, IN_FRONT_M)[::8]
        ]
    for k, s in places:
        if hanging.faces[k].free_m(s - width / 2, s + width / 2, low, low + height) >= IN_FRONT_M:
            hanging.hang(*made, k, s, low)
            return
    hanging.draft.refused["walls: no free wall for a pin board"] += 1


def _over_desks(hanging: Hanging, space: HouseSpace) -> list[tuple[int, float]]:
    """(face, s) of the wall behind the middle of each desk, or table in a room with a bed."""
    found = []
    for number in hanging.room.items:
        item, (low, high) = hanging.draft.items[number], space.bounds[number]
        if item.nyu40 in (DESK, TABLE) and 0.6 < high[1] - hanging.floor_y < 0.95:
            found += [(k, (s0 + s1) / 2) for k, s0, s1 in faces_behind(hanging.room, low, high)[:1]]
    return found


def pin_board(rng: np.random.Generator, style: Style, width: float, height: float) -> Made:
    """Cork in a frame, with papers, cards and photographs pinned to it."""
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    parts: list[Part] = [
        (ring("frame", low, high, 0.022, 0.018), frame_material(rng, style)),
        (
            slab((low[0] + 0.022, 0.022, 0.001), (high[0] - 0.022, height - 0.022, 0.01)),
            plain("cork", (0.66, 0.5, 0.34), 0.9),
        ),
    ]
    # Pin sheets to cells of a grid, so that they lie beside one another.
    columns, rows = max(2, int(width / 0.19)), max(2, int(height / 0.2))
    for i in range(columns * rows):
        if rng.random() < 0.3:
            continue
        w, h = (float(v) for v in rng.uniform((0.07, 0.08), (0.15, 0.16)))
        x = low[0] + 0.03 + (i % columns + 0.5) * (width - 0.06) / columns
        y = 0.03 + (i // columns + 0.5) * (height - 0.06) / rows
        white = rng.random() < 0.5
        sheet = plain("sheet", (0.92, 0.91, 0.88) if white else any_colour(rng, style), 0.8)
        card = slab((x - w / 2, y - h / 2, 0.01), (x + w / 2, y + h / 2, 0.0108))
        parts.append((card, sheet))
        if white:
            lines = plain("print", (0.45, 0.45, 0.47), 0.8)
            for k in range(int(rng.integers(2, 5))):
                top = y + h / 2 - 0.018 - 0.018 * k
                line = slab((x - 0.38 * w, top - 0.003, 0.0108), (x + 0.35 * w, top, 0.0111))
                parts.append((line, lines))
        pin = slab((x - 0.005, y + h / 2 - 0.012, 0.0108), (x + 0.005, y + h / 2 - 0.002, 0.016))
        parts.append((pin, plain("pin", any_colour(rng, style), 0.3)))
    return hung("pin_board", "pin_board", WHITEBOARD, parts)
