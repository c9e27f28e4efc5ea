"""The task by its name; no effects."""

from __future__ import annotations

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.tasks.classes_task import ClassesTask
from pbrs_farm.study.tasks.depth_task import DepthTask
from pbrs_farm.study.tasks.edges_task import EdgesTask
from pbrs_farm.study.tasks.normals_task import NormalsTask
from pbrs_farm.study.tasks.study_task import StudyTask


def task_of(name: str, n_thresholds: int = 0) -> StudyTask:
    """Raises BadInput for a name that is none.

    n_thresholds: at which boundaries are judged, 0 = the task's own number.
    """
    edges = EdgesTask(n_thresholds) if n_thresholds else EdgesTask()
    tasks: dict[str, StudyTask] = {
        t.name: t for t in (NormalsTask(), ClassesTask(), edges, DepthTask())
    }
    if name not in tasks:
        raise BadInput("task", name, "no such task", hint=f"of {', '.join(tasks)}")
    return tasks[name]
