"""The body of a render process: tasks come in one after another, messages leave.

Effects: those of the tasks; ends when its parent does. It is started afresh (never forked), so that
S3 and Mitsuba are safe in it, and may be killed at any moment. Requests are lines on what was stdin,
messages leave on what was stdout; whatever libraries print goes to stderr, which is the task's log.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import pkgutil
import signal
import sys
import traceback
from typing import BinaryIO, NoReturn

from pbrs_farm.operating_system import die_with_parent
from pbrs_farm.run.processes.child_process import Message


def main(target: str) -> int:
    """Serve the tasks of `module:function`, which makes a Handler from what sends a message.

    Never called in the parent. It ignores SIGINT and SIGTERM, as the parent decides what they mean,
    and dies with it. What the libraries print goes to the log, since replies have a pipe of their
    own. 1 where the handler could not be made, after saying why.
    """
    die_with_parent()
    # The parent decides what Ctrl-C and TERM mean; Slurm signals every process of a step.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    requests, replies = _own_pipes()

    def send(message: Message) -> None:
        replies.write(message.line())

    try:
        # Make the handler once: what it keeps between tasks lives in it.
        handle = pkgutil.resolve_name(target)(send)
    except Exception as error:  # noqa: BLE001 - the parent learns why
        traceback.print_exc()
        send(Message("fault", f"{type(error).__name__}: {error}"))
        return 1
    send(Message("ready"))
    for line in requests:  # until the parent closes the pipe
        send(handle(line))
    return 0


def end(code: int) -> NoReturn:
    """End this process as soon as what was left for its end is done (atexit).

    Whoever started it waits for it. Taking the interpreter apart, with all that Mitsuba and Dr.Jit
    put into it, is 0.12 s of CPU and frees nothing that the kernel does not.
    """
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(code)


def _own_pipes() -> tuple[BinaryIO, BinaryIO]:
    """Keep stdin and stdout for ourselves; everybody else reads nothing and prints to stderr."""
    requests = os.fdopen(os.dup(0), "rb")
    replies = os.fdopen(os.dup(1), "wb", buffering=0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    return requests, replies
