"""Render processes that start before the run is known."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from pbrs_farm import cli
from pbrs_farm.run.processes import early_start, limits
from pbrs_farm.run.processes.child_process import ChildProcess
from pbrs_farm.run.processes.early_start import FINISHING_HANDLER, child_of, start_early
from pbrs_farm.run.processes.pool import FINISHING, HANDLERS

TARGET = "tests.run.test_render_process:make_handler"


def _said(child: ChildProcess, word: str) -> bytes | None:
    """The last line of a process that was given a word."""
    child.send(word.encode())
    return [child.receive(60.0) for _line in ("ready", "event", "done")][-1]


def test_the_run_takes_the_process_that_was_started_early_once(tmp_path: Path) -> None:
    start_early(TARGET)
    early, early_log = early_start._STARTED[TARGET][0], early_start._STARTED[TARGET][0]._log
    first, second = (child_of(TARGET, tmp_path / name) for name in ("first", "second"))
    try:
        assert first is early
        assert second is not early
        # What it prints is in the log that the run reads, and the other place is gone.
        assert b"fine" in (_said(first, "fine") or b"")
        assert (tmp_path / "first").read_text() == first.log_tail(100) == "fine\n"
        assert not early_log.parent.exists()
        first.clear_log()
        assert first.log_size() == 0
    finally:
        first.kill()
        second.kill()


def test_a_process_that_died_is_not_taken(tmp_path: Path) -> None:
    start_early(TARGET)
    early, _folder = early_start._STARTED[TARGET]
    early.kill()
    child = child_of(TARGET, tmp_path / "log")
    try:
        assert child is not early
        assert b"fine" in (_said(child, "fine") or b"")
    finally:
        child.kill()


def test_a_process_that_nobody_takes_ends_with_the_command() -> None:
    code = f"""
from pbrs_farm.run.processes import early_start
early_start.start_early({TARGET!r})
child, folder = early_start._STARTED[{TARGET!r}]
print(child._process.pid, folder.name)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    pid, folder = done.stdout.split()
    end = time.monotonic() + 60
    while Path(f"/proc/{pid}").exists() and time.monotonic() < end:
        time.sleep(0.05)
    assert not Path(f"/proc/{pid}").exists()
    assert not Path(folder).exists()


@pytest.mark.parametrize(
    ("words", "n_started"), [("", 1), ("--jobs 2", 0), ("--jobs=2", 0), ("--help", 0)]
)
def test_the_demo_starts_the_process_of_its_house_before_its_options_are_read(
    words: str, n_started: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[str] = []
    monkeypatch.setattr(early_start, "start_early", started.append)
    monkeypatch.setattr(limits, "is_room_for_two", lambda: True)
    with pytest.raises(SystemExit):
        cli.main(["demo", *words.split(), "--no-such-option"])
    assert started == [HANDLERS[FINISHING]] * n_started
    assert HANDLERS[FINISHING] == FINISHING_HANDLER


def test_no_process_starts_early_where_the_demo_would_have_one_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started: list[str] = []
    monkeypatch.setattr(early_start, "start_early", started.append)
    monkeypatch.setattr(limits, "is_room_for_two", lambda: False)
    with pytest.raises(SystemExit):
        cli.main(["demo", "--no-such-option"])
    assert not started
