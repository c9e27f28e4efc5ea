"""A floor plan by seed: programme, layout, walls, openings. No effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import Plan
from pbrs_farm.generate.layout import Layout, layout
from pbrs_farm.generate.openings import openings_of
from pbrs_farm.generate.plan_walls import rooms_of, runs_of, walls_of
from pbrs_farm.generate.programme import Programme, Wishes, drawn_programme, with_family
from pbrs_farm.generate.slants import with_slants

_PROGRAMMES: Final = 6  # programmes drawn and tried before the wish is refused


def drawn_plan(
    rng: np.random.Generator, wishes: Wishes | None = None, programme: Programme | None = None
) -> Plan:
    """A floor plan by seed, for a user's programme or drawn within wishes; BadInput if none fits."""
    if programme:
        plans = (wishes and wishes.plans) or programme.plans
        where = layout(replace(programme, plans=plans), rng, is_fixed=True)
        return plan_of_layout(where, drawn_height(where, rng), rng)
    where = _drawn_layout(rng, with_family(wishes or Wishes(), rng))
    plan = plan_of_layout(where, drawn_height(where, rng), rng)
    return with_slants(plan, where.programme.family, rng)


def drawn_height(where: Layout, rng: np.random.Generator) -> float:
    """From floor to ceiling, metres."""
    return float(rng.choice(where.programme.family.heights))


def plan_of_layout(where: Layout, height: float, rng: np.random.Generator) -> Plan:
    """Rooms, walls, doors and windows by seed on a layout's rectangles; a balcony comes on top."""
    runs = runs_of(where)
    walls = walls_of(where, runs)
    rooms = rooms_of(where, walls)
    all_rooms, all_walls, openings = openings_of(where, runs, walls, rooms, rng)
    return Plan(all_rooms, all_walls, openings, height, where.programme.plans)


def _drawn_layout(rng: np.random.Generator, wishes: Wishes) -> Layout:
    """Rectangles for a programme by seed; redraws the programme if it has no solution."""
    for _ in range(_PROGRAMMES):
        try:
            return layout(drawn_programme(rng, wishes), rng)
        except BadInput as error:
            refused = error
    raise refused
