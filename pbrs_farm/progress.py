"""Progress of a run: bars on a terminal, plain lines otherwise, JSON lines for machines.

Effects: writes bars to standard error, lines to standard output; plain lines of failures to standard error.
"""

from __future__ import annotations

import json
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, Protocol, TypeAlias

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

from pbrs_farm.core.shown_text import printable
from pbrs_farm.crash_notes import current_step, display_shown, waiting_lines
from pbrs_farm.run.processes.render_task import Event

ShareTeller: TypeAlias = "Callable[[str, float], None]"
_SHARE_EVERY_S: Final = 30.0  # interval between lines about one view
_HOME_SHARE_EVERY_S: Final = 10.0


class CountTeller(Protocol):
    """Callback with the number of finished items and, if known, their total."""

    def __call__(self, n: int, of: int | None = None, /) -> None: ...


class ProgressReporter(ABC):
    """Reports a run's events: call it with each event inside its `with` block."""

    def __enter__(self) -> ProgressReporter:
        self._display = display_shown()
        self._display.__enter__()
        return self

    def __exit__(self, *_error: object) -> None:
        self._display.__exit__(None, None, None)

    @abstractmethod
    def __call__(self, event: Event) -> None: ...


def progress_reporter(n_homes: int, *, as_json: bool) -> ProgressReporter:
    """Choose a reporter: JSON lines if as_json, bars if standard error is a terminal, else plain lines.

    n_homes: number of homes to make, for the remaining time. Use it as a context manager and call it
    with each event:

        with progress_reporter(3, as_json=False) as report:
            run_local(run, report)
    """
    if as_json:
        return _JsonLines()
    return _Bars(n_homes) if sys.stderr.isatty() else _PlainLines(n_homes)


def _name(event: Event) -> str:
    return "/".join(x for x in (event.house_id, event.view_id) if x)


