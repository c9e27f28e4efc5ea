"""Homes and views of a root or of shards, to choose from and to read one by one. Effects: reads lazily."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SPLITS, SplitShares
from pbrs_farm.study.reading.stored_layers import ViewFacts
from pbrs_farm.study.reading.view_sample import Sample, SampleRequest


@dataclass(frozen=True, slots=True, order=True)
class ViewRef:
    """Names a view of a root."""

    house: str
    view: str

    @property
    def id(self) -> str:
        """`<house>/<view>`, as in Sample.id."""
        return f"{self.house}/{self.view}"

    @property
    def is_object(self) -> bool:
        """A single model without context, not a view of a house."""
        return self.house.startswith("object_")


class ViewSource(Protocol):
    """Where views are read from: an output root in a store, or shards. Can be sent to a process."""

    @property
    def url(self) -> str:
        """What was opened."""
        ...

    def lacks(self, ref: ViewRef, request: SampleRequest) -> str:
        """The first file of what is asked for that the view has not; "" where it has all."""
        ...

    def modes(self, ref: ViewRef) -> tuple[str, ...]:
        """The lighting modes the view has a picture of."""
        ...

    def facts(self, ref: ViewRef) -> ViewFacts:
        """The view's camera; BadInput where it cannot be read."""
        ...

    def table(self, ref: ViewRef) -> dict[str, Any]:
        """view.json as it is stored (docs/formats.md); of shards the part that was packed."""
        ...

    def read(self, ref: ViewRef, request: SampleRequest) -> Sample:
        """The arrays asked for; BadInput where one is missing, damaged or of the wrong type."""
        ...

    def layers(self, ref: ViewRef) -> tuple[str, ...]:
        """The layers the view has, by the names of core/layers.py; of shards those packed."""
        ...

    def layer(self, ref: ViewRef, name: str) -> NDArray[Any]:
        """A layer as it is stored; BadInput where there is none."""
        ...

    def kept_by(self, run: str) -> frozenset[ViewRef]:
        """The views that a selection keeps; BadInput where there is no such run."""
        ...

    def split_of(self, ref: ViewRef, shares: SplitShares | None) -> str:
        """The split the view's house falls into; shares None: as packed, else 80/10/10."""
        ...


@dataclass(frozen=True, slots=True)
class View:
    """One view; nothing is read before it is asked for."""

    ref: ViewRef
    source: ViewSource

    @property
    def id(self) -> str:
        """`<house>/<view>`."""
        return self.ref.id

    @property
    def modes(self) -> tuple[str, ...]:
        """The lighting modes it has a picture of."""
        return self.source.modes(self.ref)

    @property
    def room(self) -> str:
        """The id of its room."""
        return self.source.facts(self.ref).room

    @property
    def size(self) -> tuple[int, int]:
        """Width and height as stored, pixels."""
        return self.source.facts(self.ref).size

    @property
    def k(self) -> NDArray[np.float64]:
        """(3, 3): (x right, y down, z forward) to pixels."""
        return np.array(self.source.facts(self.ref).K, np.float64)

    @property
    def world_from_camera_opencv(self) -> NDArray[np.float64]:
        """(4, 4) pose: metres, world y up, camera x right, y down, z forward."""
        return np.array(self.source.facts(self.ref).world_from_camera_opencv, np.float64)

    @property
    def table(self) -> dict[str, Any]:
        """view.json: instances with their boxes and classes, sky, seeds (docs/formats.md)."""
        return self.source.table(self.ref)

    @property
    def layers(self) -> tuple[str, ...]:
        """All layers it has, optional ones too; pbrs_farm.core.layers.LAYER says unit and axes of each."""
        return self.source.layers(self.ref)

    def layer(self, name: str) -> NDArray[Any]:
        """A layer as it is stored, (H, W) or (H, W, C): "depth" in mm, "position" in metres, ..."""
        return self.source.layer(self.ref, name)

    def sample(self, request: SampleRequest | None = None) -> Sample:
        """The arrays of a request: colour in mlt_il_ol light and normals in OpenCV's axes for None."""
        return self.source.read(self.ref, request or SampleRequest())


@dataclass(frozen=True, slots=True)
class Views(Sequence[View]):
    """Views of one source, in the order of their ids.

    left_out: id -> why, of views that `only` looked at and could not keep.
    """

    source: ViewSource
    refs: tuple[ViewRef, ...]
    left_out: dict[str, str]

    @overload
    def __getitem__(self, at: int) -> View: ...
    @overload
    def __getitem__(self, at: slice) -> Views: ...
    def __getitem__(self, at: int | slice) -> View | Views:
        if isinstance(at, slice):
            return replace(self, refs=self.refs[at])
        return View(self.refs[at], self.source)

    def __len__(self) -> int:
        return len(self.refs)

    def __iter__(self) -> Iterator[View]:
        return (View(ref, self.source) for ref in self.refs)

    @property
    def homes(self) -> tuple[str, ...]:
        """The ids of houses (and objects without context) there are views of."""
        return tuple(dict.fromkeys(ref.house for ref in self.refs))

    @property
    def modes(self) -> tuple[str, ...]:
        """The lighting modes that some view has."""
        return tuple(dict.fromkeys(m for ref in self.refs for m in self.source.modes(ref)))

    def only(
        self,
        *,
        split: str | None = None,
        shares: SplitShares | None = None,
        houses: Collection[str] | None = None,
        objects: bool | None = None,
        selection: str | None = None,
        request: SampleRequest | None = None,
    ) -> Views:
        """The views of a split, of some houses, of rooms or of objects, with all that request needs.

        selection: only what that run of `pbrs-farm select` keeps. A view that lacks a file of request (a run goes on, or was made without that mode) is left
        out and named in left_out. Raises BadInput where none is left.
        """
        if split is not None and split not in SPLITS:
            raise BadInput("split", split, "no such split", hint=f"of {', '.join(SPLITS)}")
        chosen = None if selection is None else self.source.kept_by(selection)
        refs = [
            ref
            for ref in self.refs
            if (chosen is None or ref in chosen)
            and (houses is None or ref.house in houses)
            and (objects is None or ref.is_object == objects)
            and (split is None or self.source.split_of(ref, shares) == split)
        ]
        lacking = {r.id: self.source.lacks(r, request) for r in refs} if request else {}
        left_out = {at: f"no {file}" for at, file in lacking.items() if file}
        kept = tuple(ref for ref in refs if ref.id not in left_out)
        if not kept:
            raise BadInput(self.source.url, "", _nothing_left(split, len(refs), left_out))
        return replace(self, refs=kept, left_out=left_out)


def _nothing_left(split: str | None, n_found: int, left_out: dict[str, str]) -> str:
    where = f" in split {split}" if split else ""
    if not left_out:
        return f"no view{where}"
    at, why = next(iter(left_out.items()))
    return f"none of {n_found} views{where} has what was asked for: {at}: {why}"
