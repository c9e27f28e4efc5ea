"""Messages of a render process to its parent, one line of JSON each. Effects: none."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

# ready: it may be given a task. step: a step begins. waiting: storage does not answer.
# share: how much of the step is done, 0..1. event: something else its parent wants to know.
# done, fault: the end of the task.
MessageKind = Literal["ready", "step", "waiting", "share", "event", "done", "fault"]


@dataclass(frozen=True, slots=True)
class Message:
    """One line from a render process."""

    kind: MessageKind
    text: str = ""
    body: dict[str, Any] = field(default_factory=dict)  # JSON values that its parent understands

    def line(self) -> bytes:
        """The message as one line for message_from_line; the body must be JSON values."""
        return json.dumps(asdict(self), separators=(",", ":")).encode() + b"\n"


def message_from_line(line: bytes) -> Message:
    """The message a line holds."""
    return Message(**json.loads(line))


Send = Callable[[Message], None]
# Runs the task a request line names; its last message, done or fault.
Handler = Callable[[bytes], Message]
