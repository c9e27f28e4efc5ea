"""Log lines of the farm's processes: one line each, never a password. Effects: logging set-up."""

from __future__ import annotations

import logging
import re
import sys
from typing import Final

from workers.ledger.redis_connections import RefusedForNow

_SECRETS: Final = re.compile(r"(rediss?://[^:/@\s]*:)[^@\s]+@")


class NoSecrets(logging.Formatter):
    """Formats a record with Redis URLs' passwords as ***, a passing refusal as one line."""

    def format(self, record: logging.LogRecord) -> str:
        if record.exc_info and isinstance(record.exc_info[1], RefusedForNow):
            record.exc_info = None
        return _SECRETS.sub(r"\1***@", super().format(record))


def log_to_stderr(level: int | str = "INFO") -> None:
    """Log to stderr, passwords as ***, instead of all root handlers: for main functions alone."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(NoSecrets("%(asctime)s %(process)d %(levelname)s %(name)s: %(message)s"))
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level)
    # A line per message received and done would be most of what Celery's processes do.
    for name in ("celery.worker.strategy", "celery.app.trace"):
        logging.getLogger(name).setLevel(logging.WARNING)
