"""The ledger in Redis: every change is one Lua script, so it happens whole or not at all.

Effects: Redis. All keys begin with the farm's prefix; a job's keys share a {job} hash tag. The
scripts name keys they compute, so a Redis Cluster will not do; one Redis with a replica will.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import redis
from redis.backoff import ExponentialWithJitterBackoff
from redis.retry import Retry

from workers.config import FarmConfig, shown_url
from workers.ids import LIGHT_GPU, POOLS, STAGES
from workers.ledger.redis_connections import ANSWER_S, BY_SCHEME, RefusedForNow
from workers.ledger.task_ledger import (
    ALIVE_S,
    EVERYWHERE,
    MOST_TOGETHER,
    STATES,
    SUSPECT,
    TOGETHER_S,
    UNCOUNTED,
    Claim,
    Fault,
    Finished,
    GoOn,
    Hold,
    HouseState,
    JobView,
    LedgerUnavailable,
    batches_from_text,
    fault_from_json,
    hold_from_text,
    text_from_batches,
)

if TYPE_CHECKING:
    from workers.job import HouseEntry, JobSpec

T = TypeVar("T")
_log = logging.getLogger("pbrs.ledger")
_AWAY_S: Final = 2.0  # between two tries to reach a Redis that is not there yet
_SCRIPTS: Final = (
    "claim", "heartbeat", "finish", "fail", "reap", "dispatch", "resend", "create", "load",
    "retry", "steer", "lead", "preempt",
)  # fmt: skip
_CHUNK: Final = 1000  # keys or houses in one round trip
_LEAD_S: Final = 15
_REAP_MOST: Final = 200  # in one script, which nobody else can interrupt
_RESEND_MOST: Final = 500


@contextmanager
def _errors(where: str) -> Iterator[None]:
    """Refusals and failures of Redis become LedgerUnavailable; bugs pass through."""
    try:
        yield
    # From the special to the general.
    except redis.AuthenticationError as error:
        raise LedgerUnavailable(f"{where} rejects these credentials: {error}") from error
    except redis.exceptions.NoPermissionError as error:
        raise LedgerUnavailable(f"{where} denies: {error}") from error
    except RefusedForNow as error:
        is_full = error.prefix == "OOM"
        hint = "raise maxmemory" if is_full else "wait, or see the log of Redis"
        # Redis 6 writes the script and its line before the prefix.
        text = error.prefix + str(error).partition(error.prefix)[2]
        raise LedgerUnavailable(f"{where} refused: {text}", hint=hint) from error
    except (redis.ConnectionError, redis.TimeoutError) as error:
        hint = "is it running? see PBRS_REDIS_URL"
        raise LedgerUnavailable(f"no Redis at {where}: {error}", hint=hint) from error


class _Pipeline(redis.client.Pipeline):
    """redis-py's pipeline, which raises LedgerUnavailable."""

    where = ""  # its URL without secrets

    def execute(self, raise_on_error: bool = True) -> list[Any]:
        with _errors(self.where):
            return list(super().execute(raise_on_error))


class _Client(redis.Redis):
    """redis-py's client, which raises LedgerUnavailable."""

    where = ""

    def execute_command(self, *args: Any, **options: Any) -> Any:
        with _errors(self.where):
            return super().execute_command(*args, **options)  # type: ignore[no-untyped-call]

    def pipeline(self, transaction: bool = True, shard_hint: Any = None) -> _Pipeline:
        pipe = _Pipeline(self.connection_pool, self.response_callbacks, transaction, shard_hint)
        pipe.where = self.where
        return pipe


def redis_client(config: FarmConfig) -> Any:
    """A client that retries lost connections and passing refusals for seconds, but no timeout. Typed Any.

    Where Redis is away or refuses it raises LedgerUnavailable.
    """
    url = config.redis_url.reveal()
    scheme = url.partition(":")[0]
    kind = {"connection_class": BY_SCHEME[scheme]} if scheme in BY_SCHEME else {}
    # TLS with a checked certificate, or none at all.
    ca = {"ssl_ca_certs": config.redis_ca} if config.redis_ca else {}
    tls: dict[str, Any] = {"ssl_cert_reqs": "required", **ca} if url.startswith("rediss:") else {}
    client: Any = _Client.from_url(
        url,
        decode_responses=True,
        socket_timeout=ANSWER_S,
        socket_connect_timeout=5,
        socket_keepalive=True,
        health_check_interval=25,
        retry=Retry(ExponentialWithJitterBackoff(cap=2.0, base=0.05), 5, (redis.ConnectionError,)),
        client_name="pbrs-ledger",
        **kind,
        **tls,
    )
    client.where = shown_url(url)
    return client


