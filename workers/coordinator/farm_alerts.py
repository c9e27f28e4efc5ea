"""Alerts for a person on call: problems of a farm with running jobs, found by regular checks.

Effect: the clock's. Failure rates, dead workers, stuck queues, an unhealthy store. The leader checks; a
new leader starts without state, so it may post ongoing problems once more.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from workers.ledger.task_ledger import JobView, WorkerView

_WINDOW_S: Final = 600.0  # over which failures are counted
_MOST_FAILED: Final = 0.2  # of the attempts that ended in it
_LEAST_ATTEMPTS: Final = 10  # that ended in it: fewer say nothing
_STUCK_S: Final = 1800.0  # tasks wait and none ends
_STORE_S: Final = 60.0  # that the store is in trouble before an alert
_LOST_S: Final = 3600.0  # a worker that died longer ago is history


@dataclass(slots=True)
class _Seen:
    """A job as the last looks saw it."""

    ended: deque[tuple[float, float, float]]  # time, attempts failed, tasks done
    moved_at: float  # when a task ended last, or nothing waited


class FarmAlerts:
    """Posts each alert once when it begins and once when it is over.

    Call `look` regularly; what fails to be posted is posted after a later look. post: takes one JSON
    object, with alert, state ("begins" or "over"), reason and text; may raise OSError. clock: monotonic, s.
    """

    def __init__(
        self, post: Callable[[dict[str, Any]], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._post, self._clock = post, clock
        self._jobs: dict[str, _Seen] = {}
        self._trouble_at: float | None = None  # since when the store is in trouble
        self._posted: dict[str, str] = {}  # alert that goes on -> its reason

    def look(self, views: Sequence[JobView], workers: Iterable[WorkerView], breaker: str) -> None:
        """Compare with the previous check. breaker: reason for stopped claims, or "".

        views: of all active jobs; a missing job ends its alerts. workers: all in the registry. An alert is
        posted once when it begins, and once when it ends.
        """
        now = self._clock()
        alerts: dict[str, str] = {}
        for view in views:
            alerts |= self._of_job(view, now)
        for worker in workers:
            if worker.state == "dead" and worker.age_s < _LOST_S:
                since = f"silent for {worker.age_s:.0f} s; other workers get its tasks"
                alerts[f"lost worker {worker.name}"] = since
        self._trouble_at = None if not breaker else self._trouble_at or now
        if self._trouble_at is not None and now - self._trouble_at >= _STORE_S:
            alerts["store"] = breaker
        # A missing job ends its alerts too.
        self._jobs = {v.job_id: self._jobs[v.job_id] for v in views}
        for name in alerts.keys() - self._posted.keys():
            self._post_alert(name, "begins", alerts[name])
        for name in self._posted.keys() - alerts.keys():
            self._post_alert(name, "over", self._posted[name])

    def _of_job(self, view: JobView, now: float) -> dict[str, str]:
        done = sum(n for name, n in view.counts.items() if name.startswith("done:"))
        failed = sum(n for name, n in view.counts.items() if name.startswith("failures:"))
        history = self._jobs.setdefault(view.job_id, _Seen(deque([(now, failed, done)]), now))
        alerts = {}
        # Attempts that ended within the window.
        while len(history.ended) > 1 and history.ended[0][0] < now - _WINDOW_S:
            history.ended.popleft()
        n_failed, n_done = failed - history.ended[0][1], done - history.ended[0][2]
        n_ended = n_failed + n_done
        if n_ended >= _LEAST_ATTEMPTS and n_failed > _MOST_FAILED * n_ended:
            text = f"{n_failed:.0f} of {n_ended:.0f} attempts of the last minutes failed"
            alerts[f"failures of job {view.job_id}"] = text
        # Tasks wait, the job runs, and nothing ends.
        waiting = sum(n for name, n in view.counts.items() if name[-2:] in (":w", ":q"))
        if view.state != "running" or not waiting or done + failed != sum(history.ended[-1][1:]):
            history.moved_at = now
        elif now - history.moved_at >= _STUCK_S:
            text = f"{waiting:.0f} tasks are waiting, and none has finished for {(now - history.moved_at) / 60:.0f} minutes"
            alerts[f"stuck job {view.job_id}"] = text
        history.ended.append((now, failed, done))
        return alerts

    def _post_alert(self, name: str, state: str, said: str) -> None:
        text = f"pbrs_farm: {name} {'is over' if state == 'over' else f'- {said}'}"
        try:
            self._post({"alert": name, "state": state, "reason": said, "text": text})
        except (OSError, ValueError):
            return  # tried again at the next look
        if state == "over":
            del self._posted[name]
        else:
            self._posted[name] = said
