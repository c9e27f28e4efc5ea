"""A torch Dataset of the views of an output root or of shards. Effects: reads them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import Dataset

from pbrs_farm.core.house_split import SplitShares
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.view_sample import Sample, SampleRequest
from pbrs_farm.views.views import Views

Tensors = dict[str, Any]  # name -> tensor or text

# Random augmentation: (sample, its generator) -> sample.
Transform = Callable[[Sample, np.random.Generator], Sample]


def tensors_of_sample(sample: Sample) -> Tensors:
    """Tensors by the names of Sample's arrays, and id, house, room, mode, axes as text.

    colour (3, H, W) uint8; normal (3, H, W), depth (H, W) and K (3, 3) float32; valid and boundary
    (H, W) bool; class40 (H, W) uint8; instance (H, W) int32, since torch hardly supports uint16.
    """
    names = ("id", "house", "room", "mode", "axes")
    tensors: Tensors = {name: getattr(sample, name) for name in names}
    tensors["K"] = _tensor(sample.K)
    for name, array in sample.arrays().items():
        # Torch's convolutions need channels first.
        planes = array.transpose(2, 0, 1) if array.ndim == 3 else array
        tensors[name] = _tensor(planes.astype(np.int32) if name == "instance" else planes)
    return tensors


def _tensor(array: NDArray[Any]) -> Any:
    # Copy read-only arrays and views of other arrays.
    is_usable = array.flags.c_contiguous and array.flags.writeable
    return torch.from_numpy(array if is_usable else array.copy(order="C"))


class StoredViews(Dataset):  # type: ignore[misc]
    """Views by index as dictionaries of tensors (view_loader.py).

    place: an argument of pbrs_farm.open, or Views. request: layers, mode, axes, size. Views without
    a requested file are skipped and listed in `views.left_out`. transform: of the numpy Sample, with
    a generator that depends on seed, epoch and the view's index. Raises BadInput if no view remains.
    """

    def __init__(
        self,
        place: str | Path | Views,
        request: SampleRequest | None = None,
        *,
        split: str | None = None,
        shares: SplitShares | None = None,
        transform: Transform | None = None,
        seed: int = 0,
    ) -> None:
        self.request = request or SampleRequest()
        views = place if isinstance(place, Views) else open_views(place)
        self.views = views.only(split=split, shares=shares, request=self.request)
        self.transform = transform
        self.seed = seed
        self.epoch = 0  # set by ViewLoader

    def __len__(self) -> int:
        return len(self.views)

    def sample(self, index: int) -> Sample:
        """The transformed arrays of a view."""
        sample = self.views[index].sample(self.request)
        if self.transform is None:
            return sample
        return self.transform(sample, np.random.default_rng((self.seed, self.epoch, index)))

    def __getitem__(self, index: int) -> Tensors:
        return tensors_of_sample(self.sample(index))