def lua_constants() -> str:
    """Constants shared by Lua and Python, as the first lines of every script."""
    lines = [f"local {name} = '{letter}'" for name, letter in STATES.items()]
    lines += [f"local {name.upper()}_STAGE = '{name}'" for name in STAGES]
    lines += [f"local STAGES = {{ {', '.join(f'{s!r}' for s in STAGES)} }}"]
    for name, classes in (("UNCOUNTED", UNCOUNTED), ("SUSPECT", SUSPECT)):
        lines += [f"local {name} = {{ {', '.join(f'{c} = true' for c in classes)} }}"]
    return "\n".join(
        [
            *lines,
            f"local ALIVE_S = {ALIVE_S:g}",
            f"local MOST_TOGETHER = {MOST_TOGETHER}",
            f"local GPU_LEASE = '{LIGHT_GPU}'",
            f"local EVERYWHERE = '{EVERYWHERE}'",
            "",
        ]
    )


def script_text(name: str) -> str:
    """A script with what all share before it; whatever it does is written when it is over."""
    folder = Path(__file__).with_name("lua")
    common, body = ((folder / f"{n}.lua").read_text("utf-8") for n in ("common", name))
    main = f"local function main()\n{body}end\nlocal answer = main()\nflush()\nreturn answer\n"
    return lua_constants() + common + main


