"""A worker's outermost process (PID 1 in a container): starts Celery, and shuts down in order.

Effects: starts and ends processes; files on scratch. TERM: take no more tasks, finish the running ones; when
the grace is nearly over, return them to the ledger, uncounted. INT, QUIT: return them immediately.
"""

from __future__ import annotations

import argparse
import contextlib
import logging
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import FrameType
from typing import Final

from pbrs_farm.core.errors import MachineFailed, PbrsError
from pbrs_farm.operating_system import dying_with_parent, is_running, tree_mb
from pbrs_farm.store import store_from_url
from workers.config import FarmConfig, config_from_environment, make_scratch
from workers.ids import QUEUES
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import LedgerUnavailable
from workers.ledger.worker_registry import Registry
from workers.liveness import touch
from workers.logs import log_to_stderr
from workers.store_identity import store_id

_log = logging.getLogger("pbrs.supervisor")
_PREEMPT_S: Final = 20.0  # what giving everything back may take
_POLL_S: Final = 0.2
_SEEN_EVERY_S: Final = 10.0  # heartbeat of a worker finishing its tasks
DRAINED_POLL_S: Final = 5.0  # between two looks of a drained worker whether it is wanted again
_ASK_EVERY_S: Final = 10.0  # whether a job has work
_STORE_S: Final = 5.0  # how long the store may take to say which it is
# On scratch when a signal made the worker leave: deploy/slurm/worker.sbatch asks for it.
PREEMPTED_NOTE: Final = "preempted"


@dataclass(slots=True)
class Orders:
    """Requests by signals."""

    leave_at: float | None = None  # when leaving began
    was_signalled: bool = False  # it leaves because of a signal, not because its time is over
    at_once: bool = False  # without finishing what runs
    done: set[str] = field(default_factory=set)  # finished steps of the shutdown

    def on_signal(self, number: int, _frame: FrameType | None) -> None:
        self.was_signalled = True
        self.leave_at = self.leave_at or time.monotonic()
        # Ctrl-C in a terminal, or a second signal of an impatient scheduler.
        self.at_once = self.at_once or number in (signal.SIGINT, signal.SIGQUIT)


def command(config: FarmConfig) -> list[str]:
    """The Celery worker's command line, a process per slot; secrets and URLs stay in the environment."""
    return [
        sys.executable,
        "-m",
        "celery",
        "--app",
        "workers.queue.celery_app",
        "worker",
        "--concurrency",
        str(config.slots),
        "--queues",
        ",".join(config.queues or QUEUES),
        "--hostname",
        f"pbrs@{config.worker}",
        "--loglevel",
        "INFO",
        "--without-gossip",
        "--without-mingle",
        "--without-heartbeat",
    ]


def check_machine(config: FarmConfig) -> None:
    """Wait, alive, for Redis, and check the space on scratch, not LLVM and OpenGL. PbrsError."""
    RedisLedger(config).wait_until_there(meanwhile=lambda: touch(config.heartbeat_file))
    if not config.store_url:
        raise MachineFailed("no store", hint="PBRS_STORE=file:///folder or s3://bucket/prefix")
    free_mb = shutil.disk_usage(config.scratch).free / 2**20
    if free_mb < config.min_free_mb:
        text = f"{config.scratch}: {free_mb:.0f} MB free, {config.min_free_mb} needed"
        hint = "PBRS_FARM_SCRATCH names another folder"
        raise MachineFailed(text, hint=hint)


def sweep(config: FarmConfig) -> None:
    """Remove this worker's own files, and folders of ended processes, from scratch before it starts."""
    config.preemption_file.unlink(missing_ok=True)
    config.heartbeat_file.unlink(missing_ok=True)
    config.leaving_file.unlink(missing_ok=True)
    # Logs of dead pool processes; "pbrs-<worker>-<pid>".
    for folder in config.scratch.glob(f"pbrs-{config.worker}-*"):
        pid = folder.name.rpartition("-")[2]
        if pid.isdigit() and not is_running(int(pid)):
            shutil.rmtree(folder, ignore_errors=True)


def supervise(
    config: FarmConfig,
    *,
    until_s: float | None = None,
    idle_s: float | None = None,
    preempted_code: int | None = None,
) -> int:
    """Run a worker until a signal asks it to leave; returns Celery's exit status.

    until_s: leave after this many seconds, with the grace before them (Slurm's wall time). idle_s: leave when no
    job had work for this many seconds. preempted_code: the status instead of Celery's after a signal, for
    schedulers that treat 0 as the end.
    """
    orders = Orders()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGQUIT):
        signal.signal(number, orders.on_signal)
    began = time.monotonic()
    seen_at = 0.0  # as one that leaves
    ledger = RedisLedger(config)
    registry, idleness = Registry(ledger), Idleness(ledger)
    if not wait_while_drained(config, orders):
        return 0
    # Celery's parent process never touches storage: name the store in its environment.
    celery = subprocess.Popen(
        command(config),
        env={**os.environ, "PBRS_FARM_STORE_ID": config.store_id},
        preexec_fn=dying_with_parent(signal.SIGTERM),
    )
    while True:
        code = _reap(celery)
        if code is not None:
            with contextlib.suppress(LedgerUnavailable):
                registry.leave()
            sweep(config)
            if orders.was_signalled and preempted_code is not None:
                return preempted_code
            return code
        # Celery's own heartbeat ends while it leaves; what runs may take minutes more.
        if config.leaving_file.exists() and time.monotonic() >= seen_at + _SEEN_EVERY_S:
            seen_at = time.monotonic()
            touch(config.heartbeat_file)
            with contextlib.suppress(LedgerUnavailable):
                registry.heartbeat(is_leaving=True, memory_mb=tree_mb(os.getpid()))
        if until_s is not None and time.monotonic() - began > until_s - config.grace_s:
            orders.leave_at = orders.leave_at or time.monotonic()
        if idle_s is not None and idleness.seconds() >= idle_s:
            orders.leave_at = orders.leave_at or time.monotonic()
        # A preempted Slurm job requeues itself, an ended one does not.
        if orders.was_signalled:
            touch(config.scratch / PREEMPTED_NOTE)
        if orders.leave_at is not None:
            _leave(config, celery, orders, time.monotonic() - orders.leave_at)
        time.sleep(_POLL_S)


