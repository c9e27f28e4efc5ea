"""Who gives an order to the farm, whether he may, and the line that says he did. Effects: Redis.

A farm without users asks nobody. On one that has some, each order names its user by a token. The
commands and the board keep these rules: they separate accounts, and whoever has Redis' own password is
outside of them.
"""

from __future__ import annotations

import platform
from datetime import UTC, datetime

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.shown_text import MAX_MESSAGE, shown
from pbrs_farm.store.secret import Secret
from workers.ledger.task_ledger import User
from workers.ledger.user_table import UserTable


class Rights:
    """Rights of the caller: his token, the user if already known, the client's address."""

    def __init__(
        self, users: UserTable, token: Secret, acting: User | None = None, place: str = ""
    ) -> None:
        self._users, self._token, self._acting = users, token, acting
        self._place = place or platform.node()

    def who(self) -> User | None:
        """The calling user; None on a farm without users. Raises BadInput for an unknown one.

        Reads the table of users in Redis on each call, so a removed user loses all rights immediately. Raises
        too if the farm has users and no token is given.
        """
        if self._acting is not None or not self._users.all():
            return self._acting
        if not self._token:
            hint = "an admin's `pbrs-farm users add NAME` prints a token"
            raise BadInput("PBRS_TOKEN", "", "this farm needs a user's token", hint=hint)
        user = self._users.named_by(self._token.reveal())
        if user is None:
            raise BadInput("PBRS_TOKEN", "", "is not a user's token")
        return user

    def check_owner(self, job: str, owner: str) -> None:
        """BadInput unless admin for another user's job, or one without owner; anybody without users."""
        user = self.who()
        if user is not None and not user.is_admin and user.name != owner:
            raise BadInput(
                job, "", f"is a job of {owner or 'no user'}", hint="ask its owner or an admin"
            )

    def check_admin(self, what: str) -> None:
        """BadInput, naming the command, unless an admin asks or the farm has no users."""
        user = self.who()
        if user is not None and not user.is_admin:
            raise BadInput(what, "", "only an admin may")

    def check_preempt(self) -> None:
        """BadInput unless an admin, a user with that right, or anybody of a farm without users asks."""
        user = self.who()
        if user is not None and not (user.is_admin or user.may_preempt):
            hint = f"an admin's `pbrs-farm users limit {user.name} --may-preempt yes`"
            raise BadInput("--preempt", user.name, "may not submit urgent jobs", hint=hint)

    def note(self, what: str, of: str, answer: str) -> None:
        """Keep the line of a change: when, who, from where, what, and what came of it.

        Call it after the change. what: the command; of: the job, user or worker it was about. Texts
        are cut and stripped of control characters; an unknown token leaves the user "".
        """
        # Also of the first user, who had no token before.
        user = self._acting
        if user is None and self._token:
            user = self._users.named_by(self._token.reveal())
        self._users.note(
            {
                "utc": datetime.now(UTC).isoformat(timespec="seconds"),
                "user": user.name if user is not None else "",
                "from": shown(self._place),
                "what": what,
                "of": shown(of),
                "answer": shown(answer, MAX_MESSAGE),
            }
        )
