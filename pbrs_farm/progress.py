"""Progress of a run: bars on a terminal, plain lines otherwise, JSON lines for machines.

Effects: writes to standard output; plain lines of failures to standard error.
"""

from __future__ import annotations

import json
import sys
import time
from abc import ABC, abstractmethod

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from pbrs_farm.core.shown_text import printable
from pbrs_farm.run.processes.render_task import Event


class ProgressReporter(ABC):
    """Reports a run's events, called with each, until its `with` block ends."""

    def __enter__(self) -> ProgressReporter:
        return self

    def __exit__(self, *_error: object) -> None:
        return None

    @abstractmethod
    def __call__(self, event: Event) -> None: ...


def progress_reporter(n_homes: int, *, as_json: bool) -> ProgressReporter:
    """The reporter that fits standard output."""
    if as_json:
        return _JsonLines()
    return _Bars(n_homes) if sys.stdout.isatty() else _PlainLines()


def _name(event: Event) -> str:
    return "/".join(x for x in (event.house_id, event.view_id) if x)


def _write_line(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


class _JsonLines(ProgressReporter):
    """A JSON object a line for each event."""

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
        _write_line(json.dumps(row))


class _PlainLines(ProgressReporter):
    """A line per house's step and per finished view; failures on standard error."""

    def __init__(self) -> None:
        self._started = time.monotonic()
        self._seconds: dict[str, float] = {}  # view -> seconds of its steps so far
        self._made: dict[str, int] = {}  # view -> steps made now, not kept

    def __call__(self, event: Event) -> None:
        name = _name(event)
        clock = f"[{time.monotonic() - self._started:6.1f} s]"
        if event.kind == "failed":
            sys.stderr.write(f"{clock} {name} {event.step}: FAILED: {printable(event.message)}\n")
        elif event.kind in ("done", "kept"):
            # Add the step to its view; say a house's steps at once.
            self._seconds[name] = self._seconds.get(name, 0.0) + event.seconds
            self._made[name] = self._made.get(name, 0) + (event.kind == "done")
            if event.view_id is None:
                _write_line(f"{clock} {name} {event.step}: {_how(event)}{_facts(event)}")
        elif event.kind == "end" and event.view_id is not None:
            seconds, made = self._seconds.pop(name, 0.0), self._made.pop(name, 0)
            _write_line(f"{clock} {name}: {f'{seconds:.1f} s' if made else 'already there'}")


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
    """A bar for houses and one for views, with rate and time left."""

    def __init__(self, n_homes: int) -> None:
        self._progress = Progress(
            TextColumn("{task.description:<7}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[note]}"),
            console=Console(),
        )
        self._houses = self._progress.add_task("houses", total=n_homes, note="")
        self._views = self._progress.add_task("views", total=None, note="")
        self._n_views = 0  # of all houses whose views are known
        self._n_ended = 0
        self._started = 0.0  # when the first view ended; 0 = not yet

    def __enter__(self) -> ProgressReporter:
        self._progress.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._progress.stop()

    def __call__(self, event: Event) -> None:
        if event.kind == "failed":
            self._progress.console.print(
                f"{_name(event)} {event.step}: FAILED: {printable(event.message)}",
                style="red",
                markup=False,
            )
        elif event.kind == "begin":
            note = f"{_name(event)} {event.step}"
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
        # Leave out the first view: its time includes the house's.
        seconds = time.monotonic() - self._started if self._started else 0.0
        return f"{60 * (self._n_ended - 1) / seconds:.1f}/min" if self._n_ended > 1 else ""
