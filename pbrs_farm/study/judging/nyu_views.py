"""NYUv2's .mat as views to judge on: its test pictures, truth at their own size. Effects: reads files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.judging.photo_views import JudgedViews
from pbrs_farm.study.photographs.nyu_arrays import NYU_HOME
from pbrs_farm.study.photographs.nyu_pictures import NYU_TRUTHS, has_splits, nyu_pictures
from pbrs_farm.study.training_plan import Plan


def nyu_views(path: Path, plan: Plan, name: str, trained_on: frozenset[str]) -> JudgedViews:
    """The test pictures of the .mat, all of them where no splits.mat lies beside it.

    Raises BadInput for a file that is none, lacks what a task needs, or would judge what trained.
    """
    split = "test" if has_splits(path) else "all"
    if split == "all" and NYU_HOME in trained_on:
        text = "the run was tuned on NYUv2, and without splits.mat what trained would judge"
        raise BadInput(path, "", text, hint="put splits.mat beside it")
    pictures = list(nyu_pictures(path, plan, split))
    which = f"{len(pictures)} test pictures" if split == "test" else "all pictures, no splits.mat"
    said = f"{NYU_TRUTHS[plan.task]}; Eigen's crop; {which}"
    colour = np.stack([picture.colour for picture in pictures])
    truths = tuple(picture.truth for picture in pictures)
    return JudgedViews(name, said, tuple(picture.id for picture in pictures), colour, truths)
