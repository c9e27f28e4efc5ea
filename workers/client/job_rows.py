"""Every job of a farm as a row: progress, rate, cost. Effects: reads the ledger."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from workers.coordinator.progress_rates import StageView, stage_views
from workers.ids import GL, LIGHT
from workers.ledger.task_ledger import JobView

if TYPE_CHECKING:
    from workers.client.farm_client import Farm


def job_rows(farm: Farm) -> list[dict[str, Any]]:
    """A row of plain JSON values per job in the ledger, oldest first, by a few reads each."""
    slots = farm.registry.slots()
    return [job_row(view, slots) for view in farm.jobs()]


def job_row(view: JobView, slots: Mapping[str, int]) -> dict[str, Any]:
    """A job's row. slot_hours: of finished tasks; slot_hours_left: expected.

    slots: stage -> maximum concurrent tasks, for the ETA. For an ended job "eta_s" is None and
    "slot_hours_left" 0, even if tasks were not run.
    """
    stages = stage_views(view, slots)
    # An ended job has no work left, although tasks behind failed ones never ran.
    is_over = view.state not in ("loading", "running", "paused")
    # Remaining tasks, including running ones, times the mean of finished ones.
    left_s = sum(s.mean_s * max(0, s.total - s.done - s.failed) for s in stages)
    return {
        "job": view.job_id,
        "state": view.outcome,
        "reason": view.fields.get("reason", ""),
        "recipe": view.fields.get("recipe_name", ""),
        "user": view.user,
        "priority": view.priority,
        "houses": int(view.fields.get("n_houses", 0)),
        "houses_done": int(view.counts.get("houses:done", 0)),
        "views": int(view.counts.get("views", 0)),
        "views_per_h": round(3600 * _views_per_s(view, stages), 1),
        "eta_s": None
        if is_over
        else max((s.eta_s for s in stages if s.eta_s is not None), default=None),
        "failed": view.n_failed,
        "slot_hours": round(view.spent_h, 4),
        "slot_hours_left": 0.0 if is_over else round(left_s / 3600, 4),
        "done": sum(s.done for s in stages),
        "running": sum(s.running for s in stages),
        "tasks": sum(s.total for s in stages),
    }


def _views_per_s(view: JobView, stages: list[StageView]) -> float:
    """Batches a second of the last stage that makes views, times the views of a batch so far."""
    if view.state != "running":
        return 0.0
    last = [s for s in stages if s.stage in (GL, LIGHT)][-1:]
    return sum(s.per_s * view.counts.get("views", 0.0) / max(1, s.done) for s in last)
