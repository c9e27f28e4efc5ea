"""Estimated cost of a run, from constants measured on one machine, to an order of magnitude; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Final

from pbrs_farm.core.recipe import Recipe
from pbrs_farm.core.record import Record, read_csv
from pbrs_farm.run.request import Wanted
from pbrs_farm.sample.camera_source import source_of

VIEWS_PER_HOUSE: Final = 17.1
"""Where a run asks for all: 779,342 views of 45,622 houses, the paper's own count."""


class _Row(Record):
    what: str
    value: float
    unit: str
    of: str


@cache
def measured() -> Mapping[str, float]:
    """The constants of costs.csv, by name.

    >>> measured()["light_cpu_s"] > measured()["light_gpu_s"] > 0
    True
    """
    return {row.what: row.value for row in read_csv(Path(__file__).with_name("costs.csv"), _Row)}


@dataclass(frozen=True, slots=True)
class RunCost:
    """Total cost of runs. On a GPU light takes gpu_s, and cpu_beside_gpu_s of the CPU."""

    n_houses: int = 0
    n_views: int = 0
    cpu_s: float = 0.0
    gpu_s: float = 0.0
    cpu_beside_gpu_s: float = 0.0
    n_bytes: float = 0.0
    n_radiance_bytes: float = 0.0  # of radiance.exr, in n_bytes unless the run drops it
    n_files: float = 0.0

    def __add__(self, other: RunCost) -> RunCost:
        pairs = (getattr(self, f.name) + getattr(other, f.name) for f in fields(self))
        return RunCost(*pairs)


def megasamples(recipe: Recipe) -> float:
    """Millions of light samples, or mutations, of a view: outdoor and indoor light have each their own."""
    light = recipe.light
    is_path = light.integrator == "path"
    per_pixel = light.spp if is_path else light.direct_spp + light.mutations_per_pixel
    return 2 * per_pixel * megapixels(recipe)


def megapixels(recipe: Recipe) -> float:
    """Millions of pixels of a picture."""
    return recipe.image.width_px * recipe.image.height_px / 1e6


def views_per_house(recipe: Recipe, want: Wanted) -> float:
    """Expected views per home: the requested number, a walk's frames, or else the paper's average."""
    count = source_of(recipe.cameras).n_views
    if count is not None:
        n = count(recipe.cameras)
        return min(want.n_views, n) if want.n_views else n
    return min(want.n_views, VIEWS_PER_HOUSE) if want.n_views else VIEWS_PER_HOUSE


def cost_of_run(recipe: Recipe, want: Wanted, n_houses: int) -> RunCost:
    """Cost of a run of n_houses houses."""
    m, pixels = measured(), megapixels(recipe)
    has_light = any(mode.groups for mode in want.modes)
    rig = recipe.rig_in_use
    per_house = views_per_house(recipe, want) * (1 if rig is None else len(rig.cameras))
    n_views = n_houses * per_house
    # Either mode of light writes both pictures, and each variant one more.
    n_pictures = sum(not mode.groups for mode in want.modes)
    n_pictures += has_light * (2 + recipe.tone.variants)
    samples, lit = has_light * megasamples(recipe), has_light * pixels * m["develop_cpu_s"]
    house_s = m["house_cpu_s"] + has_light * m["daylight_cpu_s"]
    beside_s = n_houses * house_s + n_views * (m["view_cpu_s"] + lit)
    per_pixel = (
        m["label_bytes"] + n_pictures * m["picture_bytes"] + len(want.layers) * m["layer_bytes"]
    )
    has_radiance = has_light and not want.drop_radiance
    radiance = n_views * pixels * 1e6 * has_light * m["radiance_bytes"]
    files = m["view_files"] + n_pictures + has_radiance + len(want.layers)
    return RunCost(
        n_houses=n_houses,
        n_views=round(n_views),
        cpu_s=beside_s + n_views * samples * m["light_cpu_s"],
        gpu_s=n_views * samples * m["light_gpu_s"],
        cpu_beside_gpu_s=beside_s,
        n_bytes=n_houses * m["house_bytes"]
        + n_views * pixels * 1e6 * per_pixel
        + has_radiance * radiance,
        n_radiance_bytes=radiance,
        n_files=n_houses * m["house_files"] + n_views * files,
    )
