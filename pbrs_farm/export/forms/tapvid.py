"""TAP-Vid's form: films with point tracks, as in its DAVIS file. Effects: reads views, writes files.

Doersch et al. 2022, TAP-Vid: A Benchmark for Tracking Any Point in a Video.
"""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import Convention, ViewForm, frames_with
from pbrs_farm.export.sequences import films_of
from pbrs_farm.formats import tracks_npz
from pbrs_farm.regular_files import read_given

_FILE: Final = "tapvid.pkl"
_PROTOCOL: Final = 4
FILMS: Final = frames_with("--cameras walk --tracks", of_rigs=False)


def write_tapvid(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """tapvid.pkl: house id -> "video", "points" and "occluded", for readers of TAP-Vid's DAVIS file.

    video (T, H, W, 3) uint8; points (N, T, 2) float32, x and y as shares of the picture's width and
    height from its upper left corner; occluded (N, T) bool. Contains the exported frames only, and only
    points visible in at least one of them. Raises BadInput for a house without tracks.npz.
    """
    videos = {house: _video(frames) for (house, _eye), frames in films_of(views).items()}
    (out / _FILE).write_bytes(pickle.dumps(videos, _PROTOCOL))


def _video(frames: list[ChosenView]) -> dict[str, Any]:
    tracks = film_tracks(frames)
    pictures = [frame.colours for frame in frames]
    return {
        "video": np.stack(pictures),
        "points": tracks["points"].astype(np.float32),
        "occluded": tracks["occluded"],
    }


def film_tracks(frames: list[ChosenView]) -> dict[str, NDArray[Any]]:
    """Arrays of tracks.npz for these frames of a film and the points visible in one of them.

    "points" are shares of the picture's width and height. BadInput without tracks.npz or for another film's.
    """
    path = frames[0].entry.folder.parents[1] / tracks_npz.FILE
    data = read_given(path, hint="run it with --tracks")
    tracks = tracks_npz.tracks_from_npz(data, str(path))
    number = {name: k for k, name in enumerate(tracks["frames"].tolist())}
    unknown = [frame.id for frame in frames if frame.id not in number]
    if unknown:
        raise BadInput(path, unknown[0], "is not a frame of these tracks")
    columns = [number[frame.id] for frame in frames]
    of_frames = {name: tracks[name][:, columns] for name in ("points", "occluded", "depth_m")}
    rendered = frames[0].entry.facts
    size = np.array([rendered["width_px"], rendered["height_px"]], np.float32)
    is_seen = ~of_frames["occluded"].all(1)
    of_frames["points"] = of_frames["points"] / size
    return {name: array[is_seen] for name, array in of_frames.items()}


FORM = ViewForm(
    "tapvid",
    write_tapvid,
    "`tapvid.pkl` as TAP-Vid's DAVIS: house id -> `video`, `points` (N, T, 2) as shares of width and height,"
    " `occluded` (N, T); for films rendered with `--tracks`",
    takes=FILMS,
    is_of_frames=True,
    convention=Convention(0.5, axes="x right, y down from the upper left corner, 0..1"),
)
