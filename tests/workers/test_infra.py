"""Tests against real infrastructure, named by the environment (docs/farm/settings.md says how to start it).

S3: PBRS_S3_ENDPOINT, PBRS_S3_ACCESS_KEY, PBRS_S3_SECRET_KEY, PBRS_S3_ALLOW_HTTP, PBRS_S3_BUCKET.
Redis with TLS and ACL: PBRS_TEST_TLS_REDIS (URL), PBRS_FARM_REDIS_CA.  Slurm: PBRS_TEST_SLURM=1.
Docker and kubectl are used if they are installed.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from pbrs_farm.store.secret import Secret
from tests.inputs.s3_stores import s3_store
from tests.workers.redis_server import RedisServer
from tests.workers.small_farm import REPO, SmallFarm
from workers.client.farm_client import Farm

pytestmark = pytest.mark.infra


def test_a_farm_on_s3_with_a_worker_killed(tmp_path: Path) -> None:
    store = s3_store()
    (tmp_path / "redis").mkdir()
    server = RedisServer(tmp_path / "redis")
    server.start()
    farm = SmallFarm(tmp_path, server, s3=store)
    try:
        (farm.control / "slow").write_text("0.1")
        farm.coordinator()
        farm.worker("w1", slots=2)
        farm.worker("w2")
        farm.submit(5)
        farm.wait(lambda: farm.running() >= 2, 40, "tasks are being run")
        farm.kill("w1")
        farm.wait_done(120)
        farm.check_complete(n_repeats=2)
        server.client.flushall()
        assert farm.farm.recover(farm.job).counts["done:light"] == sum(
            2 + len(h) % 2 for h in farm.houses
        )
    finally:
        farm.close()
        server.end()


def test_s3_refuses_wrong_credentials_and_a_missing_bucket_in_one_line() -> None:
    from pbrs_farm.core.errors import StoreFailed, StoreUnavailable
    from pbrs_farm.settings import settings_from_environment
    from pbrs_farm.store import store_from_url

    s3_store()
    settings = settings_from_environment().store
    bad = replace(settings.s3, secret_key=Secret("wrong"), retry_timeout_s=1.0)
    for url, chosen, text in (
        ("s3://pbrs/x", replace(settings, s3=bad), "rejects these credentials"),
        ("s3://no-such-bucket-here/x", settings, "no bucket"),
    ):
        with pytest.raises(StoreFailed, match=text) as caught:
            store_from_url(url, chosen).put("a", b"1")
        assert not isinstance(caught.value, StoreUnavailable)
        assert "\n" not in str(caught.value)


class _SomebodysRedis(RedisServer):
    """An existing Redis; only its URL matters."""

    url = ""

    def __init__(self, url: str) -> None:
        self.url = url


def test_a_farm_over_tls_with_an_acl_user(tmp_path: Path) -> None:
    url, ca = os.environ.get("PBRS_TEST_TLS_REDIS"), os.environ.get("PBRS_FARM_REDIS_CA", "")
    if not url:
        pytest.skip("PBRS_TEST_TLS_REDIS is not set")
    farm = SmallFarm(tmp_path, _SomebodysRedis(url), redis_ca=ca)
    farm.farm = Farm(replace(farm.farm.config, redis_ca=ca))
    try:
        farm.coordinator()
        farm.worker("tls", slots=2)
        farm.submit(3)
        farm.wait_done(60)
        farm.check_complete(n_repeats=0)
        password = urlsplit(url).password or ""
        assert password
        assert all(password not in log.read_text() for log in tmp_path.glob("*.log"))
    finally:
        if farm.job:
            farm.farm.ledger.forget(farm.job)
        farm.close()


@pytest.mark.parametrize("words", [[], ["-f", "docker/compose.s3.yaml"]])
def test_the_compose_files_are_valid(words: list[str]) -> None:
    if shutil.which("docker") is None:
        pytest.skip("no docker")
    version = ["docker", "compose", "version"]
    if subprocess.run(version, capture_output=True, check=False).returncode != 0:
        pytest.skip("docker has no Compose")
    command = ["docker", "compose", "-f", "docker/compose.yaml", *words, "config", "-q"]
    done = subprocess.run(command, cwd=REPO, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("folder", ["base", "overlays/small", "overlays/gpu", "overlays/site"])
def test_the_kustomizations_build(folder: str) -> None:
    if shutil.which("kubectl") is None:
        pytest.skip("no kubectl")
    command = ["kubectl", "kustomize", f"deploy/kubernetes/{folder}"]
    done = subprocess.run(command, cwd=REPO, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_preempted_slurm_worker_hands_back_and_returns(tmp_path: Path) -> None:
    if os.environ.get("PBRS_TEST_SLURM") != "1" or shutil.which("sbatch") is None:
        pytest.skip("PBRS_TEST_SLURM is not 1, or no sbatch")
    (tmp_path / "redis").mkdir()
    server = RedisServer(tmp_path / "redis")
    server.start()
    farm = SmallFarm(tmp_path, server, grace_s=8, lease_s=60)
    jobs: list[str] = []
    try:
        (farm.control / "slow").write_text("30")
        env_file = tmp_path / "worker.env"
        lines = {k: v for k, v in farm.environment("x").items() if k.startswith("PBRS_")}
        lines |= {"PBRS_BIN": str(REPO / ".venv/bin/pbrs-farm"), "PYTHONPATH": str(REPO)}
        for name in ("PBRS_FARM_WORKER", "PBRS_FARM_SCRATCH"):
            del lines[name]
        env_file.write_text("".join(f"{k}={v}\n" for k, v in lines.items()))
        farm.coordinator()
        farm.submit(2)
        cpus = subprocess.run(
            ["sinfo", "-h", "-o", "%c"], capture_output=True, text=True, check=True
        ).stdout.split()[0]
        sbatch = ["sbatch", "--parsable", f"--cpus-per-task={cpus}", "--mem=512M", "--tmp=0"]
        words = [*sbatch, "--partition=spot", f"--output={tmp_path}/slurm.log", "--array=0"]
        jobs.append(_run([*words, "deploy/slurm/worker.sbatch"], PBRS_ENV_FILE=str(env_file)))
        farm.wait(lambda: farm.running() == 1, 90, "the pilot job runs a task")
        time.sleep(2)
        _run([*sbatch, "--partition=prio", "--wrap", "sleep 5", f"--output={tmp_path}/p.log"])
        farm.wait(
            lambda: farm.farm.view(farm.job).counts.get("handed_back:preempted", 0) == 1,
            60,
            "the task was handed back",
        )
        (farm.control / "slow").write_text("0.1")
        # A requeued job waits about two minutes.
        farm.wait_done(300)
        farm.check_complete(n_repeats=1)
        assert "failures:lost" not in farm.farm.view(farm.job).counts
        assert "back into the queue" in (tmp_path / "slurm.log").read_text()
    finally:
        for job in jobs:
            subprocess.run(["scancel", job], check=False)
        farm.close()
        server.end(signal.SIGTERM)


def _run(words: list[str], **env: str) -> str:
    done = subprocess.run(
        words, cwd=REPO, env={**os.environ, **env}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip().partition(";")[0]
