"""Log lines of the farm's processes: one line each, never a password. Effects: logging set-up."""

from __future__ import annotations

import logging
import re
import sys
from typing import Final

from workers.ledger.redis_connections import RefusedForNow

_SECRETS: Final = re.compile(r"(rediss?://[^:/@\s]*:)[^@\s]+@")


class NoSecrets(logging.Formatter):
    """Formats a record with the passwords of Redis URLs replaced by ***.

    A temporary refusal of Redis is one line: kombu adds its traceback to a message that says all.
    """

    def format(self, record: logging.LogRecord) -> str:
        if record.exc_info and isinstance(record.exc_info[1], RefusedForNow):
            record.exc_info = None
        return _SECRETS.sub(r"\1***@", super().format(record))


def log_to_stderr(level: int | str = "INFO") -> None:
    """Log to stderr with time, process and level; passwords in URLs are replaced by ***.

    For the main function of a process, never for library code: it replaces all handlers of the root
    logger. Calling it again is harmless.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(NoSecrets("%(asctime)s %(process)d %(levelname)s %(name)s: %(message)s"))
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level)
    # A line per message received and done would be most of what Celery's processes do.
    for name in ("celery.worker.strategy", "celery.app.trace"):
        logging.getLogger(name).setLevel(logging.WARNING)
