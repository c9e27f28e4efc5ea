"""Celery's transport for Redis, with one client per channel, robust against invalid messages. Effects: kombu's.

kombu makes a redis-py client, with a table of some hundred callbacks, for each message taken and each
acknowledged: a fifth of the work of a worker's parent process for a short task. An element of a queue that is
not JSON, or not an envelope, would end the worker that takes it: it is dropped and logged. So would a Redis that
temporarily refuses writes: it counts as an unavailable broker until it accepts them again.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from json import JSONDecodeError
from typing import Any, ClassVar, Final

from kombu.transport import redis as kombu_redis

from workers.ledger.redis_connections import Connection, SSLConnection

_log = logging.getLogger("pbrs.worker")
_ENVELOPE: Final = {"body": str, "headers": dict, "properties": dict}
_PROPERTIES: Final = {"delivery_tag": str, "delivery_info": dict}


class Channel(kombu_redis.Channel):  # type: ignore[misc]
    """kombu's channel; its client is kept as long as the pool of connections it draws from."""

    connection_class = Connection
    connection_class_ssl = SSLConnection
    _kept: Any = None

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        # A channel to a Redis that refuses writes would be lost at its first message, and recreated
        # immediately.
        # With this test there is no connection yet, and Celery's delays grow.
        try:
            self.client.set("takes-writes", "1", px=1)
        except self.connection_errors:
            self.close()
            raise

    def _create_client(self, asynchronous: bool = False) -> Any:
        if asynchronous:
            return super()._create_client(asynchronous=True)
        if self._kept is None or self._kept.connection_pool is not self.pool:
            self._kept = super()._create_client()
        return self._kept

    def _brpop_read(self, **options: Any) -> Any:
        try:
            return super()._brpop_read(**options)
        except (JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
            _log.error("dropped an invalid message: %s", error)
            return True


class Transport(kombu_redis.Transport):  # type: ignore[misc]
    """kombu's transport with our channel."""

    Channel = Channel
    on_try: ClassVar[Callable[[], object]] = staticmethod(lambda: None)  # at each try to connect

    def establish_connection(self) -> Any:
        type(self).on_try()
        return super().establish_connection()

    def _deliver(self, message: Any, queue: str) -> None:
        if _has(message, _ENVELOPE) and _has(message["properties"], _PROPERTIES):
            super()._deliver(message, queue)
        else:
            _log.error("dropped an invalid message from the queue %s", queue)


def _has(value: Any, fields: Mapping[str, type]) -> bool:
    return isinstance(value, dict) and all(isinstance(value.get(k), t) for k, t in fields.items())
