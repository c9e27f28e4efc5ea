"""Notes of the current file and step, which let the parent process locate a crash of this one.

Effects: writes lines to the file given to send_notes_to; run/processes/verb_process.py reads them.
"""

from __future__ import annotations

import contextlib
import os
from contextvars import ContextVar
from typing import Final

_MAX_CHARS: Final = 300  # maximum length of a file name in a note
_FILE: ContextVar[int | None] = ContextVar("file", default=None)


def note_step(file: str, step: str) -> None:
    """Note the start of a step on a file for the parent process, if any.

    If a native library kills the process without a message, the last note locates the crash. Unprintable
    characters become "?". Write errors are ignored.
    """
    notes = _FILE.get()
    if notes is not None:
        line = "".join(c if c.isprintable() else "?" for c in file)[:_MAX_CHARS]
        with contextlib.suppress(OSError):
            os.write(notes, f"{line}: {step}\n".encode("utf-8", "replace"))


def send_notes_to(notes: int) -> None:
    """Write notes of this thread's context to a file descriptor from now on."""
    _FILE.set(notes)
