"""The operator's and the packager's tutorials work: services start, a job ends, the wheel installs."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.memory import descendants
from pbrs_farm.cli import MODULES, main
from tests.docs.fenced import REPO, blocks
from tests.workers.redis_server import free_port


def lines_of(page: str) -> list[list[str]]:
    """The words of each line of each sh block."""
    texts = [text for language, text in blocks(page) if language == "sh"]
    return [shlex.split(line) for text in texts for line in text.splitlines()]


@pytest.fixture
def services(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The services of the operator's first block, on a private Redis and store."""
    port = free_port()
    monkeypatch.setenv("PBRS_REDIS_URL", f"redis://127.0.0.1:{port}/0")
    monkeypatch.setenv("PBRS_STORE", (tmp_path / "store").as_uri())
    monkeypatch.setenv("PBRS_FARM_SCRATCH", str(tmp_path))
    monkeypatch.setenv("PBRS_FARM_WORKER", "w1")
    monkeypatch.setenv("PYTHONPATH", str(REPO))
    redis, coordinator, worker = (
        words
        for words in lines_of("tutorials/operator.md")
        if words[0] == "redis-server" or words[-1] in ("coordinator", "worker")
    )
    options = ["--port", str(port), "--bind", "127.0.0.1", "--dir", str(tmp_path)]
    commands = [[*redis, *options]]
    commands += [[sys.executable, "-m", "pbrs_farm.cli", *w[1:]] for w in (coordinator, worker)]
    processes = []
    try:
        for words in commands:
            with (tmp_path / "services.log").open("ab") as log:
                processes.append(subprocess.Popen(words, stdout=log, stderr=log))
            if words[0] == "redis-server":
                wait_for_redis(port)
        yield
    finally:
        for process in reversed(processes):
            for pid in (process.pid, *descendants(process.pid)):
                subprocess.run(["kill", "-9", str(pid)], check=False, stderr=subprocess.DEVNULL)
            process.wait(20)


def wait_for_redis(port: int) -> None:
    words = ["redis-cli", "-p", str(port), "ping"]
    for _ in range(200):
        if subprocess.run(words, capture_output=True, check=False).stdout == b"PONG\n":
            return
    raise AssertionError("redis-server does not answer")


@pytest.mark.pages
def test_the_operators_job_runs_to_its_end_and_the_table_is_right(
    services: None, capsys: pytest.CaptureFixture[str]
) -> None:
    n_run = 0
    for program, *words in lines_of("tutorials/operator.md"):
        if program != "pbrs-farm" or words[0] in ("coordinator", "worker"):
            continue
        assert main(words) == 0, words
        n_run += 1
    assert n_run >= 3
    output = capsys.readouterr().out
    job = output.split()[0]
    assert re.search(rf"job {job}  done ", output)
    assert re.search(r"w1\s+alive", output)
    for words in (
        ["failures"],
        ["retry"],
        ["drain", "w1"],
        ["drain", "--undo", "w1"],
        ["recover", job],
    ):
        assert main(words) == 0, words


@pytest.mark.parametrize("page", ["operator", "packager", "researcher"])
def test_a_tutorial_names_only_verbs_that_exist(page: str) -> None:
    text = (REPO / f"docs/tutorials/{page}.md").read_text(encoding="utf-8")
    verbs_known = {verb for verbs in MODULES.values() for verb in verbs}
    assert set(re.findall(r"`pbrs-farm ([a-z][a-z-]*)", text)) <= verbs_known


@pytest.mark.pages
def test_the_packagers_wheel_is_built_installed_and_runs(tmp_path: Path) -> None:
    source = tmp_path / "source"
    for name in ("pbrs_farm", "workers"):
        shutil.copytree(REPO / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", "README.pypi.md", "LICENSE", "NOTICE"):
        shutil.copy(REPO / name, source)
    build, install, *_rest = [w for w in lines_of("tutorials/packager.md") if w[0] == "pip"]
    # Without a network: with the installed setuptools, and no dependency.
    alone = ["--no-build-isolation", "--no-index", "--quiet", "--disable-pip-version-check"]
    pip = [sys.executable, "-m", "pip"]
    subprocess.run([*pip, *build[1:], *alone], cwd=source, check=True)
    shown = subprocess.run(
        ["sh", "-c", f'echo "{install[-1]}"'],
        cwd=source,
        capture_output=True,
        text=True,
        check=True,
    )
    site = tmp_path / "site"
    words = ["install", shown.stdout.strip(), "--no-deps", "--target", str(site), *alone[1:]]
    subprocess.run([*pip, *words], cwd=source, check=True)
    env = {**os.environ, "PYTHONPATH": str(site), "PBRS_REDIS_URL": "redis://127.0.0.1:1/0"}
    output = run(
        ["-c", "import pbrs_farm, pbrs_farm_workers.job as j; print(j.__file__)"], tmp_path, env
    )
    assert output.stdout.startswith(str(site))
    assert (site / "pbrs_farm/py.typed").is_file()
    assert not (site / "workers").exists()
    assert "_pbrs" in run(["-m", "pbrs_farm.cli", "completion", "bash"], tmp_path, env).stdout
    away = run(["-m", "pbrs_farm.cli", "jobs"], tmp_path, env)
    assert (away.returncode, len(away.stderr.splitlines())) == (1, 1)
    assert "no Redis at" in away.stderr


def run(words: list[str], cwd: Path, env: dict[str, str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words], cwd=cwd, env=env, capture_output=True, text=True, check=False
    )
