"""TAP-Vid's form: films with point tracks, as in its DAVIS file. Effects: reads views, writes files.

Doersch et al. 2022, TAP-Vid: A Benchmark for Tracking Any Point in a Video.
"""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import Convention, ViewForm, name_left_out
from pbrs_farm.export.sequences import frames_by_house, required_picture
from pbrs_farm.formats import tracks_npz
from pbrs_farm.images import array_from_png
from pbrs_farm.regular_files import fault_of, read_regular

_FILE: Final = "tapvid.pkl"
_PROTOCOL: Final = 4


def write_tapvid(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """tapvid.pkl: house id -> "video", "points" and "occluded", for readers of TAP-Vid's DAVIS file.

    video (T, H, W, 3) uint8; points (N, T, 2) float32, x and y as shares of the picture's width and
    height from its upper left corner; occluded (N, T) bool. Contains the exported frames only, and only
    points visible in at least one of them. Raises BadInput for a house without tracks.npz.
    """
    videos: dict[str, dict[str, Any]] = {}
    stills: list[ChosenView] = []
    for house, moments in frames_by_house(views).items():
        frames = [m.first for m in moments if m.first.facts.get("frame") is not None]
        stills += [m.first for m in moments if m.first.facts.get("frame") is None]
        stills += [view for m in moments for view in m.others.values()]
        if frames:
            videos[house] = _video(frames)
    if not videos:
        hint = "pbrs-farm run HOME --cameras walk --tracks"
        raise BadInput("--to", "tapvid", "no view is a frame of a sequence", hint=hint)
    (out / _FILE).write_bytes(pickle.dumps(videos, _PROTOCOL))
    name_left_out(out, stills, "is not a film frame of the rig's first camera")


def _video(frames: list[ChosenView]) -> dict[str, Any]:
    house = frames[0].house
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
    pictures = [
        array_from_png(frame.data(required_picture(frame, "tapvid")), f"{house.id}/{frame.id}")
        for frame in frames
    ]
    rendered = frames[0].entry.facts
    size = np.array([rendered["width_px"], rendered["height_px"]], np.float32)
    occluded = tracks["occluded"][:, columns]
    is_seen = ~occluded.all(1)
    return {
        "video": np.stack(pictures)[..., :3],
        "points": (tracks["points"][:, columns] / size)[is_seen].astype(np.float32),
        "occluded": occluded[is_seen],
    }


FORM = ViewForm(
    "tapvid",
    write_tapvid,
    "`tapvid.pkl` as TAP-Vid's DAVIS: house id -> `video`, `points` (N, T, 2) as shares of width and height,"
    " `occluded` (N, T); for films rendered with `--tracks`",
    is_of_frames=True,
    convention=Convention(0.5, axes="x right, y down from the upper left corner, 0..1"),
)
