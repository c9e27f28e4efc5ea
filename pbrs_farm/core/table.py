"""Rows with named columns that print as text and as HTML; no effects."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, overload

_SHOWN: Final = 40  # rows of a text or of HTML


class Table(Sequence[Mapping[str, Any]]):
    """Rows, each a mapping with the same keys: a list to a program, a table to a reader."""

    def __init__(self, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
        """columns: the shown ones, in their order; rows may hold more."""
        self.columns = tuple(columns)
        self._rows = tuple(rows)

    @overload
    def __getitem__(self, at: int) -> Mapping[str, Any]: ...
    @overload
    def __getitem__(self, at: slice) -> Table: ...
    def __getitem__(self, at: int | slice) -> Mapping[str, Any] | Table:
        return Table(self.columns, self._rows[at]) if isinstance(at, slice) else self._rows[at]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[Mapping[str, Any]]:
        return iter(self._rows)

    def column(self, name: str) -> list[Any]:
        """A column's values in the order of the rows; KeyError if any row lacks it."""
        return [row[name] for row in self._rows]

    def __repr__(self) -> str:
        cells = [self.columns, *(self._cells(row) for row in self._rows[:_SHOWN])]
        widths = [max(len(row[k]) for row in cells) for k in range(len(self.columns))]
        lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths)).rstrip() for row in cells]
        return "\n".join([*lines, *self._more()])

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in self.columns)
        rows = "".join(
            "<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in self._cells(row)) + "</tr>"
            for row in self._rows[:_SHOWN]
        )
        more = "".join(f"<p>{line}</p>" for line in self._more())
        return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>{more}"

    def _cells(self, row: Mapping[str, Any]) -> tuple[str, ...]:
        return tuple(_text(row.get(name)) for name in self.columns)

    def _more(self) -> list[str]:
        n_more = len(self._rows) - _SHOWN
        return [f"... and {n_more} more"] if n_more > 0 else []


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return " ".join(_text(v) for v in value)
    return str(value)