def _write_line(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


class TimeLeft:
    """Estimates a run's remaining time from its events. now_s: monotonic seconds.

    Homes whose views are not yet planned are assumed to have the average number of views and the average
    time of preparation.
    """

    def __init__(self, n_homes: int) -> None:
        self._n_homes = n_homes
        self._n_planned = 0  # homes with planned views
        self._n_views = 0  # of these homes
        self._n_ended = 0  # finished views
        self._n_made = 0  # finished views rendered in this run
        self._began_s: float | None = None  # start of the first home or view made in this run
        self._view_s = 0.0  # total of the steps of rendered views
        self._home_s: dict[str, float] = {}  # home made in this run -> seconds of its house steps
        self._making: set[str] = set()
        self._shares: dict[str, float] = {}  # view in progress -> finished share of its light step

    def hear(self, event: Event, now_s: float) -> None:
        """Update the estimate with an event.

        now_s: time of the event on a monotonic clock.
        """
        if event.kind == "planned":
            self._n_planned += 1
            self._n_views += len(event.facts["views"])
        elif event.view_id is None:
            self._hear_of_home(event, now_s)
        elif event.kind in ("begin", "done"):
            self._began_s = now_s if self._began_s is None else self._began_s
            if event.kind == "done":
                self._making.add(_name(event))
                self._view_s += event.seconds
        elif event.kind == "end":
            self._n_ended += 1
            self._n_made += _name(event) in self._making
            self._making.discard(_name(event))
            self._shares.pop(_name(event), None)
        elif event.kind == "under_way":
            self._shares[_name(event)] = event.facts["share"]

    def _hear_of_home(self, event: Event, now_s: float) -> None:
        # No views are expected of a home that failed before they were planned.
        self._n_homes -= event.kind == "failed" and event.step in ("house", "cameras")
        if event.kind == "begin" and self._began_s is None:
            self._began_s = now_s
        if event.kind == "done":
            before = self._home_s.get(event.house_id, 0.0)
            self._home_s[event.house_id] = before + event.seconds

    @property
    def views_text(self) -> str:
        """Numbers of finished and of all views.

        "3 of 12"; "3 of about 40" while homes are still unread.
        """
        about = "about " if self._n_homes > self._n_planned else ""
        return f"{self._n_ended} of {about}{self._expected_views()}"

    def seconds(self, now_s: float) -> float | None:
        """Remaining seconds at now_s.

        None until a part of a view is rendered.
        """
        part = sum(self._shares.values())
        n_made = self._n_made + part
        if self._began_s is None or not n_made > 0:
            return None
        # A home counts as many views as could be rendered in its time.
        home_s, n_homes = sum(self._home_s.values()), max(1, len(self._home_s))
        views_a_home = home_s / n_homes / (self._view_s / n_made) if self._view_s else 0.0
        done = n_made + views_a_home * len(self._home_s)
        n_left = self._n_left(part) + views_a_home * self._n_unknown()
        return n_left * (now_s - self._began_s) / done

    def _n_left(self, part: float) -> float:
        return max(0.0, self._expected_views() - self._n_ended - part)

    def _expected_views(self) -> int:
        a_home = self._n_views / max(1, self._n_planned)
        return round(self._n_views + self._n_unknown() * a_home)

    def _n_unknown(self) -> int:
        """Number of homes whose views are not yet planned."""
        return max(0, self._n_homes - self._n_planned)


def seconds_text(seconds: float) -> str:
    """Format a duration in its two largest units.

    "40 s", "12 min", "3 h 20 min", "2 d 4 h".
    """
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    hours = minutes // 60
    return f"{hours} h {minutes % 60} min" if hours < 48 else f"{hours // 24} d {hours % 24} h"


class _JsonLines(ProgressReporter):
    """Writes one JSON object per event and line."""

    def __call__(self, event: Event) -> None:
        row = {
            "event": event.kind,
            "house": event.house_id,
            "view": event.view_id,
            "step": event.step,
            "seconds": round(event.seconds, 3),
        }
        if event.message:
            row["message"] = event.message
        if event.kind == "planned":
            row["views"] = event.facts["views"]
        if event.kind == "under_way":
            row["share"] = round(event.facts["share"], 4)
        _write_line(json.dumps(row))


class _PlainLines(ProgressReporter):
    """Writes a line per house step and finished view, with remaining time; failures to standard error."""

    def __init__(self, n_homes: int) -> None:
        self._left = TimeLeft(n_homes)
        self._started = time.monotonic()
        self._seconds: dict[str, float] = {}  # view -> seconds of its steps so far
        self._made: dict[str, int] = {}  # view -> steps run now, not skipped
        self._told_s: dict[str, float] = {}  # view -> time of its last line about its share

    def __call__(self, event: Event) -> None:
        name = _name(event)
        self._left.hear(event, time.monotonic())
        clock = f"[{time.monotonic() - self._started:6.1f} s]"
        if event.kind == "failed":
            sys.stderr.write(f"{clock} {name} {event.step}: FAILED: {printable(event.message)}\n")
        elif event.kind in ("done", "kept"):
            # Sum the steps of views; print the steps of houses immediately.
            self._seconds[name] = self._seconds.get(name, 0.0) + event.seconds
            self._made[name] = self._made.get(name, 0) + (event.kind == "done")
            if event.view_id is None:
                _write_line(f"{clock} {name} {event.step}: {_how(event)}{_facts(event)}")
        elif event.kind == "under_way":
            self._tell_share(name, clock, event)
        elif event.kind == "end" and event.view_id is not None:
            self._told_s.pop(name, None)
            seconds, was_made = self._seconds.pop(name, 0.0), self._made.pop(name, 0)
            how = f"{seconds:.1f} s" if was_made else "already there"
            _write_line(f"{clock} {name}: {how}; {self._left.views_text}{self._time_left()}")

    def _tell_share(self, name: str, clock: str, event: Event) -> None:
        """Write a line about a slow view twice a minute, about a home every ten seconds."""
        now_s = time.monotonic()
        every_s = _SHARE_EVERY_S if event.view_id else _HOME_SHARE_EVERY_S
        if now_s - self._told_s.get(name, self._started) < every_s:
            return
        self._told_s[name] = now_s
        share = f"{100 * event.facts['share']:.0f} %"
        _write_line(f"{clock} {name} {event.step}: {share}{self._time_left()}")

    def _time_left(self) -> str:
        left_s = self._left.seconds(time.monotonic())
        return f", {seconds_text(left_s)} left" if left_s else ""


def _how(event: Event) -> str:
    return f"{event.seconds:.1f} s" if event.kind == "done" else "already there"


def _facts(event: Event) -> str:
    facts = event.facts
    if event.step == "cameras" and "views" in facts:
        return f", {len(facts['views'])} views"
    if event.step == "house" and "rooms" in facts:
        return f", {facts['rooms']} rooms, {facts['items']} items"
    return ""


class _Bars(ProgressReporter):
    """Shows a bar for houses and one for views, with rate and remaining time."""

    def __init__(self, n_homes: int) -> None:
        self._progress = _bars()
        self._houses = self._progress.add_task("houses", total=n_homes, note="")
        self._views = self._progress.add_task("views", total=None, note="")
        self._left = TimeLeft(n_homes)
        self._n_views = 0  # planned views of all houses
        self._n_ended = 0
        self._started = 0.0  # when the first view ended; 0 = not yet

    def __enter__(self) -> ProgressReporter:
        self._progress.start()
        return super().__enter__()

    def __exit__(self, *_error: object) -> None:
        self._progress.refresh()
        self._progress.update(self._views, note="")
        self._progress.stop()
        super().__exit__()

    def __call__(self, event: Event) -> None:
        self._left.hear(event, time.monotonic())
        if event.kind == "failed":
            self._progress.console.print(
                f"{_name(event)} {event.step}: FAILED: {printable(event.message)}",
                style="red",
                markup=False,
            )
        elif event.kind in ("begin", "under_way"):
            share = f" {100 * event.facts['share']:.0f} %" if event.kind == "under_way" else ""
            note = f"{_name(event)} {event.step}{share}"
            self._progress.update(self._views, note=f"{self._rate()}  {note}")
        elif event.kind == "planned":
            self._n_views += len(event.facts["views"])
            self._progress.update(self._views, total=self._n_views)
        elif event.kind == "end" and event.view_id is None:
            self._progress.advance(self._houses)
        elif event.kind == "end":
            self._started = self._started or time.monotonic()
            self._n_ended += 1
            self._progress.advance(self._views)

    def _rate(self) -> str:
        # Exclude the first view, whose time includes the house's.
        seconds = time.monotonic() - self._started if self._started else 0.0
        rate = f"{60 * (self._n_ended - 1) / seconds:.1f}/min" if self._n_ended > 1 else ""
        left_s = self._left.seconds(time.monotonic())
        return rate if left_s is None else f"{rate} {seconds_text(left_s)} left"


class _StepColumn(ProgressColumn):
    """The step in progress, which changes between two updates of the bar."""

    def render(self, task: Task) -> Text:
        """Shown beside the note of the task."""
        return Text(current_step())


def _bars(done: ProgressColumn | None = None, *more: ProgressColumn) -> Progress:
    """Bars on standard error: noun, bar, progress (n of n), time, note, more columns."""
    return Progress(
        TextColumn("{task.description:<7}"),
        BarColumn(),
        done or MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[note]}"),
        *more,
        console=Console(stderr=True),
        # Output to a file or pipe is not redirected while a bar is shown.
        redirect_stdout=sys.stdout.isatty(),
    )


