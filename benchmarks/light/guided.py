"""Guiding where it pays: relMSE x CPU of a `fast` view as its trial chooses over never guiding, eight views.

A `fast` view of VIEW is tried before it is rendered (pbrs_farm/transport/pilot.py), and the trial is a chance of its
own: TRIALS of them say how often it chooses guided rays, p, and what it costs. RUNS pictures of SIZE, guided and
plain in turn, say what guided rays do: v, relMSE over that of plain rays, relMSE being the variance between pictures
of one way (picture_variance.py), and c, the CPU of a view over the plain one's, reckoned from samples and pilot.
With t the CPU of a trial over the plain view's, choosing over never guiding is

    ratio = (p v + 1 - p) (p c + 1 - p + t)

A trial also counts which shadow rays arrive; both ways know that, plain rays without paying for it, so that the
ratio is guiding's at its dearest. Where no trial guides, both ways are one estimator, the same seed gives the same
bits, and all that choosing costs is the trial: 1 + t, no quotient of two noises, and only the CPU of a plain picture
is measured. Its standard error is the jackknife's over the pictures. `light.guide_worst` is the largest ratio of the views, `light.guide_worst_error`
its standard error, `light.guide_chosen` how many views most trials guide. Four minutes on two quiet cores.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any, Final
from unittest.mock import patch

import numpy as np

from benchmarks.figures import write_report
from benchmarks.light.measured_views import EIGHT, loaded
from benchmarks.light.picture_variance import F64, Run, compared, relative_spread
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.transport import pilot
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters, EmitterWeights
from pbrs_farm.transport.light_scene import LightScene

VIEW: Final = (640, 480)  # px, of the view whose CPU is reckoned
SIZE: Final = (160, 120)  # px, of the pictures that are rendered for it
TRIALS: Final = 16
RUNS: Final = 12  # pictures of each way
_PLAIN_RUNS: Final = 2  # of a view that stays plain, for its CPU alone


@dataclass(frozen=True, slots=True)
class Choosing:
    """What choosing costs a view and brings it, as the module's docstring names it."""

    ratio: float
    error: float  # standard error of the ratio
    n_guided: int  # of TRIALS
    trial_share: float  # t


def main() -> None:
    """Measure and write out/bench/guided.json."""
    found: dict[str, Choosing] = {}
    fields = recipe_from_name("fast").light
    for view, scene, camera in loaded(EIGHT, recipe_from_name("fast"), VIEW):
        one = found[view.key] = choosing(scene, camera, fields)
        print(
            f"{view.key:<34}{one.ratio:>7.3f} ± {one.error:.3f}  guided in {one.n_guided} of {TRIALS}"
            f" trials, each {one.trial_share:.2%} of the view's CPU",
            flush=True,
        )
    write_report("guided", *figures_of(found))


def figures_of(found: dict[str, Choosing]) -> tuple[dict[str, Any], dict[str, str]]:
    """Figures and units of all views and of the worst."""
    figures: dict[str, Any] = {}
    units: dict[str, str] = {}
    for key, one in found.items():
        rows = {
            "": (round(one.ratio, 4), "relMSE x CPU as the trial chose, its CPU counted, over plain"),
            "_error": (round(one.error, 4), "standard error"),
            "_trials": (one.n_guided, f"of {TRIALS} trials chose guided rays"),
            "_trial_share": (round(one.trial_share, 5), "CPU of a trial over that of the view"),
        }  # fmt: skip
        figures |= {f"light.guide_{key}{end}": value for end, (value, _unit) in rows.items()}
        units |= {f"light.guide_{key}{end}": unit for end, (_value, unit) in rows.items()}
    worst = max(found.values(), key=lambda one: one.ratio)
    figures |= {
        "light.guide_worst": round(worst.ratio, 4),
        "light.guide_worst_error": round(worst.error, 4),
        "light.guide_chosen": sum(one.n_guided > TRIALS / 2 for one in found.values()),
    }
    units |= {
        "light.guide_worst": "the largest of the views",
        "light.guide_worst_error": "its standard error",
        "light.guide_chosen": f"views of {len(found)}",
    }
    return figures, units


