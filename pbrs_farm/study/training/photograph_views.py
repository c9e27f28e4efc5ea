"""Photographs with depth for training, alone or as a share of each batch. Effects: reads files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.photographs import PhotoFiles
from pbrs_farm.study.photographs import PHOTO_TRUTHS, arrays_of_frames, truth_text
from pbrs_farm.study.real_frames import depths_of_pairs, digest_of_picture, read_frame, real_pairs
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.training_views import ViewArrays, evenly_spaced
from pbrs_farm.study.training_plan import TrainingPlan

_MIX: Final = re.compile(r"(.+?):([0-9]*\.?[0-9]+)(?::([0-9]+))?")


@dataclass(frozen=True, slots=True)
class Mix:
    """A folder of photographs with depth, their share of each batch and their maximum number (0 = all)."""

    place: str
    share: float
    most: int = 0


@dataclass(frozen=True, slots=True)
class Photographs:
    """Training pairs of a folder."""

    folder: Path
    pairs: tuple[PhotoFiles, ...]

    def views(self, plan: TrainingPlan) -> ViewArrays:
        """Colour and truth at the plan's size; BadInput names a damaged file."""
        folder = self.folder
        frames = (
            replace(read_frame(pair, folder, plan), id=id_of(pair, folder)) for pair in self.pairs
        )
        return arrays_of_frames(frames, plan)

    def record(self) -> dict[str, Any]:
        """Entry in the record of a run; digests identify the pictures in any folder."""
        digests = [digest_of_picture(pair) for pair in self.pairs]
        name, depths = self.folder.resolve().name, depths_of_pairs(self.pairs)
        return {"name": name, "pictures": digests, "depths": depths}


def mix_of(word: str) -> Mix:
    """Parse DIR:SHARE or DIR:SHARE:N; BadInput for another form or a share outside 0..1."""
    match = _MIX.fullmatch(word)
    if match is None:
        text = "expected a folder, a share of each batch and a maximum number"
        raise BadInput("--mix", word, text, hint="--mix /my/rgbd:0.2 or /my/rgbd:0.2:80")
    mix = Mix(match[1], float(match[2]), int(match[3] or 0))
    if not 0 < mix.share < 1:
        raise BadInput("--mix", word, f"a share above 0 and below 1, got {mix.share:g}")
    return mix


def photographs_of(folder: Path, plan: TrainingPlan, most: int = 0) -> Photographs:
    """At most so many pairs below a folder with truth of the plan's task, evenly spaced."""
    return Photographs(folder, tuple(evenly_spaced(real_pairs(folder, plan), most)))


def id_of(pair: PhotoFiles, folder: Path) -> str:
    """<scene>/<picture>; the scene is the first folder below the given one, or that folder itself."""
    return pair.id if "/" in pair.id else f"{folder.resolve().name}/{pair.id}"


def facts_of(rows: Sequence[Mapping[str, Any]], plan: TrainingPlan) -> dict[str, Any]:
    """Fields of a run's record about its photographs and their truth; none without photographs."""
    if not rows:
        return {}
    depths = [depth for row in rows for depth in row["depths"]]
    of_photographs = truth_text(PHOTO_TRUTHS[plan.task], depths)
    truth = f"{task_of(plan.task).truth}; of photographs: {of_photographs}"
    return {"photographs": list(rows), "truth": truth}


def digests_of(rows: Iterable[Mapping[str, Any]]) -> frozenset[str]:
    """Digests of the pictures under "photographs" in a run's record."""
    return frozenset(digest for row in rows for digest in row["pictures"])
