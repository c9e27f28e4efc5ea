"""Notes of the current file and step: for the parent process, which locates a crash, and for a waiting user.

Effects: writes lines to the file given to send_notes_to, which run/processes/verb_process.py reads, and to
standard error while a long call lasts.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from pathlib import PurePath
from typing import Final

_MAX_CHARS: Final = 300  # maximum length of a file name in a note
_FILE: ContextVar[int | None] = ContextVar("file", default=None)
_FIRST_S: Final = 5.0  # seconds before the first line on a terminal
_EVERY_S: Final = 30.0  # seconds between lines
LINE_WRITER: Final = "pbrs-farm waiting lines"
"""Name of the thread of waiting_lines, the only one that a fork may leave behind."""


class _Waiting:
    """The state of this process that lines about a long call show."""

    step = ""  # of the last note
    count = ""  # "3 of 40 views"
    n_displays = 0  # displays that replace the lines
    is_shown = False  # a thread writes lines
    is_watched = False  # another process reports if this one crashes


_NOW: Final = _Waiting()


def note_step(file: str, step: str) -> None:
    """Note the start of a step on a file, for the lines of a long call and the parent process, if any.

    If a native library kills the process without a message, the last note locates the crash. Unprintable
    characters become "?". Write errors are ignored.
    """
    line = "".join(c if c.isprintable() else "?" for c in file)[:_MAX_CHARS]
    _NOW.step = f"{PurePath(line).name}: {step}"
    notes = _FILE.get()
    if notes is not None:
        with contextlib.suppress(OSError):
            os.write(notes, f"{line}: {step}\n".encode("utf-8", "replace"))


def send_notes_to(notes: int) -> None:
    """Write notes of this thread's context to a file descriptor from now on."""
    _FILE.set(notes)
    set_watched()


def set_watched(watched: bool = True) -> None:
    """Set whether another process watches this one, so that a crash costs one line."""
    _NOW.is_watched = watched


def is_watched() -> bool:
    """True if another process reports a crash of this one."""
    return _NOW.is_watched


def sends_notes() -> bool:
    """True in the main thread of a process started by run_watched."""
    return _FILE.get() is not None


def current_step() -> str:
    """File and step of the last note; "" before the first."""
    return _NOW.step


@contextlib.contextmanager
def waiting_lines(
    call: str, *, first_s: float | None = None, every_s: float = _EVERY_S
) -> Iterator[Callable[[str], None]]:
    """Write a line with the current step to standard error regularly while a long call lasts.

    call: begins the line. first_s: seconds before the first line; None: 5 on a terminal, else every_s. No
    lines while a display is shown (display_shown); those of an outer call continue. In a notebook they go to
    standard output, as standard error looks like a fault there. Yields a callback for the numbers done.
    """

    def tell(count: str) -> None:
        _NOW.count = count

    if _NOW.is_shown:
        yield tell
        _NOW.count = ""
        return
    if first_s is None:
        first_s = min(_FIRST_S, every_s) if sys.stderr.isatty() else every_s
    end = threading.Event()
    args = (call, first_s, every_s, end)
    thread = threading.Thread(target=_write_lines, args=args, name=LINE_WRITER, daemon=True)
    _NOW.is_shown, _NOW.step, _NOW.count = True, "", ""
    thread.start()
    try:
        yield tell
    finally:
        _NOW.is_shown = False
        end.set()
        thread.join()


def _write_lines(call: str, first_s: float, every_s: float, end: threading.Event) -> None:
    began_s, wait_s = time.monotonic(), first_s
    while not end.wait(wait_s):
        wait_s = every_s
        if _NOW.n_displays:
            continue
        seconds = f"{time.monotonic() - began_s:.0f} s"
        text = ", ".join(part for part in (_NOW.count, _NOW.step, seconds) if part)
        stream = sys.stdout if "ipykernel" in sys.modules else sys.stderr
        # A closed stream does not end the call.
        with contextlib.suppress(OSError, ValueError):
            stream.write(f"{call}: {text}\n")
            stream.flush()


@contextlib.contextmanager
def display_shown() -> Iterator[None]:
    """Suppress waiting_lines while bars or other lines show the progress."""
    _NOW.n_displays += 1
    try:
        yield
    finally:
        _NOW.n_displays -= 1
