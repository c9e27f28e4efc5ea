"""Minimal pairs: one question about two subjects of a home, with another answer in each; no effects.

A subject is a picture, a film, or two pictures of a room. The subjects of a pair are other views of a home, or the same
views before and after an edit. Both questions have the same words and the same two options, so a guess that ignores the
pictures is right in exactly one of them. In a hidden pair the question must be declined in one picture, where an
obstacle hides an item.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.edits import unedited_id
from pbrs_farm.core.lighting import Mode
from pbrs_farm.export.questions.asking import Asker, Question
from pbrs_farm.export.questions.clips import WHOLE, Clip, Thing
from pbrs_farm.export.questions.kinds import (
    bearing_deg,
    choices_of_things,
    is_clearly_nearer,
    side_of,
)

_MOST_PAIRS: Final = 400  # subjects of a home, for each kind
_OF_A_PICTURE: Final = 2  # questions of a kind about a picture, in all of its pairs
_LEAST_OPEN: Final = 0.3  # share of a door's way from which it is clearly open
_LEAST_COMMON: Final = 2  # items in both pictures of a subject, which relate their cameras
_LEAST_TURN_DEG: Final = 20.0
_MOST_TURN_DEG: Final = 150.0
_APART: Final = 0.05  # of two lamps, as a share of a picture's width
_MOVED_M: Final = 0.5  # minimum distance of two cameras ...
_FARTHER: Final = 2.0  # ... and ratio of the farther one's to the nearer one's
_LIT: Final = (Mode.MLT_IL_OL, Mode.OPENGL_IL)  # pictures in the light of lamps
HIDDEN: Final = "cannot be told"
Things = tuple[Thing, ...]
Subject = tuple[Clip, ...]  # a picture, a film, or two pictures of a room


@dataclass(frozen=True, slots=True)
class PairDraft:
    """The words of a template, and the answer and the instances of each of two subjects."""

    words: dict[str, str]
    answers: tuple[str, str]
    about: tuple[tuple[int, ...], tuple[int, ...]]


Drafts = Callable[[Subject, Subject, random.Random], Iterator[PairDraft]]


@dataclass(frozen=True, slots=True)
class PairKind:
    """subjects: of a pair, from all clips of a home. style: template with the fields of PairDraft.words and {here}."""

    name: str
    subjects: Callable[[Sequence[Clip]], Iterable[tuple[Subject, Subject]]]
    drafts: Drafts
    style: str


def clips_by_home(clips: Iterable[Clip]) -> Iterator[list[Clip]]:
    """The clips of each home together with those of its edited versions, which follow each other."""
    for _home, group in groupby(clips, lambda clip: unedited_id(clip.house.id)):
        yield list(group)


def all_questions(
    clips: Iterable[Clip], on_clip: Callable[[Clip], None] = lambda _clip: None
) -> list[Question]:
    """The questions of clips, then the pairs of each home; on_clip: called with each clip.

    Holds one home at a time.
    """
    asker, questions, pairs = Asker(), list[Question](), list[Question]()
    for of_home in clips_by_home(clips):
        for clip in of_home:
            on_clip(clip)
        questions += asker.asked(of_home)
        pairs += pair_questions(of_home, len(pairs) // 2)
    return questions + pairs


def pair_questions(clips: Sequence[Clip], first_pair: int) -> list[Question]:
    """The pairs about all clips of one home and of its edited versions; first_pair: number of the first.

    Subjects of the same cameras before and after an edit come first.
    """
    rng = random.Random(keys.seed(*(clip.name for clip in clips), "pairs"))
    questions: list[Question] = []
    for kind in PAIR_KINDS:
        n_asked: Counter[str] = Counter()
        subjects = list(kind.subjects(clips))
        rng.shuffle(subjects)
        subjects.sort(
            key=lambda pair: (
                [_views_of(clip) for clip in pair[0]] != [_views_of(clip) for clip in pair[1]]
            )
        )
        for one, two in subjects[:_MOST_PAIRS]:
            names = {clip.name for clip in (*one, *two)}
            if max(n_asked[name] for name in names) >= _OF_A_PICTURE:
                continue
            draft = next(kind.drafts(one, two, rng), None)
            if draft is not None:
                questions += _worded(kind, (one, two), draft, first_pair + len(questions) // 2)
                n_asked.update(names)
    return questions


def _views_of(clip: Clip) -> list[str]:
    return [view.id for view in clip.views]


def _pictures(clips: Sequence[Clip]) -> Iterator[tuple[Subject, Subject]]:
    """Two pictures with a common item."""
    pictures = [clip for clip in clips if not clip.is_walk]
    return (((one,), (two,)) for one, two in combinations(pictures, 2) if _common(one, two))


def _films_and_pictures(clips: Sequence[Clip]) -> Iterator[tuple[Subject, Subject]]:
    """The same film before and after an edit; and pictures."""
    films = [clip for clip in clips if clip.is_walk]
    yield from (((a,), (b,)) for a, b in combinations(films, 2) if _views_of(a) == _views_of(b))
    yield from _pictures(clips)


def _overlapping(clips: Sequence[Clip]) -> list[tuple[Clip, Clip]]:
    """Ordered pairs of pictures of one room, with common items from which their cameras can be related."""
    pictures = [clip for clip in clips if not clip.is_walk]
    rooms = [(clip.house.id, clip.views[0].facts["room"]) for clip in pictures]
    unordered = [
        (one, two)
        for (one, room), (two, other) in combinations(zip(pictures, rooms, strict=True), 2)
        if room == other
        and _views_of(one) != _views_of(two)
        and len(_common(one, two)) >= _LEAST_COMMON
    ]
    return [pair for one, two in unordered for pair in ((one, two), (two, one))]


def _of_each_camera(pairs: Iterable[tuple[Clip, Clip]]) -> Iterable[tuple[Clip, Clip]]:
    """The first pair of pictures of each two cameras; edits do not move cameras."""
    first = {tuple(clip.views[0].id for clip in pair): pair for pair in reversed(list(pairs))}
    return list(first.values())


def _both_ways(clips: Sequence[Clip]) -> Iterator[tuple[Subject, Subject]]:
    """Two pictures of a room, and the same in the other order."""
    return ((pair, pair[::-1]) for pair in _of_each_camera(_overlapping(clips)[::2]))


def _two_seconds(clips: Sequence[Clip]) -> Iterator[tuple[Subject, Subject]]:
    """One picture, each time with another second one."""
    seconds: dict[Clip, list[Clip]] = {}
    for first, second in _of_each_camera(_overlapping(clips)):
        seconds.setdefault(first, []).append(second)
    for first, others in seconds.items():
        yield from (((first, a), (first, b)) for a, b in combinations(others, 2))


def _edited_views(clips: Sequence[Clip]) -> Iterator[tuple[Subject, Subject]]:
    """Two pictures of a room before and after an edit."""
    by_views: dict[tuple[str, ...], list[Subject]] = {}
    for pair in _overlapping(clips):
        by_views.setdefault(tuple(clip.views[0].id for clip in pair), []).append(pair)
    for subjects in by_views.values():
        yield from combinations(subjects, 2)


def _common(one: Clip, two: Clip) -> list[tuple[Thing, Thing]]:
    """The items with the same unambiguous noun in both clips, as each has them."""
    others = {(thing.instance, thing.noun): thing for thing in two.single}
    keys_of_one = ((thing, (thing.instance, thing.noun)) for thing in one.single)
    return [(thing, others[key]) for thing, key in keys_of_one if key in others]


def _answered(
    n_things: int, answer: Callable[[Clip, Things], str], *, of_edits: bool = False
) -> Drafts:
    """Items with a clear answer in both clips, another one in each; "" is unclear.

    of_edits: the answer depends on the places of the items alone, so one of them must have moved.
    """

    def drafts(one: Subject, two: Subject, rng: random.Random) -> Iterator[PairDraft]:
        common = _common(one[0], two[0])
        moved = {a.instance for a, b in common if _has_moved(a, b)} if of_edits else set()
        if of_edits and not moved:
            return
        second = {a.instance: b for a, b in common}
        for things in choices_of_things(rng, [a for a, _b in common], n_things):
            if of_edits and moved.isdisjoint(thing.instance for thing in things):
                continue
            first = answer(one[0], things)
            other = first and answer(two[0], tuple(second[t.instance] for t in things))
            if other and first != other:
                yield _draft(things, (first, other))

    return drafts


def _has_moved(a: Thing, b: Thing) -> bool:
    return a.item is not b.item and not np.array_equal(a.item.bounds, b.item.bounds)


def _draft(things: Things, answers: tuple[str, str]) -> PairDraft:
    words = dict(zip("abc", (thing.noun for thing in things), strict=False))
    about = tuple(thing.instance for thing in things)
    return PairDraft(words, answers, (about, about))


def _hidden(one: Subject, two: Subject, rng: random.Random) -> Iterator[PairDraft]:
    """Two items of which an obstacle hides one in one of the pictures.

    The hidden item is in the frame of that picture, and in the room of its camera.
    """
    for (shown,), (hiding,) in rng.sample([(one, two), (two, one)], 2):
        nouns = {thing.noun for thing in hiding.things}
        both = [thing for thing, _other in _common(shown, hiding)]
        hidden = [b for b in shown.single if b.noun not in nouns and _is_hidden(b, hiding)]
        for b in hidden:
            for a in rng.sample(both, len(both)):
                answer = _nearer(shown, (a, b))
                if answer:
                    yield _draft((a, b), (answer, HIDDEN) if shown is one[0] else (HIDDEN, answer))


def _is_hidden(thing: Thing, clip: Clip) -> bool:
    """True if an item without a pixel in a picture is inside its frame, in the room of the camera."""
    view = clip.views[0]
    item = next((item for item in clip.house.items if item.id == thing.item.id), None)
    if item is None or item.room_id != view.facts["room"] or not item.surfaces:
        return False
    if any(row["id"] == thing.instance for row in view.facts["instances"]):
        return False
    return Thing(thing.instance, thing.noun, item, 0).share_within(view) >= WHOLE


def _worded(
    kind: PairKind, subjects: tuple[Subject, Subject], draft: PairDraft, number: int
) -> list[Question]:
    """Both questions of a pair. Which subject's answer has the first letter alternates."""
    options = draft.answers if number % 2 else draft.answers[::-1]
    here = "video" if subjects[0][0].is_walk else "image"
    text = kind.style.format(**draft.words, here=here)
    lettered = tuple(f"{letter}. {option}" for letter, option in zip("AB", options, strict=True))
    rows = zip(subjects, draft.answers, draft.about, strict=True)
    return [
        Question(
            "+".join(clip.name for clip in subject), kind.name, text, "AB"[options.index(answer)],
            lettered, about, number,
        )
        for subject, answer, about in rows
    ]  # fmt: skip


