"""Celery's way to Redis, with one client a channel. Effects: kombu's.

kombu makes a redis-py client, with a table of some hundred callbacks, for each message taken and
each acknowledged: a fifth of what a worker's parent process does for a short task.
"""

from __future__ import annotations

from typing import Any

from kombu.transport import redis as kombu_redis


class Channel(kombu_redis.Channel):  # type: ignore[misc]
    """kombu's channel; its client is kept as long as the pool of connections it draws from."""

    _kept: Any = None

    def _create_client(self, asynchronous: bool = False) -> Any:
        if asynchronous:
            return super()._create_client(asynchronous=True)
        if self._kept is None or self._kept.connection_pool is not self.pool:
            self._kept = super()._create_client()
        return self._kept


class Transport(kombu_redis.Transport):  # type: ignore[misc]
    """kombu's transport with our channel."""

    Channel = Channel
