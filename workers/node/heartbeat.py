"""The heartbeat of a worker's main loop, and leaving when drained. Effects: Redis, a file."""

from __future__ import annotations

import logging
import os
from typing import Any, Final

from celery import bootsteps
from celery.worker import state

from pbrs_farm.operating_system import tree_mb
from workers.config import config_from_environment
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import LedgerUnavailable
from workers.ledger.worker_registry import Registry
from workers.liveness import touch

_log = logging.getLogger("pbrs.worker")
_EVERY_S: Final = 10.0  # well below ALIVE_S, so that one lost heartbeat does no harm


class Heartbeat(bootsteps.StartStopStep):  # type: ignore[misc]
    """Celery boot step: a heartbeat for the whole worker, and shuts it down warmly when drained."""

    requires = {"celery.worker.components:Timer"}  # noqa: RUF012 - Celery's own interface

    def __init__(self, parent: Any, **options: Any) -> None:
        super().__init__(parent, **options)
        self._config = config_from_environment()
        self._registry = Registry(RedisLedger(self._config))
        self._timer: Any = None

    def start(self, parent: Any) -> None:
        self.beat()
        self._timer = parent.timer.call_repeatedly(_EVERY_S, self.beat)

    def stop(self, _parent: Any) -> None:
        if self._timer is not None:
            self._timer.cancel()
        # Running tasks are finished first: from here on the supervisor sends this worker's
        # heartbeat.
        touch(self._config.leaving_file)
        self.beat()

    def beat(self) -> None:
        touch(self._config.heartbeat_file)
        is_leaving = self._config.leaving_file.exists()
        try:
            # The supervisor started Celery, and Celery its slots and their renderers.
            memory_mb = tree_mb(os.getppid())
            if self._registry.heartbeat(is_leaving=is_leaving, memory_mb=memory_mb):
                _log.info("drained: stopping after the running tasks")
                # Celery's warm shutdown: no more messages, what runs ends.
                touch(self._config.leaving_file)
                state.should_stop = os.EX_OK
        except LedgerUnavailable as error:
            _log.warning("%s", error)
