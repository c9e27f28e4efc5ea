"""A verb in a process of its own, so that a library that dies costs one line.

Effects: starts a process, reads what it tells of its work, writes to that pipe.
"""

from __future__ import annotations

import json
import os
import pkgutil
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Final

from pbrs_farm.crash_notes import send_notes_to
from pbrs_farm.run.processes.child_process import PATH_FROM_PARENT, die_with_parent, ending

_BOOT: Final = PATH_FROM_PARENT + (
    "from pbrs_farm.run.processes.verb_process import main; "
    "sys.exit(main(int(sys.argv[2]), sys.argv[3], sys.argv[4:]))"
)


def run_watched(target: str, words: Sequence[str], say: Callable[[str], None]) -> int:
    """The exit code of `module:function`, called with words in a child that shares our terminal.

    Where the child is killed: 1, after one line through say with the file and the step it was at.
    """
    told, telling = os.pipe()
    command = [sys.executable, "-P", "-c", _BOOT, json.dumps(sys.path), str(telling), target]
    # The terminal sends Ctrl-C to both: the child decides. A handler of ours ends with its exec.
    before = signal.signal(signal.SIGINT, lambda _number, _frame: None)
    try:
        process = subprocess.Popen([*command, *words], pass_fds=(telling,))
        os.close(telling)
        # Keep the last notice; the pipe ends when the child does.
        notices = b""
        with os.fdopen(told, "rb", buffering=0) as pipe:
            while chunk := pipe.read(65536):
                notices = (notices + chunk)[-65536:]
        code = process.wait()
    finally:
        signal.signal(signal.SIGINT, before)
    if code >= 0:
        return code
    lines = notices.decode("utf-8", "replace").splitlines()
    say(f"{lines[-1] if lines else ' '.join(words[:2])}: {ending(code)}")
    return 1


def main(telling: int, target: str, words: Sequence[str]) -> int:
    """The child: run the function that target names; its notices leave through `telling`."""
    die_with_parent()
    os.set_inheritable(telling, False)
    send_notes_to(telling)
    return int(pkgutil.resolve_name(target)(words))
