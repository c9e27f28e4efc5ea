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
    """The task "HOUSE/UNIT/STAGE", which need not exist; BadInput for any other form."""
    match = _TASK.fullmatch(text)
    if match is None or match[3] not in STAGES:
        raise BadInput(repr(text[:120]), "", "not a task", hint="HOUSE/UNIT/STAGE")
    return TaskId(match[1], match[2], match[3])


def group_text(tasks: Sequence[TaskId]) -> str:
    """Tasks (at least one) of one house and stage as a message: HOUSE/UNIT,UNIT/STAGE."""
    return f"{tasks[0].house}/{','.join(t.unit for t in tasks)}/{tasks[0].stage}"


def tasks_from_group(text: str) -> tuple[TaskId, ...]:
    """The tasks a message, maybe a stranger's, names; BadInput for none, too many or a wrong one."""
    house, _, rest = text.partition("/")
    units, _, stage = rest.partition("/")
    names = units.split(",", MOST_IN_GROUP)
    return tuple(task_from_text(f"{house}/{unit}/{stage}") for unit in names)


def check_job_id(text: str) -> str:
    """text, if it is 12 hex digits, before it enters a key (no "../"); BadInput otherwise."""
    if not _JOB_ID.fullmatch(text):
        raise BadInput(repr(text[:40]), "", "not a job", hint="12 hex digits, as `submit` prints")
    return text


def queue_of(stage: str, *, gpu: bool) -> str:
    """The queue of a stage's tasks, by kind of worker (gpu: of light); all merges share one."""
    if stage in (REDUCE, SHARD, JOB):
        return REDUCE
    return LIGHT_GPU if gpu and stage == LIGHT else stage


def pool_of(stage: str, *, gpu: bool) -> str:
    """The pool of a stage's tasks, with its own window and leases: the stage, but light on GPUs apart."""
    return LIGHT_GPU if gpu and stage == LIGHT else stage


def stage_of_pool(pool: str) -> str:
    """The stage whose tasks a pool has; light has two pools."""
    return LIGHT if pool == LIGHT_GPU else pool


def stages_of_queue(queue: str) -> tuple[str, ...]:
    """The stages, in order, whose tasks a queue carries; () for an unknown name."""
    return tuple(s for s in STAGES if queue in (queue_of(s, gpu=False), queue_of(s, gpu=True)))


def job_key(job: str, file: str = "job.json") -> str:
    """Key of a file in the job's folder: job.json, houses.jsonl, logs/...; neither is checked."""
    return f"jobs/{job}/{file}"


def log_key(job: str, task: str, attempt: int) -> str:
    """Key of a task's log, its slashes flattened, by attempt (from 1): a failed or a long one."""
    return job_key(job, f"logs/{_flat_name(task)}.{attempt}.txt")


def attempts_from_log_keys(job: str, task: str, keys: Iterable[str]) -> dict[int, str]:
    """Attempt -> key of its log, from keys that may be of other tasks."""
    pattern = re.compile(re.escape(log_key(job, task, 0)).replace(r"\.0\.txt", r"\.(\d+)\.txt"))
    return {int(match[1]): key for key in keys if (match := pattern.fullmatch(key))}


def failed_key(job: str, task: str) -> str:
    """Key of the record, which outlives Redis, of a task that failed for good; `retry` deletes it."""
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
    """Parse a priority, one digit, 0 first; BadInput for anything else."""
    if len(text) != 1 or not text.isascii() or not text.isdigit():
        hint = f"a number from 0, the first, to {LEAST_URGENT}"
        raise BadInput(repr(text[:40]), "", "not a priority", hint=hint)
    return int(text)
