"""Shelves, boxes and cupboards on walls, towel radiators and woven cloth. Effects: changes the house."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.classes import OTHERPROP
from pbrs_farm.core.house import Material
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model, Part, hanging_piece, transformed
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.dress.walls.fittings import hang_anywhere
from pbrs_farm.dress.walls.hanging import IN_FRONT_M, WANTS, Hanging
from pbrs_farm.dress.walls.hung_things import CUPBOARD_FORMS, faced_slab, jpeg_texture
from pbrs_farm.geometry.bodies import revolve
from pbrs_farm.home.room_use import RoomKind

_RADIATORS: Final = 0.65  # share of bathrooms with a towel radiator
_LADDER_M: Final = 0.45  # height of a towel radiator's foot above the floor
_ABOVE_M: Final = 0.32  # free height above the highest board, for its contents
_BEFORE_M: Final = 0.3  # free before it


def hang_shelves(hanging: Hanging, style: Style, share: float) -> None:
    """Boards, open boxes and cupboards: the clutter that follows fills them. A bath's towel radiator."""
    kind = hanging.room.kind
    rng = hanging.house.rng("shelf", hanging.room.room.id)
    low, high = WANTS[kind].shelves, WANTS[kind].most_shelves
    n_shelves = int(np.floor(rng.integers(low, high + 1) * share + rng.random()))
    is_bath = kind is RoomKind.BATHROOM
    if is_bath and rng.random() < _RADIATORS * share:
        hang_anywhere(hanging, content().things["towel_radiator"](rng, style), _LADDER_M, 0.2, rng)
    wood = plain(f"shelf {style.wood.name}", style.wood.mean, 0.4)
    board = wood if rng.random() < 0.6 else plain("shelf white", (0.9, 0.9, 0.88), 0.4)
    # Shelves of one room share a design, with several widths.
    for _ in range(n_shelves):
        longest = 0.7 if is_bath else 1.7
        width = float(rng.uniform(0.35 if is_bath else 0.6, longest))
        shelf_seed = int(rng.integers(1 << 30))
        for factor in (1.0, 0.65, 0.45):
            shelf, low_m, above_m = _shelf(
                np.random.default_rng(shelf_seed), style, board, width * factor, is_bath=is_bath
            )
            depth = float(shelf[1].bounds[1, 2])
            if hang_anywhere(
                hanging, shelf, low_m, depth + _BEFORE_M, rng, above_m=above_m, tags=("support",)
            ):
                break


def _shelf(
    rng: np.random.Generator, style: Style, board: Material, width: float, *, is_bath: bool
) -> tuple[Model, float, float]:
    """Something with shelves, how high above the floor its lower edge hangs, and what stays free above it."""
    depth = float(rng.uniform(0.14, 0.18) if is_bath else rng.uniform(0.19, 0.27))
    kind = rng.random()
    if kind < 0.5:
        boards = int(rng.choice([1, 2, 2, 3]))
        return (
            content().things["wall_shelf"](rng, style, width, depth, boards, board),
            1.5 if boards == 1 else 1.38,
            _ABOVE_M,
        )
    if kind < 0.75:
        height = float(rng.choice([0.34, 0.34, 0.62]))
        shelf = content().things["open_cupboard"](rng, style, board, width, height, depth)
        return shelf, float(rng.uniform(1.35, 1.55)), _ABOVE_M
    n_doors = max(1, round(width / 0.45))
    height = float(rng.uniform(0.38, 0.6))
    args = (board, board, width, height, depth + 0.06, n_doors, int(rng.integers(CUPBOARD_FORMS)))
    shelf = content().things["wall_cupboard"](rng, style, *args)
    return shelf, float(rng.uniform(1.4, 1.6)), 0.05


def hang_cloth(hanging: Hanging, style: Style, share: float) -> None:
    """A woven cloth on a rod, in some rooms."""
    rng = hanging.house.rng("wall cloth", hanging.room.room.id)
    if rng.random() >= WANTS[hanging.room.kind].cloth * share:
        return
    width, height = float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.6, 1.1))
    hang_anywhere(hanging, wall_cloth(rng, style, width, height), 1.6 - height / 2, IN_FRONT_M, rng)


def wall_cloth(rng: np.random.Generator, style: Style, width: float, height: float) -> Model:
    """A patterned cloth that hangs from a rod, a fringe at its foot."""
    fringe, rod = 0.09, 0.009
    pixels = content().rug_pixels(rng, width, height, style, str(rng.choice(content().rugs)))
    texture = jpeg_texture("wall cloth", pixels)
    shown = Material(f"cloth {texture.id[:8]}", texture_id=texture.id, roughness=1.0)
    r, g, b = (float(c) / 255 for c in pixels.reshape(-1, 3).mean(0))
    yarn = plain("yarn", (r, g, b), 1.0)
    low, high = np.array([-width / 2, fringe]), np.array([width / 2, height])
    face, back = faced_slab("cloth", low, high, (0.002, 0.008))
    parts: list[Part] = [(face, shown), (back, yarn)]
    for x in np.arange(-width / 2 + 0.01, width / 2 - 0.01, 0.02):
        ends = (
            np.array([float(x), float(rng.uniform(0.0, 0.015))]),
            np.array([float(x) + 0.012, fringe]),
        )
        parts += [(part, yarn) for part in faced_slab("fringe", *ends, (0.003, 0.007))]
    along = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    long = width + 0.1
    stick = revolve([(0.0, 0.0), (rod, 0.0), (rod, long), (0.0, long)], n=12)
    parts.append(
        (
            transformed(stick, along, (-long / 2, height + rod, rod)),
            plain("rod", style.wood.mean, 0.5),
        )
    )
    return hanging_piece("wall_cloth", "wall_cloth", OTHERPROP, parts, [texture])
