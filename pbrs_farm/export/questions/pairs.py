"""Minimal pairs: one question about two pictures of a home, with another answer in each; no effects.

The pictures are two views of a home, or one view before and after an edit. Both questions have the same words and
the same two options, so a guess that ignores the pictures is right in exactly one of them. In a hidden pair the
question must be declined in one picture, where an obstacle hides an item.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.edits import unedited_id
from pbrs_farm.export.questions.asking import Question
from pbrs_farm.export.questions.clips import WHOLE, Clip, Thing
from pbrs_farm.export.questions.kinds import choices_of_things, is_clearly_nearer, side_of
from pbrs_farm.export.sequences import pose_opencv

_MOST_PAIRS: Final = 24  # of pictures of a home, for each kind
_OF_A_PICTURE: Final = 2  # questions of a kind about a picture, in all of its pairs
_LEAST_OPEN: Final = 0.3  # share of a door's way from which it is clearly open
HIDDEN: Final = "cannot be told"
Things = tuple[Thing, ...]


@dataclass(frozen=True, slots=True)
class PairKind:
    """n_things: named by {a}, {b} and {c}. answer: "" if it is not clear in a picture."""

    name: str
    n_things: int
    answer: Callable[[Clip, Things], str]
    style: str


def clips_by_home(clips: Iterable[Clip]) -> Iterator[list[Clip]]:
    """The clips of each home together with those of its edited versions, which follow each other."""
    for _home, group in groupby(clips, lambda clip: unedited_id(clip.house.id)):
        yield list(group)


def pair_questions(clips: Sequence[Clip], first_pair: int) -> list[Question]:
    """The pairs about all pictures of one home and of its edited versions; first_pair: number of the first.

    Pictures of one camera before and after an edit come first.
    """
    pictures = [clip for clip in clips if not clip.is_walk]
    rng = random.Random(keys.seed(*(clip.name for clip in pictures), "pairs"))
    pairs = [(one, two) for one, two in combinations(pictures, 2) if _share_items(one, two)]
    rng.shuffle(pairs)
    pairs.sort(key=lambda pair: pair[0].views[0].id != pair[1].views[0].id)
    questions: list[Question] = []
    for kind in PAIR_KINDS:
        n_asked: dict[str, int] = {}
        for one, two in pairs[:_MOST_PAIRS]:
            if max(n_asked.get(clip.name, 0) for clip in (one, two)) >= _OF_A_PICTURE:
                continue
            draft = next(_drafts(kind, one, two, rng), None)
            if draft is not None:
                number = first_pair + len(questions) // 2
                questions += _worded(kind, (one, two), *draft, number)
                for clip in (one, two):
                    n_asked[clip.name] = n_asked.get(clip.name, 0) + 1
    return questions


def _share_items(one: Clip, two: Clip) -> bool:
    """True if an item has an unambiguous noun in both pictures."""
    first, second = ({thing.instance for thing in clip.single} for clip in (one, two))
    return bool(first & second)


def _drafts(
    kind: PairKind, one: Clip, two: Clip, rng: random.Random
) -> Iterator[tuple[Things, tuple[str, str]]]:
    """Items with a clear answer in both pictures, another one in each."""
    if kind.name == "pair_hidden":
        yield from _hidden_drafts(kind, one, two, rng)
        return
    seen = {thing.noun: thing for thing in two.single}
    common = [t for t in one.single if t.noun in seen and seen[t.noun].instance == t.instance]
    for things in choices_of_things(rng, common, kind.n_things):
        answers = kind.answer(one, things), kind.answer(two, tuple(seen[t.noun] for t in things))
        if all(answers) and answers[0] != answers[1]:
            yield things, answers


def _hidden_drafts(
    kind: PairKind, one: Clip, two: Clip, rng: random.Random
) -> Iterator[tuple[Things, tuple[str, str]]]:
    """Two items of which an obstacle hides one in one of the pictures.

    The hidden item is in the frame of that picture, and in the room of its camera.
    """
    for shown, hiding in rng.sample([(one, two), (two, one)], 2):
        seen = {thing.noun: thing for thing in hiding.single}
        nouns = {thing.noun for thing in hiding.things}
        for things in choices_of_things(rng, shown.single, 2):
            a, b = things
            answer = kind.answer(shown, things)
            is_seen = a.noun in seen and seen[a.noun].instance == a.instance
            is_hidden = is_seen and b.noun not in nouns and _is_hidden(b, hiding)
            if answer and is_hidden:
                yield things, (answer, HIDDEN) if shown is one else (HIDDEN, answer)


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
    kind: PairKind, clips: tuple[Clip, Clip], things: Things, answers: tuple[str, str], number: int
) -> list[Question]:
    """Both questions of a pair. Which picture's answer has the first letter alternates."""
    options = answers if number % 2 else answers[::-1]
    words = dict(zip("abc", (thing.noun for thing in things), strict=False))
    text = kind.style.format(**words)
    lettered = tuple(f"{letter}. {option}" for letter, option in zip("AB", options, strict=True))
    about = tuple(thing.instance for thing in things)
    return [
        Question(clip.name, kind.name, text, "AB"[options.index(answer)], lettered, about, number)
        for clip, answer in zip(clips, answers, strict=True)
    ]


def _nearer(clip: Clip, things: Things) -> str:
    """The item nearer to the camera, by the nearest points of their surfaces."""
    eye = pose_opencv(clip.views[0])[:3, 3]
    (near, noun), (far, _) = sorted((float(t.points.query(eye)[0]), t.noun) for t in things)
    return noun if is_clearly_nearer(near, far) else ""


def _nearest(clip: Clip, things: Things) -> str:
    """Which of two items is nearer to a third."""
    target, *others = things
    (near, noun), (far, _) = sorted((clip.gap_m(target, other), other.noun) for other in others)
    return noun if is_clearly_nearer(near, far) else ""


def _is_on(_clip: Clip, things: Things) -> str:
    lights = things[0].item.lights
    return ("yes" if any(light.power > 0 for light in lights) else "no") if lights else ""


def _is_open(_clip: Clip, things: Things) -> str:
    shares = [joint.share for joint in things[0].item.joints]
    if not shares or 0 < max(shares) < _LEAST_OPEN:
        return ""
    return "yes" if max(shares) > 0 else "no"


# fmt: off
PAIR_KINDS: Final = (
    PairKind("pair_lamp", 1, _is_on, "Is the {a} in the image switched on?"),
    PairKind("pair_open", 1, _is_open, "Is the {a} in the image open?"),
    PairKind(
        "pair_side", 3, side_of,
        "I stand by the {a} in the image and face the {b}. Is the {c} to my left or to my right?",
    ),
    PairKind(
        "pair_nearest", 3, _nearest,
        "Measured from the closest point of each, which is nearer to the {a} in the image: the {b} or the {c}?",
    ),
    PairKind("pair_nearer", 2, _nearer, "Which is nearer to the camera in the image: the {a} or the {b}?"),
    PairKind(
        "pair_hidden", 2, _nearer,
        "Which is nearer to the camera in the image: the {a} or the {b}? It cannot be told if one of them is"
        " hidden behind something else.",
    ),
)
# fmt: on
