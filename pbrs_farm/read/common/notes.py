"""Collects the recoverable faults of a source while it is read; no effects but its own list."""

from __future__ import annotations

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Note


class Notes:
    """The notes of one house, each once. With strict, the first one is raised as BadHouse."""

    def __init__(self, file: str, *, strict: bool) -> None:
        self.file = file
        self._strict = strict
        self._notes: dict[Note, None] = {}

    def add(self, kind: str, place: str, text: str) -> None:
        """Remember a fault, or raise it when strict."""
        if self._strict:
            raise BadHouse(self.file, place, text, hint=f"{kind}; an error because of --strict")
        self._notes[Note(kind, place, text)] = None

    def all(self) -> tuple[Note, ...]:
        """Every note in the order it first came up."""
        return tuple(self._notes)
