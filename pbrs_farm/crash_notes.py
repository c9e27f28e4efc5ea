"""Notes of the present file and step, for the process that watches this one: they locate a crash.

Effects: writes lines to the file that send_notes_to names. run/processes/verb_process.py reads them.
"""

from __future__ import annotations

import contextlib
import os
from contextvars import ContextVar
from typing import Final

_MAX_CHARS: Final = 300  # of a file's name
_FILE: ContextVar[int | None] = ContextVar("file", default=None)


def note_step(file: str, step: str) -> None:
    """Note the beginning of a file's step, for the process that watches this one, if any.

    A native library may kill the process without a message; the last note then locates the crash. Characters
    that cannot be printed become "?". A failed write is no error.
    """
    notes = _FILE.get()
    if notes is not None:
        line = "".join(c if c.isprintable() else "?" for c in file)[:_MAX_CHARS]
        with contextlib.suppress(OSError):
            os.write(notes, f"{line}: {step}\n".encode("utf-8", "replace"))


def send_notes_to(notes: int) -> None:
    """Write the notes of this thread's context to a file descriptor from now on."""
    _FILE.set(notes)
