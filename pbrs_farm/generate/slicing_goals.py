"""Goals of a slicing: leaves, contacts, and the distance of a layout from them. No effects."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

STEP_M: Final = 0.05
_WALL_STEPS: Final = 3  # steps that walls take from a room's width, about
_AREA_SHARES: Final = (0.72, 1.4)  # least and largest area of a leaf by its wished area
_ARM_STEPS: Final = 50  # least steps of an arm of the outline beside a court
_UNMET: Final = 1.5  # cost of a hard rule that is not met, beside how far it is from it

IntRect = tuple[int, int, int, int]  # x0, z0, x1, z1 in steps


@dataclass(frozen=True, slots=True)
class SliceLeaf:
    """A rectangle of the plan with its requirements; lengths in metres."""

    area: float  # with its share of the walls, square metres
    min_width: float
    max_aspect: float = math.inf
    outer: float = 0.0  # least length of outer wall with daylight
    any_outer: float = 0.0  # least length of any outer wall
    is_corner: bool = False  # a notch of the outline: in a corner, counted as outside
    is_court: bool = False  # such a notch in the middle of a side
    pinned: IntRect | None = None  # exact place; at most one leaf of a brief
    holds: IntRect | None = None  # area that it must contain


@dataclass(frozen=True, slots=True)
class Contact:
    """A rule that a leaf shares a stretch of wall with one of others."""

    leaf: int
    others: tuple[int, ...]
    length: float  # metres
    is_hard: bool = True


@dataclass(frozen=True, slots=True)
class Brief:
    """The problem for the annealer to solve."""

    leaves: tuple[SliceLeaf, ...]
    contacts: tuple[Contact, ...]
    hall: int  # the leaf that a first tree puts in the middle
    width: int  # of the outline, steps
    depth: int
    lit_sides: tuple[bool, bool, bool, bool]  # left, top, right, bottom: daylight comes in there
    places: tuple[tuple[int, IntRect, bool], ...] = ()  # given to leaves: (leaf, place, exactly)


def given_places(leaves: Sequence[SliceLeaf]) -> tuple[tuple[int, IntRect, bool], ...]:
    """(leaf, place, whether exact) of leaves with a given place, exact ones last."""
    around = [(i, leaf.holds, False) for i, leaf in enumerate(leaves) if leaf.holds]
    return (*around, *((i, leaf.pinned, True) for i, leaf in enumerate(leaves) if leaf.pinned))


class Rules:
    """Distance of a layout's rooms from their requirements."""

    def __init__(self, brief: Brief) -> None:
        self._brief = brief
        self._width, self._depth, self._lit = brief.width, brief.depth, brief.lit_sides
        self._limits = [
            (leaf.min_width, leaf.max_aspect, _has_place(leaf)) for leaf in brief.leaves
        ]
        self._contacts = [(c.leaf, c.others, c.length, c.is_hard) for c in brief.contacts]
        self._notches = [
            i for i, leaf in enumerate(brief.leaves) if leaf.is_corner or leaf.is_court
        ]

    def judge(
        self, rects: list[IntRect], good: float = math.inf, most: Callable[[], float] = lambda: 0.0
    ) -> tuple[float, int] | None:
        """(smooth cost, number of violated hard rules) of a rectangle, in steps of STEP_M, for each leaf.

        None as soon as the cost exceeds both `good` and the result of `most`, which is called once, and only if the
        cost exceeds `good`.
        """
        total, unmet = 0.0, 0
        limit, is_final = good, False
        for leaf, (min_width, max_aspect, has_place), rect in zip(
            self._brief.leaves, self._limits, rects, strict=True
        ):
            width = rect[2] - rect[0] - _WALL_STEPS
            depth = rect[3] - rect[1] - _WALL_STEPS
            short, long = (width, depth) if width < depth else (depth, width)
            short_m = short * STEP_M
            if short_m < min_width:
                total += _UNMET + 4 * (min_width - short_m)
                unmet += 1
            if long > max_aspect * short:
                aspect = long / short if short > 0 else 20.0
                total += min(2 * (aspect - max_aspect), 6.0)
                unmet += aspect > 1.3 * max_aspect
            # Only cuts that keep off a pinned leaf divide by other shares than those of areas.
            if self._brief.places:
                missed = _missed_area(leaf, rect)
                total += missed
                unmet += missed > 0
            missing = self._missing_place(leaf, rect, rects) if has_place else 0.0
            if missing > 0:
                total += _UNMET + missing
                unmet += 1
            if total > limit and not is_final:
                limit, is_final = most(), True
            if total > limit:
                return None
        for leaf_number, partners, length, is_hard in self._contacts:
            rect, missing = rects[leaf_number], math.inf
            for partner in partners:
                missing = min(missing, _missing_contact(rect, rects[partner], length))
                if missing <= 0:
                    break
            if missing > 0:
                total += _UNMET + missing if is_hard else 0.2 + 0.3 * min(missing, 2.0)
                unmet += is_hard
                if total > limit and not is_final:
                    limit, is_final = most(), True
                if total > limit:
                    return None
        return total, unmet

    def _missing_place(self, leaf: SliceLeaf, rect: IntRect, rects: list[IntRect]) -> float:
        """Metres by which a leaf misses its place and outer wall; of a notch, whether it is off the corners."""
        if leaf.is_corner:
            return self._off_corner(rect)
        if leaf.is_court:
            return self._off_middle(rect)
        if leaf.pinned:
            return sum(abs(a - b) for a, b in zip(rect, leaf.pinned, strict=True)) * STEP_M
        missed = _missing_around(rect, leaf.holds) if leaf.holds else 0.0
        if not leaf.outer and not leaf.any_outer:
            return missed
        x0, z0, x1, z1 = rect
        left, top, right, bottom = self._lit
        # Measure the stretches on the outline, with daylight and without.
        daylight = anywhere = 0
        for is_there, length, is_lit in (
            (x0 == 0, z1 - z0, left),
            (z0 == 0, x1 - x0, top),
            (x1 == self._width, z1 - z0, right),
            (z1 == self._depth, x1 - x0, bottom),
        ):
            if is_there and length > anywhere:
                anywhere = length
            if is_there and is_lit and length > daylight:
                daylight = length
        # A notch is outside, too.
        for notch in self._notches:
            beside = shared_length(rect, rects[notch])
            daylight, anywhere = max(daylight, beside), max(anywhere, beside)
        lacking = max(leaf.outer - daylight * STEP_M, leaf.any_outer - anywhere * STEP_M)
        return missed + max(lacking, 0.0)

    def _off_corner(self, rect: IntRect) -> float:
        x0, z0, x1, z1 = rect
        at_x = x0 == 0 or x1 == self._brief.width
        at_z = z0 == 0 or z1 == self._brief.depth
        spans = x1 - x0 == self._brief.width or z1 - z0 == self._brief.depth
        return 0.0 if at_x and at_z and not spans else 2.0 - at_x - at_z + spans

    def _off_middle(self, rect: IntRect) -> float:
        """Metres by which a court misses one side of the outline, or an arm beside it its width."""
        (x0, z0, x1, z1), (width, depth) = rect, (self._width, self._depth)
        at_x, at_z = (x0 == 0) + (x1 == width), (z0 == 0) + (z1 == depth)
        if at_x + at_z != 1:
            return 2.0
        arms = (z0, depth - z1) if at_x else (x0, width - x1)
        return sum(max(_ARM_STEPS - arm, 0) for arm in arms) * STEP_M


