"""The kinds of questions about space: their subjects, wording and answers; no effects.

The kinds and their names are those of VSI-Bench (Yang et al. 2025, "Thinking in Space"). A kind's
`drafts` gives the unambiguous questions about a clip: items with a unique name, clearly visible, and
answers that do not depend on small distances.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.export.nouns import plural
from pbrs_farm.export.questions.clips import WHOLE, Clip, Thing

_MOST_TRIED: Final = 60  # maximum combinations of items tried, per clip and kind
_MOST_WAYS: Final = 600  # the same for routes, since few are free
_LEAST_GAP_M: Final = 0.3  # minimum distance in a question
_CLEARLY: Final = 1.25  # minimum ratio of the second nearest distance to the nearest ...
_CLEARLY_M: Final = 0.25  # ... and minimum difference, metres
_STEP_APART_M: Final = 0.7  # minimum distance between the centres of items in a direction question
_MARGIN_DEG: Final = 15.0  # minimum angle between a direction and the boundary to the next one
_LATER_FRAMES: Final = (
    5  # minimum frames from the first view of an item to the first pixel of the next
)
# Nouns with an ambiguous extent: a sink's bowl or its cabinet, one curtain or both.
_UNMEASURED: Final = frozenset({"sink", "curtain", "set of curtains"})
_SIDES: Final = ("left", "right")
_SIDES_OR_BACK: Final = ("left", "right", "back")
_QUADRANTS: Final = ("front-left", "front-right", "back-left", "back-right")


@dataclass(frozen=True, slots=True)
class Draft:
    """A possible question: the words of its template, its answer, and its instances."""

    words: dict[str, str]
    answer: str  # a number, or one of options
    options: tuple[str, ...]  # () for a number
    about: tuple[int, ...]  # instances, in the order of the words


@dataclass(frozen=True, slots=True)
class QuestionKind:
    """name: of VSI-Bench. styles: templates with the fields of Draft.words and {here}.

    answers: all possible answers, if every question has the same few; the counts of right answers then
    differ by two at most.
    """

    name: str
    drafts: Callable[[Clip, random.Random], Iterator[Draft]]
    styles: tuple[str, ...]
    of_walks_only: bool = False
    answers: tuple[str, ...] = ()


def choices_of_things(
    rng: random.Random, things: Sequence[Thing], n: int, most: int = _MOST_TRIED
) -> Iterator[tuple[Thing, ...]]:
    """Distinct ordered choices of n items, in random order."""
    done: set[tuple[int, ...]] = set()
    if len(things) < n:
        return
    if n <= 2:
        orders = list(permutations(range(len(things)), n))
        rng.shuffle(orders)
        for chosen in orders[:most]:
            yield tuple(things[k] for k in chosen)
        return
    for _ in range(most):
        chosen = tuple(rng.sample(range(len(things)), n))
        if chosen not in done:
            done.add(chosen)
            yield tuple(things[k] for k in chosen)


def _counts(clip: Clip, _rng: random.Random) -> Iterator[Draft]:
    """Number of items of a noun, at least two, unless the clip has look-alikes of another noun."""
    for noun, same in clip.by_noun.items():
        if len(same) > 1 and not clip.has_look_alike(noun):
            yield Draft({"many": plural(noun)}, str(len(same)), (), tuple(t.instance for t in same))


def _distances(clip: Clip, rng: random.Random) -> Iterator[Draft]:
    """Gap between two items, metres."""
    for a, b in choices_of_things(rng, clip.single, 2):
        gap = clip.gap_m(a, b)
        if gap >= _LEAST_GAP_M:
            words = {"a": a.noun, "b": b.noun}
            yield Draft(words, f"{gap:.1f}", (), (a.instance, b.instance))


def _sizes(clip: Clip, _rng: random.Random) -> Iterator[Draft]:
    """Longest side of an almost fully visible item, centimetres."""
    for thing in clip.single:
        if thing.noun in _UNMEASURED:
            continue
        if thing.most_visible >= WHOLE and thing.longest_m >= 0.1:
            yield Draft({"a": thing.noun}, f"{100 * thing.longest_m:.0f}", (), (thing.instance,))


def _room_sizes(clip: Clip, _rng: random.Random) -> Iterator[Draft]:
    """Floor area of the rooms entered by the camera, square metres."""
    area = sum(float(shapely.Polygon(room.polygon).area) for room in clip.rooms_entered)
    if area > 0:
        yield Draft({}, f"{area:.1f}", (), ())


def _visits(clip: Clip, _rng: random.Random) -> Iterator[Draft]:
    """Number of times that the camera is in a room, which it may have left and entered again."""
    names = Counter(room.name for room in clip.house.rooms)
    for room in clip.rooms_entered:
        visits = clip.visits_of(room, _LATER_FRAMES)
        if visits and room.name and names[room.name] == 1:
            yield Draft({"room": room.name.lower()}, str(visits), (), ())


def _nearest(clip: Clip, rng: random.Random) -> Iterator[Draft]:
    """The nearest of four items to a fifth."""
    for target, *candidates in choices_of_things(rng, clip.single, 5):
        gaps = sorted((clip.gap_m(target, candidate), candidate.noun) for candidate in candidates)
        nearest, second = gaps[0][0], gaps[1][0]
        if is_clearly_nearer(nearest, second):
            yield Draft(
                {"a": target.noun},
                gaps[0][1],
                tuple(candidate.noun for candidate in candidates),
                (target.instance, *(candidate.instance for candidate in candidates)),
            )


def is_clearly_nearer(nearest_m: float, second_m: float) -> bool:
    """True if the second distance is larger by a ratio and a length that anybody sees."""
    return second_m >= max(_CLEARLY * nearest_m, nearest_m + _CLEARLY_M)


def bearing_deg(stand: F64, face: F64, to: F64) -> float:
    """Bearing of `to` in plan, degrees, seen from `stand` in the direction of `face`: 0 ahead, 90 right.

    stand, face, to: (2,) x and z in metres; world y is up and right-handed. Left is negative.
    """
    ahead, aim = face - stand, to - stand
    right = np.array([-ahead[1], ahead[0]])
    return float(np.degrees(np.arctan2(aim @ right, aim @ ahead)))


def _side(bearing: float) -> str:
    return "right" if bearing > 0 else "left"


def _left_or_right(bearing: float, margin_deg: float) -> str:
    """left or right; "" if too close to straight ahead or straight back."""
    return _side(bearing) if margin_deg <= abs(bearing) <= 180 - margin_deg else ""


def _left_right_or_back(bearing: float, margin_deg: float) -> str:
    if abs(bearing) >= 135 + margin_deg:
        return "back"
    return _side(bearing) if margin_deg <= abs(bearing) <= 135 - margin_deg else ""


def _quadrant(bearing: float, margin_deg: float) -> str:
    if abs(abs(bearing) - 90) < margin_deg or not _left_or_right(bearing, margin_deg):
        return ""
    return f"{'front' if abs(bearing) < 90 else 'back'}-{_side(bearing)}"


def _directions(
    answer_of: Callable[[float, float], str], options: tuple[str, ...]
) -> Callable[[Clip, random.Random], Iterator[Draft]]:
    """Direction of a third item, for a person next to the first who faces the second."""

    def drafts(clip: Clip, rng: random.Random) -> Iterator[Draft]:
        for a, b, c in choices_of_things(rng, clip.single, 3):
            answer = side_of(clip, (a, b, c), answer_of)
            if answer:
                words = {"a": a.noun, "b": b.noun, "c": c.noun}
                yield Draft(words, answer, options, (a.instance, b.instance, c.instance))

    return drafts


def side_of(
    clip: Clip, things: Sequence[Thing], answer_of: Callable[[float, float], str] = _left_or_right
) -> str:
    """Direction of the third item, for a person next to the first who faces the second; "" if unclear.

    The answer holds at the first item's centre, by a margin, and at each of its corners.
    """
    a, b, c = things
    distances = [float(np.linalg.norm(x.middle - y.middle)) for x, y in ((a, b), (a, c), (b, c))]
    is_crowded = a.plan.intersects(b.plan) or a.plan.intersects(c.plan)
    if min(distances) < _STEP_APART_M or is_crowded or not clip.stands_on_floor(a):
        return ""
    answer = answer_of(bearing_deg(a.middle, b.middle, c.middle), _MARGIN_DEG)
    corners = shapely.get_coordinates(a.plan)
    is_same = all(
        answer_of(bearing_deg(corner, b.middle, c.middle), 0) == answer for corner in corners
    )
    return answer if is_same else ""


def _turn(before: Thing, at: Thing, after: Thing) -> str:
    """The turn at an item between two others; "" if no word fits."""
    way = at.middle - before.middle
    bearing = bearing_deg(at.middle, at.middle + way, after.middle)
    if abs(bearing) >= 180 - 2 * _MARGIN_DEG:
        return "turn back"
    fits = abs(abs(bearing) - 90) <= 2 * _MARGIN_DEG
    return f"turn {_side(bearing)}" if fits else ""


def _routes(clip: Clip, rng: random.Random) -> Iterator[Draft]:
    """The turns of a route over one or two items to a last one."""
    turns = ("turn left", "turn right", "turn back")
    places = [thing for thing in clip.single if clip.stands_on_floor(thing)]
    for n in (3, 4):
        for stops in choices_of_things(rng, places, n, _MOST_WAYS):
            taken = [_turn(*stops[k : k + 3]) for k in range(n - 2)]
            if not all(taken) or not all(
                clip.is_way_free(stops[k], stops[k + 1]) for k in range(n - 1)
            ):
                continue
            answer = ", ".join(taken)
            options = list(turns) if n == 3 else _four_of(rng, answer, turns)
            steps = [f"1. Go forward until the {stops[1].noun}."]
            for k, stop in enumerate(stops[2:]):
                steps.append(f"{2 * k + 2}. [please fill in]")
                steps.append(f"{2 * k + 3}. Go forward until the {stop.noun}.")
            words = {
                "a": stops[0].noun,
                "b": stops[1].noun,
                "c": stops[-1].noun,
                "steps": " ".join(steps),
            }
            yield Draft(words, answer, tuple(options), tuple(t.instance for t in stops))


def _four_of(rng: random.Random, answer: str, turns: tuple[str, ...]) -> list[str]:
    """The answer and three other pairs of turns."""
    wrong = [f"{a}, {b}" for a in turns for b in turns if f"{a}, {b}" != answer]
    return [answer, *rng.sample(wrong, 3)]


def _orders(clip: Clip, rng: random.Random) -> Iterator[Draft]:
    """Order of the first appearance of four items."""
    for chosen in choices_of_things(rng, clip.single, 4):
        by_time = sorted(chosen, key=lambda t: t.first_seen or 0)
        if any(
            later.first_glimpsed < (earlier.first_seen or 0) + _LATER_FRAMES
            for earlier, later in pairwise(by_time)
        ):
            continue
        right = ", ".join(t.noun for t in by_time)
        wrong = [
            ", ".join(t.noun for t in order)
            for order in permutations(by_time)
            if list(order) != by_time
        ]
        options = (right, *rng.sample(wrong, 3))
        words = {"things": ", ".join(t.noun for t in chosen)}
        yield Draft(words, right, options, tuple(t.instance for t in chosen))


# fmt: off
KINDS: Final = (
    QuestionKind(
        "object_counting", _counts,
        (
            "How many {many} are there {here}?",
            "Count the {many} {here}. Answer with a number.",
            "What is the number of {many} {here}?",
        ),
    ),
    QuestionKind(
        "object_abs_distance", _distances,
        (
            "How far apart are the {a} and the {b}, between their nearest points? Answer in metres, to one"
            " decimal.",
            "What is the distance in metres (to one decimal) from the {a} to the {b}, measured where they"
            " are closest?",
            "Measure from the closest point of each: how many metres lie between the {a} and the {b}?"
            " Give one decimal.",
        ),
    ),
    QuestionKind(
        "object_size_estimation", _sizes,
        (
            "How long is the longest side of the {a} (length, width or height), in centimetres?",
            "What does the {a} measure along its longest dimension? Answer in centimetres.",
            "Take the largest of length, width and height of the {a}: how many centimetres is it?",
        ),
    ),
    QuestionKind(
        "room_size_estimation", _room_sizes,
        (
            "What floor area do the rooms that the camera enters have together, in square metres?",
            "How many square metres of floor are in the rooms that the camera walks through, all taken"
            " together?",
        ),
        of_walks_only=True,
    ),
    QuestionKind(
        "room_visits", _visits,
        (
            "How many separate times is the camera in the {room}? It may leave and come back.",
            "Count the stays of the camera in the {room}: how many are there, from the first to the last?",
        ),
        of_walks_only=True,
    ),
    QuestionKind(
        "object_rel_distance", _nearest,
        (
            "Measured from the closest point of each, which of these is nearest to the {a}: {choices}?",
            "Which of these things is closest to the {a}: {choices}?",
            "Of {choices}, which has the smallest gap to the {a}?",
        ),
    ),
    QuestionKind(
        "object_rel_direction_easy", _directions(_left_or_right, _SIDES),
        (
            "I stand by the {a} and face the {b}. Is the {c} to my left or to my right?",
            "Standing next to the {a} and looking at the {b}, on which side is the {c}: left or right?",
        ),
        answers=_SIDES,
    ),
    QuestionKind(
        "object_rel_direction_medium", _directions(_left_right_or_back, _SIDES_OR_BACK),
        (
            "I stand by the {a} and face the {b}. Is the {c} to my left, to my right, or behind me? Behind"
            " me means that I would have to turn by at least 135 degrees to face it.",
            "Next to the {a}, looking at the {b}: is the {c} left, right or back? Back is a turn of 135"
            " degrees or more.",
        ),
        answers=_SIDES_OR_BACK,
    ),
    QuestionKind(
        "object_rel_direction_hard",
        _directions(_quadrant, _QUADRANTS),
        (
            "I stand by the {a} and face the {b}. Is the {c} to my front-left, front-right, back-left or"
            " back-right? These are the quadrants of a plan with me at the middle, facing along its axis.",
            "Next to the {a}, looking at the {b}: in which quadrant is the {c}, with me at the origin and"
            " the {b} straight ahead?",
        ),
        answers=_QUADRANTS,
    ),
    QuestionKind(
        "route_planning", _routes,
        (
            "You are a robot that starts at the {a} and faces the {b}. You want to reach the {c}. Fill in"
            " each gap with 'turn back', 'turn left' or 'turn right': {steps} You have arrived.",
        ),
    ),
    QuestionKind(
        "obj_appearance_order", _orders,
        (
            "In which order do these things first appear in the video: {things}?",
            "Put these in the order in which they are first seen in the video: {things}.",
        ),
        of_walks_only=True,
    ),
)
# fmt: on
"""All kinds. A kind is added by a row: nothing else lists them."""
