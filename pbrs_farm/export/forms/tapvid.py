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
from pbrs_farm.export.form import Convention, ViewForm, name_left_out
from pbrs_farm.export.sequences import films_of, picture_of
from pbrs_farm.formats import tracks_npz
from pbrs_farm.regular_files import fault_of, read_regular

_FILE: Final = "tapvid.pkl"
_PROTOCOL: Final = 4
NO_FILM: Final = "pbrs-farm run HOME --cameras walk --tracks"


def write_tapvid(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """tapvid.pkl: house id -> "video", "points" and "occluded", for readers of TAP-Vid's DAVIS file.

    video (T, H, W, 3) uint8; points (N, T, 2) float32, x and y as shares of the picture's width and
    height from its upper left corner; occluded (N, T) bool. Contains the exported frames only, and only
    points visible in at least one of them. Raises BadInput for a house without tracks.npz.
    """
    films, others = films_of(views)
    others += [view for (_house, eye), frames in films.items() if eye for view in frames]
    videos = {house: _video(frames) for (house, eye), frames in films.items() if not eye}
    if not videos:
        raise BadInput("--to", "tapvid", "no view is a frame of a sequence", hint=NO_FILM)
    (out / _FILE).write_bytes(pickle.dumps(videos, _PROTOCOL))
    name_left_out(out, others, "is not a film frame of the rig's first camera")


def _video(frames: list[ChosenView]) -> dict[str, Any]:
    tracks = film_tracks(frames)
    pictures = [picture_of(frame, "tapvid") for frame in frames]
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
    try:
        data = read_regular(path)
    except OSError as error:
        hint = "run it with --tracks"
        raise BadInput(path, "", fault_of(error), hint=hint) from None
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
    is_of_frames=True,
    convention=Convention(0.5, axes="x right, y down from the upper left corner, 0..1"),
)
