"""The remaining time of a run, computed only from its events."""

from __future__ import annotations

import io
import re
import time

import pytest

from pbrs_farm.crash_notes import display_shown, note_step, waiting_lines
from pbrs_farm.progress import TimeLeft, counting_bar, progress_reporter, seconds_text, share_bar
from pbrs_farm.run.processes.render_task import Event


def planned(house: str, n: int) -> Event:
    return Event("planned", house, None, "cameras", facts={"views": [str(k) for k in range(n)]})


def view(left: TimeLeft, house: str, k: int, began_s: float, ended_s: float, how: str) -> None:
    """Report a view from its first step to its end."""
    left.hear(Event("begin", house, str(k), "truth"), began_s)
    left.hear(Event(how, house, str(k), "truth"), ended_s)  # type: ignore[arg-type]
    left.hear(Event("end", house, str(k), ""), ended_s)


def test_no_time_is_estimated_before_the_first_view() -> None:
    timer = TimeLeft(1)
    timer.hear(planned("a", 4), 0)
    assert timer.seconds(9.0) is None


def test_views_of_one_home_are_estimated_by_earlier_ones() -> None:
    timer = TimeLeft(1)
    timer.hear(planned("a", 4), 0)
    view(timer, "a", 0, 10.0, 20.0, "done")
    assert timer.views_text == "1 of 4"
    assert timer.seconds(20.0) == pytest.approx(30.0)
    view(timer, "a", 1, 20.0, 40.0, "done")
    assert timer.seconds(40.0) == pytest.approx(30.0)


def test_homes_not_read_yet_count_with_the_mean_of_the_others() -> None:
    timer = TimeLeft(3)
    timer.hear(planned("a", 4), 0)
    view(timer, "a", 0, 0.0, 10.0, "done")
    assert timer.views_text == "1 of about 12"
    assert timer.seconds(10.0) == pytest.approx(110.0)


def test_homes_still_to_be_made_are_estimated_by_the_others() -> None:
    timer = TimeLeft(3)
    timer.hear(Event("begin", "a", None, "house"), 0.0)
    timer.hear(Event("done", "a", None, "house", seconds=60.0), 60.0)
    timer.hear(planned("a", 2), 60.0)
    for k in range(2):
        timer.hear(Event("begin", "a", str(k), "truth"), 60.0 + 5 * k)
        timer.hear(Event("done", "a", str(k), "truth", seconds=5.0), 65.0 + 5 * k)
        timer.hear(Event("end", "a", str(k), ""), 65.0 + 5 * k)
    assert timer.seconds(70.0) == pytest.approx(140.0)


