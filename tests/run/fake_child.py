"""A scripted render process, on a clock that advances only when it is waited for."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from pbrs_farm.run.processes.messages import Message, MessageKind


@dataclass
class FakeClock:
    """A clock that advances only in waits."""

    now: float = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass
class FakeChild:
    """Implements pbrs_farm.run.processes.child_process.Child in memory."""

    clock: FakeClock
    requests: list[bytes] = field(default_factory=list)
    script: deque[tuple[float, Message | Callable[[], None]]] = field(default_factory=deque)
    code: int | None = None
    used_mb: float = 1.0
    log: str = ""
    was_killed: bool = False
    was_closed: bool = False

    def at(
        self, seconds: float, what: MessageKind | Callable[[], None], text: str = "", **body: Any
    ) -> None:
        """Send a message, or call a function, at that time of the clock."""
        self.script.append((seconds, Message(what, text, body) if isinstance(what, str) else what))

    def dies(self, code: int) -> None:
        self.code = code

    def send(self, line: bytes) -> None:
        self.requests.append(line)

    def receive(self, timeout_s: float) -> bytes | None:
        until = self.clock.now + timeout_s
        while self.script and self.script[0][0] <= until and self.code is None:
            time, event = self.script.popleft()
            self.clock.now = max(self.clock.now, time)
            if isinstance(event, Message):
                return event.line()
            event()
        self.clock.now = until
        return None

    def exit_code(self) -> int | None:
        return self.code

    def kill(self) -> None:
        self.was_killed = True
        self.code = -9 if self.code is None else self.code

    def release(self) -> None:
        return None

    def close(self) -> None:
        self.was_closed = True
        self.code = 0

    def fileno(self) -> int:
        raise AssertionError("a fake has no descriptor")

    def resident_mb(self) -> float:
        return self.used_mb

    def log_size(self) -> int:
        return len(self.log)

    def log_tail(self, n_bytes: int) -> str:
        return self.log[-n_bytes:]

    def clear_log(self) -> None:
        self.log = ""
