"""Drives a ledger by hand, in place of a coordinator and workers, without Celery."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

from tests.workers.conftest import JOB_ID, spec
from workers.config import FarmConfig
from workers.ids import STAGES
from workers.job import HouseEntry, JobSpec
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import Claim, Fault, FaultClass, Finished

ROOM = dict.fromkeys(STAGES, 100)
BATCHES = (("a", "b"), ("c",))


@dataclass
class Drive:
    """A job of n houses in a ledger, with a leader and methods that act as any worker."""

    ledger: RedisLedger
    job: JobSpec
    leader: str = "leader"
    ran: Counter[str] = field(default_factory=Counter)

    def dispatch(self) -> list[str]:
        assert self.ledger.lead(self.leader)
        tasks = self.ledger.dispatch(self.job.job_id, self.leader, max_open=100, room=ROOM)
        assert tasks is not None
        return tasks

    def claim(self, task: str, worker: str = "w1", *, direct: bool = False) -> Claim:
        config = replace(self.ledger.config, worker=worker)
        worker_ledger = RedisLedger(config, self.ledger.client)
        return worker_ledger.claim(
            self.job.job_id, task, token=f"{worker}:{task}:{self.ran[task]}",
            recipe=self.job.recipe.digest(), direct=direct,
        )  # fmt: skip

    def run(self, task: str, batches: tuple[tuple[str, ...], ...] = BATCHES) -> None:
        """Claim the task and finish it without a fault."""
        claim = self.claim(task)
        assert claim.verdict == "run", (task, claim)
        self.ran[task] += 1
        self.finish(task, claim, batches)

    def finish(
        self, task: str, claim: Claim, batches: tuple[tuple[str, ...], ...] = BATCHES
    ) -> None:
        stage = task.rpartition("/")[2]
        end = Finished(1.0, batches if stage == "geometry" else (), 1)
        self.ledger.finish_many(self.job.job_id, {task: end}, claim.token)

    def fail(self, task: str, claim: Claim, kind: FaultClass = "crash", worker: str = "w1") -> str:
        fault = Fault(fault=kind, fingerprint=kind, message=kind, worker=worker)
        config = replace(self.ledger.config, worker=worker)
        worker_ledger = RedisLedger(config, self.ledger.client)
        return worker_ledger.fail(self.job.job_id, task, claim.token, fault, delay_s=0.0)

    def run_all(self) -> None:
        """Dispatch and run until no task is left."""
        while tasks := self.dispatch():
            for task in tasks:
                self.run(task)

    @property
    def counts(self) -> dict[str, float]:
        view = self.ledger.view(self.job.job_id)
        assert view is not None
        return {k: v for k, v in view.counts.items() if v}

    @property
    def state(self) -> str:
        view = self.ledger.view(self.job.job_id)
        assert view is not None
        return view.state


def drive(
    ledger: RedisLedger, n_houses: int, *, gpu: bool = False, job_id: str = JOB_ID, **rules: object
) -> Drive:
    """A submitted job of houses h0, h1, ..."""
    job = spec(n_houses, job_id, **rules).model_copy(update={"gpu": gpu})
    assert ledger.create(job) == ""
    ledger.add_houses(
        job.job_id, 0, [HouseEntry(house_id=f"h{k}", source="{}") for k in range(n_houses)]
    )
    ledger.open(job.job_id, job.priority)
    return Drive(ledger, job)


def with_config(ledger: RedisLedger, **changes: object) -> RedisLedger:
    config: FarmConfig = replace(ledger.config, **changes)  # type: ignore[arg-type]
    return RedisLedger(config, ledger.client)
