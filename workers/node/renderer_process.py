"""The side of a worker that holds one renderer: starts it, watches it, kills it when it must.

Effects: a subprocess and its log file on scratch. Nothing here touches storage or mitsuba.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from workers.config import FarmConfig
from workers.ledger.interface import FaultClass
from workers.node.memory import memory_limit_mb, resident_mb
from workers.runner import Reply, Request, Result

_TICK_S: Final = 1.0
_START_S: Final = 300.0
_TAIL: Final = 6000


@dataclass(frozen=True, slots=True)
class Ended:
    """How a task ended in the renderer: a result, or a class of fault and what to say of it."""

    seconds: float
    result: Result | None = None
    fault: FaultClass | None = None
    message: str = ""
    fingerprint: str = ""


@dataclass(slots=True)
class Watch:
    """What the renderer's attendant asks the world, about once a second.

    wanted: None, or why the task must stop now. on_storage: storage does not answer the renderer.
    on_log: the log so far, now and then, for tasks that take long.
    """

    wanted: Callable[[], FaultClass | None]
    on_storage: Callable[[str], None]
    on_log: Callable[[], None]


@dataclass(slots=True)
class _Clock:
    """Deadlines of one task; waiting for storage stops both."""

    began: float = field(default_factory=time.monotonic)
    last_sign: float = field(default_factory=time.monotonic)
    excused_s: float = 0.0
    last_tick: float = field(default_factory=time.monotonic)

    def sign(self) -> None:
        self.last_sign = time.monotonic()

    def excuse(self) -> None:
        now = time.monotonic()
        self.excused_s += now - self.last_sign
        self.last_sign = now

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.began

    @property
    def counted_s(self) -> float:
        return self.seconds - self.excused_s

    @property
    def silent_s(self) -> float:
        return time.monotonic() - self.last_sign


class Attendant:
    """Holds a renderer process for one slot; a new one replaces a dead, worn or swollen one."""

    def __init__(self, config: FarmConfig) -> None:
        self._config = config
        self._process: subprocess.Popen[bytes] | None = None
        self._buffer = b""
        self._n_tasks = 0
        self._weigh_at = 0.0
        self._limit_mb = config.limits.memory_mb or memory_limit_mb(config.slots)
        folder = config.scratch / f"pbrs-{config.worker}-{os.getpid()}"
        folder.mkdir(parents=True, exist_ok=True)
        self.log = folder / "log.txt"

    def run(self, request: Request, watch: Watch) -> Ended:
        """Run one task in the renderer; never raises for what the renderer does."""
        clock = _Clock()
        trouble = self._ensure(watch)
        if trouble is not None:
            return trouble
        os.truncate(self.log, 0)
        try:
            self._send(request)
            ended = self._attend(request, watch, clock)
        except (BrokenPipeError, ConnectionResetError):
            ended = self._buried(clock)
        self._n_tasks += 1
        if self._is_worn():
            self.stop()
        return ended

    def _is_worn(self) -> bool:
        """Many tasks, or more memory held between tasks than half of what is allowed."""
        process = self._process
        if process is None:
            return False
        if self._n_tasks >= self._config.limits.tasks_per_renderer:
            return True
        if time.monotonic() < self._weigh_at:
            return False
        self._weigh_at = time.monotonic() + _TICK_S
        return resident_mb(process.pid) > 0.5 * self._limit_mb

    def stop(self) -> None:
        """Kill the renderer and whatever it started."""
        process, self._process = self._process, None
        if process is None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()

    def tail(self) -> str:
        """The end of the running or last task's log."""
        return read_tail(self.log, _TAIL)

    def _ensure(self, watch: Watch) -> Ended | None:
        """A renderer that is ready, or why there is none."""
        if self._process is not None and self._process.poll() is None:
            return None
        self.stop()
        self._buffer, self._n_tasks = b"", 0
        clock = _Clock()
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "workers.node.renderer"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                start_new_session=True,
            )
        while clock.seconds < _START_S:
            reply = self._reply(_TICK_S)
            stop = watch.wanted()
            if stop is not None:
                self.stop()
                return Ended(clock.seconds, fault=stop, message="stopped", fingerprint=stop)
            if reply is not None and reply.kind == "ready":
                return None
            if reply is not None and reply.kind == "fault":
                self.stop()
                return _faulty(reply, clock.seconds)
            if self._process.poll() is not None:
                return self._buried(clock)
        self.stop()
        return Ended(clock.seconds, None, "machine", "the renderer did not start", "no start")

    def _attend(self, request: Request, watch: Watch, clock: _Clock) -> Ended:
        limits = self._config.limits
        deadline_s = limits.deadline_s(request.stage)
        log_size = 0
        while True:
            reply = self._reply(_TICK_S)
            if reply is not None:
                if reply.kind == "done":
                    return Ended(clock.seconds, result=reply.result)
                if reply.kind == "fault":
                    return _faulty(reply, clock.seconds)
                if reply.kind == "storage":
                    clock.excuse()
                    watch.on_storage(reply.text)
                clock.sign()
                continue
            if self._process is None or self._process.poll() is not None:
                return self._buried(clock)
            size = self.log.stat().st_size
            if size != log_size:
                log_size = size
                clock.sign()
                watch.on_log()
            stop = watch.wanted()
            if stop is not None:
                return self._killed(clock, stop, f"stopped: {stop}")
            if clock.counted_s > deadline_s:
                return self._killed(clock, "timeout", f"longer than {deadline_s:.0f} s")
            if clock.silent_s > limits.silence_s:
                return self._killed(clock, "silent", f"silent for {limits.silence_s:.0f} s")
            used_mb = resident_mb(self._process.pid)
            if used_mb > self._limit_mb:
                text = f"{used_mb:.0f} MB resident, {self._limit_mb:.0f} allowed"
                return self._killed(clock, "resource", text)

    def _killed(self, clock: _Clock, fault: FaultClass, message: str) -> Ended:
        self.stop()
        return Ended(clock.seconds, None, fault, message, fault)

    def _buried(self, clock: _Clock) -> Ended:
        """The renderer died by itself: a crash, or the kernel's out-of-memory killer."""
        code = self._process.wait() if self._process is not None else 0
        self.stop()
        name = signal.Signals(-code).name if code < 0 else f"exit status {code}"
        if code == -signal.SIGKILL:
            text = "the renderer was killed from outside (out of memory?)"
            return Ended(clock.seconds, None, "resource", text, name)
        text = f"the renderer died: {name}"
        return Ended(clock.seconds, None, "crash", text, text)

    def _send(self, request: Request) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(request.model_dump_json().encode() + b"\n")
        self._process.stdin.flush()

    def _reply(self, timeout_s: float) -> Reply | None:
        """The next line of the renderer, None when none came in time or the pipe is closed."""
        assert self._process is not None
        assert self._process.stdout is not None
        pipe = self._process.stdout.fileno()
        if b"\n" not in self._buffer:
            readable, _, _ = select.select([pipe], [], [], timeout_s)
            if not readable:
                return None
            chunk = os.read(pipe, 65536)
            if not chunk:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(timeout=_TICK_S)
                return None
            self._buffer += chunk
            if b"\n" not in self._buffer:
                return None
        line, _, self._buffer = self._buffer.partition(b"\n")
        return Reply.model_validate_json(line)


def _faulty(reply: Reply, seconds: float) -> Ended:
    return Ended(seconds, None, reply.fault or "bug", reply.text, reply.fingerprint)


def read_tail(path: Path, n_bytes: int) -> str:
    """The last n_bytes of a text file, "" when there is none."""
    try:
        with path.open("rb") as file:
            file.seek(0, os.SEEK_END)
            file.seek(max(0, file.tell() - n_bytes))
            return file.read().decode("utf-8", "replace")
    except OSError:
        return ""
