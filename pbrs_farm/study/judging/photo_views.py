"""Views to judge on whose truth has a size of its own, as of photographs; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.training.view_arrays import ViewArrays


@dataclass(frozen=True, slots=True, eq=False)
class JudgedViews:
    """Pictures at the network's size, and what is true of each."""

    name: str  # what a table calls them
    truth: str  # which truth and which mask, in words
    ids: tuple[str, ...]
    colour: NDArray[np.uint8]  # (N, h, w, 3) sRGB
    truths: tuple[Arrays, ...]  # arrays (H, W, ...) of each view, of any size
    credits: tuple[str, ...] = ()  # whose homes the pictures show

    @property
    def sizes(self) -> list[tuple[int, int]]:
        """(height, width) of each truth."""
        shapes = [next(iter(truth.values())).shape for truth in self.truths]
        return [(int(shape[0]), int(shape[1])) for shape in shapes]


def judged_of_arrays(
    name: str, truth: str, views: ViewArrays, credits: tuple[str, ...] = ()
) -> JudgedViews:
    """Rendered views, whose truth has the network's size."""
    truths = tuple(views.target(k) for k in range(len(views)))
    return JudgedViews(name, truth, views.ids, views.colour, truths, credits)
