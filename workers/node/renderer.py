"""A renderer: a process of its own that runs tasks one after another, fed through pipes.

Effects: the runner's; dies with its parent. It is started afresh (never forked), so that S3 and
Mitsuba are safe in it, and may be killed at any moment. Requests come as JSON lines on stdin,
replies leave on what was stdout; whatever libraries print goes to stderr, which is the task's log.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import traceback
from typing import BinaryIO

from workers.config import config_from_environment
from workers.node.faults import class_of, fingerprint, one_line
from workers.runner import Reply, Request, StepRunner, Tell, runner_maker

_PR_SET_PDEATHSIG = 1


def die_with_parent(sign: int = signal.SIGKILL) -> None:
    """Ask Linux to send us the signal when the thread that started us ends."""
    parent = os.getppid()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(sign), 0, 0, 0)
    if os.getppid() != parent:
        os.kill(os.getpid(), sign)


def _own_pipes() -> tuple[BinaryIO, BinaryIO]:
    """Keep stdin and stdout for ourselves; everybody else reads nothing and prints to stderr."""
    requests = os.fdopen(os.dup(0), "rb")
    replies = os.fdopen(os.dup(1), "wb", buffering=0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    return requests, replies


def serve(runner: StepRunner, requests: BinaryIO, tell: Tell, reply: Tell) -> None:
    """Answer requests until the pipe closes. reply: writes one JSON line."""
    for line in requests:
        request = Request.model_validate_json(line)
        try:
            result = runner.run(request, tell)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - reported, by class
            traceback.print_exc()
            fault = Reply(
                kind="fault",
                text=one_line(error),
                fault=class_of(error),
                fingerprint=fingerprint(error),
            )
            reply(fault.model_dump_json())
        else:
            reply(Reply(kind="done", result=result).model_dump_json())


def main() -> int:
    """Serve the runner this machine's configuration names."""
    die_with_parent()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    requests, replies = _own_pipes()

    def reply(line: str) -> None:
        replies.write(line.encode() + b"\n")

    def tell(step: str) -> None:
        reply(Reply(kind="step", text=step).model_dump_json())

    def storage_waits(reason: str) -> None:
        reply(Reply(kind="storage", text=reason).model_dump_json())

    try:
        config = config_from_environment()
        runner = runner_maker(config.runner)(config, storage_waits)
    except Exception as error:  # noqa: BLE001 - the parent is told why
        traceback.print_exc()
        why = Reply(
            kind="fault", text=one_line(error), fault="machine", fingerprint=fingerprint(error)
        )
        reply(why.model_dump_json())
        return 1
    reply(Reply(kind="ready").model_dump_json())
    serve(runner, requests, tell, reply)
    return 0


if __name__ == "__main__":
    sys.exit(main())
