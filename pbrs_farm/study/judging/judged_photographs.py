"""Photographs with depth as views to judge normals and depth on, of ScanNet classes too. Effects: reads files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.judging.evaluation import JudgedViews
from pbrs_farm.study.photographs import PHOTO_TRUTHS
from pbrs_farm.study.real_frames import real_frames
from pbrs_farm.study.training_plan import TrainingPlan


def pair_views(
    folder: Path, plan: TrainingPlan, name: str, trained_on: frozenset[str] = frozenset()
) -> JudgedViews:
    """Every pair below a folder, for normals and depth, of ScanNet for classes; BadInput for one without intrinsics.

    All are held in memory, at the plan's size of picture. BadInput also for tasks of which its files
    say nothing, and for a photograph whose digest is in trained_on.
    """
    frames = list(real_frames(folder, plan))
    for frame in frames:
        if frame.digest in trained_on:
            text = "this photograph has trained, it may not judge"
            raise BadInput(folder, frame.id, text, hint="photographs of other rooms")
    colour = np.stack([frame.colour for frame in frames])
    ids, truths = tuple(f.id for f in frames), tuple(f.truth for f in frames)
    cameras = np.stack([frame.camera for frame in frames])
    return JudgedViews(name, PHOTO_TRUTHS[plan.task], ids, colour, truths, cameras=cameras)
