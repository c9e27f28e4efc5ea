"""Registry of workers (heartbeats, draining) and the storage breaker, in Redis for the ledger's scripts."""

from __future__ import annotations

import os
from collections.abc import Mapping

import pbrs_farm
from pbrs_farm.core.plugins import installed_marks
from pbrs_farm.run.processes.limits import machine_mb
from workers.config import shown_url
from workers.ids import QUEUES, stages_of_queue
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import ALIVE_S, WorkerView

_GONE_S = 3600.0  # a worker not seen for so long is forgotten
_DRAINED_S = 30 * 86400  # a drained worker that comes back within so long stays drained


class Registry:
    """Workers of the farm, and the health of storage, on the ledger's Redis.

    A worker calls `heartbeat` every ten seconds and `leave` when it ends; whoever was not seen for ALIVE_S counts
    as dead, and for an hour is forgotten. `drain` outlasts a restart under the same name. Every
    method raises LedgerUnavailable.
    """

    def __init__(self, ledger: RedisLedger) -> None:
        self._ledger = ledger
        self._g = ledger.config.prefix

    def heartbeat(
        self, *, takes_work: bool = True, is_leaving: bool = False, memory_mb: float = 0.0
    ) -> bool:
        """Send a heartbeat; True if the worker is asked to leave.

        takes_work: False while it is drained and waits to be asked back; it has no slot then.
        is_leaving: it takes no more tasks and finishes the running ones.
        memory_mb: current memory of its processes, 0 if unknown.
        """
        config, client = self._ledger.config, self._ledger.client
        key = f"{self._g}worker:{config.worker}"
        # One round trip: be seen, as a worker and for each stage; then read the order to leave.
        now = self._ledger.now()
        pipe = client.pipeline(transaction=False)
        pipe.zadd(f"{self._g}workers", {config.worker: now})
        queues = (config.queues or QUEUES) if takes_work and not is_leaving else ()
        taken = {s for q in queues for s in stages_of_queue(q)}
        for stage in taken:
            pipe.zadd(f"{self._g}workers:{stage}", {config.worker: now})
        for stage in {s for q in QUEUES for s in stages_of_queue(q)} - taken:
            pipe.zrem(f"{self._g}workers:{stage}", config.worker)
        fields: Mapping[str, str | int] = {
            "slots": config.slots if queues else 0,
            "leaving": int(is_leaving),
            "queues": ",".join(queues),
            "store": shown_url(config.store_url),
            "store_id": config.store_id,
            "version": pbrs_farm.__version__,
            "plugins": "\n".join(installed_marks()),
            "pid": os.getpid(),
            "memory_mb": round(memory_mb),
            "machine_mb": round(machine_mb()),
        }
        pipe.hset(key, mapping=dict(fields))
        pipe.expire(key, int(2 * _GONE_S))
        pipe.exists(self._drained(config.worker))
        pipe.hget(key, "drain")
        *_, was_drained, drain = pipe.execute()
        # The order outlives the worker's own fields, which go when it leaves.
        if was_drained and drain != "1":
            client.hset(key, "drain", "1")
        return bool(was_drained)

    def leave(self) -> None:
        """Remove this worker, whose tasks have ended, from the registry."""
        config, client = self._ledger.config, self._ledger.client
        for name in ("workers", *(f"workers:{s}" for q in QUEUES for s in stages_of_queue(q))):
            client.zrem(f"{self._g}{name}", config.worker)
        client.delete(f"{self._g}worker:{config.worker}")

    def drain(self, worker: str, *, undo: bool = False) -> bool:
        """Ask a worker, even after a restart, to finish and leave (undo: no more); False for an unknown one."""
        client, drained = self._ledger.client, self._drained(worker)
        is_there = client.zscore(f"{self._g}workers", worker) is not None
        # One that has left can be asked back before its machine starts it again.
        if not is_there and not (undo and client.exists(drained)):
            return False
        if undo:
            client.delete(drained)
        else:
            client.set(drained, "1", ex=_DRAINED_S)
        if is_there:
            client.hset(f"{self._g}worker:{worker}", "drain", "0" if undo else "1")
        return True

    def is_drained(self) -> bool:
        """Whether this worker was asked to leave, in this life or an earlier one of its name."""
        return bool(self._ledger.client.exists(self._drained(self._ledger.config.worker)))

    def _drained(self, worker: str) -> str:
        return f"{self._g}drained:{worker}"

    def note_rejection(self, reason: str) -> None:
        """Show in `workers` and `status` that this worker rejected a job of another version."""
        key = f"{self._g}worker:{self._ledger.config.worker}"
        self._ledger.client.hset(key, mapping={"refuses": reason})

    def workers(self) -> list[WorkerView]:
        """Every worker, dead ones too, seen in the last hour, by name; `age_s` is by Redis' clock."""
        client = self._ledger.client
        now = self._ledger.now()
        # Forget who is gone, then read everybody in one round trip.
        client.zremrangebyscore(f"{self._g}workers", "-inf", now - _GONE_S)
        rows = client.zrange(f"{self._g}workers", 0, -1, withscores=True)
        pipe = client.pipeline(transaction=False)
        for name, _seen_at in rows:
            pipe.hgetall(f"{self._g}worker:{name}")
        fields = pipe.execute()
        return sorted(
            (
                WorkerView(name, now - seen_at, row)
                for (name, seen_at), row in zip(rows, fields, strict=True)
            ),
            key=lambda worker: worker.name,
        )

    def slots(self) -> dict[str, int]:
        """Stage -> maximum concurrent tasks of live workers, a slot counted for each of its stages."""
        # A worker's slots serve every stage of every queue it takes.
        slots: dict[str, int] = {}
        for worker in self.workers():
            if worker.age_s <= ALIVE_S:
                for queue in worker.fields.get("queues", "").split(","):
                    for stage in stages_of_queue(queue):
                        slots[stage] = slots.get(stage, 0) + int(worker.fields.get("slots", 1))
        return slots

    def open_breaker(self, reason: str) -> None:
        """Storage is unhealthy: stop claims and messages for a period; reason: cut to 300 characters."""
        self._ledger.client.set(f"{self._g}breaker", reason[:300], ex=self._ledger.config.breaker_s)

    def breaker(self) -> str:
        """Why nothing is claimed or sent, "" while storage is healthy."""
        return str(self._ledger.client.get(f"{self._g}breaker") or "")
