"""Run the steps of a task in a render process, with an event for each; a crash costs one step."""

from __future__ import annotations

import atexit
import contextlib
import importlib
import os
import pkgutil
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Literal

from pbrs_farm.core.errors import MachineFailed, PbrsError
from pbrs_farm.core.shown_text import MAX_MESSAGE, shown
from pbrs_farm.operating_system import give_back_memory, peak_mb
from pbrs_farm.raycast.variant import choose_variant, set_threads
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.processes.messages import Handler, Message, Send
from pbrs_farm.run.processes.render_task import Event, RenderTask, Setting, task_from_line
from pbrs_farm.run.step_cache import Outcome, Work
from pbrs_farm.store import store_from_url

# Steps that start Dr.Jit, whose number of threads is fixed from then on.
_DRJIT_STEPS = ("house", "cameras", "pairs", "tracks", "truth", "illuminance", "light", "develop")


_OF_LIGHT = (
    "pbrs_farm.run.steps",
    "pbrs_farm.formats.house_bundle",
    "pbrs_farm.transport.light_scene",
    "pbrs_farm.transport.illuminance",
    "pbrs_farm.transport.lampshade_exitance",
    "pbrs_farm.transport.pilot",
    "pbrs_farm.transport.sample_passes",
    "pbrs_farm.transport.view_emitters",
    "pbrs_farm.transport.kernels.outside",
    "pbrs_farm.run.house_cache",
)
_OF_FINISHING = (
    "pbrs_farm.run.steps",
    "pbrs_farm.read.sweethome3d",
    "pbrs_farm.dress.dressing",
    "pbrs_farm.repair",
    "pbrs_farm.formats.house_bundle",
    "pbrs_farm.run.chosen_cameras",
)


def make_handler(send: Send) -> Handler:
    """The handler of a render process: answers each line with faults and "done", keeps the last house."""
    house_cache = HouseCache()
    atexit.register(house_cache.clear)

    def handle(line: bytes) -> Message:
        setting, task = task_from_line(line)
        # Mesa reads it when the first GL context is made.
        os.environ.setdefault("LP_NUM_THREADS", str(setting.n_threads))
        run_task(send, setting, house_cache, task)
        end = Event("end", task.house_id, task.view_id, "", peak_mb=peak_mb())
        return Message("done", body=asdict(end))

    return handle


def make_light_handler(send: Send) -> Handler:
    """As make_handler, with the libraries of light loaded, while the house is made."""
    _load(_OF_LIGHT)
    return make_handler(send)


def make_finishing_handler(send: Send) -> Handler:
    """As make_handler, with what a house needs loaded before it is ready, while homes are still looked for."""
    _load(_OF_FINISHING)
    return make_handler(send)


def _load(modules: Sequence[str]) -> None:
    for module in modules:
        # The step that needs a missing library reports it.
        with contextlib.suppress(ImportError):
            importlib.import_module(module)
    with contextlib.suppress(PbrsError):
        choose_variant()


def run_task(send: Send, setting: Setting, house_cache: HouseCache, task: RenderTask) -> None:
    """Run the steps of a task; a fault is sent, and steps that need its files are skipped, except `view`."""
    work = Work(
        store=store_from_url(setting.store_url, setting.store),
        recipe=setting.recipe,
        house_id=task.house_id,
        house_cache=house_cache,
        source=task.source,
        view_id=task.view_id,
        layers=task.layers,
        drops_radiance=task.drops_radiance,
        tell_share=lambda share: send(Message("share", f"{share:.4f}")),
    )
    failed: set[str] = set()
    for name in task.steps:
        is_blocked = name != "view" and bool(failed.intersection(plan.STEPS[name].after))
        if is_blocked or not _run_step(send, setting, name, work):
            failed.add(name)


def _run_step(send: Send, setting: Setting, name: str, work: Work) -> bool:
    run_step = pkgutil.resolve_name(setting.runner)  # tests name their own
    limit_threads(name, setting.n_threads)
    send(Message("step", name))
    started = time.perf_counter()
    kind: Literal["failed", "lacking"] = "failed"
    try:
        outcome = run_step(name, work)
    except PbrsError as error:
        message = str(error)
        # Without OpenGL here its pictures are left out, where there are others.
        if isinstance(error, MachineFailed) and name in plan.OPENGL_STEPS:
            kind = "lacking"
    except Exception as error:  # noqa: BLE001  any other fault costs this step, not the run
        message = shown(f"{type(error).__name__}: {error}", MAX_MESSAGE)
        traceback.print_exc()
        sys.stderr.flush()
    else:
        if not plan.STEPS[name].per_view:
            _give_back_memory()  # of painting, repair and candidate views, before scenes are built
        seconds = time.perf_counter() - started
        send(Message("event", body=asdict(_event_of_outcome(work, name, outcome, seconds))))
        return True
    message += "\n" + traceback.format_exc() if setting.debug else ""
    failed = Event(kind, work.house_id, work.view_id, name, message=message)
    send(Message("event", body=asdict(failed)))
    return False


def _give_back_memory() -> None:
    """Return the free memory of Dr.Jit, if it is loaded, and of this process to the system."""
    if drjit := sys.modules.get("drjit"):
        drjit.flush_malloc_cache()
    give_back_memory()


def _facts_for_run(step: str, facts: dict[str, Any]) -> dict[str, Any]:
    """The marker facts that a run needs: all of a house's steps, the darkness of a view."""
    if not plan.STEPS[step].per_view:
        return facts
    return {"dark": facts["dark"]} if facts.get("dark") else {}


def _event_of_outcome(work: Work, name: str, outcome: Outcome, seconds: float) -> Event:
    facts = _facts_for_run(name, outcome.marker.facts)
    kind: Literal["kept", "done"] = "kept" if outcome.was_done else "done"
    return Event(kind, work.house_id, work.view_id, name, seconds, "", facts, peak_mb())


def limit_threads(step: str, n_threads: int) -> None:
    """Give Dr.Jit its share of the cores before a step first uses it."""
    if n_threads < (os.cpu_count() or 1) and step in _DRJIT_STEPS:
        set_threads(n_threads)
