"""The operating system's side of a render process: its start, session, pipes, log and end."""

from __future__ import annotations

import contextlib
import contextvars
import json
import os
import pkgutil
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path
from typing import IO, Final, NoReturn, Protocol

from pbrs_farm.core.plugins import LOADED
from pbrs_farm.crash_notes import LINE_WRITER, sends_notes
from pbrs_farm.operating_system import (
    OWN_SESSION,
    PATH_FROM_PARENT,
    ReplyPipe,
    can_fork,
    end_tree,
    forked,
    resident_mb,
)

_CLOSE_S: Final = 10.0  # what freeing GL and Mitsuba may take
_BOOT: Final = PATH_FROM_PARENT + (
    "from pbrs_farm.run.processes.task_loop import end, main; end(main(sys.argv[2]))"
)


class Child(Protocol):
    """A process as RenderProcess needs it; tests put their own."""

    def send(self, line: bytes) -> None: ...
    def receive(self, timeout_s: float) -> bytes | None: ...
    def exit_code(self) -> int | None: ...
    def kill(self) -> None: ...
    def release(self) -> None: ...
    def close(self) -> None: ...
    def fileno(self) -> int: ...
    def resident_mb(self) -> float: ...
    def log_size(self) -> int: ...
    def log_tail(self, n_bytes: int) -> str: ...
    def clear_log(self) -> None: ...


class ChildProcess:
    """A Python process that serves the tasks of `target` (see task_loop.main)."""

    def __init__(self, target: str, log: Path) -> None:
        self._log = log
        self._buffer = b""  # received, up to no line's end yet
        with log.open("ab") as file:
            self.process = (_forked if may_fork() else _started)(target, file)
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self._requests, self._replies = self.process.stdin, ReplyPipe(self.process.stdout)

    def send(self, line: bytes) -> None:
        """Put a line into its pipe; nothing when it is dead, as exit_code then says."""
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self._requests.write(line + b"\n")
            self._requests.flush()

    def receive(self, timeout_s: float) -> bytes | None:
        """Its next line, or None by then or at its end, whose `exit_code` it awaits; from one thread only."""
        # Read on where no whole line is held yet.
        if b"\n" not in self._buffer:
            chunk = self._replies.read(timeout_s)
            if chunk is None:
                return None
            if not chunk:  # end of file: exit_code soon returns the exit status
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self.process.wait(timeout=1.0)
            self._buffer += chunk
            if b"\n" not in self._buffer:
                return None
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line

    def exit_code(self) -> int | None:
        """Its exit code, minus the signal that killed it; None while it lives."""
        return self.process.poll()

    def kill(self) -> None:
        """Kill it and its children, without any clean-up; `close` ends it in good order."""
        end_tree(self.process)
        self.process.wait()
        self.release()
        self._replies.close()

    def release(self) -> None:
        """Close the pipe of requests, which makes the process exit."""
        with contextlib.suppress(BrokenPipeError):
            self._requests.close()

    def close(self) -> None:
        """Let the process exit, which frees its libraries' resources; kill it if it does not."""
        self.release()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=_CLOSE_S)
        self.kill()

    def fileno(self) -> int:
        """The descriptor that becomes readable when it says something."""
        return self._replies.fileno()

    def resident_mb(self) -> float:
        """Memory it holds, MiB."""
        return resident_mb(self.process.pid)

    def log_size(self) -> int:
        """Bytes in its log."""
        return self._log.stat().st_size

    def log_tail(self, n_bytes: int) -> str:
        """The end of its log; "" without one."""
        try:
            with self._log.open("rb") as file:
                file.seek(max(0, file.seek(0, os.SEEK_END) - n_bytes))
                return file.read().decode("utf-8", "replace")
        except OSError:
            return ""

    def move_log(self, log: Path) -> None:
        """Keep its log at another place of the same file system."""
        self._log = self._log.replace(log)

    def clear_log(self) -> None:
        """Empty its log: the next task's begins."""
        os.truncate(self._log, 0)


# fmt: off
_UNFORKABLE: Final = frozenset({
    "OpenImageIO", "cupy", "drjit", "embreex", "jax", "mitsuba", "moderngl", "mujoco", "obstore",
    "onnxruntime", "pxr", "pyarrow", "tensorflow", "torch",
})
# fmt: on
"""Modules that have native threads or hold devices, which a fork would break."""
# All render processes load this module, which loads none of these.
_LOADED_FIRST: Final = "pbrs_farm.run.steps"


def may_fork() -> bool:
    """Whether a render process is a fork of this one, which saves it half a second of loading modules.

    Only of a command's own process: that of a notebook, a test or a farm may hold anything. Nor with a plugin,
    whose libraries are unknown, or with a thread, as its pool would wait for it in the child forever.
    """
    if not (can_fork() and sends_notes()) or LOADED or not _UNFORKABLE.isdisjoint(sys.modules):
        return False
    threads = {t.name for t in threading.enumerate() if t is not threading.main_thread()}
    return threads <= {LINE_WRITER}


def _started(target: str, log: IO[bytes]) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-P", "-c", _BOOT, json.dumps(sys.path), target]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=log, **OWN_SESSION)


def _forked(target: str, log: IO[bytes]) -> subprocess.Popen[bytes]:
    for name in (target, _LOADED_FIRST):
        with contextlib.suppress(Exception):  # the child reports it
            pkgutil.resolve_name(name)
    return forked(partial(_serve, target), log) if may_fork() else _started(target, log)


def _serve(target: str) -> NoReturn:
    from pbrs_farm.run.processes.task_loop import end, main

    # In a context of its own, without the parent's notes.
    end(contextvars.Context().run(main, target))
