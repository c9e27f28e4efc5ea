"""A set as a data set for training, rendered on demand. Effects: the stream's cache, processes.

Readers wait for units that stream_renderer.py renders ahead of them, and draw the light of each picture.
"""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.picture_cameras import CAMERAS
from pbrs_farm.operating_system import OWN_SESSION, end_tree, lock_file
from pbrs_farm.run.relight import picture_of_layers
from pbrs_farm.sets.stream_cache import CachedView, StreamCache, renderer_lock
from pbrs_farm.sets.stream_plan import StreamPlan, Unit
from pbrs_farm.sets.stream_renderer import FAULT
from pbrs_farm.views.stored_layers import sample_of_stored

_LOOK_S: Final = 0.02
_TELL_S: Final = 1.0  # between notes of this reader's place
_LINE_S: Final = 10.0  # between lines about waiting
_MOST_STARTS: Final = 4  # of renderers that end without the unit
_LOG_CHARS: Final = 400


class Stream(Sequence[dict[str, Any]]):
    """The samples of one epoch of a set, rendered on demand; a map-style data set for torch's DataLoader.

    A sample is a dict of arrays (H, W, ...) by layer, with K (3, 3), id, house, room, generation of the view,
    `light` (the options of `pbrs-farm relight` that give the picture) and exposure_ev (drawn; 0 for a camera whose own exposure errs). The order is shuffled by
    seed and epoch: leave a DataLoader's shuffle off. Equal seeds and epochs give equal bytes for any number of
    workers, after a kill too. Each epoch draws new light, and every `reuse` epochs new views. Raises BadInput if no
    home has a view, MachineFailed if the renderer ends.
    """

    def __init__(self, plan: StreamPlan, number: int = 0, start: int = 0) -> None:
        """number: of the epoch. start: its first sample."""
        self.plan = plan
        self.number = number
        self.start = start
        self._cache = StreamCache(plan.folder, plan.cache_bytes)
        self._told_s = -math.inf  # time of the last note of this reader's place

    def epoch(self, number: int, start: int = 0) -> Stream:
        """The samples of an epoch, from 0; start: number of samples to skip, to resume within it."""
        if number < 0 or not 0 <= start <= len(self.plan.order(0)):
            raise BadInput("stream", f"epoch {number}, start {start}", "is not in the stream")
        stream = Stream(self.plan, number, start)
        stream.start_renderers(start)
        return stream

    def __len__(self) -> int:
        return len(self.plan.order(self.number)) - self.start

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        position = self.start + index % len(self)
        home, view = self.plan.order(self.number)[position].tolist()
        fault = ""
        # A home that cannot be rendered is replaced by the next one.
        for k in range(len(self.plan.homes)):
            unit = self.plan.unit((home + k) % len(self.plan.homes), self.number)
            cached = self._cached(unit, view, position)
            if isinstance(cached, CachedView):
                return self._sample(cached, unit, view)
            fault = fault or cached
        raise BadInput(self.plan.name, "", f"no home has a view: {fault}")

    def _sample(self, cached: CachedView, unit: Unit, view: int) -> dict[str, Any]:
        """The arrays of a view, its picture in the light of this epoch."""
        labels = dict(cached.labels)
        facts: dict[str, Any] = {"generation": unit[1]}
        colour: dict[str, NDArray[Any]] = {}
        if cached.light is not None:
            draw = self.plan.light(self.number, unit, view, cached.light)
            # A camera that errs has its own draw of the exposure.
            ev = 0.0 if CAMERAS[cached.tone.camera].spread else draw.exposure_ev
            stops = float(np.clip(cached.tone.exposure_ev + ev, -8, 8))
            tone = cached.tone.model_copy(update={"exposure_ev": stops})
            colour["colour"] = picture_of_layers(
                cached.light, tone, outdoor=draw.outdoor, lamps=draw.factors
            )
            facts |= {"light": str(draw), "exposure_ev": ev}
        sample = sample_of_stored(cached.facts, labels, replace(self.plan.request, size=None))
        names = {"id": sample.id, "house": sample.house, "room": sample.room, "K": sample.K}
        return names | facts | colour | sample.arrays() | cached.layers

    def _cached(self, unit: Unit, view: int, position: int) -> CachedView | str:
        """A view of a unit, once it is rendered, or the fault of a home without views."""
        if time.monotonic() - self._told_s >= _TELL_S:
            self._tell(position)
        cached = self._cache.read(unit, view)
        began_s = line_s = time.monotonic()
        n_started = 0
        while cached is None:
            if n_started == 0 or time.monotonic() - self._told_s >= _TELL_S:
                n_started += self.start_renderers(position)
            self._check_renderers(n_started)
            time.sleep(_LOOK_S)
            if time.monotonic() - line_s >= _LINE_S:
                line_s = time.monotonic()
                self._report_wait(unit, line_s - began_s)
            cached = self._cache.read(unit, view)
        return cached

    def start_renderers(self, position: int) -> int:
        """Note this process's place and start the renderers that do not run; returns their number."""
        self._tell(position)
        n_started = 0
        for number in range(self.plan.jobs):
            log = lock_file(renderer_lock(self.plan.folder, number))
            if log is None:
                continue
            with log:
                process = subprocess.Popen(
                    [sys.executable, "-m", "pbrs_farm.sets.stream_renderer", str(number)],
                    stdin=subprocess.PIPE, stdout=log, stderr=log, **OWN_SESSION,
                )  # fmt: skip
            assert process.stdin is not None
            with process.stdin as pipe:
                pipe.write(pickle.dumps(self.plan))
            _STARTED.append(process)
            n_started += 1
        return n_started

    def close(self) -> None:
        """End the renderers that this process has started; others end soon after their last reader."""
        for process in _STARTED:
            end_tree(process)
            process.wait()
        _STARTED.clear()

    def _tell(self, position: int) -> None:
        self._cache.tell_place((self.number, position, self.plan.reuse))
        self._told_s = time.monotonic()

    def _check_renderers(self, n_started: int) -> None:
        """Raise the error that ended a renderer."""
        _STARTED[:] = [process for process in _STARTED if process.poll() is None]
        fault = self.plan.folder / FAULT
        if fault.is_file():
            text = fault.read_text()
            fault.unlink(missing_ok=True)
            raise MachineFailed(f"the renderer of {self.plan.name} ended: {text}")
        if n_started > _MOST_STARTS * self.plan.jobs:
            log = renderer_lock(self.plan.folder, 0)
            tail = log.read_text(errors="replace")[-_LOG_CHARS:].strip().rpartition("\n")[2]
            raise MachineFailed(f"the renderer ends again and again: {tail}", hint=f"see {log}")

    def _report_wait(self, unit: Unit, waited_s: float) -> None:
        n_units = sum(1 for _ in (self.plan.folder / "units").glob("*"))
        word = self.plan.homes[unit[0]].word
        text = f"{self.plan.name}: waited {waited_s:.0f} s for the views of {word}; {n_units} units"
        sys.stderr.write(f"{text} of {len(self.plan.homes)} homes are cached\n")


_STARTED: Final[list[subprocess.Popen[bytes]]] = []
"""Renderers that this process has started."""


def cache_root(folder: str | Path) -> Path:
    """The folder of all streams: a given one, else $PBRS_CACHE/stream or ~/.cache/pbrs_farm/stream."""
    from pbrs_farm.assets.debian import cache_folder

    return Path(folder).absolute() if os.fspath(folder) else cache_folder() / "stream"
