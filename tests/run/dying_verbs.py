"""Verbs for tests of verb_process.py: they end well, raise, or are killed in the middle of a file."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence

from pbrs_farm.crash_notes import note_step


def main(words: Sequence[str]) -> int:
    """`end CODE`; `die SIGNAL FILE STEP ...`: killed by the signal after the last step."""
    if words[0] == "end":
        sys.stdout.write("done\n")
        return int(words[1])
    for step in words[3:]:
        note_step(words[2], step)
    os.kill(os.getpid(), signal.Signals[words[1]])
    raise AssertionError("alive after a signal")
