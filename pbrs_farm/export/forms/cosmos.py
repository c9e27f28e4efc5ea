"""Films with control films and captions, for Cosmos Transfer's post-training (its TransferSFTDataset).

    videos/<house>.mp4  depth/<house>.mp4  seg/<house>.mp4  depth.jsonl  seg.jsonl

Effects: reads views, writes files; encodes with PyAV.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, Line, write_files
from pbrs_farm.export.form import REMARKS, Convention, ViewForm, frames_with
from pbrs_farm.export.forms.captions import caption
from pbrs_farm.export.sequences import films_of, pace_of
from pbrs_farm.formats.film_mp4 import film

_LEAST_FRAMES: Final = 61  # of a window; its loader drops shorter ones
_MOST_SECONDS: Final = 61.0  # of a film; its loader drops longer ones
_DARKEST: Final = 40  # of the channels of an instance's colour; black is nothing
_COLOURS: Final = np.random.default_rng(0).integers(_DARKEST, 256, (2**16, 3), np.uint8)


def write_cosmos(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the films and the lists above; a film is the walk of a camera.

    A line has uuid, size, nb_frames, framerate, duration, vision_path, t2w_windows with captions, control_type and
    control_path; paths are relative to the list. A window has 61 to 121 frames and the caption of its middle one.
    depth is the nearest depth of the film over that of the pixel, white is near; seg has a colour an instance, the
    same in all frames. remarks.txt names films that its loader drops. BadInput without a film, MachineFailed
    without PyAV.
    """
    remarks: list[str] = []
    write_files(out, (_files(*place, frames, remarks) for place, frames in films_of(views).items()))
    if remarks:
        head = f"its loader drops films below {_LEAST_FRAMES} frames or over {_MOST_SECONDS:g} s:\n"
        (out / REMARKS).write_text(head + "".join(remarks), "utf-8")


def _files(house: str, eye: str, frames: list[ChosenView], remarks: list[str]) -> Files:
    """The films of a walk, and its line in each list; adds a remark if the loader drops it."""
    uuid = f"{house}_{eye}" if eye else house
    pace = pace_of(frames)
    row = _row(uuid, frames, float(pace))
    if len(frames) < _LEAST_FRAMES or row["duration"] > _MOST_SECONDS:
        remarks.append(f"{uuid}: {len(frames)} frames of {row['duration']:g} s\n")
    controls = {"depth": _depth_pictures(frames), "seg": _instance_pictures(frames)}
    files: dict[str, Content] = {
        f"videos/{uuid}.mp4": film((view.colours for view in frames), pace)
    }
    for control, pictures in controls.items():
        path = f"{control}/{uuid}.mp4"
        line = row | {"control_type": control, "control_path": path}
        files |= {path: film(pictures, pace), f"{control}.jsonl": Line(json.dumps(line))}
    return files


def _row(uuid: str, frames: list[ChosenView], pace: float) -> dict[str, Any]:
    facts, n = frames[0].facts, len(frames)
    starts = window_starts(n)
    return {
        "uuid": uuid,
        "width": facts["width_px"] // 2 * 2,
        "height": facts["height_px"] // 2 * 2,
        "nb_frames": n,
        "framerate": pace,
        "duration": n / pace,
        "vision_path": f"videos/{uuid}.mp4",
        "t2w_windows": [
            {
                "start_frame": start,
                "end_frame": end - 1,
                "temporal_interval": 1,
                "caption": caption(frames[(start + end) // 2])["text"],
            }
            for start, end in pairwise(starts)
        ],
    }


def window_starts(n: int) -> list[int]:
    """First frames of the windows of a film of n frames, and n.

    >>> window_starts(130)
    [0, 65, 130]
    """
    n_windows = max(1, n // _LEAST_FRAMES)
    return [k * n // n_windows for k in range(n_windows + 1)]


def _instance_pictures(frames: list[ChosenView]) -> Iterator[NDArray[np.uint8]]:
    for view in frames:
        instance = view.array("instance")
        yield _COLOURS[instance] * (instance > 0)[..., None]


def _depth_pictures(frames: list[ChosenView]) -> Iterator[NDArray[np.uint8]]:
    """Pictures (H, W, 3) of inverse depth, by the nearest depth of all frames."""
    near = min(float(d[d > 0].min(initial=np.inf)) for d in (v.depth_m for v in frames))
    for view in frames:
        depth = view.depth_m
        share = np.divide(near, depth, out=np.zeros_like(depth), where=depth > 0)
        yield np.repeat(np.rint(share * 255).astype(np.uint8)[..., None], 3, axis=2)


FORM = ViewForm(
    "cosmos",
    write_cosmos,
    "Cosmos Transfer: `depth.jsonl`, `seg.jsonl` (films and captions), `videos`, `depth`, `seg` (extra `video`)",
    takes=frames_with("--cameras walk --frames 121"),
    lenses=("pinhole",),
    is_of_frames=True,
    convention=Convention(None, axes="", depth="nearest depth over depth, 8 bit"),
)
