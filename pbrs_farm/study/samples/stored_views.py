"""A torch Dataset of the views of an output root or of shards, by number. Effects: reads them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from torch.utils.data import Dataset

from pbrs_farm.core.house_split import SplitShares
from pbrs_farm.study.reading.open_views import open_views
from pbrs_farm.study.reading.view_sample import Request, Sample
from pbrs_farm.study.reading.views import Views
from pbrs_farm.study.samples.view_tensors import Tensors, tensors_of_sample

# Changes a sample by chance: (sample, its random numbers) -> sample.
Transform = Callable[[Sample, np.random.Generator], Sample]


class StoredViews(Dataset):  # type: ignore[misc]
    """Views by number as dictionaries of tensors (view_tensors.py).

    place: what pbrs_farm.open takes, or Views. request: layers, mode, axes, size. Views without a
    file that request needs are left out: `views.left_out` names them. transform: of the numpy
    Sample, with random numbers that follow from seed, epoch and the view's number alone.
    Raises BadInput where no view is left.
    """

    def __init__(
        self,
        place: str | Path | Views,
        request: Request | None = None,
        *,
        split: str | None = None,
        shares: SplitShares | None = None,
        transform: Transform | None = None,
        seed: int = 0,
    ) -> None:
        self.request = request or Request()
        views = place if isinstance(place, Views) else open_views(place)
        self.views = views.only(split=split, shares=shares, request=self.request)
        self.transform = transform
        self.seed = seed
        self.epoch = 0  # set by ViewLoader

    def __len__(self) -> int:
        return len(self.views)

    def sample(self, at: int) -> Sample:
        """The view of that number as arrays, transformed."""
        sample = self.views[at].sample(self.request)
        if self.transform is None:
            return sample
        return self.transform(sample, np.random.default_rng((self.seed, self.epoch, at)))

    def __getitem__(self, at: int) -> Tensors:
        return tensors_of_sample(self.sample(at))
