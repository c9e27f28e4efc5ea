"""Cupboards, open boxes and rails above the worktops of kitchens without any. Effects: changes the house."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.classes import CABINET, COUNTER, OTHERFURNITURE, SHELVES, SINK
from pbrs_farm.dress.content import content
from pbrs_farm.dress.space import HouseSpace
from pbrs_farm.dress.style import Style, mix
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.dress.walls.hanging import Hanging, faces_behind
from pbrs_farm.dress.walls.hung_things import CUPBOARD_FORMS
from pbrs_farm.home.names import words_of_item
from pbrs_farm.home.room_use import RoomKind

_WORKTOPS: Final = frozenset({CABINET, COUNTER, OTHERFURNITURE, SINK})
_TOP_M: Final = (0.7, 1.15)  # heights of worktops
_OVER_M: Final = 1.42  # height of cupboards' lower edge above the floor
_BEFORE_M: Final = 0.38
_HOT: Final = frozenset({"cooker", "stove", "hob", "oven"})  # nothing hangs over them
_CHANCE, _RAIL, _OPEN = 0.75, 0.6, 0.3
_LEAST_M: Final = 0.35
_DEEP_M: Final = 0.32  # depth of cupboards; open ones are 4 cm less


def hang_kitchen(hanging: Hanging, space: HouseSpace, style: Style, share: float) -> None:
    """Hang cupboards above a kitchen's worktops where the wall is free, and a rail below or instead."""
    rng = hanging.house.rng("kitchen wall", hanging.room.room.id)
    if hanging.room.kind is not RoomKind.KITCHEN or rng.random() >= share:
        return
    runs = _walls_over_worktops(hanging, space)
    if not _has_cupboards(hanging, space) and rng.random() < _CHANCE:
        _hang_cupboards(hanging, runs, style, rng)
    if rng.random() < _RAIL:
        _hang_rail(hanging, runs, style, rng)


def _has_cupboards(hanging: Hanging, space: HouseSpace) -> bool:
    return any(
        hanging.house.items[n].nyu40 in (CABINET, SHELVES)
        and space.bounds[n][0, 1] > hanging.floor_y + 1.2
        for n in hanging.room.items
    )


def _walls_over_worktops(hanging: Hanging, space: HouseSpace) -> list[tuple[int, float, float]]:
    """(face, s0, s1) of the wall behind each stretch of worktops that join."""
    pieces: dict[int, list[tuple[float, float]]] = {}
    for number in hanging.room.items:
        item, (low, high) = hanging.house.items[number], space.bounds[number]
        is_top = _TOP_M[0] < high[1] - hanging.floor_y < _TOP_M[1] and item.nyu40 in _WORKTOPS
        if is_top and not words_of_item(item) & _HOT:
            for k, s0, s1 in faces_behind(hanging.room, low, high)[:1]:
                pieces.setdefault(k, []).append((s0, s1))
    runs: list[tuple[int, float, float]] = []
    for k in sorted(pieces):
        # Merge adjacent worktops.
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
    body = white if rng.random() < 0.6 else front
    form = int(rng.integers(CUPBOARD_FORMS))
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
            if is_open:
                cupboard = content().things["open_cupboard"](
                    rng, style, body, w, height, _DEEP_M - 0.04
                )
            else:
                options = (body, front, w, height, _DEEP_M, 2 if w > 0.62 else 1, form)
                cupboard = content().things["wall_cupboard"](rng, style, *options)
            tags = ("support",) if is_open else ()
            hanging.hang(*cupboard, k, s + w / 2, low, margin_m=0.0, tags=tags)
            s += w + 0.001


def _hang_rail(
    hanging: Hanging, runs: list[tuple[int, float, float]], style: Style, rng: np.random.Generator
) -> None:
    width = float(rng.uniform(0.55, 0.95))
    piece, shape = content().things["tool_rail"](rng, style, width)
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
    hanging.house.refused["walls: no free wall for a kitchen rail"] += 1
