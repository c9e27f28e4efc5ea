"""Views for training tests, built in code: the colour encodes the normal, so that it can be learnt."""

from __future__ import annotations

import numpy as np

from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.training_views import ViewArrays, arrays_of_samples
from pbrs_farm.study.training_plan import TrainingPlan, plan_of
from pbrs_farm.views.view_sample import Sample

SMALL = {
    "width_px": "40", "height_px": "32", "batch": "2", "steps": "6", "checkpoint_every": "2",
    "log_every": "1", "threads": "1",
}  # fmt: skip


TINY = [
    word
    for field in ("width_px=40", "height_px=32", "batch=2", "steps=3", "threads=1", "log_every=1")
    for word in ("--set", field)
]  # fmt: skip
"""The same plan with three steps, as words of the command line."""


def small_plan(task: str = "normals", **changed: str) -> TrainingPlan:
    """A plan of size tiny at 40x32 for six steps of two views."""
    return plan_of(task, "tiny", SMALL | changed)


def killed_plan(word: str) -> TrainingPlan:
    """The plan of a run that a test kills: of a task, or of normals with a running mean."""
    return small_plan(average="0.9") if word == "mean" else small_plan(word)


def sample(number: int, size: tuple[int, int] = (40, 32)) -> Sample:
    """A box of three walls with its corner at another place in each view."""
    width, height = size
    rng = np.random.default_rng(number)
    corner = rng.uniform(0.3, 0.7, 2) * (width, height)
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    surface = np.where(rows > corner[1], 2, np.where(columns > corner[0], 1, 0))
    tilt = rng.uniform(-0.2, 0.2)
    normals = np.array([[0.8, 0, -0.6], [-0.6, 0, -0.8], [0, -1, tilt]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normal = normals[surface].astype(np.float32)
    valid = rng.random((height, width)) > 0.05
    colour = np.clip((normal + 1) * 100 + rng.normal(0, 6, normal.shape) + 20, 0, 255)
    edges = np.zeros((height, width), bool)
    edges[:, :-1] |= surface[:, :-1] != surface[:, 1:]
    edges[:-1] |= surface[:-1] != surface[1:]
    house = f"home-{number % 4}-00000000"
    return Sample(
        id=f"{house}/{number}", house=house, room="0", mode="mlt_il_ol",
        K=np.eye(3, dtype=np.float32), axes="opencv", colour=colour.astype(np.uint8),
        normal=np.where(valid[..., None], normal, 0), valid=valid,
        class40=(surface + 1).astype(np.uint8), boundary=edges,
        depth=np.where(valid, 2 + 0.02 * rows + surface, 0).astype(np.float32),
    )  # fmt: skip


def views(n: int, plan: TrainingPlan) -> ViewArrays:
    """n views in the form that the plan's task needs."""
    size = (plan.width_px, plan.height_px)
    return arrays_of_samples((sample(k, size) for k in range(n)), task_of(plan.task), plan)