def choosing(scene: LightScene, camera: Camera, fields: LightFields) -> Choosing:
    """A view measured. camera: of VIEW."""
    choices, trial_s, pilot_s = _trials(scene, camera, fields)
    p = sum(choices) / TRIALS
    made: dict[bool, list[tuple[F64, float]]] = {False: [], True: []}
    if p == 0:
        made[False] = [_picture(scene, camera, fields, k, guided=False) for k in range(_PLAIN_RUNS)]
        trial_share = trial_s / _view_s(made[False], pilot_s)
        return Choosing(1 + trial_share, 0.0, 0, trial_share)

    # In turn, so that other work on the machine slows both alike; with seeds of their own.
    for k in range(RUNS):
        for guided, pictures in made.items():
            pictures.append(_picture(scene, camera, fields, 2 * k + guided, guided=guided))
    plain_s, guided_s = (_view_s(made[guided], pilot_s) for guided in (False, True))
    trial_share = trial_s / plain_s

    # The mean over the trial's choices, and the same with the k-th picture of both left out.
    plain, guided_run = (Run(np.stack([x for x, _s in made[g]]), 1.0) for g in (False, True))
    found = compared(guided_run, plain)
    times = p * guided_s / plain_s + 1 - p + trial_share
    ratio = (p * found.relmse_ratio + 1 - p) * times
    without = (p * found.relmse_without + 1 - p) * times
    return Choosing(ratio, ratio * relative_spread(without), sum(choices), trial_share)


def _trials(
    scene: LightScene, camera: Camera, fields: LightFields
) -> tuple[list[bool], float, float]:
    """(what each trial chose, CPU seconds of one, CPU seconds of a pilot)."""
    few = fields.model_copy(update={"spp": 1})
    emitters, weights = scene.emitters(camera, few, 0)  # too few samples to be tried
    # Compile, and measure the lamps' targets, before any clock starts.
    pilot.trial_weights(scene.device_scene, emitters, camera, weights, fields, 0)
    _picture(scene, camera, fields.model_copy(update={"spp": 2}), 0, guided=True)
    choices, trial_s, pilot_s = [], [], []
    for seed in range(1, TRIALS + 1):
        began = time.process_time()
        emitters, weights = scene.emitters(camera, few, seed)
        piloted = time.process_time()
        tried = pilot.trial_weights(scene.device_scene, emitters, camera, weights, fields, seed)
        choices.append(tried.is_guided)
        trial_s.append(time.process_time() - piloted)
        pilot_s.append(piloted - began)
    return choices, float(np.mean(trial_s)), float(np.mean(pilot_s))


def _picture(
    scene: LightScene, camera: Camera, fields: LightFields, seed: int, *, guided: bool
) -> tuple[F64, float]:
    """(luminance at SIZE, CPU seconds with the pilot), guided or plain whatever its trial says.

    Its trial is that of VIEW, whose CPU is left out. A scene keeps the weights of its last seed: both
    ways need seeds of their own.
    """
    trial, trial_s = pilot.trial_weights, [0.0]

    def tried_at_view(
        device_scene: DeviceScene,
        emitters: Emitters,
        _small: Camera,
        weights: EmitterWeights,
        some: LightFields,
        trial_seed: int,
    ) -> EmitterWeights:
        before = time.process_time()
        tried = trial(device_scene, emitters, camera, weights, some, trial_seed)
        trial_s.append(time.process_time() - before)
        return replace(tried, is_guided=guided)

    with patch("pbrs_farm.transport.view_emitters.trial_weights", tried_at_view):
        began = time.process_time()
        result = scene.render(camera.with_size(*SIZE), "-", fields, seed)
        spent = time.process_time() - began - sum(trial_s)
    return (result.outdoor + result.indoor).astype(np.float64) @ LUMINANCE, spent


def _view_s(made: list[tuple[F64, float]], pilot_s: float) -> float:
    """CPU seconds of a view of VIEW by its pictures of SIZE: a pilot, and samples by the pixel."""
    picture_s = float(np.mean([spent for _picture, spent in made]))
    times = VIEW[0] * VIEW[1] / (SIZE[0] * SIZE[1])
    return pilot_s + (picture_s - pilot_s) * times


if __name__ == "__main__":
    main()
