"""Questions of clips, balanced against blind guessing, and the score of a blind guesser; no effects."""

from __future__ import annotations

import random
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.export.questions.clips import Clip
from pbrs_farm.export.questions.kinds import KINDS, Draft, QuestionKind

DATASET: Final = "pbrs_farm"
_OF_A_PICTURE: Final = 2  # questions of a kind about a picture
_OF_A_WALK: Final = 8
_MOST_APART: Final = (
    2  # maximum lead of one answer's count over another's, or over all others together
)
_LETTERS: Final = "ABCD"


@dataclass(frozen=True, slots=True)
class Question:
    """A question with its answer, as a row of VSI-Bench, and its instances."""

    clip: str  # of two pictures the names, joined by "+"
    kind: str
    text: str
    ground_truth: str  # a number, or the letter of an option
    options: tuple[str, ...]  # "A. left", ...; () for a number
    about: tuple[int, ...]
    pair: int = -1  # number of the minimal pair (pairs.py); -1 = none

    @property
    def answer(self) -> str:
        """The answer in words: the option without its letter, or the number."""
        if not self.options:
            return self.ground_truth
        return self.options[_LETTERS.index(self.ground_truth)].partition(". ")[2]

    def facts(self) -> dict[str, Any]:
        """Entries of questions.jsonl beside the columns: instances, and the number of the minimal pair."""
        pair = {} if self.pair < 0 else {"pair": self.pair}
        return {"instances": list(self.about), **pair}

    def row(self, number: int) -> dict[str, Any]:
        """The columns of VSI-Bench."""
        return {
            "id": number,
            "dataset": DATASET,
            "scene_name": self.clip,
            "question_type": self.kind,
            "question": self.text,
            "ground_truth": self.ground_truth,
            "options": list(self.options) or None,
        }


class Asker:
    """Asks about clip after clip, and counts the answers so that no answer becomes the usual one.

    >>> from pbrs_farm.export.questions.asking import Asker
    >>> Asker().asked([])
    []
    """

    def __init__(self) -> None:
        self._answers: dict[str, Counter[str]] = defaultdict(Counter)
        self._letters: dict[str, Counter[str]] = defaultdict(Counter)

    def asked(self, clips: Iterable[Clip]) -> list[Question]:
        """The questions of clips, in their order; the same clips give the same questions."""
        return [question for clip in clips for question in self._of_clip(clip)]

    def _of_clip(self, clip: Clip) -> list[Question]:
        questions = []
        for kind in KINDS:
            if kind.of_walks_only and not clip.is_walk:
                continue
            rng = random.Random(keys.seed(clip.name, kind.name))
            drafts = list(kind.drafts(clip, rng))
            for _ in range(min(len(drafts), _OF_A_WALK if clip.is_walk else _OF_A_PICTURE)):
                draft = self._take_rarest(kind, drafts)
                if draft is None:
                    break
                drafts = [d for d in drafts if set(d.about) != set(draft.about)]
                questions.append(self._worded(clip, kind, draft, rng))
                if not drafts:
                    break
        return questions

    def _take_rarest(self, kind: QuestionKind, drafts: Sequence[Draft]) -> Draft | None:
        """Take the first draft with the rarest answer, and count that answer.

        Returns None, and counts nothing, if that answer's count already leads by two: over any other answer
        for a kind with few answers, else over all other answers together.
        """
        count = self._answers[kind.name]
        draft = min(drafts, key=lambda d: count[d.answer])
        n_other = count.total() - count[draft.answer]
        least = min((count[answer] for answer in kind.answers), default=n_other)
        if count[draft.answer] >= least + _MOST_APART:
            return None
        count[draft.answer] += 1
        return draft

    def _worded(self, clip: Clip, kind: QuestionKind, draft: Draft, rng: random.Random) -> Question:
        medium = "in the video" if clip.is_walk else "in the image"
        style = rng.choice(kind.styles)
        truth, options = draft.answer, list(draft.options)
        if options:
            # Give the answer the letter with the fewest right answers; shuffle the other options.
            wrong = [o for o in options if o != draft.answer]
            rng.shuffle(wrong)
            count = self._letters[kind.name]
            truth = min(_LETTERS[: len(options)], key=lambda letter: count[letter])
            count[truth] += 1
            wrong.insert(_LETTERS.index(truth), draft.answer)
            options = wrong
        text = style.format(**draft.words, here=medium, choices=", ".join(options))
        lettered = tuple(f"{_LETTERS[k]}. {o}" for k, o in enumerate(options))
        return Question(clip.name, kind.name, text, truth, lettered, draft.about)


def mean_relative_accuracy(guess: float, truth: float) -> float:
    """The share of thresholds t in .5, .55 ... .95 with |guess - truth| / truth < 1 - t (VSI-Bench).

    >>> mean_relative_accuracy(1.0, 1.0), mean_relative_accuracy(3.0, 1.0)
    (1.0, 0.0)
    """
    off = abs(guess - truth) / truth
    return float(np.mean([off < 1 - t for t in np.arange(0.5, 0.951, 0.05)]))


def blind_scores(questions: Sequence[Question]) -> dict[str, tuple[int, float, float]]:
    """Kind -> number of questions, and the scores of two guessers that see no picture.

    The first gives the best constant answer: for choices, the larger of the most frequent letter's share
    and the most frequent answer's share; for numbers, the best constant's mean relative accuracy. The
    second reads the question: it gives the usual answer of the other questions with the same words,
    the most frequent one or the median, else that of all others.
    """
    by_kind: dict[str, list[Question]] = defaultdict(list)
    for question in questions:
        by_kind[question.kind].append(question)
    scores = {}
    order = [kind.name for kind in KINDS]
    # Pairs come after the kinds of single questions.
    for kind, of_kind in sorted(
        by_kind.items(), key=lambda row: order.index(row[0]) if row[0] in order else len(order)
    ):
        if of_kind[0].options:
            counts = Counter(q.ground_truth for q in of_kind), Counter(q.answer for q in of_kind)
            best = max(count.most_common(1)[0][1] for count in counts) / len(of_kind)
        else:
            truths = [float(q.ground_truth) for q in of_kind]
            best = max(
                float(np.mean([mean_relative_accuracy(guess, t) for t in truths]))
                for guess in sorted(set(truths))
            )
        scores[kind] = len(of_kind), best, _score_by_words(of_kind)
    return scores


def _score_by_words(questions: Sequence[Question]) -> float:
    """The mean score of the answer that other questions with the same words suggest."""
    if len(questions) < 2:
        return 0.0
    by_words: dict[str, list[int]] = defaultdict(list)
    for k, question in enumerate(questions):
        by_words[question.text].append(k)
    scores = []
    for k, question in enumerate(questions):
        others = [n for n in by_words[question.text] if n != k] or [
            n for n in range(len(questions)) if n != k
        ]
        if question.options:
            answers = Counter(questions[n].answer for n in others)
            scores.append(float(answers.most_common(1)[0][0] == question.answer))
        else:
            guess = float(np.median([float(questions[n].ground_truth) for n in others]))
            scores.append(mean_relative_accuracy(guess, float(question.ground_truth)))
    return float(np.mean(scores))
