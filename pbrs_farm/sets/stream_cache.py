"""The bounded cache of a stream: rendered units, prepared homes, readers' places. Effects: its folder.

    units/<home>-<generation>.npz   labels and layers of light of a unit's views
    houses/<home>/                  the finished steps `house` and `cameras` of a home
    readers/<host>-<pid>            place of a reading process
    renderer-<n>.log                log of a renderer, locked while it runs

A rename publishes each file, so a killed process leaves no partial file.
"""

from __future__ import annotations

import io
import json
import os
import platform
import shutil
import time
import zipfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.recipe import ToneFields
from pbrs_farm.operating_system import is_running, lock_file
from pbrs_farm.run.relight import RelightLayers
from pbrs_farm.sets.stream_plan import Place, Unit
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.transport.develop.mode_pictures import LinearAovs
from pbrs_farm.views.stored_layers import ViewFacts

_LATE_S: Final = 60.0  # readers idle for longer than the latest one do not count
_HALF_RANGE: Final = 2.0**10  # brightest value of a layer of light, stored as float16
_HEADER: Final = "header"


@dataclass(frozen=True, slots=True, eq=False)
class CachedView:
    """A view of a unit: stored labels by name, further layers, and its light if colour is asked for."""

    facts: ViewFacts
    labels: dict[str, NDArray[Any]]
    layers: dict[str, NDArray[Any]]
    light: RelightLayers | None
    tone: ToneFields


def bytes_of_unit(views: Sequence[CachedView], fault: str = "") -> bytes:
    """The file of a unit. fault: reason why its home has no views."""
    arrays: dict[str, NDArray[Any]] = {}
    rows = []
    for k, view in enumerate(views):
        scales: dict[str, float] = {}
        for name, layer in ({} if view.light is None else _images(view.light)).items():
            scales[name] = float(layer.max(initial=0.0)) / _HALF_RANGE or 1.0
            arrays[f"{k}/light/{name}"] = (layer / np.float32(scales[name])).astype(np.float16)
        arrays |= {f"{k}/labels/{name}": array for name, array in view.labels.items()}
        arrays |= {f"{k}/layers/{name}": array for name, array in view.layers.items()}
        rows.append({"facts": asdict(view.facts), "scales": scales, "tone": view.tone.model_dump()})
    header = json.dumps({"views": rows, "fault": fault}).encode()
    data = io.BytesIO()
    np.savez_compressed(data, **{_HEADER: np.frombuffer(header, np.uint8)}, **arrays)  # type: ignore[arg-type]
    return data.getvalue()


def _images(light: RelightLayers) -> dict[str, F32]:
    lamps = {f"lamp{number}": layer for number, layer in light.lamps.items()}
    return {"outdoor": light.aovs.outdoor, "albedo": light.aovs.albedo, **lamps}


def _light(images: dict[str, F32]) -> RelightLayers:
    outdoor, albedo = images.pop("outdoor"), images.pop("albedo")
    lamps = {int(name.removeprefix("lamp")): image for name, image in images.items()}
    # Normals guide the denoiser only, and these layers are denoised.
    return RelightLayers(LinearAovs(outdoor, np.zeros_like(outdoor), albedo, albedo), lamps)


class StreamCache:
    """The cache of one stream, shared by its readers and renderers."""

    def __init__(self, folder: Path, most_bytes: int) -> None:
        self.folder = folder
        self.most_bytes = most_bytes
        self.store = FolderStore(folder)

    def path(self, unit: Unit) -> Path:
        """The file of a unit."""
        return self.folder / "units" / f"{unit[0]:06d}-{unit[1]:06d}.npz"

    def house(self, home: int) -> Path:
        """The folder of a prepared home."""
        return self.folder / "houses" / f"{home:06d}"

    def read(self, unit: Unit, number: int) -> CachedView | str | None:
        """A view of a unit, counted round; the fault of a unit without views; None if it is not there."""
        try:
            file = np.load(self.path(unit), allow_pickle=False)
        except (FileNotFoundError, zipfile.BadZipFile):
            return None
        with file:
            header = json.loads(file[_HEADER].tobytes())
            if not header["views"]:
                return str(header["fault"])
            number %= len(header["views"])
            row = header["views"][number]
            names = [name for name in file.files if name.startswith(f"{number}/")]
            parts: dict[str, dict[str, Any]] = {"light": {}, "labels": {}, "layers": {}}
            for name in names:
                _number, kind, layer = name.split("/")
                parts[kind][layer] = file[name]
        scales = row["scales"]
        images = {
            n: a.astype(np.float32) * np.float32(scales[n]) for n, a in parts["light"].items()
        }
        light = _light(images) if images else None
        facts, tone = ViewFacts(**row["facts"]), ToneFields(**row["tone"])
        return CachedView(facts, parts["labels"], parts["layers"], light, tone)

    def put(self, unit: Unit, data: bytes, distance: Callable[[Path], float]) -> bool:
        """Write a unit within the bound; False if the cache is full of units used earlier."""
        with lock_file(self.folder / "space.lock", wait=True) or io.BytesIO():
            path = self.path(unit)
            has_room = self.make_room(len(data), distance, distance(path))
            if has_room:
                self.store.put(path.relative_to(self.folder).as_posix(), data)
            return has_room

    def make_room(self, n_bytes: int, distance: Callable[[Path], float], limit: float) -> bool:
        """Evict the entries used last until n_bytes fit; False if only entries used before `limit` remain.

        The bound holds for all streams below the cache's folder together; those of other streams go first.
        """
        streams = [path for path in self.folder.parent.iterdir() if path.is_dir()]
        kinds = [stream / kind for stream in streams for kind in ("units", "houses")]
        sizes = {path: _size(path) for kind in kinds for path in kind.glob("*")}
        total = sum(sizes.values()) + n_bytes
        for path in sorted(sizes, key=distance, reverse=True):
            if total <= self.most_bytes or distance(path) <= limit:
                break
            stream = path.parents[1]
            if stream == self.folder or not _is_in_use(stream):
                shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
                total -= sizes[path]
        return total <= self.most_bytes

    def tell_place(self, place: Place) -> None:
        """Note where this process reads."""
        key = f"readers/{platform.node()}-{os.getpid()}"
        self.store.put(key, " ".join(map(str, place)).encode())

    def places(self) -> list[Place]:
        """The places of the processes that read; [] if all of them have ended."""
        live = []
        for path in (self.folder / "readers").glob("*"):
            host, _, pid = path.name.rpartition("-")
            with suppress(OSError, ValueError):
                told_s = path.stat().st_mtime
                is_here = host == platform.node()
                if is_running(int(pid)) if is_here else time.time() - told_s < _LATE_S:
                    epoch, position, reuse = map(int, path.read_text().split())
                    live.append((told_s, (epoch, position, reuse)))
                else:
                    path.unlink(missing_ok=True)
        last_s = max((told_s for told_s, _place in live), default=0.0)
        return [place for told_s, place in live if told_s > last_s - _LATE_S]


def renderer_lock(stream: Path, number: int) -> Path:
    """The file that a renderer of a stream has locked, its log."""
    return stream / f"renderer-{number}.log"


def _is_in_use(stream: Path) -> bool:
    """True if a renderer works for a stream."""
    lock = lock_file(renderer_lock(stream, 0))
    if lock is not None:
        lock.close()
    return lock is None


def _size(path: Path) -> int:
    """Bytes of a file or a folder; 0 if it is gone."""
    files = path.rglob("*") if path.is_dir() else [path]
    with suppress(OSError):
        return sum(file.stat().st_size for file in files)
    return 0
