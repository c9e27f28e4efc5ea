"""Figures that README.md and the pages outside the lab book state: each is quoted from a line of docs/lab.

Effects: reads pages and stated_numbers.csv. A line that states a measured figure holds a comment, which neither
GitHub nor the site shows:

    | a view of 640x480 | 6.8 s <!-- figure: views.md: a `fast` view of 640x480 --> |

docs/lab/views.md has a row whose first cell has these words, or a line with them, and that has the number, as far
as the page rounds it; `views.md#a-run` names a chapter, too. Times, bytes, prices, rates and ratios without such a
comment are faults, except those that stated_numbers.csv calls a limit, a default, the size of a download or an
example. `python -m benchmarks.quoted_figures` prints the faults.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

from benchmarks.manual_pages import REPO, manual_pages, without_code
from pbrs_farm.core.record import Record, Several, read_csv

STATED: Final = Path(__file__).with_name("stated_numbers.csv")

_MARK: Final = re.compile(r"<!-- figure: (\w+\.md)(?:#([\w-]+))?: (.+?) -->")
_DIGITS: Final = r"\d+(?:,\d{3})*(?:\.\d+)?|\.\d+"
_NUMBER: Final = re.compile(rf"(?<![\w.#/-])({_DIGITS})(?!\.?\d)")
# Measured quantities: time, bytes, money, rates, and how many times or percent more or less something is.
_UNIT: Final = (
    r"(?:ms|s|seconds?|minutes?|min|hours?|h|[kMGT]B|dollars|CPU-s|(?:views|tasks|homes)(?:/h| an hour| a second)"
    r"|times (?:the|as|less|more|faster|slower)\b|%(?= (?:more|less|longer|shorter|faster|slower)\b))"
)
_MEASURED: Final = re.compile(rf"{_NUMBER.pattern}(?: to ({_DIGITS}))?\s?{_UNIT}(?!\w)")
_SHARE: Final = re.compile(rf"{_NUMBER.pattern}(?:\s?%|\sdegrees)?")


class Stated(Record):
    """Numbers of a page that nobody measured. numbers: as the page writes them, with their unit."""

    page: str
    numbers: Several[str]
    what: str


def main() -> None:
    """Print each figure without a line in the lab book."""
    print("\n".join(faults_of_pages()))


def faults_of_pages() -> list[str]:
    """The figures of all pages that the lab book does not have, and rows of the table that no page needs."""
    found = [fault for page in manual_pages(REPO) for fault in faults(page)]
    for row in read_csv(STATED, Stated):
        text = _plain((REPO / row.page).read_text(encoding="utf-8"))
        told = {m[0] for m in _MEASURED.finditer(text)}
        found += [f"{STATED.name}: {row.page} has no {n}" for n in row.numbers if n not in told]
    return found


def faults(page: Path) -> list[str]:
    """The figures of a page without a line in the lab book, as "page:line: message"."""
    name = str(page.relative_to(REPO))
    stated = {n for row in read_csv(STATED, Stated) if row.page == name for n in row.numbers}
    text = page.read_text(encoding="utf-8")
    return [f"{name}:{line}: {what}" for line, what in stale(text, stated, REPO / "docs/lab")]


def stale(text: str, stated: set[str], lab: Path) -> Iterator[tuple[int, str]]:
    """(line, fault) of a page's text. stated: numbers with units that are not measured."""
    for number, line in enumerate(_plain(text).splitlines(), 1):
        rows: list[str] = []
        for page, chapter, words in _MARK.findall(line):
            found = [
                row for at, row in _rows(lab / page) if chapter in ("", at) and words in _head(row)
            ]
            if not found:
                yield number, f"docs/lab/{page} has no row or line {words!r} {chapter}".rstrip()
            rows += found
        known = [float(n.replace(",", "")) for row in rows for n in _NUMBER.findall(row)]
        for figure, *ends in _figures(_MARK.sub("", line), marked=bool(rows)):
            if figure not in stated and not all(_is_one_of(end, known) for end in ends):
                yield number, f"{figure!r} is in no line of the lab book that is named beside it"


def _figures(line: str, *, marked: bool) -> Iterator[tuple[str, ...]]:
    """(figure as written, its number or both ends of its range) of a line.

    In a line with a mark shares, angles and what has a decimal point are figures, too.
    """
    for match in _MEASURED.finditer(line):
        yield match[0], *(end for end in match.group(1, 2) if end)
    for match in _SHARE.finditer(_MEASURED.sub("", line) if marked else ""):
        if match[0] != match[1] or "." in match[1]:
            yield match[0], match[1]


def _is_one_of(number: str, known: list[float]) -> bool:
    """Whether one of these rounds to the number, which has all its digits, or zeros behind two of them."""
    digits = number.replace(",", "")
    decimals = len(digits.partition(".")[2])
    zeros = 0 if "." in digits else min(len(digits) - len(digits.rstrip("0")), len(digits) - 2)
    half = 0.5 * 10.0 ** (max(zeros, 0) - decimals)
    return any(abs(float(digits) - k) <= half * (1 + 1e-9) for k in known)


def _head(line: str) -> str:
    """The first cell of a table's row, or the whole of any other line."""
    return line.split("|")[1] if line.startswith("|") else line


def _plain(text: str) -> str:
    """A page's text without code, a line where a line was."""
    return re.sub(r"`[^`\n]*`(?![^<>\n]*-->)", "code", without_code(text))


@cache
def _rows(page: Path) -> tuple[tuple[str, str], ...]:
    """(anchor of its chapter, line) of a page of the lab book; none where there is no such page."""
    rows, chapter = [], ""
    for line in page.read_text(encoding="utf-8").splitlines() if page.exists() else ():
        if line.startswith("#"):
            chapter = re.sub(r"[^\w -]", "", line.lstrip("# ")).strip().lower().replace(" ", "-")
        rows.append((chapter, line))
    return tuple(rows)


if __name__ == "__main__":
    main()
