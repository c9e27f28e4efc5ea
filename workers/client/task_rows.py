"""State of a task, and its obstacle if it does not run. Effects: reads the ledger."""

from __future__ import annotations

import json
from typing import Any

from pbrs_farm.core.errors import BadInput
from workers.ids import LIGHT, LIGHT_GPU, WHOLE, TaskId, queue_of, task_from_text
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import ALIVE_S, STATES, JobView, hold_from_text
from workers.ledger.worker_registry import Registry

_TEXTS = {letter: name.lower() for name, letter in STATES.items()} | {
    STATES["LOADED"]: "waiting: its house is not admitted yet",
    STATES["FAILED"]: "failed permanently",
}
# States that may have an obstacle.
_WAITING = {_TEXTS[STATES[name]] for name in ("LOADED", "READY", "QUEUED")}


def explain_tasks(
    ledger: RedisLedger, registry: Registry, view: JobView, text: str
) -> list[dict[str, Any]]:
    """A row per task of a task's, house's or view's name, () for an unknown house; BadInput."""
    house, _, rest = text.partition("/")
    states = ledger.unit_states(view.job_id, house)
    batches = ledger.batches(view.job_id, house)
    # The house's hash holds other fields beside its units.
    units = {u: now for u, now in states.items() if u == WHOLE or u.isdigit() or u[:1] == "s"}
    units = {u: now for u, now in units.items() if ":" in now}
    unit = rest.partition("/")[0]
    # A view names the batch that holds it.
    if states and unit and unit not in units:
        holding = [str(k) for k, views in enumerate(batches) if unit in views]
        if not holding:
            raise BadInput(text, "", "the job has no such task or view")
        units = {holding[0]: units[holding[0]]}
    elif unit:
        units = {u: now for u, now in units.items() if u == unit}
    rows = [
        _row_of_task(ledger, view.job_id, house, u, now, batches)
        for u, now in sorted(units.items())
    ]
    for row in rows:
        if "worker" in row:
            row |= _facts_of_holder(ledger, registry, view, row)
        if row["state"] in _WAITING and (obstacle := _obstacle(registry, view, row["task"])):
            row["because"] = obstacle
    return rows


def _row_of_task(
    ledger: RedisLedger,
    job: str,
    house: str,
    unit: str,
    at: str,
    batches: tuple[tuple[str, ...], ...],
) -> dict[str, Any]:
    # Say the state, then what the ledger knows of the attempt.
    stage, _, letter = at.partition(":")
    task = str(TaskId(house, unit, stage))
    facts = ledger.task_facts(job, task)
    row: dict[str, Any] = {"task": task, "state": _TEXTS.get(letter, letter)}
    if unit.isdigit():
        row["views"] = list(batches[int(unit)])
    # Ready, but only after a delay.
    if letter == STATES["READY"] and "not_before" in facts:
        row["state"] = "waits before the next attempt"
    if "claim" in facts:
        hold = hold_from_text(job, task, facts["claim"])
        row["worker"], row["for_s"] = hold.worker, round(ledger.now() - hold.since, 1)
        if hold.is_preempted:
            row["state"] += ", is interrupted for an urgent job"
    row |= {name: facts[name] for name in ("attempts", "tried") if name in facts}
    if "fault" in facts:
        row["fault"] = json.loads(facts["fault"])
    return row


def _facts_of_holder(
    ledger: RedisLedger, registry: Registry, view: JobView, row: dict[str, Any]
) -> dict[str, Any]:
    """Remaining lease of a running task, and time since its worker's last heartbeat."""
    stage = task_from_text(row["task"]).stage
    # Light on a GPU has another lease time.
    gpu = stage == LIGHT and view.uses_gpu
    left_s = ledger.lease_left_s(view.job_id, row["task"], LIGHT_GPU if gpu else stage)
    ages = {w.name: w.age_s for w in registry.workers()}
    facts: dict[str, Any] = {} if left_s is None else {"lease_s": round(max(0.0, left_s), 1)}
    age_s = ages.get(row["worker"])
    if age_s is None or age_s > ALIVE_S:
        facts["silent_s"] = None if age_s is None else round(age_s, 1)
    return facts


def _obstacle(registry: Registry, view: JobView, task: str) -> str:
    """Why a task that could run does not: the job, storage or the workers; "" for its turn."""
    if view.state == "running" and view.blocked_queues:
        return f"blocked: {view.blocked_why}"
    if view.state != "running":
        return f"the job is {view.state}: {view.fields.get('reason', '')}".rstrip(": ")
    if reason := registry.breaker():
        return f"storage is unhealthy: {reason}"
    # Then the workers: none takes its queue, or all are leaving.
    queue = queue_of(task_from_text(task).stage, gpu=view.uses_gpu)
    takers = [
        w
        for w in registry.workers()
        if w.age_s <= ALIVE_S and queue in w.fields.get("queues", "").split(",")
    ]
    if not takers:
        return f"no worker serves {queue}"
    store = view.fields.get("store_id", "")
    if store and all(w.fields.get("store_id", store) not in (store, "") for w in takers):
        return f"all workers for {queue} use another store"
    if all(w.fields.get("drain") == "1" for w in takers):
        return f"all workers for {queue} are stopping"
    return ""


def rerun_command(job: str, task: str) -> str:
    """`pbrs-farm rerun ...` of the task, as a shell takes it: neither id holds a special character."""
    return f"pbrs-farm rerun {task} --job {job}"
