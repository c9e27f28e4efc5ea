"""Names of the farm's tasks, stages, queues and of what a job stores; no effects.

A task is `<house>/<unit>/<stage>`. Unit "-" is the house as a whole, "0", "1", ... its batches of
views. House "-" is the job: `-/s3/shard` merges shard 3, `-/-/job` ends the job.

    geometry -> each batch: gl -> light -> reduce -> (all of a shard) shard -> (all shards) job
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from pbrs_farm.core.errors import BadInput

# Stages of a job's work; a queue carries those of one kind of worker.
GEOMETRY: Final = "geometry"  # a house: read, repaired, its cameras placed
GL: Final = "gl"  # a batch of its views: labels and OpenGL
LIGHT: Final = "light"  # a batch of its views: path or Metropolis, developed
REDUCE: Final = "reduce"  # a house: its manifest
SHARD: Final = "shard"  # some hundred houses: their manifests as one
JOB: Final = "job"  # the root's manifest, the report
STAGES: Final = (GEOMETRY, GL, LIGHT, REDUCE, SHARD, JOB)
LIGHT_GPU: Final = "light.gpu"  # the queue of light on a GPU, and its leases
QUEUES: Final = (GEOMETRY, GL, LIGHT, LIGHT_GPU, REDUCE)
POOLS: Final = (*STAGES, LIGHT_GPU)  # each has a window of messages and a list of leases
WHOLE: Final = "-"
MOST_IN_GROUP: Final = 64  # tasks of one house that a message names
DEFAULT_PRIORITY: Final = 5  # of a job: a number from 0, which goes first, to 9
LEAST_URGENT: Final = 9

_JOB_ID: Final = re.compile(r"[0-9a-f]{12}")
_TASK: Final = re.compile(r"([A-Za-z0-9_.\-]{1,120})/(-|[0-9]{1,4}|s[0-9]{1,5})/([a-z]+)")


@dataclass(frozen=True, slots=True)
class TaskId:
    """One piece of work of a job."""

    house: str
    unit: str
    stage: str

    def __str__(self) -> str:
        return f"{self.house}/{self.unit}/{self.stage}"


def task_from_text(text: str) -> TaskId:
    """The task a word names; raises BadInput when it cannot be one.

    text: "HOUSE/UNIT/STAGE", as messages, logs and the command line have it. Only the form is
    checked, not whether a job has such a task.
    """
    match = _TASK.fullmatch(text)
    if match is None or match[3] not in STAGES:
        raise BadInput(repr(text[:120]), "", "not a task", hint="HOUSE/UNIT/STAGE")
    return TaskId(match[1], match[2], match[3])


def group_text(tasks: Sequence[TaskId]) -> str:
    """Tasks of one house and stage as a message names them: HOUSE/UNIT,UNIT/STAGE.

    tasks: at least one; house and stage are read from the first, and nothing checks that the others
    share them. `tasks_from_group` reads it.
    """
    return f"{tasks[0].house}/{','.join(t.unit for t in tasks)}/{tasks[0].stage}"


def tasks_from_group(text: str) -> tuple[TaskId, ...]:
    """The tasks a message names; raises BadInput when it names none, or too many.

    A message of one task is a group of one. Every task is checked as `task_from_text` does, since a
    message may come from anybody who reaches the broker.
    """
    house, _, rest = text.partition("/")
    units, _, stage = rest.partition("/")
    names = units.split(",", MOST_IN_GROUP)
    return tuple(task_from_text(f"{house}/{unit}/{stage}") for unit in names)


def check_job_id(text: str) -> str:
    """text itself, if it is 12 hex digits; raises BadInput otherwise.

    Call it before a word of a user becomes part of a key: nothing else keeps "../" out of it.
    """
    if not _JOB_ID.fullmatch(text):
        raise BadInput(repr(text[:40]), "", "not a job", hint="12 hex digits, as `submit` prints")
    return text


def queue_of(stage: str, *, gpu: bool) -> str:
    """The queue a stage's tasks go to: by kind of worker, not by job.

    gpu: whether the job's light runs on GPUs; it matters to the stage light alone. The merges of
    houses, shards and jobs share one queue. `stages_of_queue` is the way back.
    """
    if stage in (REDUCE, SHARD, JOB):
        return REDUCE
    return LIGHT_GPU if gpu and stage == LIGHT else stage


def pool_of(stage: str, *, gpu: bool) -> str:
    """The pool of a stage's tasks, with its own window and leases.

    A pool is a stage, except that light on a GPU is a separate one: messages without a worker block no others.
    """
    return LIGHT_GPU if gpu and stage == LIGHT else stage


def stage_of_pool(pool: str) -> str:
    """The stage whose tasks a pool has.

    A pool is a stage, but that light has two: on GPUs and without. So several pools may give one
    stage.
    """
    return LIGHT if pool == LIGHT_GPU else pool


def stages_of_queue(queue: str) -> tuple[str, ...]:
    """The stages whose tasks a queue carries.

    In the order of STAGES; a queue of light carries light alone, the queue of merges three. An
    unknown name gives ().
    """
    return tuple(s for s in STAGES if queue in (queue_of(s, gpu=False), queue_of(s, gpu=True)))


def job_key(job: str, file: str = "job.json") -> str:
    """Key of one of the job's own objects: job.json, houses.jsonl, logs/..., failed/...

    file: below the job's folder; neither it nor the id is checked here (`check_job_id`).
    """
    return f"jobs/{job}/{file}"


def log_key(job: str, task: str, attempt: int) -> str:
    """Key of a task's log: of a failed attempt, and of a long one while it runs.

    task: as text; its slashes are flattened. attempt: counts from 1; one log each.
    """
    return job_key(job, f"logs/{_flat_name(task)}.{attempt}.txt")


def attempts_from_log_keys(job: str, task: str, keys: Iterable[str]) -> dict[int, str]:
    """Attempt -> the key of its log, for the keys of the task's logs.

    keys: any keys, as from a listing of the job's logs; those of other tasks are ignored. Empty if the task
    has no log: only failures and long tasks have one.
    """
    pattern = re.compile(re.escape(log_key(job, task, 0)).replace(r"\.0\.txt", r"\.(\d+)\.txt"))
    return {int(match[1]): key for key in keys if (match := pattern.fullmatch(key))}


def failed_key(job: str, task: str) -> str:
    """Key of the record of a task that failed for good; survives the loss of Redis.

    `task_from_failed_key` reads the task from it again. `retry` deletes the record; the job's last
    merge reads all of them.
    """
    return job_key(job, f"failed/{_flat_name(task)}.json")


def task_from_failed_key(job: str, key: str) -> str:
    """The task of a failure record's key."""
    flat = key.removeprefix(job_key(job, "failed/")).removesuffix(".json")
    return flat.replace("whole/", "-/", 1) if flat.startswith("whole/") else flat


def shard_key(job: str, shard: int) -> str:
    """Key of a shard's merged manifest."""
    return job_key(job, f"shards/{shard}.jsonl")


def _flat_name(task: str) -> str:
    return task.replace("-/", "whole/", 1) if task.startswith("-/") else task


def priority_from_text(text: str) -> int:
    """Parse a priority. Raises BadInput for anything but a number from 0 to 9.

    0 goes first. A sign, a space or a second digit is an error, so that "10" is not read as 1.
    """
    if len(text) != 1 or not text.isascii() or not text.isdigit():
        hint = f"a number from 0, the first, to {LEAST_URGENT}"
        raise BadInput(repr(text[:40]), "", "not a priority", hint=hint)
    return int(text)
