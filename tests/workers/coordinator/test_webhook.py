"""A webhook gets one post for each end and each pause, whichever coordinator leads."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.store.secret import Secret
from tests.workers.memory_ledger import MemoryLedger
from workers.coordinator.webhook import Webhook, notice, poster
from workers.ledger.task_ledger import JobView

JOB = "0" * 12


def view(ledger: MemoryLedger, state: str, **counts: float) -> JobView:
    ledger.fields |= {"state": state, "n_houses": "3", "reason": ""}
    return JobView(JOB, dict(ledger.fields), counts, {}, 0)


class Listener:
    """Takes posts after failing a given number of times."""

    def __init__(self, n_failures: int = 0) -> None:
        self.rows: list[dict[str, Any]] = []
        self.n_failures = n_failures
        self.n_tries = 0

    def __call__(self, row: dict[str, Any]) -> None:
        self.n_tries += 1
        if self.n_tries <= self.n_failures:
            raise OSError("no answer")
        self.rows.append(row)


def test_an_end_is_posted_once_whichever_coordinator_leads() -> None:
    ledger, heard = MemoryLedger(), Listener()
    for _leader in range(2):
        webhook = Webhook(ledger, heard)
        webhook.look([view(ledger, "running")])
    assert heard.rows == []
    for _leader in range(3):
        Webhook(ledger, heard).look([view(ledger, "done")])
    assert [row["state"] for row in heard.rows] == ["done"]


def test_a_job_that_runs_again_is_posted_again() -> None:
    ledger, heard = MemoryLedger(), Listener()
    webhook = Webhook(ledger, heard)
    for state in ("paused", "running", "paused", "running", "done"):
        webhook.look([view(ledger, state)])
    assert [row["state"] for row in heard.rows] == ["paused", "paused", "done"]


def test_a_job_with_failures_posts_their_number() -> None:
    row = notice(view(MemoryLedger(), "done", **{"geometry:f": 2, "views": 7, "houses:done": 1}))
    assert row["state"] == "done with failures"
    assert row["text"].endswith("done with failures; 1 of 3 houses, 7 views, 2 tasks failed")


def test_a_silent_url_is_retried_up_to_a_limit() -> None:
    ledger, heard = MemoryLedger(), Listener(n_failures=2)
    webhook = Webhook(ledger, heard)
    for _look in range(5):
        webhook.look([view(ledger, "done")])
    assert len(heard.rows) == 1
    deaf = Listener(n_failures=100)
    quiet = MemoryLedger()
    webhook = Webhook(quiet, deaf)
    for _look in range(20):
        webhook.look([view(quiet, "done")])
    assert deaf.n_tries == 5


def test_a_notice_is_one_post_of_json() -> None:
    bodies: list[bytes] = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            bodies.append(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_words: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.handle_request)
    thread.start()
    poster(Secret(f"http://127.0.0.1:{server.server_port}/x"))({"job": JOB})
    thread.join(10)
    server.server_close()
    assert [json.loads(body) for body in bodies] == [{"job": JOB}]


def test_only_http_is_a_webhook() -> None:
    with pytest.raises(BadInput, match="PBRS_WEBHOOK"):
        poster(Secret("file:///etc/passwd"))
