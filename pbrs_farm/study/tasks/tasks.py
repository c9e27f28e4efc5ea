"""The task by its name."""

from __future__ import annotations

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.tasks.classes_task import ClassesTask
from pbrs_farm.study.tasks.depth_task import DepthTask
from pbrs_farm.study.tasks.edges_task import N_THRESHOLDS, EdgesTask
from pbrs_farm.study.tasks.normals_task import NormalsTask
from pbrs_farm.study.tasks.study_task import StudyTask


def task_of(name: str, n_thresholds: int = N_THRESHOLDS) -> StudyTask:
    """The task; BadInput for an unknown name. n_thresholds: of the score of boundaries."""
    options = (NormalsTask(), ClassesTask(), EdgesTask(n_thresholds), DepthTask())
    tasks = {task.name: task for task in options}
    if name not in tasks:
        raise BadInput("task", name, "no such task", hint=f"of {', '.join(tasks)}")
    return tasks[name]