class Idleness:
    """Time without work for any job of the farm, according to Redis; polled every ten seconds."""

    def __init__(self, ledger: RedisLedger, clock: Callable[[], float] = time.monotonic) -> None:
        self._ledger, self._clock = ledger, clock
        self._since = self._asked_at = clock()

    def seconds(self) -> float:
        """Seconds since a job was last seen with work, or Redis did not answer."""
        now = self._clock()
        if now >= self._asked_at + _ASK_EVERY_S:
            self._asked_at = now
            try:
                has_work = bool(self._ledger.active_jobs())
            except LedgerUnavailable:
                has_work = True  # nothing is known: stay
            if has_work:
                self._since = now
        return now - self._since


def wait_while_drained(config: FarmConfig, orders: Orders) -> bool:
    """Stay without work while drained, so that nobody restarts it; False on a signal to end."""
    registry, due, is_logged = Registry(RedisLedger(config)), 0.0, False
    while orders.leave_at is None:
        if time.monotonic() >= due:
            due = time.monotonic() + DRAINED_POLL_S
            # The liveness probe must see a drained worker as alive.
            touch(config.heartbeat_file)
            try:
                if not registry.is_drained():
                    return True
                registry.heartbeat(takes_work=False, memory_mb=tree_mb(os.getpid()))
            except LedgerUnavailable as error:
                _log.warning("%s", error)
            if not is_logged:
                is_logged = True
                _log.info(
                    "drained: accepting no tasks until `pbrs-farm drain --undo %s`", config.worker
                )
        time.sleep(_POLL_S)
    with contextlib.suppress(LedgerUnavailable):
        registry.leave()
    return False


def _with_store_id(config: FarmConfig) -> FarmConfig:
    """The configuration with its store's id; without where the store does not answer now."""
    settings = replace(config.store, s3=replace(config.store.s3, retry_timeout_s=_STORE_S))
    try:
        return replace(config, store_id=store_id(store_from_url(config.store_url, settings)))
    except PbrsError as error:
        _log.warning("the store is not known yet: %s", error)
        return config


def _leave(
    config: FarmConfig, celery: subprocess.Popen[bytes], orders: Orders, since_s: float
) -> None:
    """The next step of the shutdown, each once."""
    # Name, seconds after leaving began, what to do.
    steps: list[tuple[str, float, Callable[[], None]]] = [
        ("be seen leaving", 0.0, lambda: touch(config.leaving_file)),
        ("finish what runs", 0.0, lambda: celery.send_signal(signal.SIGTERM)),
        (
            "give back what runs",
            0.0 if orders.at_once else max(0.0, config.grace_s - _PREEMPT_S),
            lambda: touch(config.preemption_file),
        ),
        ("kill", config.grace_s if not orders.at_once else _PREEMPT_S, celery.kill),
    ]
    for name, after_s, act in steps:
        if since_s >= after_s and name not in orders.done:
            orders.done.add(name)
            _log.info("leaving: %s", name)
            act()


def _reap(celery: subprocess.Popen[bytes]) -> int | None:
    """Celery's exit status once it has ended; as PID 1, also reaps orphans."""
    if os.getpid() != 1:
        return celery.poll()
    # Whatever a killed pool process leaves behind becomes a child of process 1.
    with contextlib.suppress(ChildProcessError):
        while True:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                break
            if pid == celery.pid:
                celery.returncode = os.waitstatus_to_exitcode(status)
    return celery.returncode


def main(arguments: list[str] | None = None) -> int:
    """`python -m workers.node.supervisor`: a worker, until a signal asks it to leave; options as of supervise."""
    parser = argparse.ArgumentParser(prog="workers.node.supervisor", description=main.__doc__)
    parser.add_argument("--until", type=float, default=None, metavar="SECONDS")
    parser.add_argument("--until-idle", type=float, default=None, metavar="SECONDS")
    parser.add_argument("--preempted-code", type=int, default=None, metavar="CODE")
    args = parser.parse_args(arguments)
    log_to_stderr()
    try:
        config = config_from_environment()
        make_scratch(config)
        sweep(config)
        check_machine(config)
        config = _with_store_id(config)
    except PbrsError as error:
        sys.stderr.write(f"pbrs-farm: {error}\n")
        return 1
    return supervise(
        config, until_s=args.until, idle_s=args.until_idle, preempted_code=args.preempted_code
    )


if __name__ == "__main__":
    sys.exit(main())
