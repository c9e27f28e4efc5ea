"""Render processes that start before the run is known."""

from pathlib import Path

import pytest

from pbrs_farm import cli
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.processes import early_start, limits
from pbrs_farm.run.processes.child_process import ChildProcess
from pbrs_farm.run.processes.early_start import FINISHING_HANDLER, child_of, start_early
from pbrs_farm.run.processes.pool import FINISHING, HANDLERS

TARGET = "tests.run.test_render_process:make_handler"


def _last_line(child: ChildProcess, word: str) -> bytes | None:
    """The last line of a process after it is sent a word."""
    child.send(word.encode())
    return [child.receive(60.0) for _line in ("ready", "event", "done")][-1]


def test_the_run_takes_the_process_that_was_started_early_once(tmp_path: Path) -> None:
    start_early(TARGET)
    early, folder = early_start.STARTED[TARGET]
    first, second = (child_of(TARGET, tmp_path / name) for name in ("first", "second"))
    try:
        assert first is early
        assert second is not early
        # Its output is in the log that the run reads, and the other folder is deleted.
        assert b"fine" in (_last_line(first, "fine") or b"")
        assert (tmp_path / "first").read_text() == first.log_tail(100) == "fine\n"
        assert not Path(folder.name).exists()
        first.clear_log()
        assert first.log_size() == 0
    finally:
        first.kill()
        second.kill()


def test_a_process_that_died_is_not_taken(tmp_path: Path) -> None:
    start_early(TARGET)
    early, _folder = early_start.STARTED[TARGET]
    early.kill()
    child = child_of(TARGET, tmp_path / "log")
    try:
        assert child is not early
        assert b"fine" in (_last_line(child, "fine") or b"")
    finally:
        child.kill()


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, Path]]:
    """Process id and folder of each process of TARGET that the command starts early."""
    places: list[tuple[int, Path]] = []

    def start(_target: str) -> None:
        start_early(TARGET)
        child, folder = early_start.STARTED[TARGET]
        places.append((child.process.pid, Path(folder.name)))

    monkeypatch.setattr(early_start, "start_early", start)
    monkeypatch.setattr(limits, "is_room_for_two", lambda: True)
    return places


def _are_gone(places: list[tuple[int, Path]]) -> bool:
    return not any(Path(f"/proc/{pid}").exists() or folder.exists() for pid, folder in places)


def test_an_unused_process_ends_with_the_command(started: list[tuple[int, Path]]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["demo", "--no-such-option"])
    assert len(started) == 1
    assert _are_gone(started)


def test_a_surplus_process_ends_when_the_runs_processes_start(
    started: list[tuple[int, Path]], tmp_path: Path
) -> None:
    early_start.start_early(TARGET)
    run_local(Run((), str(tmp_path / "out"), Recipe()))
    assert len(started) == 1
    assert _are_gone(started)


def test_a_command_continues_if_no_process_can_start_early(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(_target: str) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(early_start, "start_early", full)
    monkeypatch.setattr(limits, "is_room_for_two", lambda: True)
    with pytest.raises(SystemExit, match="2"):
        cli.main(["demo", "--no-such-option"])
    assert "--no-such-option" in capsys.readouterr().err


def test_an_interrupt_before_the_options_are_read_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_words: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "build_parser", interrupted)
    monkeypatch.setattr(limits, "is_room_for_two", lambda: False)
    assert cli.main(["demo"]) == 130
    assert len(capsys.readouterr().err.splitlines()) == 1


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


def test_no_process_starts_early_if_the_demo_would_use_only_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started: list[str] = []
    monkeypatch.setattr(early_start, "start_early", started.append)
    monkeypatch.setattr(limits, "is_room_for_two", lambda: False)
    with pytest.raises(SystemExit):
        cli.main(["demo", "--no-such-option"])
    assert not started
