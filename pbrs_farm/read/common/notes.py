"""Collects the recoverable faults of a source while it is read; no effects but its own list."""

from __future__ import annotations

from typing import Final

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Note
from pbrs_farm.core.shown_text import MAX_MESSAGE, MAX_PLACE, shown

# Kinds of notes that strict reading accepts: nothing that can be seen is missing or guessed.
HARMLESS: Final = frozenset(
    {
        "unmapped-class",  # the item is otherprop
        "hidden-level",  # left out as the home's author chose, or read though it was hidden
        "degenerate-faces",  # faces without area, which nobody could see
        "unknown-material",  # the surface has its format's default colour
        "unknown-type",  # a node that is not a room, object, box or ground
        "wholly-cut-out",  # a surface whose alpha is below its cutoff everywhere: nobody sees it
        "unread-map",  # a bump, gloss or such picture of an MTL: its colour is there
        "unused-opacity-map",  # the colour map's own alpha is used
        "door-leaf-left-out",  # of a door requested open
        "door-without-hinge",  # the same: it stays as drawn
        "library-warning",  # of OpenUSD's library about the file's form
        "package-version",  # of the example homes, another than the tested one
    }
)


class Notes:
    """The notes of one house, each once. strict: a note not in HARMLESS is raised (recipe field read.strict)."""

    def __init__(self, file: str, *, strict: bool) -> None:
        self.file = file
        self._strict = strict
        self._notes: dict[Note, None] = {}  # in the order they first came up

    def add(self, kind: str, place: str, text: str) -> None:
        """Record a fault of the source, at most once; raise it as BadHouse if reading is strict.

        kind: a word of docs/houses/notes.md; kinds in HARMLESS are never raised. place: where in the file, as
        a reader finds it there: `nodes[3] (Sofa)`, `line 12`. text: the omission or assumption.
        """
        if self._strict and kind not in HARMLESS:
            raise BadHouse(self.file, place, f"{text} ({kind})", hint="read without --strict")
        note = Note(kind, shown(place, MAX_PLACE), shown(text, MAX_MESSAGE))
        self._notes[note] = None

    def all(self) -> tuple[Note, ...]:
        """Every note in the order it first came up."""
        return tuple(self._notes)

    def count(self, kind: str) -> int:
        """Number of notes of a kind; a note repeated at one place counts once."""
        return sum(note.kind == kind for note in self._notes)
