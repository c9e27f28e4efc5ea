"""The one supervisor of render processes: starts one, feeds it tasks, watches it, kills it.

Effects: those of the Child it starts. A local run holds one for each of its jobs, a worker of the
farm one for each slot; the limits and what counts as a sign of life are the same in both.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

from pbrs_farm.operating_system import ending, was_killed
from pbrs_farm.run.processes.child_process import Child
from pbrs_farm.run.processes.limits import ProcessLimits
from pbrs_farm.run.processes.messages import Message, message_from_line

CHECK_EVERY_S: Final = 1.0
REPORTED: Final = "reported"


@dataclass(frozen=True, slots=True)
class Ended:
    """How a task ended.

    cause: "" when it was done; "reported" when the process itself says what went wrong; "crash" when
    it died; "resource" when it held too much memory or was killed from outside; "machine" when it did
    not start; "timeout", "silent" for a limit of time; else the cause given to kill().
    """

    seconds: float
    cause: str = ""
    text: str = ""
    body: dict[str, Any] = field(default_factory=dict)  # of the process's own last message


class RenderProcess:
    """One render process at a time, made by start; a dead, worn or swollen one is replaced by the next."""

    def __init__(
        self,
        start: Callable[[], Child],
        limits: ProcessLimits,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._start = start
        self._limits = limits
        self._clock = clock
        self._child: Child | None = None
        self._is_ready = False
        self._is_busy = False
        self._n_tasks = 0  # since the process was started
        self._task_s = math.inf  # what the running task may take
        self._begun_at = 0.0  # when the task was given
        # Begin of what a limit counts; moved on by the time that storage did not answer.
        self._task_at = 0.0
        self._step_at = 0.0
        self._sign_at = 0.0  # last sign of life
        self._check_at = 0.0  # when the limits are looked at next
        self._log_size = 0

    @property
    def is_busy(self) -> bool:
        """It has a task that has not ended."""
        return self._is_busy

    def fileno(self) -> int:
        """File descriptor that becomes readable with the next message; only while the process is busy."""
        assert self._child is not None
        return self._child.fileno()

    def start(self) -> Child:
        """Start the process unless it lives, also before it has a task."""
        child = self._child
        if child is None or child.exit_code() is not None:
            self.stop()
            child = self._child = self._start()
            self._is_ready, self._n_tasks = False, 0
        return child

    def begin(self, request: bytes, *, task_s: float = math.inf) -> None:
        """Send a task of at most task_s seconds, with an empty log; starts the process if needed."""
        assert not self._is_busy, "one task at a time"
        child = self.start()
        child.clear_log()
        now = self._clock()
        self._begun_at = self._task_at = self._step_at = self._sign_at = now
        self._check_at, self._task_s, self._log_size = now + CHECK_EVERY_S, task_s, 0
        self._is_busy = True
        child.send(request)

    def poll(self, timeout_s: float) -> Message | Ended | None:
        """The next message, or the end of the task; None if nothing happens within timeout_s.

        Limits of time and memory are checked here, once a second, so poll while a task runs. The last message
        of a dying process comes before its end.
        """
        child = self._child
        assert child is not None
        assert self._is_busy, "no task to wait for"
        # Look at the limits once a second, also while it talks without pause.
        if self._clock() >= self._check_at:
            self._check_at = self._clock() + CHECK_EVERY_S
            exceeded = self._exceeded(child)
            if exceeded is not None:
                return self.kill(*exceeded)
        line = child.receive(timeout_s)
        if line is None and child.exit_code() is not None:
            line = child.receive(0.0)  # its last message
            if line is None:
                return self._died(child)
        return None if line is None else self._heard(message_from_line(line))

    def kill(self, cause: str, text: str) -> Ended:
        """End the running task and its process; cause as of Ended, text for people."""
        self.stop()
        return Ended(self._clock() - self._begun_at, cause, text)

    def stop(self) -> None:
        """Kill the process and whatever it started; its log can still be read."""
        self._is_busy = False
        if self._child is not None:
            self._child.kill()

    def release(self) -> None:
        """Tell an idle process that nothing more comes, without waiting for its end; then close it."""
        if self._child is not None and not self._is_busy:
            self._child.release()

    def close(self) -> None:
        """End an idle process in good order, kill one that has a task or never had one."""
        child = self._child
        if child is not None and not self._is_busy and self._n_tasks and child.exit_code() is None:
            child.close()
        else:
            self.stop()

    def log_tail(self, n_bytes: int = 6000) -> str:
        """The end of the running or last task's log."""
        return "" if self._child is None else self._child.log_tail(n_bytes)

    def _heard(self, message: Message) -> Message | Ended:
        now = self._clock()
        if message.kind == "waiting":
            # Storage is nobody's fault: the time since the last sign counts for no limit.
            self._task_at += now - self._sign_at
            self._step_at += now - self._sign_at
        self._sign_at = now
        if message.kind == "ready":
            self._is_ready, self._task_at = True, now
        if message.kind in ("ready", "step"):
            self._step_at = now
        if message.kind == "fault" and not self._is_ready:
            return self.kill("machine", message.text)
        if message.kind not in ("done", "fault"):
            return message
        self._is_busy = False
        self._n_tasks += 1
        self._recycle()
        cause = REPORTED if message.kind == "fault" else ""
        return Ended(now - self._begun_at, cause, message.text, message.body)

    def _recycle(self) -> None:
        """Between two tasks: end a process that has run many, or that holds much."""
        child, limits = self._child, self._limits
        if child is not None and (
            self._n_tasks >= limits.recycle_tasks or child.resident_mb() > limits.recycle_mb
        ):
            self.stop()

    def _exceeded(self, child: Child) -> tuple[str, str] | None:
        """The limit the process is over, and what to say of it."""
        limits, now = self._limits, self._clock()
        # A line in the log is a sign of life too.
        size = child.log_size()
        if size != self._log_size:
            self._log_size, self._sign_at = size, now
        used_mb = child.resident_mb()
        if used_mb > limits.memory_mb:
            return "resource", f"{used_mb:.0f} MB resident, limit {limits.memory_mb:.0f}; killed"
        # Starting: its task and its step have not begun.
        if not self._is_ready:
            if now - self._begun_at > limits.start_s:
                return "machine", f"the process did not start within {limits.start_s:.0f} s"
            return None
        if now - self._task_at > self._task_s:
            return "timeout", f"longer than {self._task_s:.0f} s; killed"
        if now - self._step_at > limits.step_s:
            return "timeout", f"the step took longer than {limits.step_s:.0f} s; killed"
        if now - self._sign_at > limits.silence_s:
            return "silent", f"silent for {limits.silence_s:.0f} s; killed"
        return None

    def _died(self, child: Child) -> Ended:
        """End of a process after a crash or by the kernel's out-of-memory killer."""
        code = child.exit_code() or 0
        self.stop()
        seconds = self._clock() - self._begun_at
        cause = "resource" if was_killed(code) else "crash"
        return Ended(seconds, cause, ending(code))
