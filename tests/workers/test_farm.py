"""Real Redis, real Celery, real renderer processes: a job runs to its end, and processes end cleanly."""

from __future__ import annotations

import base64
import json
import logging
import os
import signal
import subprocess
import sys
import uuid

import pytest

from pbrs_farm.core.errors import BadInput
from tests.inputs.farm_processes import renderers
from tests.workers.small_farm import SmallFarm
from workers.config import config_from_environment
from workers.ledger.redis_connections import RefusedForNow
from workers.logs import NoSecrets
from workers.node.supervisor import command


def test_a_job_ends_with_the_same_objects_as_a_single_run(farm: SmallFarm) -> None:
    farm.coordinator()
    farm.worker("w1", slots=2)
    farm.submit(8)
    farm.wait_done()
    farm.check_complete(n_repeats=0)
    farm.submit(8)
    assert farm.state() == "done"


def test_hostile_messages_are_dropped_and_a_killed_renderer_replaced(farm: SmallFarm) -> None:
    (farm.control / "slow").write_text("0.2")
    for body in hostile_messages():
        farm.redis.client.lpush("pbrs:geometry", body)
    farm.coordinator()
    farm.worker("w1")
    farm.submit(2)
    farm.wait(lambda: len(renderers(farm, "w1")) == 1 and farm.running() == 1, 30, "a task runs")
    os.kill(renderers(farm, "w1")[0], signal.SIGKILL)
    farm.wait_done()
    farm.check_complete(n_repeats=1)
    log = (farm.folder / "w1.log").read_text()
    assert "pbrs.evil" in log
    assert not (farm.folder / "owned").exists()
    assert farm.redis.client.llen("pbrs:geometry") == 0


def hostile_messages() -> list[str]:
    """Raw broker messages: an unknown task, a giant one, a pickle, and invalid ids."""

    def message(task: str, args: list[str], kind: str = "application/x-pbrs-json") -> str:
        body = base64.b64encode(json.dumps([args, {}, {}]).encode()).decode()
        headers = {"lang": "py", "task": task, "id": str(uuid.uuid4()), "root_id": None,
                   "parent_id": None, "group": None, "retries": 0}  # fmt: skip
        properties = {
            "correlation_id": headers["id"], "delivery_mode": 2, "priority": 0,
            "body_encoding": "base64", "delivery_tag": str(uuid.uuid4()),
            "delivery_info": {"exchange": "", "routing_key": "geometry"},
        }  # fmt: skip
        return json.dumps(
            {"body": body, "content-encoding": "utf-8", "content-type": kind,
             "headers": headers, "properties": properties}
        )  # fmt: skip

    return [
        message("pbrs.evil", ["x"]),
        message("pbrs.run", ["f" * 12, "h/0/gl", "x" * 100_000]),
        message("pbrs.run", ["f" * 12, "h/0/gl", "r"], kind="application/x-python-serialize"),
        message("pbrs.run", ["../../etc", "h/0/gl", "r"]),
        message("pbrs.run", ["f" * 12, "h/0/gl;FLUSHALL", "r"]),
    ]


def test_celerys_parent_process_is_kept_out_of_storage() -> None:
    code = """
from celery.signals import worker_init
from pbrs_farm.store import store_from_url
import workers.queue.celery_app
worker_init.send(sender=None)
store_from_url("s3://bucket/prefix").put("k", b"")
"""
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert "must not use storage" in done.stderr


def test_no_secret_is_on_a_command_line_or_in_a_log() -> None:
    config = config_from_environment(
        {"PBRS_REDIS_URL": "redis://redis:6379/0", "PBRS_REDIS_PASSWORD": "hu/sh"}
    )
    assert config.redis_url.reveal() == "redis://:hu%2Fsh@redis:6379/0"
    assert "hu" not in " ".join(command(config)) + repr(config)
    record = logging.LogRecord("x", 20, "", 0, "to redis://farm:hush@h:1/0", (), None)
    assert "hush" not in NoSecrets("%(message)s").format(record)


def test_a_temporary_refusal_of_redis_is_logged_without_a_traceback() -> None:
    """As kombu logs it when Redis refuses the acknowledgement of a message."""
    formatter = NoSecrets("%(message)s")
    for error, is_shown in ((RefusedForNow("OOM", "OOM not now"), False), (ValueError("x"), True)):
        info = (type(error), error, None)
        record = logging.LogRecord("kombu", logging.CRITICAL, "", 0, "no ack", None, info)
        assert (type(error).__name__ in formatter.format(record)) == is_shown


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("PBRS_FARM_SLOTS", "many"),
        ("PBRS_FARM_SLOTS", "0"),
        ("PBRS_FARM_LIMITS_LIGHT_S", "-1"),
        ("PBRS_FARM_QUEUES", "light,gpu"),
        ("PBRS_FARM_NONSENSE", "1"),
        ("PBRS_FARM_STORE_URL", "memory:"),
    ],
)
def test_an_unknown_setting_is_one_line(name: str, value: str) -> None:
    with pytest.raises(BadInput, match=name) as caught:
        config_from_environment({name: value})
    assert "\n" not in str(caught.value)