@contextmanager
def counting_bar(noun: str) -> Iterator[CountTeller]:
    """Show a bar on standard error while items are counted; a line every 30 s if it is not a terminal.

    Yields a callback that takes the number of finished items and, if known, their total.
    """
    if not sys.stderr.isatty():
        with waiting_lines(noun) as tell_count:
            yield lambda n, of=None: tell_count(f"{n}{'' if of is None else f' of {of}'} {noun}")
        return
    with display_shown(), _bars(None, _StepColumn()) as bar:
        task, began_s = bar.add_task(noun, total=None, note=""), time.monotonic()

        def tell(n: int, of: int | None = None) -> None:
            seconds = time.monotonic() - began_s
            note = f"{60 * n / seconds:.1f}/min" if n and n != of else ""
            if note and of is not None:
                note += f" {seconds_text((of - n) * seconds / n)} left"
            bar.update(task, completed=n, total=of, note=note)

        yield tell


@contextmanager
def share_bar(noun: str) -> Iterator[ShareTeller]:
    """Show a bar on standard error for one long task; a line every 30 s if it is not a terminal.

    Yields a callback that takes the current step and the finished share of the whole task (0..1).
    """
    if not sys.stderr.isatty():
        with waiting_lines(noun) as tell_share:
            yield lambda _doing, share: tell_share(f"{100 * share:.0f} %")
        return
    with display_shown(), _bars(TaskProgressColumn()) as bar:
        task = bar.add_task(noun, total=1.0, note="")
        yield lambda doing, share: bar.update(task, completed=share, note=doing)
