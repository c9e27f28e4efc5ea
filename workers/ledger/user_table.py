"""Who may ask the farm for work, and how much: users by token, in Redis and in the store.

Effects: Redis, the store. The store's copy is the truth: it is written first, and a Redis that lost its
data gets the table back. A token itself is kept nowhere, only its digest.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import re
import secrets
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any, Final

from pbrs_farm.core.errors import BadInput, ObjectMissing
from pbrs_farm.core.shown_text import did_you_mean
from pbrs_farm.store import Store
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import SPENT_DAYS, User

KEY: Final = "jobs/users.json"
_NAME: Final = re.compile(r"[a-z0-9][a-z0-9_.\-]{0,39}")
_DAY_S: Final = 86400
_MOST_CHANGES: Final = 1000  # maximum lines of the audit


class UserTable:
    """Who may ask for work, on the ledger's Redis; no token is required while the table is empty. Methods raise LedgerUnavailable."""

    def __init__(self, ledger: RedisLedger) -> None:
        self._ledger = ledger
        self._key = f"{ledger.config.prefix}users"
        self._audit = f"{ledger.config.prefix}audit"

    def all(self) -> dict[str, User]:
        """Every user by name, in order, by one read; {} on a farm without users."""
        rows = self._ledger.client.hgetall(self._key)
        return {name: user_from_row(json.loads(row)) for name, row in sorted(rows.items())}

    def named_by(self, token: str) -> User | None:
        """The user with a token, by its digest, in constant time; None for an unknown one."""
        digest, match = token_digest(token), None
        for user in self.all().values():
            if hmac.compare_digest(user.token_sha256, digest):
                match = user
        return match

    def save(self, users: Mapping[str, User], store: Store) -> None:
        """Replace all of the farm's users, in the store first; of two admins the last wins."""
        rows = {name: json.dumps(asdict(user)) for name, user in sorted(users.items())}
        store.put(KEY, f"{json.dumps([json.loads(r) for r in rows.values()], indent=1)}\n".encode())
        self._enter(rows)

    def restore(self, store: Store) -> bool:
        """Load the store's users into a Redis without users, which is never overwritten; True if it had some."""
        if self.all():
            return False
        try:
            rows = json.loads(store.get(KEY))
        except ObjectMissing:
            return False
        users = [user_from_row(row) for row in rows]
        self._enter({user.name: json.dumps(asdict(user)) for user in users})
        return bool(users)

    def _enter(self, rows: Mapping[str, str]) -> None:
        pipe = self._ledger.client.pipeline(transaction=True)
        pipe.delete(self._key)
        if rows:
            pipe.hset(self._key, mapping=dict(rows))
        pipe.execute()

    def spent_h(self) -> dict[str, float]:
        """User -> slot-hours, if any, of the tasks finished in the last SPENT_DAYS days (UTC)."""
        client = self._ledger.client
        today = int(self._ledger.now() // _DAY_S)
        keys = [f"{self._ledger.config.prefix}spent:{today - k}" for k in range(SPENT_DAYS)]
        pipe = client.pipeline(transaction=False)
        for key in keys:
            pipe.hgetall(key)
        pipe.expire(keys[0], (SPENT_DAYS + 1) * _DAY_S)  # so that no day is kept for ever
        days: list[dict[str, str]] = pipe.execute()[:-1]
        seconds_of_user: dict[str, float] = {}
        for day in days:
            for name, seconds in day.items():
                seconds_of_user[name] = seconds_of_user.get(name, 0.0) + float(seconds) / 3600
        return seconds_of_user

    def note(self, row: Mapping[str, str]) -> None:
        """Keep a line, text to text, of who changed what; the last _MOST_CHANGES stay for `changes`."""
        pipe = self._ledger.client.pipeline(transaction=False)
        pipe.lpush(self._audit, json.dumps(dict(row)))
        pipe.ltrim(self._audit, 0, _MOST_CHANGES - 1)
        pipe.execute()

    def changes(self, n: int) -> list[dict[str, str]]:
        """The last n lines of who changed what, newest first."""
        return [json.loads(line) for line in self._ledger.client.lrange(self._audit, 0, n - 1)]


def user_from_row(row: Mapping[str, Any]) -> User:
    """The user that a row of JSON describes; fields it does not know are left out."""
    names = {f.name for f in fields(User)}
    return User(**{name: value for name, value in row.items() if name in names})


def new_user(name: str, **limits: Any) -> tuple[User, str]:
    """A user with limits, and the token that names him, shown once and kept nowhere; BadInput. Saves nothing."""
    if not _NAME.fullmatch(name):
        hint = "a letter or digit, then letters, digits, _ . -; 40 at most, no capitals"
        raise BadInput("users", repr(name[:60]), "is not a user name", hint=hint)
    token = secrets.token_urlsafe(24)
    return User(name, token_digest(token), **limits), token


def known_user(users: Mapping[str, User], name: str) -> User:
    """The user with a name; BadInput, with a similar name, for an unknown one."""
    if name not in users:
        raise BadInput("users", repr(name[:60]), "no such user", hint=did_you_mean(name, users))
    return users[name]


def token_digest(token: str) -> str:
    """Stored form of a token: tokens are random, so a plain digest does not reveal them."""
    return hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()
