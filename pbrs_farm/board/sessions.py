"""Sessions in cookies, and words of forms against cross-site requests.

A session is a random word in a cookie; it ends with the process. The word of a form is a keyed digest
of the session's.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Final

from pbrs_farm.store.secret import Secret

COOKIE: Final = "pbrs_board"
_MAX_SESSIONS: Final = 1000
_LIFE_S: Final = 12 * 3600.0
_MAX_WORD: Final = 200  # maximum length of a form's word


class Sessions:
    """The sessions of one board. user_by: user of a token of the farm, "" for a wrong one."""

    def __init__(self, token: Secret, user_by: Callable[[str], str] = lambda _word: "") -> None:
        self._token = token
        self._user_by = user_by
        self._key = secrets.token_bytes(32)
        # digest of a session -> end (monotonic), user
        self._open: OrderedDict[str, tuple[float, str]] = OrderedDict()
        self._lock = threading.Lock()

    def knows(self, token: str) -> bool:
        """True if a word is the board's token, in constant time; False for a board without one."""
        expected = self._token.reveal()
        return bool(expected) and hmac.compare_digest(_digest(token), _digest(expected))

    def user_with(self, token: str) -> str | None:
        """User of a token: of the farm, "" for the board's own token, None for a wrong one."""
        return "" if self.knows(token) else self._user_by(token) or None

    def open(self, user: str = "") -> str:
        """Open a session of a user; its word. With too many sessions the oldest ends."""
        session = secrets.token_urlsafe(32)
        with self._lock:
            self._open[_digest(session)] = (time.monotonic() + _LIFE_S, user)
            while len(self._open) > _MAX_SESSIONS:
                self._open.popitem(last=False)
        return session

    def close(self, session: str) -> None:
        """End a session."""
        with self._lock:
            self._open.pop(_digest(session), None)

    def user_of(self, session: str) -> str | None:
        """User of an open session, "" for the board's own token; else None."""
        with self._lock:
            ends, user = self._open.get(_digest(session), (0.0, ""))
        return user if time.monotonic() < ends else None

    def form_word(self, session: str) -> str:
        """Word of the forms of a session: a digest with a key of this process."""
        return hmac.new(self._key, session.encode(), hashlib.sha256).hexdigest()

    def is_form_word(self, session: str, word: str) -> bool:
        """True for the word of the forms of a session, in constant time."""
        expected = self.form_word(session).encode()
        return hmac.compare_digest(word[:_MAX_WORD].encode("utf-8", "replace"), expected)


def _digest(word: str) -> str:
    return hashlib.sha256(word.encode("utf-8", "replace")).hexdigest()


def new_token() -> Secret:
    """A random token."""
    return Secret(secrets.token_urlsafe(24))
