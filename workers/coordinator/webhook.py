"""Posts to a URL when a job ends or pauses itself, one JSON object each. Effects: requests, the ledger.

The ledger stores the last post of each job, so a new leader repeats and misses nothing.
"""

from __future__ import annotations

import json
import logging
import threading
import urllib.request
from collections import Counter
from collections.abc import Callable
from typing import Any, Final
from urllib.parse import urlsplit

from pbrs_farm.core.errors import BadInput
from pbrs_farm.store.secret import Secret
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import WITH_FAILURES, JobView, LedgerUnavailable

_log = logging.getLogger("pbrs.webhook")
_TIMEOUT_S: Final = 10.0
_MOST_TRIES: Final = 5
_NEWEST: Final = 50  # maximum jobs to check
_POSTED_STATES: Final = ("done", WITH_FAILURES, "paused", "cancelled")

Post = Callable[[dict[str, Any]], None]


class Webhook:
    """Posts each new end or pause of a job once, across leaders, by the ledger; five tries after OSError."""

    def __init__(self, ledger: RedisLedger, post: Post) -> None:
        self._ledger = ledger
        self._post = post
        self._tries: Counter[tuple[str, str]] = Counter()

    def look(self, views: list[JobView]) -> None:
        """Post new events of these jobs, and failed posts again, five times in all."""
        for view in views:
            notified = view.fields.get("notified", "")
            if view.outcome not in _POSTED_STATES:
                # A job that runs again may end or pause again.
                if notified:
                    self._ledger.set_notified(view.job_id, "")
            elif view.outcome != notified:
                self._post_outcome(view)

    def _post_outcome(self, view: JobView) -> None:
        try:
            self._post(notice(view))
        except (OSError, ValueError) as error:
            self._tries[view.job_id, view.outcome] += 1
            _log.warning("the webhook accepts nothing: %s", error)
            if self._tries[view.job_id, view.outcome] < _MOST_TRIES:
                return
        self._ledger.set_notified(view.job_id, view.outcome)


def notice(view: JobView) -> dict[str, Any]:
    """Event of a job in JSON values (a contract: add keys, never rename); `text` is for chat programs."""
    counts = view.counts
    reason = view.fields.get("reason", "")
    row: dict[str, Any] = {
        "job": view.job_id,
        "state": view.outcome,
        "reason": reason,
        "recipe": view.fields.get("recipe_name", ""),
        "houses": int(view.fields.get("n_houses", 0)),
        "houses_done": int(counts.get("houses:done", 0)),
        "houses_quarantined": int(counts.get("houses:quarantined", 0)),
        "views": int(counts.get("views", 0)),
        "tasks_failed": view.n_failed,
    }
    text = f"pbrs_farm: job {view.job_id} {view.outcome}{f': {reason}' if reason else ''}"
    text += f"; {row['houses_done']} of {row['houses']} houses, {row['views']} views"
    if view.n_failed:
        text += f", {view.n_failed} task{'s' if view.n_failed > 1 else ''} failed"
    return row | {"text": text}


def poster(url: Secret) -> Post:
    """A Post to the URL. Raises BadInput for a scheme other than http or https.

    The function waits for the answer and raises OSError for a failed one, as urllib does. The URL is a
    secret: chat programs put their token in it.
    """
    if urlsplit(url.reveal()).scheme not in ("http", "https"):
        raise BadInput("environment", "PBRS_WEBHOOK", "expected an http:// or https:// URL")

    def post(row: dict[str, Any]) -> None:
        request = urllib.request.Request(
            url.reveal(), json.dumps(row).encode(), {"Content-Type": "application/json"}
        )
        with urllib.request.urlopen(request, timeout=_TIMEOUT_S):
            pass

    return post


def watch_jobs(
    webhook: Webhook,
    ledger: RedisLedger,
    look_at: Callable[[list[JobView]], None] = lambda _views: None,
) -> Callable[[], None]:
    """Function for the leader: look_at and webhook check jobs in a thread, which a slow URL may hold."""
    # Taken by begin, given back by the thread that it starts.
    busy = threading.Lock()

    def look() -> None:
        try:
            jobs = ledger.known_jobs()[-_NEWEST:]
            views = [v for job in jobs if (v := ledger.view(job)) is not None]
            webhook.look(views)
            look_at(views)
        except LedgerUnavailable as error:
            _log.warning("cannot send a notice: %s", error)
        finally:
            busy.release()

    def begin() -> None:
        if busy.acquire(blocking=False):
            threading.Thread(target=look, daemon=True).start()

    return begin
