"""Run a task of a farm again in this process, with its steps, log and error on the terminal.

Effects: those of the task's steps, which write to the farm's store as a worker would. The ledger is
not changed: use `retry` for a task that failed permanently.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from pbrs_farm.core.errors import BadInput
from workers.ids import GEOMETRY, TaskId, task_from_text
from workers.job import stored_houses
from workers.runner import Result, TaskRequest, runner_maker

if TYPE_CHECKING:
    from workers.client.farm_client import Farm


def rerun(farm: Farm, job: str, text: str, on_step: Callable[[str], None]) -> Result:
    """Run the task named by text; raises the errors of its steps, BadInput for an unknown task.

    on_step: called with each step as it begins, and when waiting for storage.
    """
    task = task_from_text(text)
    farm.check_task(job, task)
    request = TaskRequest(
        job_id=job,
        house=task.house,
        unit=task.unit,
        stage=task.stage,
        views=_views(farm, job, task),
        source=_source_of_house(farm, job, task.house) if task.stage == GEOMETRY else "",
    )
    return runner_maker(farm.config.runner)(farm.config, on_step).run(request, on_step)


def _views(farm: Farm, job: str, task: TaskId) -> tuple[str, ...]:
    """The views of a batch, () for a task of a whole house or job."""
    return farm.ledger.batches(job, task.house)[int(task.unit)] if task.unit.isdigit() else ()


def _source_of_house(farm: Farm, job: str, house: str) -> str:
    """The house's source as submitted, from the store."""
    for entry in stored_houses(farm.store, job):
        if entry.house_id == house:
            return entry.source
    raise BadInput(house, "", "the job has no such house")
