"""What a job is and where its own objects are stored; frozen values, no effects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache

from pydantic import BaseModel, ConfigDict, Field

from pbrs_farm.core import keys
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.core.record import Record
from pbrs_farm.store import laid_out
from workers.ids import DEFAULT_PRIORITY, GL, LEAST_URGENT, LIGHT


@cache
def work_version() -> str:
    """What a worker of this installation makes of a task: workers of one such version make the same.

    It follows the versions of the steps and of the passes of a house, not the package's: an upgrade that changes no stored byte
    changes nothing here, and a running job goes on.
    """
    from pbrs_farm.prepare.passes import versions_of_passes
    from pbrs_farm.run import plan

    steps = {name: step.version for name, step in plan.STEPS.items()}
    # Workers that do not know how a root lies would not find what others made.
    return keys.digest(steps, versions_of_passes(), laid_out.FORMAT)[:12]


# What a job is and where its own objects are stored.


class HouseEntry(Record):
    """A house of a job."""

    house_id: str
    source: str = ""  # JSON the runner understands; it travels to the geometry task only
    sha256: str = ""  # of the source: a house that changed since submission is noticed


class JobRules(Record):
    """When to give up on a task, a house, a job."""

    max_attempts: int = Field(3, ge=1)
    failed_share: float = Field(0.5, description="of a house's batches; more quarantines the house")
    max_quarantined: int = Field(20, ge=1, description="houses; fewer never pause a job")
    quarantined_share: float = Field(0.2, description="of closed houses; more pauses the job")
    max_same_failure: int = Field(50, ge=1, description="alike for good; as many pause the job")
    shard_size: int = Field(500, ge=1, description="houses merged by one task")


class JobSpec(BaseModel):
    """Everything a job is made with except its houses; stored as jobs/<id>/job.json.

    A batch is some views of a house that one task makes; job.json calls it a group.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", validate_by_name=True, serialize_by_alias=True
    )
    job_id: str
    version: str  # work_version of who submitted or adopted it
    versions_before: tuple[str, ...] = ()  # by which it was worked on before it was adopted
    recipe: Recipe
    modes: tuple[str, ...] = ()
    layers: tuple[str, ...] = ()
    n_views: int = 0
    gpu: bool = False
    priority: int = Field(DEFAULT_PRIORITY, ge=0, le=LEAST_URGENT, description="0 goes first")
    max_slots: int = Field(0, ge=0, description="tasks in flight at once; 0 = as there are slots")
    budget_h: float = Field(0.0, ge=0, description="slot-hours, then it pauses itself; 0 = none")
    after: tuple[str, ...] = Field((), description="jobs that must be done before it begins")
    user: str = Field("", description="whose job it is; nobody's on a farm without users")
    preempt: bool = Field(False, description="urgent: running tasks of other jobs make room for it")
    batch_stages: tuple[str, ...] = Field((GL, LIGHT), alias="group_stages")
    seconds_per_view: float = Field(20.0, gt=0, description="of light, expected; sizes the batches")
    min_batches: int = Field(
        1, ge=1, alias="min_groups", description="of a house, about; by slots at submission"
    )
    reference: str = Field("", description="key of the reference selection scores against, or none")
    rules: JobRules = JobRules()
    n_houses: int = 0


# What is decided when a job is entered and changes nothing of what it makes.
_NOT_WORK = {
    "job_id",
    "priority",
    "max_slots",
    "budget_h",
    "after",
    "user",
    "preempt",
    "rules",
    "n_houses",
    "min_batches",
    "seconds_per_view",
    "versions_before",
}


def job_id(spec: JobSpec, houses: Iterable[HouseEntry]) -> str:
    """The id of a job: equal for equal work, so that submitting twice is submitting once."""
    work = spec.model_dump(mode="json", exclude=_NOT_WORK)
    work["recipe"] = spec.recipe.digest()
    return keys.digest(work, [[h.house_id, h.sha256] for h in houses])[:12]


def lines_from_houses(houses: Iterable[HouseEntry]) -> bytes:
    """houses.jsonl: a house a line, in the job's order."""
    return "".join(house.model_dump_json() + "\n" for house in houses).encode()


def houses_from_lines(data: bytes) -> Iterator[HouseEntry]:
    """The houses of a houses.jsonl."""
    for line in data.splitlines():
        yield HouseEntry.model_validate_json(line)
