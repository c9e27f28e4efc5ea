"""Pictures of the ways to render at equal CPU: rooms.png and techniques.png in out/bench.

`rooms.png`: a column a room; `path`, below it Metropolis with MUTATIONS a pixel. `techniques.png`: the
paper's comparison on a home: path, Metropolis with 16 and with 512 direct samples, and a crop of each.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import FOLDER
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
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.transport.develop.tone_mapping import exposure_of, tone

SIZE: Final = (128, 96)
MUTATIONS: Final = 64


def main() -> None:
    """Draw both; four minutes of CPU."""
    columns = [_room(room_shot(key, SIZE)) for key in ROOMS]
    _write("rooms.png", np.concatenate(columns, 1))
    for shot in home_shots(SIX[:1], SIZE):
        _write("techniques.png", _techniques(shot))


def _room(shot: Shot) -> NDArray[np.uint8]:
    """`path` above Metropolis, in equal CPU time."""
    result, spent_s = timed(
        shot, METROPOLIS.model_copy(update={"mutations_per_pixel": MUTATIONS}), seed=1
    )
    path, spp = _path_in(shot, spent_s)
    print(f"{shot.name}: {spent_s:.1f} s CPU each; path {spp} samples", flush=True)
    return np.concatenate(_toned([path, all_light(result)]), 0)


def _techniques(shot: Shot) -> NDArray[np.uint8]:
    """Path, Metropolis with 16 and with 512 direct samples in equal CPU time; below, a crop of each."""
    few = METROPOLIS.model_copy(update={"direct_spp": 16, "mutations_per_pixel": MUTATIONS})
    _result, few_s = timed(shot, few, seed=1)
    many, many_s = timed(shot, few.model_copy(update={"direct_spp": 512}), seed=1)
    more = max(round(MUTATIONS * many_s / few_s), 1)
    result_few, _s = timed(shot, few.model_copy(update={"mutations_per_pixel": more}), seed=1)
    path, spp = _path_in(shot, many_s)
    print(f"techniques: {many_s:.1f} s CPU each; path {spp} samples, 16 direct with {more} mutations,"
          f" 512 direct with {MUTATIONS}", flush=True)  # fmt: skip
    shown = _toned([path, all_light(result_few), all_light(many)])
    w, h = SIZE
    crops = [p[h // 2 : h // 2 + h // 3, w // 3 : w // 3 + w // 3] for p in shown]
    enlarged = [c.repeat(3, 0).repeat(3, 1)[:h, :w] for c in crops]
    rows = [np.concatenate(row, 1) for row in (shown, enlarged)]
    width = min(r.shape[1] for r in rows)
    return np.concatenate([r[:, :width] for r in rows], 0)


def _path_in(shot: Shot, cpu_s: float) -> tuple[NDArray[np.float64], int]:
    """(picture of `path` that takes as much CPU time, its samples)."""
    _trial, trial_s = timed(shot, PLAIN.model_copy(update={"spp": 64}), seed=1)
    spp = max(round(64 * cpu_s / trial_s), 1)
    result, _s = timed(shot, PLAIN.model_copy(update={"spp": spp}), seed=1)
    return all_light(result), spp


def _toned(pictures: list[NDArray[np.float64]]) -> list[NDArray[np.uint8]]:
    """The pictures as sRGB, all by the exposure of the last."""
    fields = Recipe().tone
    exact = [p.astype(np.float32) for p in pictures]
    exposure = exposure_of(exact[-1], fields)
    return [tone(p, fields, exposure=exposure) for p in exact]


def _write(name: str, picture: NDArray[np.uint8]) -> None:
    """Write the picture, enlarged twice."""
    from pbrs_farm.images import png_from_array

    FOLDER.mkdir(parents=True, exist_ok=True)
    Path(FOLDER / name).write_bytes(png_from_array(picture.repeat(2, 0).repeat(2, 1)))


if __name__ == "__main__":
    main()
