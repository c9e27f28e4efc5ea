"""Walks and rigs as episodes of LeRobot v3 (huggingface/lerobot), with depth, K and poses.

    data/chunk-000/file-000.parquet  meta/{info.json,stats.json,tasks.parquet}
    meta/episodes/chunk-000/file-000.parquet

Effects: reads views, writes files.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from PIL import Image

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Files, parquet_bytes, write_files
from pbrs_farm.export.form import Convention, ViewForm, frames_with
from pbrs_farm.export.sequences import films_of, pace_of
from pbrs_farm.images import png_from_array

_FILE: Final = "chunk-{chunk:03d}/file-{file:03d}.parquet"
_PATH: Final = "{root}/chunk-{{chunk_index:03d}}/file-{{file_index:03d}}.parquet"
_FILES_A_CHUNK: Final = 1000
_TASK: Final = "Walk through the home."
_POSE: Final = ["x", "y", "z", "qx", "qy", "qz", "qw"]
_IMAGE: Final = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
_NUMBERS: Final = ("frame_index", "episode_index", "index", "task_index")
_AXES: Final = ["height", "width", "channels"]
_DEPTH: Final = {"is_depth_map": True, "depth_unit": "mm"}


def write_lerobot(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the files above; an episode is a house's film, a camera of its rig a group of features.

    Of each camera (`first` or its name): observation.images.<camera> (PNG), observation.images.<camera>_depth
    (TIFF, uint16 mm along the axis, 0 for nothing), observation.<camera>.K (9 numbers) and .pose (x y z qx qy qz
    qw, camera in OpenCV's axes to the home's world, y up, metres). observation.state is the first camera's pose,
    action that of the next frame. BadInput without a film, and for films of other cameras, sizes or frames a second.
    """
    episodes: dict[str, dict[str, list[ChosenView]]] = {}
    for (house, eye), frames in films_of(views).items():
        episodes.setdefault(house, {})[eye or "first"] = frames
    _require_alike(episodes)
    first = next(iter(episodes.values()))
    features, fps = _features(first), float(pace_of(first["first"]))
    stats = {name: _Stats(feature) for name, feature in features.items()}
    rows: list[dict[str, Any]] = []
    n_frames = 0
    for number, cameras in enumerate(episodes.values()):
        columns = _columns(cameras, fps, number, n_frames, stats)
        place = {"chunk": number // _FILES_A_CHUNK, "file": number % _FILES_A_CHUNK}
        table = parquet_bytes(columns, _schema(features))
        write_files(out, [{f"data/{_FILE.format(**place)}": table}])
        n = len(cameras["first"])
        rows.append(_episode(number, n, n_frames, place))
        n_frames += n
    tasks: dict[str, list[Any]] = {"task_index": [0], "task": [_TASK]}
    info = {
        "codebase_version": "v3.0",
        "robot_type": "camera",
        "total_episodes": len(episodes),
        "total_frames": n_frames,
        "total_tasks": 1,
        "chunks_size": _FILES_A_CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": int(fps) if fps == int(fps) else fps,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": _PATH.format(root="data"),
        "video_path": None,
        "features": features,
    }
    files: Files = {
        f"meta/episodes/{_FILE.format(chunk=0, file=0)}": parquet_bytes(rows, None),
        "meta/tasks.parquet": parquet_bytes(tasks, _schema_of_tasks()),
        "meta/info.json": info,
        "meta/stats.json": {name: of.table() for name, of in stats.items()},
    }
    write_files(out, [files])


def _require_alike(episodes: dict[str, dict[str, list[ChosenView]]]) -> None:
    """BadInput unless all films have the same cameras, frames, sizes and frames a second."""
    wanted: tuple[Any, ...] | None = None
    for house, cameras in episodes.items():
        if "first" not in cameras or len({len(frames) for frames in cameras.values()}) > 1:
            raise BadInput(house, "", "lacks frames of a camera of the rig")
        sizes = {name: {view.size for view in frames} for name, frames in cameras.items()}
        kind = sizes, pace_of(cameras["first"])
        wanted = wanted or kind
        if kind != wanted or any(len(size) > 1 for size in sizes.values()):
            raise BadInput(
                house, "", "has other cameras, sizes or frames a second than other films"
            )


def _features(cameras: dict[str, list[ChosenView]]) -> dict[str, dict[str, Any]]:
    features: dict[str, dict[str, Any]] = {}
    for name, (view, *_rest) in cameras.items():
        size = [*reversed(view.size)]
        image = f"observation.images.{name}"
        features[image] = {"dtype": "image", "shape": [*size, 3], "names": _AXES}
        depth = {"dtype": "image", "shape": [*size, 1], "names": _AXES, "info": _DEPTH}
        features[f"{image}_depth"] = depth
        features[f"observation.{name}.K"] = _vector(
            [f"k{r}{c}" for r in range(3) for c in range(3)]
        )
        features[f"observation.{name}.pose"] = _vector(_POSE)
    features |= {"observation.state": _vector(_POSE), "action": _vector(_POSE)}
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    return features | {name: {"dtype": "int64", "shape": [1], "names": None} for name in _NUMBERS}


def _vector(names: list[str]) -> dict[str, Any]:
    return {"dtype": "float32", "shape": [len(names)], "names": names}


def _columns(
    cameras: dict[str, list[ChosenView]],
    fps: float,
    number: int,
    first_row: int,
    stats: dict[str, _Stats],
) -> dict[str, list[Any]]:
    """The columns of an episode; counts their values in stats."""
    n = len(cameras["first"])
    columns: dict[str, list[Any]] = {}
    for name, frames in cameras.items():
        image, depth = f"observation.images.{name}", f"observation.images.{name}_depth"
        columns |= {image: [], depth: []}
        for view in frames:
            picture, millimetres = view.colours, view.depth_mm
            columns[image].append({"bytes": png_from_array(picture), "path": None})
            columns[depth].append({"bytes": _tiff(millimetres), "path": None})
            stats[image].add(np.moveaxis(picture / 255, -1, 0))
            stats[depth].add(millimetres[None])
        ks = [np.ravel(view.k_of_whole_centres) for view in frames]
        columns[f"observation.{name}.K"] = list(np.array(ks, np.float32))
        columns[f"observation.{name}.pose"] = [
            np.array(view.place_and_quaternion, np.float32) for view in frames
        ]
    poses = columns["observation.first.pose"]
    columns |= {"observation.state": poses, "action": [*poses[1:], poses[-1]]}
    columns["timestamp"] = [np.float32(k / fps) for k in range(n)]
    values = range(n), [number] * n, range(first_row, first_row + n), [0] * n
    columns |= {name: list(column) for name, column in zip(_NUMBERS, values, strict=True)}
    for name, column in columns.items():
        if stats[name].is_vector:
            for value in column:
                stats[name].add(np.atleast_1d(value))
    return columns


def _tiff(depth: NDArray[np.uint16]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(depth).save(buffer, "TIFF", compression="tiff_adobe_deflate")
    return buffer.getvalue()


class _Stats:
    """Least, greatest, mean and deviation of a feature, by channel."""

    def __init__(self, feature: dict[str, Any]) -> None:
        self.is_vector = feature["dtype"] != "image"
        n = feature["shape"][0 if self.is_vector else 2]
        self.low, self.high = np.full(n, np.inf), np.full(n, -np.inf)
        self.total, self.squares, self.n_values, self.n_frames = np.zeros(n), np.zeros(n), 0, 0

    def add(self, value: NDArray[Any]) -> None:
        """Count a frame's value, its first axis the channels."""
        flat = value.reshape(len(value), -1).astype(np.float64)
        self.low, self.high = np.minimum(self.low, flat.min(1)), np.maximum(self.high, flat.max(1))
        self.total, self.squares = self.total + flat.sum(1), self.squares + (flat**2).sum(1)
        self.n_values, self.n_frames = self.n_values + flat.shape[1], self.n_frames + 1

    def table(self) -> dict[str, Any]:
        """Entries of stats.json: an image's have the shape (channels, 1, 1)."""
        mean = self.total / self.n_values
        deviation = np.sqrt(np.maximum(self.squares / self.n_values - mean**2, 0))
        named = {"min": self.low, "max": self.high, "mean": mean, "std": deviation}
        shape = (-1,) if self.is_vector else (-1, 1, 1)
        rows = {name: values.reshape(shape).tolist() for name, values in named.items()}
        return rows | {"count": [self.n_frames]}


def _episode(number: int, n: int, first_row: int, place: dict[str, int]) -> dict[str, Any]:
    return {
        "episode_index": number,
        "tasks": [_TASK],
        "length": n,
        "data/chunk_index": place["chunk"],
        "data/file_index": place["file"],
        "dataset_from_index": first_row,
        "dataset_to_index": first_row + n,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }


def _schema(features: dict[str, dict[str, Any]]) -> pa.Schema:
    """Types of the columns: images by their bytes, vectors of a fixed length."""
    types = {"float32": pa.float32(), "int64": pa.int64()}
    fields = []
    for name, feature in features.items():
        n = feature["shape"][0]
        kind = _IMAGE if feature["dtype"] == "image" else types[feature["dtype"]]
        is_vector = feature["dtype"] == "float32" and n > 1
        fields.append((name, pa.list_(kind, n) if is_vector else kind))
    return pa.schema(fields)


def _schema_of_tasks() -> pa.Schema:
    """Types of tasks.parquet, whose index is `task` for pandas."""
    schema = pa.schema([("task_index", pa.int64()), ("task", pa.string())])
    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    columns = [
        {"name": n, "field_name": n, "pandas_type": k, "numpy_type": t, "metadata": None}
        for n, (k, t) in kinds.items()
    ]
    head = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    return schema.with_metadata({"pandas": json.dumps(head | {"pandas_version": "2.2.0"})})


FORM = ViewForm(
    "lerobot",
    write_lerobot,
    "LeRobot v3: an episode a walk, of each camera `observation.images.<camera>`, `_depth`, `observation.<camera>.K`, `.pose`",
    takes=frames_with("--cameras walk"),
    lenses=("pinhole",),
    is_of_frames=True,
    convention=Convention(0, axes="OpenCV's; world y up, m", depth="mm, along the axis"),
)
