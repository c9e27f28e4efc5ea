"""Films with tracks in the folders of CoTracker3's Kubric data (facebookresearch/co-tracker: its Kubric dataset).

    <house>/<house>.npy  <house>/frames/<3 digits>.png  <house>/depth/<3 digits>_depth.png

Effects: reads views, writes files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.options import option
from pbrs_farm.core.record import Record
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    depth_metres,
    intrinsics_of,
    k_of_whole_centres,
    require_lens,
)
from pbrs_farm.export.form import REMARKS, Convention, ViewForm, name_left_out, write_file
from pbrs_farm.export.forms.tapvid import NO_FILM, film_tracks
from pbrs_farm.export.sequences import films_of, picture_of, pose_opencv
from pbrs_farm.formats.hypersim import ray_lengths
from pbrs_farm.images import png_from_array

_USUAL_FRAMES: Final = 24  # of a sample in its training
_MOST_FRAMES: Final = 999  # its loaders sort files by three digits


class CoTrackerOptions(Record):
    """The program that reads the folders."""

    reader: str = option(
        "cotracker",
        "tapip3d: depth beside the frames and its K, as TAPIP3D reads them; CoTracker takes every file there for a frame",
        choices=("cotracker", "tapip3d"),
    )


def write_cotracker(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """Write the files above; a film is that of a house's first camera.

    <house>.npy is a pickled table: coords (N, T, 2) px from the picture's corner, visibility and occluded (N, T),
    both True where hidden (CoTracker inverts visibility), traj_3d (N, T, 3) in the home's world, intrinsics
    (T, 3, 3) over the picture's size (for TAPIP3D of pixels whose centres are whole numbers, as its loader counts
    them), matrix_world (T, 4, 4) from OpenGL's camera axes, depth_range. A depth of 16 bit is the distance along the ray between these two; the sky is at the far one. A point behind the camera has
    the place of the nearest frame with it in front. remarks.txt names films below 24 frames. BadInput without a
    film, without tracks.npz, and above 999 frames.
    """
    films, others = films_of(views)
    others += [view for (_house, eye), frames in films.items() if eye for view in frames]
    films = {(house, eye): frames for (house, eye), frames in films.items() if not eye}
    if not films:
        raise BadInput("--to", "cotracker", "no view is a frame of a sequence", hint=NO_FILM)
    for (house, _eye), frames in films.items():
        _write_film(out / house, house, frames, choice.of(CoTrackerOptions).reader)
    short = [f"{h}: {len(f)}\n" for (h, _eye), f in films.items() if len(f) < _USUAL_FRAMES]
    if short:
        head = f"films with fewer than the {_USUAL_FRAMES} frames of CoTracker's samples:\n"
        (out / REMARKS).write_text(head + "".join(short), "utf-8")
    name_left_out(out, others, "is not a film frame of the rig's first camera")


def _write_film(folder: Path, house: str, frames: list[ChosenView], reader: str) -> None:
    if len(frames) > _MOST_FRAMES:
        raise BadInput(house, "", f"has {len(frames)} frames, more than {_MOST_FRAMES}")
    distances = [depth_metres(view) * ray_lengths(intrinsics_of(view.facts)) for view in frames]
    hits = [array[array > 0] for array in distances if (array > 0).any()]
    near = min((float(array.min()) for array in hits), default=0.0)
    far = max(max((float(array.max()) for array in hits), default=1.0), near + 1e-3)
    for number, (view, distance) in enumerate(zip(frames, distances, strict=True)):
        require_lens(view, "cotracker", *FORM.lenses)
        picture = png_from_array(picture_of(view, "cotracker"), attribution=view.house.attribution)
        write_file(folder / f"frames/{number:03d}.png", picture)
        beside = "frames" if reader == "tapip3d" else "depth"
        share = np.where(distance > 0, (distance - near) / (far - near), 1)
        png = png_from_array(np.rint(share * 65535).astype(np.uint16))
        write_file(folder / f"{beside}/{number:03d}_depth.png", png)
    table = _table(frames, reader) | {"depth_range": np.array([near, far], np.float32)}
    np.save(folder / f"{house}.npy", np.array(table, object), allow_pickle=True)


def _table(frames: list[ChosenView], reader: str) -> dict[str, NDArray[Any]]:
    tracks, facts = film_tracks(frames), frames[0].facts
    size = np.array([facts["width_px"], facts["height_px"]], np.float64)
    coords, occluded = tracks["points"] * size, tracks["occluded"]
    over_size = np.array([[1 / size[0]], [1 / size[1]], [1.0]])
    ks = [view.facts["K"] for view in frames]
    if reader == "tapip3d":
        ks = [k_of_whole_centres(k) for k in ks]
    intrinsics = [np.array(k, np.float64) * over_size for k in ks]
    poses = [np.array(view.facts["world_from_camera_opengl"], np.float64) for view in frames]
    return {
        "coords": coords.astype(np.float32),
        "visibility": occluded,
        "occluded": occluded,
        "traj_3d": places_of_tracks(coords, tracks["depth_m"], frames).astype(np.float32),
        "intrinsics": np.stack(intrinsics).astype(np.float32),
        "matrix_world": np.stack(poses).astype(np.float32),
    }


def places_of_tracks(coords: F64, depth_m: NDArray[np.float32], frames: list[ChosenView]) -> F64:
    """(N, T, 3) world, metres; of points behind the camera those of the nearest frame with them in front."""
    places = np.empty((*depth_m.shape, 3))
    for k, view in enumerate(frames):
        pose = pose_opencv(view)
        rays = intrinsics_of(view.facts).directions(coords[:, k])
        places[:, k] = (rays * depth_m[:, k, None]) @ pose[:3, :3].T + pose[:3, 3]
    number = np.arange(len(frames))
    gap = np.abs(number[:, None] - number) + np.where(depth_m > 0, 0, len(frames))[:, None, :]
    return np.asarray(places[np.arange(len(places))[:, None], gap.argmin(-1)])


FORM = ViewForm(
    "cotracker",
    write_cotracker,
    "CoTracker3's Kubric folders: `<house>/<house>.npy`, `frames`, `depth`; of films with `--tracks`;"
    " `--reader tapip3d` puts depth beside the frames",
    options=CoTrackerOptions,
    lenses=("pinhole",),
    is_of_frames=True,
    convention=Convention(
        0.5, axes="OpenGL's; world y up, m", depth="16 bit between two distances along the ray"
    ),
)
