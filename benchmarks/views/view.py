"""A 640x480 view of Studio by recipe `fast`, step by step: `make bench NAME=view` -> out/bench/view.json."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Final

from benchmarks.figures import write_report
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore

N_VIEWS: Final = 3
UNITS: Final = {
    "view.fast_s": "s of light and picture: both groups, denoised, written; median of views after the first",
    "view.fast_first_s": "s of the first view, with loading and compiling",
    "view.labels_s": "s of all labels, written; median of views after the first",
    "view.opengl_s": "s of an OpenGL picture, written; mean of both modes, median of views after the first",
}


def main() -> None:
    """Measure and write out/bench/view.json."""
    store, recipe, source = MemoryStore(), recipe_from_name("fast"), resolve("Studio")
    work = Work(store, recipe, source.house_id, HouseCache(), source=source)
    run_step("house", work)
    views = [str(row[0]) for row in run_step("cameras", work).marker.facts["views"]][:N_VIEWS]
    rows = []
    print(f"{'view':<10}{'light s':>9}{'develop s':>11}{'labels s':>10}{'GL s':>7}{'noise':>8}")
    for view in views:
        of_view = Work(
            store, recipe, source.house_id, work.house_cache, source=source, view_id=view
        )
        labels = _seconds(lambda w=of_view: run_step("truth", w))
        gl = _seconds(lambda w=of_view: (run_step("opengl_dl", w), run_step("opengl_il", w)))
        light = _seconds(lambda w=of_view: (run_step("illuminance", work), run_step("light", w)))
        develop = _seconds(lambda w=of_view: run_step("develop", w))
        noise = run_step("light", of_view).marker.facts["noise"]["sum"]
        rows.append((light + develop, labels, gl / 2))
        print(f"{view:<10}{light:>9.2f}{develop:>11.2f}{labels:>10.2f}{gl:>7.2f}{noise:>8.3f}")
    fast_s, labels_s, opengl_s = (statistics.median(row[k] for row in rows[1:]) for k in range(3))
    figures = {
        "view.fast_s": round(fast_s, 2),
        "view.fast_first_s": round(rows[0][0], 2),
        "view.labels_s": round(labels_s, 3),
        "view.opengl_s": round(opengl_s, 3),
    }
    write_report("view", figures, UNITS)


def _seconds(call: Callable[[], object]) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
