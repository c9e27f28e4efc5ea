"""A home of two storeys by seed: programmes, a core that both share, a plan for each. No effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.made_home import AREA_OF_TWO_STOREYS
from pbrs_farm.generate.drawn_plan import drawn_height, plan_of_layout
from pbrs_farm.generate.floor_plan import Plan, RoomType
from pbrs_farm.generate.layout import Core, lit_sides, storey_layout
from pbrs_farm.generate.programme import (
    AREA_RANGE,
    MEDIAN_AREA,
    Programme,
    RoomWish,
    Wishes,
    drawn_area,
    scaled_rooms,
    with_family,
)
from pbrs_farm.generate.slicing import drawn_outline
from pbrs_farm.generate.slicing_goals import STEP_M, IntRect
from pbrs_farm.generate.staircase import SLAB_M, Stair, stair_between

_STAIRS: Final = (44, 58)  # across its front and from front to back, steps, walls included
_LANDING: Final = 22  # before it, steps
_BESIDE: Final = 56  # between stairs and a corner they do not lie in: a room's width, steps
_WALLS: Final = 1.13  # floor with the walls it needs, by floor alone
_CORES: Final = 1000  # stair cores tried before the wish is refused
_STOREY_TRIES: Final = (2, 6)  # layouts tried of the lower and of the upper storey, for each core
_BEDROOMS: Final = (2, 3, 4)
_BEDROOM_SHARES: Final = (0.25, 0.5, 0.25)


def drawn_storeys(rng: np.random.Generator, wishes: Wishes) -> tuple[tuple[Plan, Plan], Stair]:
    """The lower and the upper plan of a home, and its stairs. Raises BadInput if none is found."""
    wishes = with_family(wishes, rng)
    n_bedrooms = _drawn_bedrooms(rng, wishes)
    for _ in range(_CORES):
        lower, upper = _programmes(rng, wishes, n_bedrooms)
        core = _drawn_core(rng, lower, upper)
        # Generate the upper storey only once the lower one has a plan.
        layouts = []
        for programme, n_tries in zip((lower, upper), _STOREY_TRIES, strict=True):
            storeys = storey_layout(programme, core, n_tries, rng)
            if storeys is None:
                break
            layouts.append(storeys)
        if len(layouts) < 2:
            continue
        height = drawn_height(layouts[0], rng)
        plans = (plan_of_layout(layouts[0], height, rng), plan_of_layout(layouts[1], height, rng))
        front = float(core.front[0]), float(core.front[1])
        foot_is_right = bool(rng.random() < 0.5)
        return plans, stair_between(*plans, front, SLAB_M, foot_is_right=foot_is_right)
    raise BadInput(
        "storeys", "2", "no plan of two storeys was found", hint="another seed, or storeys=1"
    )


def _drawn_bedrooms(rng: np.random.Generator, wishes: Wishes) -> int:
    """Draw the number of bedrooms once, so that numbers whose plans often fail are not under-represented."""
    low, high = max(wishes.bedrooms[0], _BEDROOMS[0]), wishes.bedrooms[1]
    shares = np.array(
        [s for n, s in zip(_BEDROOMS, _BEDROOM_SHARES, strict=True) if low <= n <= high]
    )
    # Redraw numbers without a plan in the given area; at least one number always has one.
    while True:
        n = int(rng.choice(np.arange(low, high + 1), p=shares / shares.sum()))
        if AREA_OF_TWO_STOREYS[n][0] <= wishes.area[1]:
            return n


def _programmes(rng: np.random.Generator, wishes: Wishes, n: int) -> tuple[Programme, Programme]:
    """Programmes of equal area: living and cooking below, n bedrooms and bathrooms above."""
    below = [RoomType.LIVING, RoomType.KITCHEN, RoomType.WC]
    above = [RoomType.BEDROOM] * n + [RoomType.BATHROOM]
    # Move a bedroom down where there are many; add the small rooms of larger homes.
    if n == 4 and rng.random() < 0.5:
        below.append(above.pop(0))
    if rng.random() < 0.4:
        below.append(RoomType.STORE)
    if rng.random() < 0.3:
        above.append(RoomType.WARDROBE)
    if n >= 3 and rng.random() < 0.3:
        above.append(RoomType.BATHROOM)
    storeys = [_draw_room_wishes(rng, types) for types in (below, above)]
    areas = [sum(r.area for r in rooms) for rooms in storeys]
    # Both get the mean area, or half of the requested one.
    whole = float(np.clip(sum(areas), *wishes.area))
    lower, upper = (
        tuple(_with_room_for_toilet(wish) for wish in scaled_rooms(rooms, whole / 2))
        for rooms in storeys
    )
    open_kitchen = bool(rng.random() < 0.4)
    return Programme(lower, open_kitchen=open_kitchen, plans=wishes.plans), Programme(
        upper, is_upper=True, plans=wishes.plans
    )


def _with_room_for_toilet(wish: RoomWish) -> RoomWish:
    """A WC in the corner of another room, its door on any side, needs more than the least area."""
    if wish.type is not RoomType.WC:
        return wish
    return replace(wish, area=max(wish.area, MEDIAN_AREA[RoomType.WC]))


def _draw_room_wishes(rng: np.random.Generator, types: list[RoomType]) -> list[RoomWish]:
    rooms = [RoomWish(t, drawn_area(rng, t)) for t in types]
    # The landing and a door for each room are on it.
    hall = max(sum(r.area for r in rooms) * float(rng.uniform(0.13, 0.18)), 3.5 + 1.3 * len(rooms))
    width, depth = (side * STEP_M for side in _STAIRS)
    rooms.append(RoomWish(RoomType.HALL, float(np.clip(hall, *AREA_RANGE[RoomType.HALL]))))
    return [*rooms, RoomWish(RoomType.STAIRS, width * depth)]


def _drawn_core(rng: np.random.Generator, lower: Programme, upper: Programme) -> Core:
    """An outline for both, stairs at one of its sides, the landing before them."""
    area = _WALLS * (lower.area + upper.area) / 2
    width, depth = drawn_outline(area, rng)
    lit = lit_sides(int(rng.choice([0, 1, 2], p=[0.5, 0.3, 0.2])), rng)
    # Transform the stairs to a frame with x along their wall and z away from it.
    side = int(rng.integers(4))  # left, top, right, bottom
    along, across = (depth, width) if side % 2 == 0 else (width, depth)
    is_sideways = bool(rng.random() < 0.5)
    w, d = (_STAIRS[1], _STAIRS[0]) if is_sideways else _STAIRS
    if is_sideways:
        u = _drawn_start(rng, along, w + _LANDING, w)
        stairs, landing, front = ((u, 0, u + w, d), (u + w, 0, u + w + _LANDING, d), (1, 0))
    else:
        u = _drawn_start(rng, along, w, w)
        stairs, landing, front = ((u, 0, u + w, d), (u, d, u + w, d + _LANDING), (0, 1))
    # Turn the frame onto that side of the outline.
    origin, tip = (_on_side(side, (x, z), across) for x, z in ((0, 0), front))
    places = [_turn_rect(side, rect, across) for rect in (stairs, landing)]
    turned = tip[0] - origin[0], tip[1] - origin[1]
    return Core(width, depth, places[0], places[1], turned, lit)


def _drawn_start(rng: np.random.Generator, along: int, needed: int, width: int) -> int:
    """Where stairs begin on a side: in its corners, or with room for a room on either side."""
    low, high = _BESIDE, along - max(needed, width + _BESIDE)
    if low < high and rng.random() < 0.4:
        return int(rng.integers(low, high))
    return 0 if rng.random() < 0.5 or needed > width else along - width


def _on_side(side: int, point: tuple[int, int], across: int) -> tuple[int, int]:
    """A point (along a side, away from it) in the outline; across: how far the other side is."""
    along, away = point
    return ((away, along), (along, away), (across - away, along), (along, across - away))[side]


def _turn_rect(side: int, rect: IntRect, across: int) -> IntRect:
    a, b = _on_side(side, rect[:2], across), _on_side(side, rect[2:], across)
    return min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1])
