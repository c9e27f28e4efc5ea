"""How the docs read: commits, dates, sentences, links, how-to pages.

Effects: reads README.md and docs/, asks git which numbers name a commit, builds the site into a temporary folder,
and writes out/bench/docs.json. `python -m benchmarks.docs_figures --pages` lists the sentences' mean length by page
and writes nothing.
"""

from __future__ import annotations

import contextlib
import os
import re
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import write_report
from benchmarks.manual_pages import REPO, manual_pages, without_code
from benchmarks.quoted_figures import faults_of_pages
from tests.docs.api_examples import faults, public_names

UNITS: Final = {
    "docs.hashes": "commits named in README.md and docs/ outside docs/lab",
    "docs.dates": "dates there, YYYY-MM-DD",
    "docs.stale": "figures there that are in no line of docs/lab (benchmarks/quoted_figures.py)",
    "docs.words_a_sentence": "words of a sentence there, mean; tables, headings and code apart",
    "docs.longest_page": "words of the longest page there, tables and code among them (2,500 are the aim)",
    "docs.readme_lines": "lines of README.md",
    "docs.dead_links": "warnings of `mkdocs build --strict`",
    "docs.howto": "pages of docs/howto",
    "docs.api_examples": "share of the public Python names whose docstring has an example that ran here and was right",
}

_COMMENT: Final = re.compile(r"<!--.*?-->", re.DOTALL)
# Seven to forty digits of base 16, one of 0..9 among them; a house's id has a hyphen before its own.
_HASH: Final = re.compile(r"(?<![\w/.-])(?=[a-f]*[0-9])[0-9a-f]{7,40}(?![\w.-]*\w)")
_DATE: Final = re.compile(r"\b20[0-9]{2}-[01][0-9]-[0-3][0-9]\b")
_LINK: Final = re.compile(r"!?\[([^\]]*)\]\(([^)\s]+)\)")
# A line without prose: of a table, a heading, indented code, a picture, a directive of the site.
_NO_PROSE: Final = re.compile(r"^(\||#|    |!\[|---|\[!\[|\*?!\[)")
_ITEM: Final = re.compile(r"^\s*(?:[-*]|[0-9]+\.)\s+")
_END: Final = re.compile(r"[.!?](?:[)*\"”]*)\s+(?=[A-Z`*(\[0-9\"])")
_ABBREVIATION: Final = re.compile(r"\b(e\.g|i\.e|vs|cf|al|St)\.")


def main() -> None:
    """Measure and write out/bench/docs.json."""
    texts = {p: p.read_text(encoding="utf-8") for p in manual_pages(REPO)}
    prose = [s for t in texts.values() for s in sentences(t)]
    figures: dict[str, Any] = {
        "docs.hashes": sum(len(commits_named(t)) for t in texts.values()),
        "docs.dates": sum(len(_DATE.findall(t)) for t in texts.values()),
        "docs.stale": len(faults_of_pages()),
        "docs.words_a_sentence": round(statistics.mean(map(word_count, prose)), 2),
        "docs.longest_page": max(len(t.split()) for t in texts.values()),
        "docs.readme_lines": len((REPO / "README.md").read_text(encoding="utf-8").splitlines()),
        "docs.dead_links": dead_links(),
        "docs.howto": len([p for p in (REPO / "docs/howto").glob("*.md") if p.stem != "index"]),
        "docs.api_examples": share_of_examples(),
    }
    write_report("docs", figures, UNITS)


def commits_named(text: str) -> list[str]:
    """Numbers of a page that name a commit: those with a letter, and of bare digits those git knows."""
    hashes = _HASH.findall(text)
    return [h for h in hashes if not h.isdigit() or _is_commit(h)]


def dates_named(text: str) -> list[str]:
    """Dates of a page."""
    return _DATE.findall(text)


def _is_commit(word: str) -> bool:
    try:
        done = subprocess.run(
            ["git", "-C", str(REPO), "cat-file", "-e", f"{word}^{{commit}}"], capture_output=True
        )
    except OSError:
        return False
    return done.returncode == 0


def sentences(text: str) -> Iterator[str]:
    """The prose of a page, sentence by sentence; an item of a list ends one."""
    text = _COMMENT.sub("", without_code(text))
    block: list[str] = []
    for line in [*text.splitlines(), ""]:
        ends = not line.strip() or _NO_PROSE.match(line) is not None
        if (ends or _ITEM.match(line)) and block:
            yield from _split(" ".join(block))
            block = []
        if not ends:
            block.append(_ITEM.sub("", line).strip())


def _split(paragraph: str) -> Iterator[str]:
    plain = _ABBREVIATION.sub(r"\1", _LINK.sub(r"\1", paragraph))
    for part in _END.split(plain):
        if word_count(part) > 1:
            yield part


def word_count(sentence: str) -> int:
    """Number of words; a span between backticks is one word."""
    return len(re.findall(r"[^\s]*\w[^\s]*", re.sub(r"`[^`]*`", "code", sentence)))


def dead_links() -> int:
    """Warnings of the site's builder."""
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-m", "mkdocs", "build", "--no-strict", "--site-dir", folder],
            cwd=REPO, env=environment, capture_output=True, text=True, check=True,
        )  # fmt: skip
    lines = done.stderr.splitlines()
    for line in lines:
        if line.startswith("WARNING"):
            print(line)
    return sum(line.startswith("WARNING") for line in lines)


def share_of_examples() -> float:
    """Runs the docstrings' examples; the share of public names whose one is right."""
    right: list[str] = []
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for of_homes in (False, True):
            for name, fault in faults(Path(folder), of_homes=of_homes):
                right += [] if fault else [name]
                print(fault, end="")
    return round(len(right) / len(public_names()), 3)


def by_page() -> None:
    """Print each page's commits, dates, sentences and their mean length."""
    for page in manual_pages(REPO):
        text = page.read_text(encoding="utf-8")
        counts = [word_count(s) for s in sentences(text)]
        mean = statistics.mean(counts) if counts else 0.0
        named = f"{len(commits_named(text))} commits, {len(_DATE.findall(text))} dates"
        print(f"{page.relative_to(REPO)}: {named}, {len(counts)} sentences of {mean:.1f} words")


if __name__ == "__main__":
    by_page() if "--pages" in sys.argv[1:] else main()
