"""The main loop of a render process: receives tasks, sends messages.

Effects: those of the tasks; ends when its parent does. It is started afresh, or forked from a process
without S3 and Mitsuba (child_process.may_fork), so that both are safe in it, and may be killed at any
moment. Requests are lines on the original stdin, messages go to the original stdout; libraries print to
stderr, the task's log.
"""

from __future__ import annotations

import atexit
import gc
import os
import pkgutil
import signal
import traceback
from typing import BinaryIO, NoReturn

from pbrs_farm.crash_notes import set_watched
from pbrs_farm.operating_system import die_with_parent, flush_output
from pbrs_farm.run.processes.messages import Message


def main(target: str) -> int:
    """Serve tasks with the Handler that `module:function` makes from a function that sends messages.

    Never called in the parent. Ignores SIGINT and SIGTERM, which the parent handles, and dies with it.
    Returns 1, after a message, if the handler cannot be made.
    """
    die_with_parent()
    set_watched()
    # The parent decides what Ctrl-C and TERM mean; Slurm signals every process of a step.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    requests, replies = _own_pipes()

    def send(message: Message) -> None:
        replies.write(message.line())

    # Loaded modules are never garbage: keep the collector off while they load and from them afterwards.
    gc.disable()
    try:
        # One handler for all tasks holds the state between them.
        handle = pkgutil.resolve_name(target)(send)
    except Exception as error:  # noqa: BLE001 - the parent learns why
        traceback.print_exc()
        send(Message("fault", f"{type(error).__name__}: {error}"))
        return 1
    gc.freeze()
    gc.enable()
    send(Message("ready"))
    for line in requests:  # until the parent closes the pipe
        send(handle(line))
    return 0


def end(code: int) -> NoReturn:
    """Run the atexit functions and end this process now, without the 0.12 s of tearing down Mitsuba."""
    atexit._run_exitfuncs()
    flush_output()
    os._exit(code)


def _own_pipes() -> tuple[BinaryIO, BinaryIO]:
    """Keep stdin and stdout for ourselves; everybody else reads nothing and prints to stderr."""
    requests = os.fdopen(os.dup(0), "rb")
    replies = os.fdopen(os.dup(1), "wb", buffering=0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    return requests, replies