def _has_place(leaf: SliceLeaf) -> bool:
    is_notch = leaf.is_corner or leaf.is_court
    return bool(leaf.outer or leaf.any_outer or is_notch or leaf.pinned or leaf.holds)


def _missed_area(leaf: SliceLeaf, rect: IntRect) -> float:
    """Cost of a rectangle much smaller or larger than its leaf's area."""
    area = (rect[2] - rect[0]) * (rect[3] - rect[1]) * STEP_M**2
    share, (low, high) = max(area / leaf.area, 0.05), _AREA_SHARES
    if leaf.pinned or low <= share <= high:
        return 0.0
    return _UNMET + 2 * math.log(low / share if share < low else share / high)


def _missing_around(rect: IntRect, inner: IntRect) -> float:
    """Metres by which the sides of a rectangle lie within those of another one."""
    low = max(rect[0] - inner[0], 0) + max(rect[1] - inner[1], 0)
    return (low + max(inner[2] - rect[2], 0) + max(inner[3] - rect[3], 0)) * STEP_M


def _missing_contact(a: IntRect, b: IntRect, length: float) -> float:
    """Metres by which two rectangles miss `length` of common wall, the gap between them counted."""
    ax0, az0, ax1, az1 = a
    bx0, bz0, bx1, bz1 = b
    overlap_x = (ax1 if ax1 < bx1 else bx1) - (ax0 if ax0 > bx0 else bx0)
    overlap_z = (az1 if az1 < bz1 else bz1) - (az0 if az0 > bz0 else bz0)
    # Rectangles of a slicing tree never overlap: one of these is a gap, or 0.
    gap, along = (-overlap_x, overlap_z) if overlap_x <= overlap_z else (-overlap_z, overlap_x)
    return gap * STEP_M + max(length - max(along, 0) * STEP_M, 0.0)


def shared_length(a: IntRect, b: IntRect) -> int:
    """Steps of wall between two rectangles that do not overlap."""
    if a[2] == b[0] or b[2] == a[0]:
        return max(min(a[3], b[3]) - max(a[1], b[1]), 0)
    if a[3] == b[1] or b[3] == a[1]:
        return max(min(a[2], b[2]) - max(a[0], b[0]), 0)
    return 0
