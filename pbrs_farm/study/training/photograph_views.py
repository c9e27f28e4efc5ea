"""Photographs with depth as views that train: alone, or as a share of each batch. Effects: reads files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.photographs import PhotoFiles
from pbrs_farm.study.photographs import PHOTO_TRUTHS
from pbrs_farm.study.real_frames import digest_of_picture, read_frame, real_pairs, truth_at_size
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.training_views import CAMERA, ViewArrays
from pbrs_farm.study.training_plan import TrainingPlan

_MIX: Final = re.compile(r"(.+?):([0-9]*\.?[0-9]+)(?::([0-9]+))?")


@dataclass(frozen=True, slots=True)
class Mix:
    """A folder of photographs with depth, the share of each batch that is of it, and how many at most (0 = all)."""

    place: str
    share: float
    most: int = 0


@dataclass(frozen=True, slots=True)
class Photographs:
    """Pairs of a folder that train."""

    folder: Path
    pairs: tuple[PhotoFiles, ...]

    def views(self, plan: TrainingPlan) -> ViewArrays:
        """Colour and truth at the plan's size; BadInput naming the file that cannot be read."""
        rows: list[dict[str, Any]] = []
        for pair in self.pairs:
            frame = read_frame(pair, self.folder, plan)
            camera = {CAMERA: frame.camera} if plan.rays else {}
            truth = truth_at_size(frame.truth, plan)
            rows.append({"colour": frame.colour, **truth, **camera})
        arrays = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
        ids = tuple(id_of(pair, self.folder) for pair in self.pairs)
        return ViewArrays(ids, arrays.pop("colour"), arrays)

    def record(self) -> dict[str, Any]:
        """What a run says of them: by their digests they are known wherever they lie."""
        return {
            "name": self.folder.resolve().name,
            "pictures": [digest_of_picture(pair) for pair in self.pairs],
        }


def mix_of(word: str) -> Mix:
    """DIR:SHARE or DIR:SHARE:N. Raises BadInput for another form, and for a share that is not above 0 and below 1."""
    match = _MIX.fullmatch(word)
    if match is None:
        text = "expected a folder, the share of each batch and how many at most"
        raise BadInput("--mix", word, text, hint="--mix /my/rgbd:0.2 or /my/rgbd:0.2:80")
    mix = Mix(match[1], float(match[2]), int(match[3] or 0))
    if not 0 < mix.share < 1:
        raise BadInput("--mix", word, f"a share above 0 and below 1, got {mix.share:g}")
    return mix


def photographs_of(folder: Path, plan: TrainingPlan, most: int = 0) -> Photographs:
    """The pairs below a folder that say something of the plan's task, at most so many, spread over all."""
    pairs = real_pairs(folder, plan)
    if most and len(pairs) > most:
        pairs = tuple(pairs[k] for k in np.linspace(0, len(pairs) - 1, most).round().astype(int))
    return Photographs(folder, pairs)


def id_of(pair: PhotoFiles, folder: Path) -> str:
    """<scene>/<picture>: what stands for a home is the folder's own name, or that of the first folder below it."""
    return pair.id if "/" in pair.id else f"{folder.resolve().name}/{pair.id}"


def facts_of(rows: Sequence[Mapping[str, Any]], plan: TrainingPlan) -> dict[str, Any]:
    """What a run's record says of photographs it trains on, and of their truth; nothing without any."""
    if not rows:
        return {}
    truth = f"{task_of(plan.task).truth}; of photographs: {PHOTO_TRUTHS[plan.task]}"
    return {"photographs": list(rows), "truth": truth}


def digests_of(rows: Iterable[Mapping[str, Any]]) -> frozenset[str]:
    """The digests of the pictures that a run's record names under "photographs"."""
    return frozenset(digest for row in rows for digest in row["pictures"])
