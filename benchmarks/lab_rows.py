"""Lines of Markdown tables, and the figures that fill them; no effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

Figures = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the docs. benches: reports with its figures; command: writes them; lines: its rows."""

    benches: tuple[str, ...]
    command: str
    lines: Callable[[Figures], list[str]]


def row(cells: Iterable[str]) -> str:
    """A line of a table."""
    return f"| {' | '.join(cells)} |"


def head(*cells: str) -> list[str]:
    """The first two lines of a table."""
    return [row(cells), "|---" * len(cells) + "|"]
