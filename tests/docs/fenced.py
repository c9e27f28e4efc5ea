"""The fenced blocks of the pages, and the mark above each that says how its commands are run.

A block of commands or of Python has a comment above it, which neither GitHub nor the site shows:

    <!-- commands: run -->                  unchanged
    <!-- commands: small -->                with small pictures, few homes and few steps
    <!-- commands: needs docker -->         not by a test; NEEDS lists the valid words
    <!-- commands: small; needs browser: board -->    except for lines that match the pattern (a regex)
    <!-- commands: excerpt -->              a part of a file or of a session

Other blocks name their language: text, json, toml, csv.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

REPO: Final = Path(__file__).parents[2]
DEPLOY_PAGES: Final = sorted(
    # The cards of the weights are written by the program that trained them.
    p
    for p in (REPO / "deploy").rglob("*.md")
    if "pbrs_farm_weights" not in p.parts
)
PAGES: Final = (
    REPO / "README.md", REPO / "README.pypi.md", REPO / "CONTRIBUTING.md", REPO / "ARCHITECTURE.md", *sorted((REPO / "docs").rglob("*.md")),
    *DEPLOY_PAGES, *sorted((REPO / "examples").rglob("*.md")),
)  # fmt: skip
HOW: Final = ("run", "small", "excerpt")
NEEDS: Final = {
    "clone": "changes the clone it stands in, or sets it up; tests/docs/test_makefile.py reads make's targets",
    "docker": "Docker with Compose; make test-infra",
    "farm": "a Redis and workers; make test-farm",
    "cluster": "Kubernetes or Slurm; make test-kube, make test-infra",
    "browser": "somebody who looks; make test-web",
    "network": "downloads",
    "study": "torch: run small where the extra study is installed, as make test-manual does",
    "data": "files of others that we may not ship",
    "package": "a package that none of our extras brings",
    "hours": "hours",
}
"""Requirements of commands that the tests of pages do not have."""

_FENCE: Final = re.compile(r"^( *)```([^\n`]*)\n(.*?)^ *```[ ]*$", re.MULTILINE | re.DOTALL)
_MARK: Final = re.compile(r"<!-- commands: (.+?) -->\n\s*\Z")
COMMANDS: Final = ("sh", "python")


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block. mark: the text of its comment, "" without one; line: of its fence in the page."""

    page: Path
    line: int
    language: str
    text: str
    mark: str

    @property
    def name(self) -> str:
        """Page and line, for messages."""
        return f"{self.page.relative_to(REPO)}:{self.line}"

    @property
    def lines(self) -> list[str]:
        """The commands of a sh block without comments and blank lines; continued lines are joined."""
        whole = re.sub(r"\\\n\s*", " ", self.text)
        lines = [re.sub(r"(?:^|\s)#.*", "", line).strip() for line in whole.splitlines()]
        return [line for line in lines if line]

    def how(self, line: str = "") -> str:
        """How a line of the block is run: "run", "small", "excerpt", or "needs WHAT"."""
        first, *exceptions = self.mark.split("; ")
        for exception in exceptions:
            need, _, pattern = exception.partition(": ")
            if re.search(pattern, line):
                return need
        return first

    def faults(self) -> list[str]:
        """Faults of the block's mark."""
        if self.language not in COMMANDS:
            return [] if self.language else ["has no language (sh, python, text, json, toml, csv)"]
        if not self.mark:
            return ["has no mark: see tests/docs/fenced.py"]
        first, *exceptions = self.mark.split("; ")
        faults = [] if _is_how(first) else [f"is marked {first!r}"]
        for exception in exceptions:
            need, colon, pattern = exception.partition(": ")
            if not colon or not _is_how(need):
                faults.append(f"is marked {exception!r}")
            elif not any(re.search(pattern, line) for line in self.lines):
                faults.append(f"no line has {pattern!r}")
        return faults


def _is_how(word: str) -> bool:
    return word in HOW or word in {f"needs {need}" for need in NEEDS}


def blocks_of(page: Path) -> list[Block]:
    """The fenced blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    page_blocks = []
    for match in _FENCE.finditer(text):
        mark = _MARK.search(text[: match.start()])
        indent = len(match[1])
        body = "".join(line[indent:] or "\n" for line in match[3].splitlines(keepends=True))
        line = text.count("\n", 0, match.start()) + 1
        page_blocks.append(Block(page, line, match[2].strip(), body, mark[1] if mark else ""))
    return page_blocks


def every_block() -> list[Block]:
    """The blocks of all pages."""
    return [block for page in PAGES for block in blocks_of(page)]


def name_of(page: Path) -> str:
    return str(page.relative_to(REPO))


def blocks(page: str) -> list[tuple[str, str]]:
    """(language, text) of each block of commands of a page."""
    page_blocks = blocks_of(REPO / "docs" / page)
    return [(b.language, b.text) for b in page_blocks if b.language in COMMANDS]
