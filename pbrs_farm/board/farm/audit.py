"""The lines that say who changed what of a farm. Effects: appends to a file, writes to the log."""

from __future__ import annotations

import json
import logging
import threading
from collections import deque
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.shown_text import MAX_MESSAGE, shown

_LOG: Final = logging.getLogger(__name__)
_SHOWN: Final = 20  # lines that the page shows


class Audit:
    """A file of JSON lines, one a change."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lock = threading.Lock()

    def note(self, *, address: str, what: str, of: str, answer: str) -> None:
        """Write one line: when, from which address, what was done to what, and what came of it."""
        row = {
            "utc": datetime.now(UTC).isoformat(timespec="seconds"),
            "address": address,
            "what": what,
            "of": shown(of),
            "answer": shown(answer, MAX_MESSAGE),
        }
        line = json.dumps(row)
        with self._lock, self._file.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
        _LOG.warning("audit: %s", line)

    def last(self) -> list[dict[str, Any]]:
        """The last changes, newest first."""
        try:
            with self._file.open(encoding="utf-8") as file:
                lines = deque(file, maxlen=_SHOWN)
        except OSError:
            return []
        return [json.loads(line) for line in reversed(lines)]
