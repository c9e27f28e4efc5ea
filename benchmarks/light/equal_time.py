"""Light transport: path, Metropolis and the denoiser at equal CPU time, scene by scene.

Every engine runs in this process on the same scene; CPU time is that of all threads. For each scene:
Metropolis with its usual settings and 128 mutations a pixel, and `path` with as many samples as fit into
the same CPU time, in turn, PICTURES of each, all of other seeds. Error is the variance between pictures of
one kind (picture_variance.py): that both have the same mean is tested elsewhere, and no reference is needed.
Ratios are Metropolis over path, below 1 favours Metropolis: `relmse_ratio` of relMSE x CPU, `median_ratio` of
the median pixel's error x sqrt(CPU); `..._spread` is a ratio's standard error as a share of it.
`fast_times_cheaper`: CPU time of Metropolis over that of recipe `fast` (its samples and the denoiser) for the
error `fast` reaches, its bias with it, against the mean of all pictures.

`light.homes_ratio`: the median of relmse_ratio over six cameras of homes. LIGHT_SCENES="door shade" measures
only some scenes. Four and a half minutes on two quiet cores.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from benchmarks.figures import write_report
from benchmarks.light.launches import launch_figures
from benchmarks.light.mutation_cost import compiled_by_another_camera, mutation_cost
from benchmarks.light.picture_variance import (
    F64,
    Comparison,
    Run,
    compared,
    relative_spread,
    relmse_of,
)
from benchmarks.light.shots import (
    METROPOLIS,
    PLAIN,
    ROOMS,
    SIX,
    Shot,
    all_light,
    home_shots,
    room_shot,
    timed,
)
from benchmarks.light.table_rows import light_head, light_row
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.transport.develop.denoiser import denoise

SIZE: Final = (48, 36)
PICTURES: Final = 6
FAST_SPP, FAST_PICTURES = recipe_from_name("fast").light.spp, 2
TRIAL_SPP: Final = 128
_CAMERAS: Final = frozenset(view.key for view in SIX)
_UNITS: Final = {
    "_launches": "kernels of a view of 640x480, on a GPU",
    "_s": "s CPU",
    "_spp": "samples a pixel",
    "_spread": "of the ratio",
}


def main() -> None:
    """Measure, print a table in markdown, write out/bench/light.json."""
    figures: dict[str, Any] = {}
    found: dict[str, Comparison] = {}
    rows = light_head()
    for shot in _shots(os.environ.get("LIGHT_SCENES", "").split() or [*ROOMS, *_CAMERAS]):
        found[shot.key], measured = measured_shot(shot)
        rows.append(light_row(shot.name, measured))
        print(rows[-1], flush=True)
        figures |= {f"light.{shot.key}_{name}": value for name, value in measured.items()}
    if found.keys() >= _CAMERAS:  # no median of some
        figures |= homes_figures([found[key] for key in sorted(_CAMERAS)])
    figures["light.mutation_cost"] = mutation_cost()
    figures["light.compiled_by_another_camera"] = compiled_by_another_camera()
    figures |= launch_figures()
    units = {name: _unit(name) for name in figures}
    units["light.mutation_cost"] = "path samples of the same depth"
    units["light.compiled_by_another_camera"] = "kernels"
    write_report("light", {k: float(f"{v:.4g}") for k, v in figures.items()}, units)
    print("\n" + "\n".join(rows))


def _shots(keys: list[str]) -> Iterator[Shot]:
    """The named scenes, rooms first. Raises ValueError for a name that is none."""
    unknown = set(keys) - set(ROOMS) - _CAMERAS
    if unknown:
        raise ValueError(
            f"no scene {sorted(unknown)[0]!r}; of {', '.join([*ROOMS, *sorted(_CAMERAS)])}"
        )
    for key in ROOMS:
        if key in keys:
            yield room_shot(key, SIZE)
    yield from home_shots(tuple(view for view in SIX if view.key in keys), SIZE)


def measured_shot(shot: Shot) -> tuple[Comparison, dict[str, float]]:
    """Path and Metropolis compared in one scene, and the figures of that and of `fast`."""
    _trial, trial_s = timed(shot, METROPOLIS, seed=1)
    _trial, few_s = timed(shot, PLAIN.model_copy(update={"spp": TRIAL_SPP}), seed=1)
    equal = PLAIN.model_copy(update={"spp": max(round(TRIAL_SPP * trial_s / few_s), 1)})

    # In turn, so that other work on the machine slows both alike.
    made: dict[str, list[tuple[F64, float]]] = {"metropolis": [], "path": []}
    for k in range(PICTURES):
        for name, fields in (("metropolis", METROPOLIS), ("path", equal)):
            made[name].append(_luminance(shot, fields, seed=10 + k))
    runs = {
        name: Run(np.stack([p for p, _s in some]), float(np.mean([s for _p, s in some])))
        for name, some in made.items()
    }
    comparison = compared(runs["metropolis"], runs["path"])
    measured = {
        "path_s": runs["path"].cpu_s,
        "metropolis_s": runs["metropolis"].cpu_s,
        "path_spp": float(equal.spp),
        "path_relmse": comparison.second.relmse,
        "metropolis_relmse": comparison.first.relmse,
        "path_median": comparison.second.median,
        "metropolis_median": comparison.first.median,
        "relmse_ratio": comparison.relmse_ratio,
        "relmse_ratio_spread": relative_spread(comparison.relmse_without),
        "median_ratio": comparison.median_ratio,
        "median_ratio_spread": relative_spread(comparison.median_without),
    }
    sample_s = runs["path"].cpu_s / equal.spp
    fast = _fast_figures(shot, comparison, sample_s, runs["metropolis"].cpu_s)
    return comparison, measured | fast


def _luminance(shot: Shot, fields: LightFields, *, seed: int) -> tuple[F64, float]:
    result, spent = timed(shot, fields, seed=seed)
    return all_light(result) @ LUMINANCE, spent


def _fast_figures(
    shot: Shot, comparison: Comparison, path_sample_s: float, metropolis_s: float
) -> dict[str, float]:
    """Error and CPU of FAST_SPP denoised samples, and how much more CPU Metropolis takes for that error.

    CPU is that of as many of path's samples: the denoiser, much of a picture this small, takes 3 % of a view's.
    """
    fields = PLAIN.model_copy(update={"spp": FAST_SPP})
    pictures = [
        all_light(denoise(timed(shot, fields, seed=100 + k)[0])) @ LUMINANCE
        for k in range(FAST_PICTURES)
    ]
    relmse = relmse_of(np.stack(pictures), comparison.truth) - comparison.truth_relmse
    cpu_s = FAST_SPP * path_sample_s
    times = comparison.first.relmse * metropolis_s / (relmse * cpu_s)
    return {"fast_relmse": relmse, "fast_s": cpu_s, "fast_times_cheaper": times}


def homes_figures(cameras: list[Comparison]) -> dict[str, float]:
    """The median ratios over the cameras, and their spread by leaving out the k-th pictures of all."""
    found = {}
    for name, ratios, without in (
        ("", [c.relmse_ratio for c in cameras], [c.relmse_without for c in cameras]),
        ("median_", [c.median_ratio for c in cameras], [c.median_without for c in cameras]),
    ):
        found[f"light.homes_{name}ratio"] = float(np.median(ratios))
        found[f"light.homes_{name}ratio_spread"] = relative_spread(np.median(without, axis=0))
    return found


def _unit(name: str) -> str:
    return next((unit for end, unit in _UNITS.items() if name.endswith(end)), "-")


if __name__ == "__main__":
    main()
