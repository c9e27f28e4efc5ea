"""Who has shown the token: sessions in cookies, and the words that forms must carry. No effects.

A session is a random word that only its browser and this process know; it ends with the process.
The form's word is a keyed digest of the session's, so that no other page can make a form that counts.
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
_MAX_WORD: Final = 200  # characters of a form's word that are looked at


class Sessions:
    """The sessions of one board.

    user_by: whose token a word is that is not the board's own, "" for nobody's.
    """

    def __init__(self, token: Secret, user_by: Callable[[str], str] = lambda _word: "") -> None:
        self._token = token
        self._user_by = user_by
        self._key = secrets.token_bytes(32)
        # digest of a session -> when it ends (monotonic), and whose it is
        self._open: OrderedDict[str, tuple[float, str]] = OrderedDict()
        self._lock = threading.Lock()

    def knows(self, token: str) -> bool:
        """Whether a word is the token; takes the same time for every wrong one.

        An empty token is never known, so a board that has none lets nobody in by it.
        """
        # Digests are of one length, whatever the words' is.
        expected = self._token.reveal()
        return bool(expected) and hmac.compare_digest(_digest(token), _digest(expected))

    def user_with(self, token: str) -> str | None:
        """Who shows a word: a user of the farm, "" with the board's own token, None for a wrong one."""
        return "" if self.knows(token) else self._user_by(token) or None

    def open(self, user: str = "") -> str:
        """A new session's word. user: whose it is, "" with the board's own token.

        The word goes into a cookie; only its digest is kept. It ends after a fixed life, or when so
        many sessions are open that the oldest goes. Sessions do not outlive the process.
        """
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

    def is_open(self, session: str) -> bool:
        """Whether the word is that of a session which has not ended."""
        return self.user_of(session) is not None

    def user_of(self, session: str) -> str | None:
        """Whose session it is, "" with the board's own token; None where it is none or has ended."""
        with self._lock:
            ends, user = self._open.get(_digest(session), (0.0, ""))
        return user if time.monotonic() < ends else None

    def form_word(self, session: str) -> str:
        """What a form of this session must carry.

        Follows from the session and a key of this process, so it needs no memory; a form of another
        site cannot know it.
        """
        return hmac.new(self._key, session.encode(), hashlib.sha256).hexdigest()

    def is_form_word(self, session: str, word: str) -> bool:
        """Whether a form carries the word of its session.

        Compares in constant time. Text from anybody: it may be of any length and content.
        """
        expected = self.form_word(session).encode()
        return hmac.compare_digest(word[:_MAX_WORD].encode("utf-8", "replace"), expected)


def _digest(word: str) -> str:
    return hashlib.sha256(word.encode("utf-8", "replace")).hexdigest()


def new_token() -> Secret:
    """A token for a board that was given none."""
    return Secret(secrets.token_urlsafe(24))
