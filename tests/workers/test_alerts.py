"""Alerts: promtool confirms the rules, and they fire in a real Prometheus that reads a farm."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from tests.workers.drive import drive, with_config
from tests.workers.redis_server import free_port
from workers.coordinator.metrics import serve_metrics
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.worker_registry import Registry

RULES = Path(__file__).parents[2] / "deploy" / "prometheus-alerts.yaml"


@pytest.mark.infra
@pytest.mark.skipif(shutil.which("promtool") is None, reason="apt-get install prometheus")
def test_each_rule_begins_when_it_should_by_promtool() -> None:
    for words in (
        ("check", RULES),
        ("test", Path(__file__).with_name("prometheus_alerts_test.yaml")),
    ):
        completed = subprocess.run(
            ["promtool", words[0], "rules", str(words[1])],
            capture_output=True,
            text=True,
            check=False,
        )
        assert completed.returncode == 0, completed.stdout + completed.stderr


@contextmanager
def prometheus(folder: Path, metrics_port: int) -> Iterator[Callable[[], set[str]]]:
    """A Prometheus that scrapes each second, with the minutes of its rules as seconds; yields the firing alerts."""
    rules = re.sub(r"(?<=for: )\d+m", "2s", RULES.read_text()).replace("[10m]", "[20s]")
    (folder / "rules.yaml").write_text(rules.replace("[5m]", "[5s]"))
    (folder / "prometheus.yml").write_text(
        "global: {scrape_interval: 1s, evaluation_interval: 1s}\n"
        "rule_files: [rules.yaml]\n"
        "scrape_configs: [{job_name: pbrs, static_configs:"
        f" [{{targets: ['127.0.0.1:{metrics_port}']}}]}}]\n"
    )
    port = free_port()
    with (folder / "prometheus.log").open("wb") as log:
        process = subprocess.Popen(
            ["prometheus", "--config.file=prometheus.yml", "--storage.tsdb.path=data",
             f"--web.listen-address=127.0.0.1:{port}"],
            cwd=folder, stdout=log, stderr=log,
        )  # fmt: skip

    def firing() -> set[str]:
        try:
            with urllib.request.urlopen(
                f"http://127.0.0.1:{port}/api/v1/alerts", timeout=5
            ) as answer:
                alerts = json.load(answer)["data"]["alerts"]
        except OSError:
            return set()
        return {a["labels"]["alertname"] for a in alerts if a["state"] == "firing"}

    try:
        yield firing
    finally:
        process.terminate()
        process.wait(20)


@pytest.mark.infra
@pytest.mark.skipif(shutil.which("prometheus") is None, reason="apt-get install prometheus")
def test_alerts_fire_in_a_prometheus_that_reads_a_farm_in_trouble(
    ledger: RedisLedger, tmp_path: Path
) -> None:
    # A job with failing tasks, a vanished worker, a queue without workers.
    d = drive(ledger, 40, max_same_failure=99, max_quarantined=99, max_attempts=9)
    Registry(with_config(ledger, worker="w1", queues=("reduce",))).heartbeat()
    Registry(with_config(ledger, worker="w2")).heartbeat()
    g, client = ledger.config.prefix, ledger.client
    tasks = d.dispatch()
    port = free_port()
    server, thread = serve_metrics(replace(ledger.config, metrics_port=port), ledger)
    fired: set[str] = set()
    began, troubled_at = time.monotonic(), 0.0
    try:
        with prometheus(tmp_path, port) as firing:
            while time.monotonic() - began < 90 and len(fired) < 5:
                fired |= firing()
                if not troubled_at and time.monotonic() - began > 8:
                    assert fired <= {"PbrsStuck"}
                    troubled_at = time.monotonic()
                    client.zadd(f"{g}workers", {"w2": ledger.now() - 600})
                    client.lpush(f"{g}light.gpu", "message")
                    for task in tasks[:12]:
                        d.fail(task, d.claim(task))
                if troubled_at:
                    Registry(ledger).open_breaker("disk full")
                threading.Event().wait(0.5)
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
    expected = {
        "PbrsFailureRate",
        "PbrsWorkerLost",
        "PbrsQueueUntaken",
        "PbrsStuck",
        "PbrsStoreUnhealthy",
    }
    assert expected <= fired
