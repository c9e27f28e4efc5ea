"""Treat temporary refusals of Redis as lost connections. Effects: sockets.

A replica that has just lost its lead answers READONLY, a full disk MISCONF, a starting server LOADING: the request is
valid and will succeed later, perhaps on another server of the same name. redis-py raises a dozen classes for these,
kombu treats most of them as errors of the caller, and Celery's worker ends at one. Here all of them become a lost
connection, on which the ledger, kombu and Celery wait and retry.
"""

from __future__ import annotations

import re
from typing import Any, Final

import redis

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
    found = _PREFIX.search(_answer(error))
    return found[1] if found else ""


def _answer(error: Exception) -> str:
    """The line that Redis sent; redis-py takes the prefixes that it knows away."""
    prefix, text = getattr(error, "status_code", None), str(error)
    return text if not prefix or text.startswith(prefix) else f"{prefix} {text}"


class _LostWhereRefused:
    """Mixin of redis-py's connections: an answer that refuses for now ends the connection."""

    def read_response(self, *args: Any, **options: Any) -> Any:
        try:
            return super().read_response(*args, **options)  # type: ignore[misc]
        except redis.RedisError as error:
            prefix = passing_prefix(error)
            if not prefix:
                raise
            # The next try connects anew: the name may lead to the new master by then.
            self.disconnect()  # type: ignore[attr-defined]
            raise RefusedForNow(prefix, _answer(error)) from error


class Connection(_LostWhereRefused, redis.Connection):
    """redis-py's connection over TCP."""


class SSLConnection(_LostWhereRefused, redis.SSLConnection):
    """redis-py's connection over TLS."""


BY_SCHEME: Final = {"redis": Connection, "rediss": SSLConnection}
