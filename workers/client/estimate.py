"""Estimate a job's cost before it runs, by pbrs_farm/run/costs.csv: an hour or a month; pure."""

from __future__ import annotations

import math
from typing import Final

from pbrs_farm.core.recipe import Recipe
from pbrs_farm.run.costs import cost_of_run, measured, megasamples, views_per_house
from workers.job import JobSpec
from workers.node.view_batches import TARGET_S

_CPUS_PER_SLOT: Final = 2


def seconds_per_view(recipe: Recipe) -> float:
    """Expected seconds (at least 1) of light for a view on a slot of two cores, by samples and size alone."""
    return max(1.0, measured()["light_cpu_s"] * megasamples(recipe) / _CPUS_PER_SLOT)


def estimate(spec: JobSpec, n_slots: int) -> dict[str, float | int | str]:
    """Expected houses, views, tasks, hours and storage of a job.

    n_slots: of the farm, 0 counts as one. "slot_hours" is work, "hours" that over the slots;
    "storage_gb" are gigabytes (10^9) of all outputs. A guess before anything was rendered: once the
    job runs, `Farm.status` has measured rates.
    """
    cost = cost_of_run(spec.recipe, spec, spec.n_houses)
    per_batch = max(1.0, TARGET_S / spec.seconds_per_view)
    n_batches = spec.n_houses * math.ceil(views_per_house(spec.recipe, spec) / per_batch)
    slot_hours = cost.cpu_s / _CPUS_PER_SLOT / 3600
    return {
        "job": spec.job_id,
        "houses": spec.n_houses,
        "views": cost.n_views,
        # geometry and reduce a house, then each stage of each batch.
        "tasks": 2 * spec.n_houses + n_batches * len(spec.batch_stages),
        "slot_hours": round(slot_hours, 2),
        "hours": round(slot_hours / max(1, n_slots), 2),
        "storage_gb": round(cost.n_bytes / 1e9, 2),
    }
