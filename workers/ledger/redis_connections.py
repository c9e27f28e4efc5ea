"""Treat temporary refusals and the silence of Redis as lost connections. Effects: sockets.

A replica that has just lost its lead answers READONLY, a full disk MISCONF, a starting server LOADING: the request is
valid and will succeed later, perhaps on another server of the same name. redis-py raises a dozen classes for these,
kombu treats most of them as errors of the caller, and Celery's worker ends at one. Here all of them become a lost
connection, on which the ledger, kombu and Celery wait and retry.

A proxy may keep connections open and forward nothing. Each of them would cost its own timeout, so after the first
timeout the process replaces all its connections.
"""

from __future__ import annotations

import re
import time
from typing import Any, Final

import redis

ANSWER_S: Final = 10  # s without an answer after which Redis is away; above any blocking read

# From Redis' own list (createSharedObjects of server.c, script.c, cluster.c): refusals that say nothing of the command.
# Not in it: what stays wrong (NOAUTH, NOPERM, WRONGTYPE, MOVED) and what redis-py answers itself (NOSCRIPT).
PASSING: Final = (
    "BUSY",  # a script runs for too long
    "CLUSTERDOWN",
    "LOADING",  # it starts, and reads its data
    "MASTERDOWN",  # a replica without its master
    "MISCONF",  # it cannot write its data to disk
    "NOREPLICAS",  # fewer than min-replicas-to-write
    "OOM",  # above maxmemory
    "READONLY",  # a replica, mostly one that led until now
    "TRYAGAIN",
    "UNBLOCKED",  # a blocking read, when its server became a replica
)
# At the start of an answer; inside one of a transaction, or of a script of Redis before 7.
_PREFIX: Final = re.compile(rf"(?:^|: -?)({'|'.join(PASSING)})(?= |$)")


class RefusedForNow(redis.ConnectionError):
    """Redis is reachable and refuses temporarily; `prefix` is its error word."""

    def __init__(self, prefix: str, text: str) -> None:
        super().__init__(text, status_code=prefix)
        self.prefix = prefix

    def __repr__(self) -> str:
        # Celery's line on a lost connection shows it; redis-py's names a class alone.
        return str(self)


def passing_prefix(error: Exception) -> str:
    """The prefix by which an answer of Redis says that it refuses for now, "" for every other error."""
    match = _PREFIX.search(_answer(error))
    return match[1] if match else ""


def _answer(error: Exception) -> str:
    """The line that Redis sent; redis-py takes the prefixes that it knows away."""
    prefix, text = getattr(error, "status_code", None), str(error)
    return text if not prefix or text.startswith(prefix) else f"{prefix} {text}"


class _Silence:
    """When a connection of this process last got no answer in time; monotonic seconds."""

    at = -1.0


class _LostWhereRefused:
    """Mixin of redis-py's connections: a refusal for now ends the connection, a silence all of them."""

    _made_at: float | None = None  # None = not connected

    def connect(self) -> None:
        self._made_at = self._made_at or time.monotonic()
        super().connect()  # type: ignore[misc]

    def disconnect(self, *args: Any, **options: Any) -> None:
        self._made_at = None
        super().disconnect(*args, **options)  # type: ignore[misc]

    def send_packed_command(self, *args: Any, **options: Any) -> None:
        if self._made_at and self._made_at <= _Silence.at:
            self.disconnect()
        self._made_at = self._made_at or time.monotonic()
        super().send_packed_command(*args, **options)  # type: ignore[misc]

    def read_response(self, *args: Any, **options: Any) -> Any:
        try:
            return super().read_response(*args, **options)  # type: ignore[misc]
        except redis.TimeoutError:
            _Silence.at = time.monotonic()
            raise
        except redis.RedisError as error:
            prefix = passing_prefix(error)
            if not prefix:
                raise
            # The next try connects anew: the name may lead to the new master by then.
            self.disconnect()
            raise RefusedForNow(prefix, _answer(error)) from error


class Connection(_LostWhereRefused, redis.Connection):
    """redis-py's connection over TCP."""


class SSLConnection(_LostWhereRefused, redis.SSLConnection):
    """redis-py's connection over TLS."""


BY_SCHEME: Final = {"redis": Connection, "rediss": SSLConnection}
