"""What a job will cost before it runs: tasks, hours, storage; pure.

The constants were measured on the example homes on two cores; they are
there to distinguish an hour from a month, not to be right to ten per cent.
"""

from __future__ import annotations

import math
from typing import Final

from pbrs_farm.core.recipe import Recipe
from workers.job import JobSpec
from workers.node.view_batches import TARGET_S

# 779,342 views of 45,622 houses, the paper's own count.
VIEWS_PER_HOUSE: Final = 17.1
_SECONDS_PER_MEGASAMPLE: Final = 0.6  # of light
_LABELS_S: Final = 1.0  # and OpenGL, a view
_HOUSE_S: Final = 60.0  # repair and cameras, a house
_BYTES_PER_PIXEL: Final = {"light": 22.0, "labels": 4.0}


def seconds_per_view(recipe: Recipe) -> float:
    """Expected seconds of light for a view on one slot of two cores.

    From the samples a pixel and the picture's size alone, never less than 1 s. What a scene costs,
    how dark it is, and GPUs are not in it: the farm measures its own rates once a job runs.
    """
    light = recipe.light
    # Outdoor and indoor light: two samples where the recipe says one.
    is_path = light.integrator == "path"
    per_pixel = light.spp if is_path else light.direct_spp + light.mutations_per_pixel
    megasamples = 2 * per_pixel * recipe.image.width_px * recipe.image.height_px / 1e6
    return max(1.0, _SECONDS_PER_MEGASAMPLE * megasamples)


def estimate(spec: JobSpec, n_slots: int) -> dict[str, float | int | str]:
    """Expected houses, views, tasks, hours and storage of a job.

    n_slots: of the farm, 0 counts as one. "slot_hours" is work, "hours" that over the slots;
    "storage_gb" are gigabytes (10^9) of all outputs. A guess before anything was rendered: once the
    job runs, `Farm.status` has measured rates.
    """
    # Expect as many views a house as the paper had, or as were asked for.
    per_house = min(spec.n_views, VIEWS_PER_HOUSE) if spec.n_views else VIEWS_PER_HOUSE
    n_views = round(spec.n_houses * per_house)
    per_batch = max(1.0, TARGET_S / spec.seconds_per_view)
    n_batches = spec.n_houses * math.ceil(per_house / per_batch)
    # geometry and reduce a house, then each stage of each batch.
    n_tasks = 2 * spec.n_houses + n_batches * len(spec.batch_stages)
    # Sum the time of houses and views, then their pixels.
    has_light = "light" in spec.batch_stages
    seconds_per_view = _LABELS_S + (spec.seconds_per_view if has_light else 0.0)
    seconds = spec.n_houses * _HOUSE_S + n_views * seconds_per_view
    n_pixels = spec.recipe.image.width_px * spec.recipe.image.height_px
    per_pixel = _BYTES_PER_PIXEL["labels"] + (_BYTES_PER_PIXEL["light"] if has_light else 0.0)
    return {
        "job": spec.job_id,
        "houses": spec.n_houses,
        "views": n_views,
        "tasks": n_tasks,
        "slot_hours": round(seconds / 3600, 2),
        "hours": round(seconds / 3600 / max(1, n_slots), 2),
        "storage_gb": round(n_views * n_pixels * per_pixel / 1e9, 2),
    }
