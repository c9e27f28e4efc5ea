"""Teams on a farm of real processes: urgent jobs, budgets, quotas and shares, while tasks run."""

from __future__ import annotations

import time

import pytest

from tests.inputs.farm_processes import note
from tests.workers.small_farm import SmallFarm
from workers.client.users import add_user, change_user

pytestmark = pytest.mark.chaos


def holders(farm: SmallFarm, job: str) -> set[str]:
    """The slots that hold tasks of a job."""
    return {hold.token for hold in farm.farm.ledger.holds(job)}


def begin(farm: SmallFarm, slow_s: float) -> None:
    (farm.control / "slow").write_text(str(slow_s))
    farm.coordinator()
    farm.worker("w1")
    farm.worker("w2")


def wait_all(farm: SmallFarm, *jobs: str) -> None:
    def done() -> bool:
        return all(farm.farm.view(job).state == "done" for job in jobs)

    farm.wait(done, 120, "all jobs are done")
    assert farm.objects() == farm.expected()
    for job in jobs:
        assert not any(k.startswith(("failures:", "failed:")) for k in farm.farm.view(job).counts)


def test_an_urgent_job_takes_the_slots_of_running_tasks_which_count_no_failure(
    farm: SmallFarm,
) -> None:
    begin(farm, 0.05)
    calm = farm.submit(4)
    farm.wait(lambda: farm.farm.view(calm).counts.get("done:gl", 0) > 2, 60, "views are made")
    (farm.control / "slow").write_text("60")
    farm.wait(lambda: len(holders(farm, calm)) == 2, 30, "both slots are busy")
    time.sleep(1.0)
    (farm.control / "slow").write_text("0.05")
    began = time.monotonic()
    urgent = farm.submit(2, "u", preempt=True)
    farm.wait_done(40)
    seconds = time.monotonic() - began
    assert seconds < 30  # a task of the normal job would have held its slot for a minute
    view = farm.farm.view(calm)
    assert view.counts["handed_back:preempted"] >= 2
    wait_all(farm, calm, urgent)
    note("an urgent job (seconds: until it was done)", farm, 2, seconds)


def test_a_budget_pauses_a_job_under_load_and_more_of_it_ends_the_job(farm: SmallFarm) -> None:
    begin(farm, 0.2)
    job = farm.submit(8, budget_h=3 / 3600)
    farm.wait(lambda: farm.state() == "paused", 60, "its budget is spent")
    assert "budget" in farm.farm.view(job).fields["reason"]
    farm.wait(lambda: farm.running() == 0, 20, "what ran has ended")
    spent_s = 3600 * farm.farm.view(job).spent_h
    # A slot reports finished tasks each five seconds, and ends its claimed tasks.
    assert 3 <= spent_s < 12
    n = sum(farm.starts().values())
    time.sleep(2)
    assert sum(farm.starts().values()) == n
    farm.farm.limit(job, budget_h=0)
    farm.farm.resume(job)
    farm.wait_done(60)
    note("a budget, then more of it", farm, farm.check_complete(n_repeats=0), 0.0)


def test_quotas_of_slots_and_slot_hours_hold_back_only_their_user(farm: SmallFarm) -> None:
    root = add_user(farm.farm, "root", {})
    admin = farm.farm.acting_as(farm.farm.users.all()["root"], "here")
    ann = add_user(admin, "ann", {"max_slots": 1, "slot_hours": 4 / 3600})
    bob = add_user(admin, "bob", {})
    begin(farm, 0.2)
    hers = farm.submit(4, "a", ann)
    seen = 0
    held = ""

    def is_held_back() -> bool:
        nonlocal seen, held
        seen = max(seen, len(holders(farm, hers)))
        held = farm.farm.status(hers)["held_back"]
        return "slot-hours" in held

    farm.wait(is_held_back, 60, "ann's slot-hours are spent")
    assert seen == 1
    assert held.startswith("ann has used")
    farm.wait(lambda: not holders(farm, hers), 20, "what ran has ended")
    his = farm.submit(4, "b", bob)
    farm.wait_done(60)
    assert farm.farm.view(hers).state == "running"
    assert not holders(farm, hers)
    change_user(admin, "ann", {"slot_hours": 0.0, "max_slots": 0})
    wait_all(farm, hers, his)
    assert [row["user"] for row in farm.farm.users.changes(9)].count("root") == 3
    assert root not in repr(farm.farm.users.all())


def test_a_late_user_gets_his_share_of_the_slots(farm: SmallFarm) -> None:
    add_user(farm.farm, "root", {})
    admin = farm.farm.acting_as(farm.farm.users.all()["root"], "here")
    ann, bob = (add_user(admin, name, {}) for name in ("ann", "bob"))
    begin(farm, 0.3)
    hers = farm.submit(20, "a", ann)
    farm.wait(lambda: farm.farm.view(hers).counts.get("done:gl", 0) > 4, 60, "views are made")
    his = farm.submit(6, "b", bob)
    began = time.monotonic()
    farm.wait(lambda: bool(holders(farm, his)), 30, "bob's job begins")
    first_s = time.monotonic() - began
    n_before = farm.starts().total()
    farm.wait(lambda: farm.farm.view(his).state == "done", 90, "bob's job is done")
    # Until his last view has begun: the later merges hold no slot, and leave both to ann.
    starts = (farm.control / "starts").read_text().splitlines()[n_before:]
    users = "".join(task[0] for task in starts if task[0] in "ab").rpartition("b")
    share = (users[0].count("b") + 1) / (len(users[0]) + 1)
    note(f"a second user, {share:.2f} of the tasks his (seconds: until he began)", farm, 0, first_s)
    assert 0.35 < share < 0.75
    assert farm.farm.view(hers).state == "running"
    wait_all(farm, hers, his)