def _nearer(clip: Clip, things: Things) -> str:
    """The item nearer to the camera, by the nearest points of their surfaces."""
    eye = clip.views[0].pose[:3, 3]
    (near, noun), (far, _) = sorted((float(t.points.query(eye)[0]), t.noun) for t in things)
    return noun if is_clearly_nearer(near, far) else ""


def _nearest(clip: Clip, things: Things) -> str:
    """Which of two items is nearer to a third."""
    target, *others = things
    (near, noun), (far, _) = sorted((clip.gap_m(target, other), other.noun) for other in others)
    return noun if is_clearly_nearer(near, far) else ""


def _is_open(_clip: Clip, things: Things) -> str:
    shares = [joint.share for joint in things[0].item.joints]
    if not shares or 0 < max(shares) < _LEAST_OPEN:
        return ""
    return "yes" if max(shares) > 0 else "no"


def _lit_lamps(one: Subject, two: Subject, _rng: random.Random) -> Iterator[PairDraft]:
    """Two lamps side by side of which one is on: brightness alone does not give the answer."""
    for noun, lamps in one[0].by_noun.items():
        answers = _lit_side(one[0], lamps), _lit_side(two[0], two[0].by_noun.get(noun, ()))
        about = tuple(lamp.instance for lamp in lamps)
        is_same = about == tuple(lamp.instance for lamp in two[0].by_noun.get(noun, ()))
        if is_same and all(answers) and answers[0] != answers[1]:
            yield PairDraft({"a": noun}, answers, (about, about))


