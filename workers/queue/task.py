"""The farm's one Celery task: ids come in, a slot does the work. Effects: the slot's."""

from __future__ import annotations

from functools import cache

from celery.signals import worker_process_init

from workers.config import config_from_environment
from workers.ids import check_job_id, tasks_from_group
from workers.node.slot import Slot, make_slot
from workers.queue.celery_app import app

RUN = "pbrs.run"


@cache
def current_slot() -> Slot:
    """This pool process's slot, never of Celery's parent."""
    return make_slot(config_from_environment())


@worker_process_init.connect  # type: ignore[untyped-decorator]
def _make_ready(**_: object) -> None:
    """A pool process has its slot before its first task."""
    current_slot()


@app.task(name=RUN)  # type: ignore[untyped-decorator]
def run(job: str, task: str, recipe: str) -> None:
    """Claim the tasks HOUSE/UNIT[,UNIT]/STAGE, run them in the render process, report to the ledger."""
    current_slot().run_tasks(check_job_id(job), tasks_from_group(task), recipe)
