"""Job specifications and the storage keys of a job's objects; frozen values, no effects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from pydantic import ConfigDict, Field

from pbrs_farm.core import keys
from pbrs_farm.core.options import option
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.core.record import Record
from pbrs_farm.run.request import ModelsOption, Request, Wanted
from pbrs_farm.store import Store
from pbrs_farm.store.pack import FORMAT
from workers.ids import DEFAULT_PRIORITY, GL, LEAST_URGENT, LIGHT, job_key


@cache
def work_version() -> str:
    """Version of the results of this installation: workers with equal versions make equal results.

    It derives from the versions of the steps and of the passes of a house, not of the package: an upgrade that changes
    no stored byte changes nothing here, and a running job continues.
    """
    from pbrs_farm.prepare.passes import versions_of_passes
    from pbrs_farm.run import plan

    steps = {name: step.version for name, step in plan.STEPS.items()}
    # Workers with another root layout would not find the results of others.
    return keys.digest(steps, versions_of_passes(), FORMAT)[:12]


class HouseEntry(Record):
    """A house of a job: its id, which is a folder of the store, and its source as text for the runner."""

    house_id: str
    source: str = ""  # JSON the runner understands; it travels to the geometry task only
    sha256: str = ""  # of the source: a house that changed since submission is noticed


class JobRules(Record):
    """When to give up on a task, a house, a job."""

    max_attempts: int = Field(3, ge=1)
    failed_share: float = Field(0.5, description="of failed batches; more quarantines the house")
    max_quarantined: int = Field(20, ge=1, description="minimum of houses to pause the job")
    quarantined_share: float = Field(0.2, description="of closed houses; more pauses the job")
    max_same_failure: int = Field(50, ge=1, description="equal failures; as many pause the job")
    shard_size: int = Field(500, ge=1, description="houses that one task merges")


class FarmOptions(Record):
    """How the farm does a job: options of `submit`, entries of job.toml, fields of its JobSpec."""

    gpu: bool = option(False, "render light on GPU workers (queue light.gpu)")
    priority: int = option(
        DEFAULT_PRIORITY,
        f"0 runs first, {LEAST_URGENT} last (default {DEFAULT_PRIORITY})",
        ge=0,
        le=LEAST_URGENT,
        choices=tuple(range(LEAST_URGENT + 1)),
    )
    max_slots: int = option(
        0, "maximum simultaneous tasks (default 0: all slots)", ge=0, metavar="N", least=0
    )
    budget_h: float = option(
        0.0,
        "pause the job after this many slot-hours (default 0: no limit)",
        ge=0,
        name="budget",
        metavar="HOURS",
        least=0,
        expected="slot-hours, 0 or more",
    )
    after: tuple[str, ...] = option((), "start when this job is done, repeatable", metavar="JOB")
    preempt: bool = option(
        False, "urgent: interrupt tasks of other jobs; they lose nothing and resume later"
    )


class FarmAccess(Record):
    """Options of submit shared by all verbs of the farm (commands/arguments.py:add_farm)."""

    store: str = option("", "store of the farm (default: $PBRS_STORE)", metavar="URL")
    as_json: bool = option(False, "print JSON", name="json")


class _HousesOption(Record):
    houses: str | None = option(
        None, "file with one SUNCG house id per line; HOME is their root folder", metavar="LIST"
    )


class _ReferenceOption(Record):
    reference: Path | None = option(None, "select views by this reference file when the job ends")


class SubmitRequest(
    FarmOptions, _ReferenceOption, Request, ModelsOption, _HousesOption, FarmAccess
):
    """Inputs of `submit` besides the words of homes, from its options or a job's file."""

    like: str = option(
        "", "use the options of this job.toml for the homes of the command", metavar="FILE"
    )
    part: str = option("", "part to render, for a data set with several", metavar="NAME")
    update: bool = option(False, "if the store has another recipe, replace it")
    dry_run: bool = option(False, "print tasks, hours and storage; submit nothing")
    slots: int = option(2, "for --dry-run: number of slots (default 2)", least=1)


class JobSpec(FarmOptions, Wanted):
    """Everything a job is made with except its houses; stored as jobs/<id>/job.json."""

    model_config = ConfigDict(validate_by_name=True, serialize_by_alias=True)
    job_id: str
    version: str  # work_version of who submitted or adopted it
    versions_before: tuple[str, ...] = ()  # by which it was worked on before it was adopted
    recipe: Recipe
    user: str = Field("", description="owner of the job; empty on a farm without users")
    batch_stages: tuple[str, ...] = Field((GL, LIGHT), alias="group_stages")
    seconds_per_view: float = Field(20.0, gt=0, description="expected, of light; sizes the batches")
    min_batches: int = Field(
        1, ge=1, alias="min_groups", description="approximate, per house; by slots at submission"
    )
    reference: str = Field("", description="key of the selection's reference; empty = none")
    rules: JobRules = JobRules()
    n_houses: int = 0


# Fields of a job's entry that do not affect its results.
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
    """The id of a job: equal for equal work, so that submitting twice is submitting once.

    spec: its own job_id may be anything; who submits, priority, limits and the like do not count.
    The order of the houses does. 12 hex digits of a sha256.
    """
    work = spec.model_dump(mode="json", exclude=_NOT_WORK)
    work["recipe"] = spec.recipe.digest()
    return keys.digest(work, [[h.house_id, h.sha256] for h in houses])[:12]


def lines_from_houses(houses: Iterable[HouseEntry]) -> bytes:
    """houses.jsonl: a house a line in the job's order, by which shards are cut."""
    return "".join(house.model_dump_json() + "\n" for house in houses).encode()


def stored_houses(store: Store, job: str) -> Iterator[HouseEntry]:
    """The houses of a stored job, in its order."""
    return houses_from_lines(store.get(job_key(job, "houses.jsonl")))


def houses_from_lines(data: bytes) -> Iterator[HouseEntry]:
    """The houses of a houses.jsonl, one by one; ValidationError for an invalid line."""
    for line in data.splitlines():
        yield HouseEntry.model_validate_json(line)
