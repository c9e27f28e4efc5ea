"""Guiding where it pays: relMSE x CPU of `fast` with the trial's choice over never guiding, eight views.

Per view: RUNS pictures of SPP samples at SIZE by each; relMSE is the variance between pictures of one kind over
the mean of all, so no reference is needed. `light.guide_worst` is the worst of the views, `light.guide_chosen`
how many are guided. Eight minutes on two quiet cores.
"""

from __future__ import annotations

import time
from typing import Any, Final
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import write_report
from benchmarks.light.measured_views import EIGHT, loaded
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.transport.guiding import pilot
from pbrs_farm.transport.light_scene import LightScene

SIZE: Final = (160, 120)
SPP: Final = 64
RUNS: Final = 8


def main() -> None:
    """Measure and write out/bench/guided.json."""
    figures: dict[str, Any] = {}
    units: dict[str, str] = {}
    worst, n_guided = 0.0, 0
    # A trial for every view, however small the pictures of this bench are.
    with patch.object(pilot, "_MIN_SAMPLES", 0):
        for view, scene, camera in loaded(EIGHT, recipe_from_name("fast"), SIZE):
            chosen, never, guided = _ratio(scene, camera)
            ratio = chosen / never
            worst, n_guided = max(worst, ratio), n_guided + guided
            figures[f"light.guide_{view.key}"] = round(ratio, 3)
            units[f"light.guide_{view.key}"] = "relMSE x CPU, as the trial chose over unguided"
            print(f"{view.key:<34}{ratio:>7.3f}  {'guided' if guided else 'plain'}", flush=True)
    figures |= {"light.guide_worst": round(worst, 3), "light.guide_chosen": n_guided}
    units |= {"light.guide_worst": "the largest of eight", "light.guide_chosen": "views of eight"}
    write_report("guided", figures, units)


def _ratio(scene: LightScene, camera: Camera) -> tuple[float, float, bool]:
    """(relMSE x CPU as the trial chose, never guided, whether it guided in most runs).

    The trial's own cost, which is that of a larger view, is left out of both.
    """
    pictures: dict[str, NDArray[np.float64]] = {}
    seconds: dict[str, float] = {}
    choices: list[bool] = []
    fields = recipe_from_name("fast").light.model_copy(update={"spp": SPP})
    for name in ("chosen", "never"):
        made = []
        for seed in range(RUNS):
            _emitters, weights = scene.emitters(camera, fields, seed)
            guided = weights.is_guided and name == "chosen"
            if name == "chosen":
                choices.append(guided)
            with patch.object(pilot, "guiding_pays", lambda *_a, g=guided: g):
                began = time.process_time()
                result = scene.render(camera, "-", fields, seed)
                seconds[name] = seconds.get(name, 0.0) + time.process_time() - began
            made.append((result.outdoor + result.indoor).astype(np.float64) @ LUMINANCE)
        pictures[name] = np.array(made)
    mean = np.mean(list(pictures.values()), axis=(0, 1))
    costs = {
        name: float((p.var(0, ddof=1) / (mean**2 + 1e-3 * mean.mean() ** 2)).mean()) * seconds[name]
        for name, p in pictures.items()
    }
    return costs["chosen"], costs["never"], sum(choices) > RUNS / 2


if __name__ == "__main__":
    main()
