"""One 640x480 view of the Studio home by recipe fast: both light groups, denoised; its labels."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

from benchmarks.figures import write_report
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore

N_VIEWS = 3


def main() -> None:
    """Render the first views with recipe fast and write out/bench/view.json.

    The first view pays for loading and compiling; the figures are the median of the others, and
    the first one beside it.
    """
    store, recipe, source = MemoryStore(), recipe_from_name("fast"), resolve("Studio")
    work = Work(store, recipe, source.house_id, HouseCache(), source=source)
    run_step("house", work)
    views = [str(row[0]) for row in run_step("cameras", work).marker.facts["views"]][:N_VIEWS]
    rows = []
    print(f"{'view':<10}{'light s':>9}{'develop s':>11}{'labels s':>10}{'GL s':>7}{'noise':>8}")
    for view in views:
        one = Work(store, recipe, source.house_id, work.house_cache, source=source, view_id=view)
        labels = _seconds(lambda w=one: run_step("truth", w))
        gl = _seconds(lambda w=one: (run_step("opengl_dl", w), run_step("opengl_il", w)))
        light = _seconds(lambda w=one: (run_step("illuminance", work), run_step("light", w)))
        develop = _seconds(lambda w=one: run_step("develop", w))
        noise = run_step("light", one).marker.facts["noise"]["sum"]
        rows.append((light + develop, labels))
        print(f"{view:<10}{light:>9.2f}{develop:>11.2f}{labels:>10.2f}{gl:>7.2f}{noise:>8.3f}")
    figures = {
        "view.fast_s": round(statistics.median(r[0] for r in rows[1:]), 2),
        "view.fast_first_s": round(rows[0][0], 2),
        "view.labels_s": round(statistics.median(r[1] for r in rows[1:]), 3),
        "view.labels_first_s": round(rows[0][1], 3),
    }
    units = {
        "view.fast_s": f"s, 640x480, {recipe.light.spp} spp, both groups, denoised, written",
        "view.fast_first_s": "s, the same, loading and compiling included",
        "view.labels_s": "s, all ground truth of the view, written",
        "view.labels_first_s": "s, the same, loading included",
    }
    write_report("view", figures, units)


def _seconds(call: Callable[[], object]) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
