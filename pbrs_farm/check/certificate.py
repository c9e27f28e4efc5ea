"""The outcome of `verify`: how much was checked, how much failed, and where; no effects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial

import numpy as np

from pbrs_farm.core.arrays import Bools
from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import MAX_MESSAGE, MAX_PLACE, shown

MAX_LISTED = 20  # failures of a check that the certificate lists; all are counted

Expect = Callable[[bool | np.bool_, str], bool]
"""Counts a fact, reports a failure with the text unless it holds, and returns whether it holds."""


class Count(Record):
    """The result of one check."""

    checked: int = 0  # pixels, files or facts
    failed: int = 0
    ties: int = 0  # with another right answer


class Coincidence(Record):
    """Surfaces of two items of a house in one place, within 0.1 mm: either is a right answer."""

    house: str
    items: tuple[str, str]  # ids, in order; twice the same for an item's own surfaces
    pixels: int  # where the stored item is not the one that the ray hit


class Certificate(Record):
    """The outcome of verify."""

    folder: str
    all_pixels: bool
    n_houses: int
    n_views: int
    counts: dict[str, Count]  # check -> its count
    failures: tuple[str, ...]  # "check: place: what", at most MAX_LISTED per check
    notes: tuple[str, ...] = ()  # oddities, not counted as failures
    coincident: tuple[Coincidence, ...] = ()  # most pixels first
    looked_at: tuple[str, ...] = ()  # "file (views): how"
    not_looked_at: tuple[str, ...] = ()  # the same, and facts that no file holds
    unfinished: tuple[str, ...] = ()  # "house: finished and planned views" of houses still rendered

    @property
    def has_failed(self) -> bool:
        """True if a check failed."""
        return any(c.failed for c in self.counts.values())

    @property
    def is_clean(self) -> bool:
        """True if nothing failed, nothing is unfinished, and there is a view; ties and notes are allowed."""
        return self.n_views > 0 and not self.unfinished and not self.has_failed

    @property
    def verdict(self) -> str:
        """CLEAN, NOT FINISHED, or NOT CLEAN."""
        if self.unfinished and not self.has_failed:
            return "NOT FINISHED"
        return "CLEAN" if self.is_clean else "NOT CLEAN"

    def text(self) -> str:
        """The certificate as lines for a terminal; the last line is the verdict, for scripts."""
        pixels = "every pixel" if self.all_pixels else "a sample of pixels"
        lines = [
            f"{self.folder}: {self.n_houses} houses, {self.n_views} views, {pixels}",
            f"{'check':<22}{'checked':>12}{'failed':>9}{'ties':>9}",
        ]
        lines += [
            f"{name:<22}{c.checked:>12}{c.failed:>9}{c.ties:>9}" for name, c in self.counts.items()
        ]
        lines += _block("looked at", self.looked_at)
        lines += _block("not looked at", self.not_looked_at)
        lines += [f"note: {note}" for note in self.notes]
        lines += self._coincidences()
        lines += list(self.failures)
        lines += _block("not finished", self.unfinished)
        if self.n_views == 0:
            lines.append("nothing to verify: no finished view in this folder")
        lines.append(self.verdict)
        return "\n".join(lines)

    def _coincidences(self) -> list[str]:
        if not self.coincident:
            return []
        n = sum(c.pixels for c in self.coincident)
        lines = [f"note: {n} pixels show surfaces that coincide within 0.1 mm, no failure:"]
        lines += [
            f"  {c.house}: {' and '.join(c.items)}: {c.pixels}"
            for c in self.coincident[:MAX_LISTED]
        ]
        more = len(self.coincident) - MAX_LISTED
        return [*lines, f"  and {more} more pairs"] if more > 0 else lines


def _block(title: str, rows: tuple[str, ...]) -> list[str]:
    return [f"{title}:", *(f"  {row}" for row in rows)] if rows else []


class Tally:
    """Collects counts and failures while verify runs."""

    def __init__(self) -> None:
        self._counts: dict[str, list[int]] = {}  # check -> [checked, failed, ties]
        self._listed: dict[str, list[str]] = {}  # check -> lines of failures
        self.notes: list[str] = []
        self.below = ""  # prefix of places: "parts/views/" within a set
        self._left_out: Counter[str] = Counter()
        self._coincident: dict[tuple[str, str, str], int] = {}  # house and two items -> pixels

    def add(self, check: str, checked: int, *, ties: int = 0) -> None:
        """Count pixels, files or facts as checked, and some of them as ties; failures are reported by `fail`."""
        row = self._counts.setdefault(check, [0, 0, 0])
        row[0] += int(checked)
        row[2] += int(ties)

    def coincide(self, house: str, items: tuple[str, str]) -> None:
        """Count a pixel that shows either of two coincident surfaces of these items; it is no failure."""
        a, b = sorted(shown(item) for item in items)
        self._coincident[house, a, b] = self._coincident.get((house, a, b), 0) + 1

    def fail(self, check: str, place: str, fault: str, n_failed: int = 1) -> None:
        """Count failures; the first MAX_LISTED of a check are listed with their place, made printable."""
        self._counts.setdefault(check, [0, 0, 0])[1] += int(n_failed)
        listed = self._listed.setdefault(check, [])
        if len(listed) < MAX_LISTED:
            at = shown(f"{self.below}{place}", MAX_PLACE)
            listed.append(f"{check}: {at}: {shown(fault, MAX_MESSAGE)}")

    def leave_out(self, what: str) -> None:
        """List a fact that no check recomputes among those not looked at; equal ones are counted."""
        self._left_out[what] += 1

    def note(self, text: str) -> None:
        """Report an oddity, which is not counted as a failure."""
        self.notes.append(shown(text, MAX_MESSAGE))

    def expect(self, check: str, place: str, holds: bool | np.bool_, fault: str) -> bool:
        """Count a fact, which fails with a text unless it holds; returns whether it holds."""
        self.add(check, 1)
        if not holds:
            self.fail(check, place, fault)
        return bool(holds)

    def at(self, check: str, place: str) -> Expect:
        """`expect` of a check at a place."""
        return partial(self.expect, check, place)

    def pixels(self, check: str, place: str, right: Bools) -> None:
        """Count the pixels (H, W) of a picture; the first wrong one is listed for all."""
        self.add(check, right.size)
        if not right.all():
            row, column = np.argwhere(~right)[0]
            self.fail(check, place, f"row {row}, column {column}", int((~right).sum()))

    def tolerate(
        self, check: str, place: str, n: int, n_wrong: int, most: float, fault: str
    ) -> None:
        """Count n pixels or points, of which wrong ones are ties up to a number, and failures beyond it."""
        is_few = n_wrong <= most
        self.add(check, n, ties=n_wrong if is_few else 0)
        if not is_few:
            self.fail(check, place, fault, n_wrong)

    @property
    def n_failed(self) -> int:
        """Number of failures so far, of all checks."""
        return sum(failed for _checked, failed, _ties in self._counts.values())

    def take(self, other: Tally) -> None:
        """Add the counts and notes of another tally without a failure."""
        assert not other.n_failed
        for check, (checked, _failed, ties) in other._counts.items():
            self.add(check, checked, ties=ties)
        self.notes += other.notes
        self._left_out += other._left_out

    def totals(self, check: str) -> tuple[int, int]:
        """(checked, ties) of a check so far."""
        row = self._counts.get(check, [0, 0, 0])
        return row[0], row[2]

    def certificate(
        self,
        folder: str,
        n_houses: int,
        n_views: int,
        *,
        all_pixels: bool,
        looked_at: tuple[str, ...] = (),
        not_looked_at: tuple[str, ...] = (),
        unfinished: tuple[str, ...] = (),
    ) -> Certificate:
        """The certificate of everything counted so far, with checks in the order of their first count."""
        return Certificate(
            folder=folder,
            all_pixels=all_pixels,
            n_houses=n_houses,
            n_views=n_views,
            counts={
                name: Count(checked=checked, failed=failed, ties=ties)
                for name, (checked, failed, ties) in self._counts.items()
            },
            failures=tuple(line for lines in self._listed.values() for line in lines),
            notes=tuple(self.notes),
            unfinished=unfinished,
            looked_at=tuple(shown(line, MAX_MESSAGE) for line in looked_at),
            not_looked_at=tuple(
                shown(line, MAX_MESSAGE)
                for line in (*not_looked_at, *(f"{k} ({n})" for k, n in self._left_out.items()))
            ),
            # The pairs that share the most pixels come first.
            coincident=tuple(
                Coincidence(house=house, items=(a, b), pixels=n)
                for (house, a, b), n in sorted(
                    self._coincident.items(), key=lambda row: (-row[1], row[0])
                )
            ),
        )
