"""The pages of the manual: README.md and docs/ but the lab book. Effects: reads the folder of pages."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

REPO: Final = Path(__file__).parents[1]
_CODE: Final = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)


def manual_pages(repo: Path) -> list[Path]:
    """README.md and every page of docs/ but the lab book's."""
    pages = sorted((repo / "docs").rglob("*.md"))
    return [repo / "README.md", *(p for p in pages if repo / "docs/lab" not in p.parents)]


def without_code(text: str) -> str:
    """A page's text with blank lines in the place of its fenced blocks."""
    return _CODE.sub(lambda block: "\n" * block[0].count("\n"), text)
