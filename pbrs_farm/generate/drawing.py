"""A floor plan by seed: programme, layout, walls, openings; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import Plan
from pbrs_farm.generate.layout import Layout, layout
from pbrs_farm.generate.openings import openings_of
from pbrs_farm.generate.plan_walls import rooms_of, runs_of, walls_of
from pbrs_farm.generate.programme import Programme, Wishes, drawn_programme

_PROGRAMMES: Final = 6  # that are tried before a wish is refused


def drawn_plan(
    rng: np.random.Generator, wishes: Wishes | None = None, programme: Programme | None = None
) -> Plan:
    """A plan for a programme, or for one drawn by seed as wished. Raises BadInput if none fits."""
    where = layout(programme, rng, is_fixed=True) if programme else _drawn_layout(rng, wishes)
    return plan_of_layout(where, drawn_height(rng), rng)


def drawn_height(rng: np.random.Generator) -> float:
    """From floor to ceiling, metres: mostly what people draw."""
    return float(rng.choice([2.4, 2.5, 2.5, 2.5, 2.6, 2.7]))


def plan_of_layout(where: Layout, height: float, rng: np.random.Generator) -> Plan:
    """Walls and rooms on rectangles, with doors and windows."""
    runs = runs_of(where)
    walls = walls_of(where, runs)
    rooms = rooms_of(where, walls)
    all_rooms, all_walls, openings = openings_of(where, runs, walls, rooms, rng)
    return Plan(all_rooms, all_walls, openings, height)


def _drawn_layout(rng: np.random.Generator, wishes: Wishes | None) -> Layout:
    """Rectangles for a programme by seed; for another one where it has none."""
    for _ in range(_PROGRAMMES):
        try:
            return layout(drawn_programme(rng, wishes), rng)
        except BadInput as error:
            refused = error
    raise refused