def _lit_side(clip: Clip, lamps: Sequence[Thing]) -> str:
    """The side of the only lit one of two lamps; "" if it is not clear in the picture."""
    view = clip.views[0]
    if len(lamps) != 2 or view.picture not in _LIT or not all(t.item.lights for t in lamps):
        return ""
    boxes = {row["id"]: row["box2d"] for row in view.facts["instances"]}
    a, b = ((boxes[t.instance][0] + boxes[t.instance][2]) / 2 for t in lamps)
    has_power = [any(light.power > 0 for light in t.item.lights) for t in lamps]
    is_on = [
        power and t.item.id not in clip.lamps_off for power, t in zip(has_power, lamps, strict=True)
    ]
    # opengl_il shows the lamps that the recipe has off, too.
    if view.picture == Mode.OPENGL_IL and is_on != has_power:
        return ""
    if abs(a - b) < _APART * view.facts["width_px"] or sum(is_on) != 1:
        return ""
    return "left" if is_on[0] == (a < b) else "right"


def _turn(one: Subject, two: Subject, _rng: random.Random) -> Iterator[PairDraft]:
    """The side to which the camera turns from the first picture to the second."""
    first, second = (clip.views[0].pose[[0, 2], 2] for clip in one)
    bearing = bearing_deg(np.zeros(2), first, second)
    if _LEAST_TURN_DEG <= abs(bearing) <= _MOST_TURN_DEG:
        yield PairDraft({}, ("right", "left") if bearing > 0 else ("left", "right"), ((), ()))


