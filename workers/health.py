"""Signs of life of a worker's main loop, and leaving when drained. Effects: Redis, a file.

`python -m workers.health` is the liveness probe: exit 1 when the main loop stands still.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from pathlib import Path
from typing import Any, Final

from celery import bootsteps
from celery.worker import state

from workers.config import config_from_environment
from workers.ledger import LedgerUnavailable
from workers.redis_ledger import RedisLedger
from workers.registry import Registry

_log = logging.getLogger("pbrs.worker")
_EVERY_S: Final = 10.0
_STALE_S: Final = 120.0


class SignsOfLife(bootsteps.StartStopStep):  # type: ignore[misc]
    """Celery boot step: beats for the whole worker, and shuts it down warmly when drained."""

    requires = {"celery.worker.components:Timer"}  # noqa: RUF012 - Celery's own interface

    def __init__(self, parent: Any, **options: Any) -> None:
        super().__init__(parent, **options)
        self._config = config_from_environment()
        self._registry = Registry(RedisLedger(self._config))
        self._timer: Any = None

    def start(self, parent: Any) -> None:
        self._beat()
        self._timer = parent.timer.call_repeatedly(_EVERY_S, self._beat)

    def stop(self, _parent: Any) -> None:
        if self._timer is not None:
            self._timer.cancel()
        try:
            self._registry.leave()
        except LedgerUnavailable as error:
            _log.warning("%s", error)
        self._config.heartbeat_file.unlink(missing_ok=True)

    def _beat(self) -> None:
        touch(self._config.heartbeat_file)
        try:
            if self._registry.beat():
                _log.info("drained: finishing what runs, then leaving")
                state.should_stop = os.EX_OK
        except LedgerUnavailable as error:
            _log.warning("%s", error)


def touch(path: Path) -> None:
    """Set the file's time to now; it appears if need be."""
    path.touch()
    os.utime(path)


def main() -> int:
    """0 while the worker on this machine is alive; 1 and a line when not."""
    path = config_from_environment().heartbeat_file
    try:
        age_s = time.time() - path.stat().st_mtime
    except FileNotFoundError:
        age_s = float("inf")
    if age_s < _STALE_S:
        return 0
    sys.stderr.write(f"{path}: no sign of life for {age_s:.0f} s\n")
    return 1


if __name__ == "__main__":
    sys.exit(main())