def test_a_home_in_progress_reports_its_share(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr("pbrs_farm.progress.time.monotonic", lambda: now[0])
    with progress_reporter(1, as_json=False) as report:
        for now[0], share in ((4.0, 0.1), (12.0, 0.4), (13.0, 0.5)):
            report(Event("under_way", "a", None, "house", facts={"share": share}))
    lines = [line.split("] ")[1] for line in capsys.readouterr().out.splitlines()]
    assert lines == ["a house: 40 %"]


def test_a_home_that_cannot_be_read_has_no_views() -> None:
    timer = TimeLeft(2)
    timer.hear(Event("failed", "b", None, "house"), 0.0)
    timer.hear(planned("a", 2), 0)
    assert timer.views_text == "0 of 2"


def test_views_that_are_there_already_do_not_make_the_rest_look_quick() -> None:
    timer = TimeLeft(1)
    timer.hear(planned("a", 4), 0)
    timer.hear(Event("kept", "a", "0", "truth"), 0.1)
    timer.hear(Event("end", "a", "0", ""), 0.1)
    view(timer, "a", 1, 0.1, 10.1, "done")
    assert timer.seconds(10.1) == pytest.approx(20.0)


def test_a_part_of_a_long_view_counts_already() -> None:
    timer = TimeLeft(1)
    timer.hear(planned("a", 2), 0)
    timer.hear(Event("begin", "a", "0", "light"), 0.0)
    timer.hear(Event("under_way", "a", "0", "light", facts={"share": 0.25}), 100.0)
    assert timer.seconds(100.0) == pytest.approx(700.0)
    timer.hear(Event("done", "a", "0", "light"), 400.0)
    timer.hear(Event("end", "a", "0", ""), 400.0)
    assert timer.seconds(400.0) == pytest.approx(400.0)


def test_plain_lines_tell_the_share_of_a_long_view_twice_a_minute(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr("pbrs_farm.progress.time.monotonic", lambda: now[0])
    with progress_reporter(1, as_json=False) as report:
        report(planned("a", 1))
        report(Event("begin", "a", "0", "light"))
        for seconds in range(0, 100, 5):
            now[0] = float(seconds)
            report(Event("under_way", "a", "0", "light", facts={"share": seconds / 400}))
    lines = [line.split("] ")[1] for line in capsys.readouterr().out.splitlines()]
    assert lines == [
        "a/0 light: 8 %, 6 min left", "a/0 light: 15 %, 6 min left", "a/0 light: 22 %, 5 min left",
    ]  # fmt: skip


def test_plain_lines_tell_it(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_reporter(1, as_json=False) as report:
        report(planned("a", 2))
        report(Event("begin", "a", "0", "truth"))
        report(Event("done", "a", "0", "truth", seconds=1.0))
        report(Event("end", "a", "0", ""))
    assert "a/0: 1.0 s; 1 of 2, 0 s left" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(40.4, "40 s"), (95, "2 min"), (5300, "88 min"), (12000, "3 h 20 min"), (190000, "2 d 4 h")],
)
def test_seconds_are_formatted_in_words(seconds: float, text: str) -> None:
    assert seconds_text(seconds) == text


class Terminal(io.StringIO):
    """A standard error that claims to be a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_terminal_gets_bars_with_count_rate_and_time_left_and_no_lines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.setenv("TERM", "xterm")
    clock = iter(range(0, 10_000, 10))
    monkeypatch.setattr("pbrs_farm.progress.time.monotonic", lambda: float(next(clock)))
    with progress_reporter(1, as_json=False) as report:
        report(planned("a", 4))
        for k in range(3):
            report(Event("begin", "a", str(k), "light"))
            report(Event("done", "a", str(k), "light"))
            report(Event("end", "a", str(k), ""))
        report(Event("begin", "a", "3", "light"))
    shown = terminal.getvalue()
    assert "3/4" in shown
    assert "a/3 light" in shown
    assert "/min" in shown
    assert " left" in shown
    assert capsys.readouterr().out == ""


def test_counted_work_has_a_bar_only_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with counting_bar("views") as tell:
        tell(1, 2)
    assert capsys.readouterr() == ("", "")
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.setenv("TERM", "xterm")
    with counting_bar("views") as tell:
        for n in range(3):
            tell(n, 2)
    assert "2/2" in terminal.getvalue()


def test_a_long_call_says_regularly_where_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    with waiting_lines("scatter", first_s=0.01, every_s=0.01):
        note_step("homes/flat.sh3d", "repair")
        with counting_bar("views") as tell:
            tell(3, 40)
            assert _line_within(capsys, 5.0) == "scatter: 3 of 40 views, flat.sh3d: repair, 0 s"
        with display_shown():
            time.sleep(0.05)
            capsys.readouterr()
            time.sleep(0.05)
            assert capsys.readouterr() == ("", "")
        assert _line_within(capsys, 5.0) == "scatter: flat.sh3d: repair, 0 s"
    capsys.readouterr()
    time.sleep(0.05)
    assert capsys.readouterr() == ("", "")


def _line_within(capsys: pytest.CaptureFixture[str], seconds: float) -> str:
    """The last line on standard error, without the seconds that a slow machine adds."""
    capsys.readouterr()
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        time.sleep(0.02)
        if lines := capsys.readouterr().err.splitlines():
            return re.sub(r"\d+ s$", "0 s", lines[-1])
    return ""


def test_bars_show_the_step_in_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.setenv("TERM", "xterm")
    with counting_bar("views") as tell:
        tell(0, 2)
        note_step("homes/flat.sh3d", "dress")
    assert "flat.sh3d: dress" in terminal.getvalue()


def test_items_of_unknown_number_are_counted_too(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.setenv("TERM", "xterm")
    with counting_bar("files") as tell:
        for n in range(8):
            tell(n)
    assert "7/?" in terminal.getvalue()


def test_long_work_shows_count_and_share_and_lines_keep_their_stream(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with share_bar("dress") as tell:
        tell("furniture", 0.5)
    assert capsys.readouterr() == ("", "")
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.setenv("TERM", "xterm")
    with share_bar("dress") as tell:
        tell("before and after", 0.25)
        print("a line for a pipe")  # noqa: T201
    assert "25%" in terminal.getvalue()
    assert "before and after" in terminal.getvalue()
    assert capsys.readouterr().out == "a line for a pipe\n"