class RedisLedger:
    """Which task may run, who runs it, how often it was tried, what follows it; one per process, safe after a fork.

    A task's life: `dispatch` takes it from the outbox and its message is sent; a slot asks for it by
    `claim_many`, keeps its lease by `heartbeat`, and ends it by `finish_many` or `fail`. Leases that are not
    kept end by `reap`, and the task is tried elsewhere. Results are in the store, from which `recover` rebuilds
    a lost ledger. Every method may be called again after a lost answer.

    The client, and so all methods, raise LedgerUnavailable where Redis is away, refuses for now or refuses the
    password. Each change is one Lua script (ledger/lua), whole or not at all; `common.lua` lists the keys. Times
    are Redis'.

    client: a redis-py client that decodes its answers; made from the configuration by default.
    """

    def __init__(self, config: FarmConfig, client: Any = None) -> None:
        self.config = config
        self.client = client or redis_client(config)
        self._g = config.prefix
        self._scripts: dict[str, Any] = {
            name: self.client.register_script(script_text(name)) for name in _SCRIPTS
        }

    # The job

    def create(self, spec: JobSpec, store_id: str = "") -> str:
        """Make the job, in the store of that id, unless it exists; its state before, "" if made now."""
        # The fields that scripts read; the rest of the spec stays in storage.
        rules = spec.rules
        fields: dict[str, object] = {
            "version": spec.version,
            "recipe": spec.recipe.digest(),
            "recipe_name": spec.recipe.name,
            "store_id": store_id,
            "stages": ",".join(spec.batch_stages),
            "priority": spec.priority,
            "gpu": int(spec.gpu),
            "max_slots": spec.max_slots,
            "budget_h": spec.budget_h,
            "after": ",".join(spec.after),
            "user": spec.user,
            "preempt": int(spec.preempt),
            "max_attempts": rules.max_attempts,
            "failed_share": rules.failed_share,
            "max_quarantined": rules.max_quarantined,
            "quarantined_share": rules.quarantined_share,
            "max_same_failure": rules.max_same_failure,
        }
        flat = [x for pair in fields.items() for x in pair]
        return str(self._run("create", spec.job_id, spec.n_houses, rules.shard_size, *flat))

    def add_houses(self, job: str, first: int, houses: Sequence[HouseEntry]) -> None:
        """Append fresh houses to the job's order; `first` is the index of the first of them.

        The caller increments `first` from call to call, unchecked; repeating a call adds the houses twice. For a
        loading job: `open` follows.
        """
        p = self._p(job)
        # Chunks bound the size of a transaction, which blocks Redis while it runs.
        for start in range(0, len(houses), _CHUNK):
            chunk = houses[start : start + _CHUNK]
            pipe = self.client.pipeline(transaction=True)
            pipe.rpush(
                f"{p}order", *(f"{first + start + k}|{h.house_id}" for k, h in enumerate(chunk))
            )
            sources = {h.house_id: h.source for h in chunk if h.source}
            if sources:
                pipe.hset(f"{p}sources", mapping=sources)
            pipe.execute()

    def load_houses(self, job: str, houses: Iterable[HouseState]) -> int:
        """Enter new houses with their progress in storage, in order, for `recover`; their number."""
        # Many calls in one round trip; each script is one house, and atomic.
        n_new = 0
        script, keys = self._scripts["load"], self._keys(job)
        for chunk in _in_chunks(houses):
            pipe = self.client.pipeline(transaction=False)
            for house in chunk:
                units = [x for u, unit_state in house.units.items() for x in (u, *unit_state)]
                state = "done" if house.done else "loaded"
                batches = text_from_batches(house.batches)
                args = [house.index, house.house_id, state, batches, *units]
                script(keys=keys, args=args, client=pipe)
            n_new += sum(pipe.execute())
        return n_new

    def open(self, job: str, priority: int) -> None:
        """The job is loaded and may be dispatched, 0 first: the last call of making a job."""
        pipe = self.client.pipeline(transaction=True)
        pipe.hset(f"{self._p(job)}job", "state", "running")
        pipe.zadd(f"{self._g}jobs", {job: priority})
        pipe.zadd(f"{self._g}known", {job: self.now()})
        pipe.lpush(f"{self._g}notify", "1")
        pipe.execute()

    def forget(self, job: str) -> None:
        """Remove an ended job from the ledger, by a slow scan that blocks nobody; storage stays."""
        self.client.zrem(f"{self._g}jobs", job)
        self.client.zrem(f"{self._g}known", job)
        # The farm's leases of this job, then all its own keys.
        for name in POOLS:
            key = f"{self._g}lease:{name}"
            members = self.client.zscan_iter(key, match=f"{job}|*")
            for member, _score in members:
                self.client.zrem(key, member)
        for own_keys in _in_chunks(self.client.scan_iter(f"{self._p(job)}*", count=_CHUNK)):
            self.client.unlink(*own_keys)

    def steer(self, job: str, what: str, reason: str = "") -> str:
        """pause, resume, cancel, reduce, or a field and its number; the state, "" if unknown."""
        return str(self._run("steer", job, what, reason))

    def retry(self, job: str, task: str) -> bool:
        """Fresh attempts for a task that failed for good (else False), its house, merges and job open again."""
        return bool(self._run("retry", job, task))

    # One task

    def claim_many(
        self, job: str, tasks: Sequence[str], *, token: str, recipe: str, direct: bool = False
    ) -> list[Claim]:
        """Claim tasks for this worker: a verdict each; attempts are counted before the answer.

        tasks: of one job, "<house>/<unit>/<stage>". token: identifies this claim; heartbeat and finish must present
        it. recipe: digest of this worker's recipe. direct: also tasks without a message. Verdicts other than "run"
        change nothing, except that a task may be sent again later; docs/farm/inside.md has a table of verdicts. A
        task that failed before is claimed alone, since it may crash others claimed with it.
        """
        from workers.job import work_version

        config = self.config
        answers = self._run(
            "claim", job, token, config.worker, work_version(), recipe, config.lease_s,
            int(direct), config.store_id, *tasks,
        )  # fmt: skip
        return [Claim(verdict, detail, inputs, token) for verdict, detail, inputs in answers]

    def claim(self, job: str, task: str, *, token: str, recipe: str, direct: bool = False) -> Claim:
        """claim_many of one task, which takes all tasks of a message in one round trip."""
        return self.claim_many(job, [task], token=token, recipe=recipe, direct=direct)[0]

    def heartbeat(self, job: str, tasks: Sequence[str], token: str) -> str:
        """Keep the leases: ok, lost, cancelled or preempted (for an urgent job), of the first that is not."""
        return str(self._run("heartbeat", job, token, self.config.lease_s, *tasks))

    def finish_many(
        self, job: str, ends: Mapping[str, Finished], token: str, go_on: GoOn | None = None
    ) -> dict[str, Claim]:
        """Mark tasks as done; their successors become ready. Returns the newly claimed tasks of the last one's house.

        A lost lease does not matter: the results are in the store. go_on: claim more immediately, if others have
        enough work, or if the house's scene is loaded.
        """
        from workers.job import work_version

        config = self.config
        args: list[object] = [token, config.worker, len(ends)]
        for task, end in ends.items():
            args += [task, f"{end.seconds:.3f}", text_from_batches(end.batches), end.n_views]
        if go_on is not None:
            args += [work_version(), go_on.recipe, config.lease_s, config.store_id, TOGETHER_S]
            args += [",".join(go_on.queues), int(go_on.is_long)]
        _verdicts, flat = self._run("finish", job, *args)
        rows = (flat[i : i + 4] for i in range(0, len(flat), 4))
        return {task: Claim(v, detail, inputs, token) for task, v, detail, inputs in rows}

    def fail(self, job: str, task: str, token: str, fault: Fault, *, delay_s: float) -> str:
        """Mark a task as failed: returns stale, handed back, retry, failed (permanently) or cancelled.

        "stale": the lease belongs to another worker and nothing was changed. A class of UNCOUNTED gives the attempt
        back ("handed back"), "data" fails permanently, all others when the job's attempts are used up. delay_s:
        before the next attempt.
        """
        args = (fault.fault, fault.fingerprint, fault.json(), self.config.worker)
        return str(self._run("fail", job, task, token, *args, delay_s, self.config.cooldown_s))

    # The coordinator

    def lead(self, token: str) -> bool:
        """Take or keep the lead for 15 seconds by this coordinator's token; False if another has it."""
        return bool(self._run("lead", "", token, _LEAD_S))

    def resign(self, token: str) -> None:
        """Give up the lead, if it is ours, so that a standby need not wait for its expiry."""
        if self.client.get(f"{self._g}leader") == token:
            self.client.delete(f"{self._g}leader")

    def reap(self, token: str) -> int:
        """End, some hundred at most, leases without heartbeats; how many, -1 when not leading."""
        return int(self._run("reap", "", token, _REAP_MOST, *POOLS))

    def dispatch(
        self, job: str, token: str, *, max_open: int, room: Mapping[str, int]
    ) -> list[str] | None:
        """Admit houses and take ready tasks to be sent, at most room[stage]; None: not leading.

        max_open: maximum houses of the job in work. The returned tasks are queued from now on: `resend` finds those
        that the caller fails to send. A job that is not running only gives its last merge.
        """
        pairs = [x for pair in room.items() for x in pair]
        return _tasks(self._run("dispatch", job, token, max_open, *pairs))

    def resend(self, job: str, token: str, stage: str, age_s: float) -> list[str] | None:
        """Tasks whose message was sent age_s ago and never claimed; None: not leading.

        Some hundred at most, which count as sent now. Call it only where the queue is empty: a
        message that waits there is not lost.
        """
        return _tasks(self._run("resend", job, token, stage, age_s, _RESEND_MOST))

    def set_blocked(self, job: str, queues: Sequence[str], why: str) -> None:
        """Let no worker that takes one of these queues claim the job's tasks, until the next call.

        queues: () lets every worker claim again; (EVERYWHERE,) stops all. why: shown by `status`.
        Tasks that run go on.
        """
        if self.client.exists(f"{self._p(job)}job"):
            fields = {"blocked": ",".join(queues), "blocked_why": why}
            self.client.hset(f"{self._p(job)}job", mapping=fields)

    def preempt(self, job: str, token: str, holds: Sequence[Hold]) -> int:
        """Let these tasks end at their next heartbeat; returns the number of new ones, -1: not leading.

        holds: from `holds`; tokens are compared, so a task claimed again in the meantime is spared. Attempts are
        given back.
        """
        pairs = [x for hold in holds for x in (hold.task, hold.token)]
        return int(self._run("preempt", job, token, *pairs))

    def set_rates(self, job: str, rates: Mapping[str, float]) -> None:
        """Keep stage -> tasks per second, measured by the leader, for `view`; unnamed stages keep theirs."""
        if rates:
            self.client.hset(f"{self._p(job)}rate", mapping=dict(rates))

    def set_notified(self, job: str, outcome: str) -> None:
        """Keep which end or pause of the job was posted to the webhook last, "" for none."""
        # A job forgotten in the meantime stays forgotten.
        if self.client.exists(f"{self._p(job)}job"):
            self.client.hset(f"{self._p(job)}job", "notified", outcome)

    def wait(self, seconds: float) -> None:
        """Wait so long at most, less when a task becomes ready meanwhile."""
        self.client.blpop([f"{self._g}notify"], timeout=seconds)

    def queue_length(self, queue: str) -> int:
        """Messages waiting on a queue of the broker."""
        return int(self.client.llen(f"{self._g}{queue}"))

    # Reading

    def view(self, job: str) -> JobView | None:
        """The job's current state by a handful of O(1) reads; None for an unknown job."""
        p = self._p(job)
        pipe = self.client.pipeline(transaction=False)
        pipe.hgetall(f"{p}job").hgetall(f"{p}n").hgetall(f"{p}rate").llen(f"{p}order")
        fields, counts, rates, n_waiting = pipe.execute()
        if not fields:
            return None
        numbers = {k: float(v) for k, v in counts.items()}
        return JobView(job, fields, numbers, {k: float(v) for k, v in rates.items()}, n_waiting)

    def age_s(self, view: JobView) -> float:
        """Seconds since the job was entered, by Redis' clock."""
        return self.now() - float(view.fields.get("created", 0.0))

    def active_jobs(self) -> list[str]:
        """Jobs that may have work, most urgent first."""
        return list(self.client.zrange(f"{self._g}jobs", 0, -1))

    def known_jobs(self) -> list[str]:
        """Every job in the ledger, oldest first."""
        return list(self.client.zrange(f"{self._g}known", 0, -1))

    def unit_states(self, job: str, house: str) -> dict[str, str]:
        """The house's hash: unit -> "<stage>:<letter>", and s (state), n, left, nf, i; or {}."""
        return dict(self.client.hgetall(f"{self._p(job)}h:{house}"))

    def finished(self, job: str, houses: Iterable[str]) -> list[str]:
        """The finished (not the quarantined) ones of the houses, a round trip per thousand."""
        done: list[str] = []
        for chunk in _in_chunks(houses):
            pipe = self.client.pipeline(transaction=False)
            for house in chunk:
                pipe.hget(f"{self._p(job)}h:{house}", "s")
            states = pipe.execute()
            done += [house for house, s in zip(chunk, states, strict=True) if s == "done"]
        return done

    def batches(self, job: str, house: str) -> tuple[tuple[str, ...], ...]:
        """The house's batches of views, () before they are known."""
        return batches_from_text(self.client.hget(f"{self._p(job)}views", house) or "")

    def task_facts(self, job: str, task: str) -> dict[str, str]:
        """Known ones of "claim", "attempts", "tried", "fault" (JSON), "not_before", "sent" (Redis' s)."""
        p = self._p(job)
        pipe = self.client.pipeline(transaction=False)
        for name in ("claims", "attempts", "tried", "failed"):
            pipe.hget(p + name, task)
        pipe.zscore(f"{p}later", task).zscore(f"{p}queued", task)
        values = pipe.execute()
        names = ("claim", "attempts", "tried", "fault", "not_before", "sent")
        return {n: str(v) for n, v in zip(names, values, strict=True) if v is not None}

    def lease_left_s(self, job: str, task: str, lease: str) -> float | None:
        """Seconds (negative: to be reaped) until a running task's lease, by its name, ends; or None."""
        end = self.client.zscore(f"{self._g}lease:{lease}", f"{job}|{task}")
        return None if end is None else float(end) - self.now()

    def faults(self, job: str) -> Iterator[tuple[str, Fault]]:
        """Every task that failed for good, in no order, read while iterating."""
        for task, text in self.client.hscan_iter(f"{self._p(job)}failed", count=_CHUNK):
            yield task, fault_from_json(text)

    def holds(self, job: str) -> list[Hold]:
        """Every task of the job that runs, or was claimed by a slot with a running one."""
        claims = self.client.hgetall(f"{self._p(job)}claims")
        return [hold_from_text(job, task, text) for task, text in claims.items()]

    def claims(self, job: str) -> dict[str, tuple[str, float]]:
        """Task that runs now -> its worker, and since when by Redis' clock."""
        return {hold.task: (hold.worker, hold.since) for hold in self.holds(job)}

    def ping(self) -> None:
        """Raises LedgerUnavailable when Redis does not answer or refuses us."""
        self.client.ping()

    def wait_until_there(
        self, patience_s: float = 300.0, meanwhile: Callable[[], object] = lambda: None
    ) -> None:
        """Return once Redis answers, calling meanwhile; LedgerUnavailable if it refuses or is late."""
        give_up = time.monotonic() + patience_s
        while True:
            meanwhile()
            try:
                return self.ping()
            except LedgerUnavailable as error:
                is_refused = isinstance(error.__cause__, redis.AuthenticationError)
                if is_refused or time.monotonic() > give_up:
                    raise
                _log.warning("%s; trying again", error)
                time.sleep(_AWAY_S)

    def now(self) -> float:
        """Redis' own clock, seconds since 1970; machines' clocks differ, so never subtract time.time()."""
        seconds, micros = self.client.time()
        return float(seconds) + float(micros) / 1e6

    def _p(self, job: str) -> str:
        return f"{self._g}{{{job}}}:"

    def _keys(self, job: str) -> list[str]:
        return [self._p(job), self._g]

    def _run(self, name: str, job: str, *args: object) -> Any:
        return self._scripts[name](keys=self._keys(job), args=list(args))


def _tasks(answer: object) -> list[str] | None:
    return [str(task) for task in answer] if isinstance(answer, list) else None


def _in_chunks(items: Iterable[T]) -> Iterator[list[T]]:
    rest = iter(items)
    while chunk := list(islice(rest, _CHUNK)):
        yield chunk