def _moved(one: Subject, two: Subject, _rng: random.Random) -> Iterator[PairDraft]:
    """The distance between the cameras of two pictures."""
    eyes = [[clip.views[0].pose[:3, 3] for clip in subject] for subject in (one, two)]
    far = [float(np.linalg.norm(b - a)) for a, b in eyes]
    near, farther = sorted(far)
    if near >= _MOVED_M and farther >= _FARTHER * near:
        words = {"x": f"{near:.1f} m", "y": f"{farther:.1f} m"}
        yield PairDraft(words, (f"{far[0]:.1f} m", f"{far[1]:.1f} m"), ((), ()))


def _same(one: Subject, two: Subject, rng: random.Random) -> Iterator[PairDraft]:
    """An item, and the only one of its noun in each second picture: it, and another one."""
    seconds = [{thing.noun: thing for thing in subject[1].single} for subject in (one, two)]
    for thing in rng.sample(one[0].single, len(one[0].single)):
        others = [nouns[thing.noun] for nouns in seconds if thing.noun in nouns]
        is_same = [other.instance == thing.instance for other in others]
        if len(others) == 2 and sum(is_same) == 1:
            answers = ("yes", "no") if is_same[0] else ("no", "yes")
            first, second = ((thing.instance, other.instance) for other in others)
            yield PairDraft({"a": thing.noun}, answers, (first, second))


def _nearest_across(one: Subject, two: Subject, rng: random.Random) -> Iterator[PairDraft]:
    """Which of two items of the first picture is nearer to an item that only the second shows."""
    nouns = {thing.noun for subject in (one, two) for thing in subject[0].things}
    targets = [(a, b) for a, b in _common(one[1], two[1]) if a.noun not in nouns]
    of_second = {(t.noun, t.instance) for subject in (one, two) for t in subject[1].things}
    common = [pair for pair in _common(one[0], two[0]) if _only(pair[0], of_second)]
    moved = {a.instance for a, b in (*targets, *common) if _has_moved(a, b)}
    for target in rng.sample(targets, len(targets)):
        for chosen in combinations(rng.sample(common, len(common)), 2):
            triple = (target, *chosen)
            if moved.isdisjoint(a.instance for a, _b in triple):
                continue
            things = tuple(a for a, _b in triple)
            first = _nearest(one[0], things)
            other = first and _nearest(two[0], tuple(b for _a, b in triple))
            if other and first != other:
                yield _draft(things, (first, other))


def _only(thing: Thing, others: set[tuple[str, int]]) -> bool:
    """True if no other instance has the same noun."""
    return all(instance == thing.instance for noun, instance in others if noun == thing.noun)


# fmt: off
PAIR_KINDS: Final = (
    PairKind(
        "pair_lamp", _pictures, _lit_lamps,
        "One of the two {a}s in the image is switched on: the left one or the right one?",
    ),
    PairKind("pair_open", _films_and_pictures, _answered(1, _is_open), "Is the {a} in the {here} open?"),
    PairKind(
        "pair_side", _films_and_pictures, _answered(3, side_of, of_edits=True),
        "I stand by the {a} in the {here} and face the {b}. Is the {c} to my left or to my right?",
    ),
    PairKind(
        "pair_nearest", _films_and_pictures, _answered(3, _nearest, of_edits=True),
        "Measured from the closest point of each, which is nearer to the {a} in the {here}: the {b} or the {c}?",
    ),
    PairKind(
        "pair_nearer", _pictures, _answered(2, _nearer),
        "Which is nearer to the camera in the image: the {a} or the {b}?",
    ),
    PairKind(
        "pair_hidden", _pictures, _hidden,
        "Which is nearer to the camera in the image: the {a} or the {b}? It cannot be told if one of them is"
        " hidden behind something else.",
    ),
    PairKind(
        "pair_views_turn", _both_ways, _turn,
        "Both images show one room. From the first image to the second, does the camera turn to its left or to its"
        " right, the shorter way round?",
    ),
    PairKind(
        "pair_views_moved", _two_seconds, _moved,
        "Both images show one room. How far apart are their cameras: about {x} or about {y}?",
    ),
    PairKind(
        "pair_views_same", _two_seconds, _same,
        "Both images show one room. Is the {a} in the second image the same one as in the first?",
    ),
    PairKind(
        "pair_views_nearest", _edited_views, _nearest_across,
        "Both images show one room. Measured from the closest point of each, which is nearer to the {a} of the second"
        " image: the {b} or the {c} of the first?",
    ),
)
# fmt: on
