"""The body of a local worker process: takes tasks from a pipe, runs their steps, answers events.

Effects: the store's, and those of the libraries the steps use; a crash here costs one step.
"""

from __future__ import annotations

import importlib
import os
import resource
import signal
import sys
import threading
import time
import traceback
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Literal

from pbrs_farm.core.errors import PbrsError
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.task import Event, Setting, Task


def work_forever(pipe: Connection, setting: Setting, log: str) -> None:
    """Run tasks until the pipe closes. log: the file that takes what native libraries print."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C means
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.environ.setdefault("LP_NUM_THREADS", str(setting.n_threads))
    threading.Thread(target=_leave_with_parent, args=(os.getppid(),), daemon=True).start()
    house_cache = HouseCache()
    try:
        while True:
            do_task(pipe, setting, house_cache, pipe.recv())
    except (EOFError, BrokenPipeError, ConnectionResetError):
        house_cache.clear()


def _leave_with_parent(parent: int) -> None:
    """End this process when its parent is gone, however it went: nobody waits for its work."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def do_task(pipe: Connection, setting: Setting, house_cache: HouseCache, task: Task) -> None:
    """Run the steps of one task; a failed one leaves out those that read what it makes."""
    from pbrs_farm.store import store_from_url

    store = store_from_url(setting.store_url, setting.store)
    work = Work(
        store=store,
        recipe=setting.recipe,
        house_id=task.house_id,
        house_cache=house_cache,
        source=task.source,
        view_id=task.view_id,
        layers=task.layers,
    )
    failed: set[str] = set()
    for name in task.steps:
        if name != "view" and failed.intersection(plan.STEPS[name].after):
            failed.add(name)
            continue
        if not _do_step(pipe, setting, name, work):
            failed.add(name)
    pipe.send(Event("end", task.house_id, task.view_id, "", peak_mb=peak_mb()))


def _do_step(pipe: Connection, setting: Setting, name: str, work: Work) -> bool:
    module, _, function = setting.runner.partition(":")
    run_step = getattr(importlib.import_module(module), function)
    limit_threads(name, setting.n_threads)
    pipe.send(Event("begin", work.house_id, work.view_id, name))
    started = time.perf_counter()
    try:
        outcome = run_step(name, work)
    except PbrsError as error:
        message = str(error)
    except Exception as error:  # noqa: BLE001  any other fault costs this step, not the run
        message = f"{type(error).__name__}: {error}"
        traceback.print_exc()
        sys.stderr.flush()
    else:
        kind: Literal["kept", "done"] = "kept" if outcome.was_done else "done"
        seconds = time.perf_counter() - started
        facts = outcome.marker.facts if name in ("house", "cameras") else {}
        pipe.send(Event(kind, work.house_id, work.view_id, name, seconds, "", facts, peak_mb()))
        return True
    if setting.debug:
        message += "\n" + traceback.format_exc()
    pipe.send(Event("failed", work.house_id, work.view_id, name, message=message))
    return False


def limit_threads(step: str, n_threads: int) -> None:
    """Give Dr.Jit its share of the cores before a step first uses it."""
    if n_threads < (os.cpu_count() or 1) and step in (
        "house",
        "cameras",
        "truth",
        "illuminance",
        "light",
        "develop",
    ):
        from pbrs_farm.raycast.variant import set_threads

        set_threads(n_threads)


def peak_mb() -> float:
    """Largest resident memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000


def last_lines(log: Path, n: int = 3) -> str:
    """The last lines a worker's libraries printed, on one line."""
    try:
        text = log.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    return " | ".join([line.strip() for line in text.splitlines() if line.strip()][-n:])
