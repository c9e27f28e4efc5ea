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
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, write_files
from pbrs_farm.export.form import REMARKS, Convention, ViewForm
from pbrs_farm.export.forms.tapvid import FILMS, film_tracks
from pbrs_farm.export.sequences import films_of
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
    films = films_of(views)
    reader = choice.of(CoTrackerOptions).reader
    write_files(out, (_files(house, f, reader) for (house, _eye), f in films.items()))
    short = [f"{h}: {len(f)}\n" for (h, _eye), f in films.items() if len(f) < _USUAL_FRAMES]
    if short:
        head = f"films with fewer than the {_USUAL_FRAMES} frames of CoTracker's samples:\n"
        (out / REMARKS).write_text(head + "".join(short), "utf-8")


def _files(house: str, frames: list[ChosenView], reader: str) -> Files:
    if len(frames) > _MOST_FRAMES:
        raise BadInput(house, "", f"has {len(frames)} frames, more than {_MOST_FRAMES}")
    distances = [view.depth_m * ray_lengths(view.intrinsics) for view in frames]
    hits = [array[array > 0] for array in distances if (array > 0).any()]
    near = min((float(array.min()) for array in hits), default=0.0)
    far = max(max((float(array.max()) for array in hits), default=1.0), near + 1e-3)
    table = _table(frames, reader) | {"depth_range": np.array([near, far], np.float32)}
    files: dict[str, Content] = {f"{house}/{house}.npy": np.array(table, object)}
    beside = "frames" if reader == "tapip3d" else "depth"
    for number, (view, distance) in enumerate(zip(frames, distances, strict=True)):
        picture = png_from_array(view.colours, attribution=view.house.attribution)
        files[f"{house}/frames/{number:03d}.png"] = picture
        share = np.where(distance > 0, (distance - near) / (far - near), 1)
        files[f"{house}/{beside}/{number:03d}_depth.png"] = np.rint(share * 65535).astype(np.uint16)
    return files


def _table(frames: list[ChosenView], reader: str) -> dict[str, NDArray[Any]]:
    tracks = film_tracks(frames)
    size = np.array(frames[0].size, np.float64)
    coords, occluded = tracks["points"] * size, tracks["occluded"]
    over_size = np.array([[1 / size[0]], [1 / size[1]], [1.0]])
    is_whole = reader == "tapip3d"
    ks = [view.k_of_whole_centres if is_whole else view.facts["K"] for view in frames]
    intrinsics = [np.array(k, np.float64) * over_size for k in ks]
    poses = [view.opengl_pose for view in frames]
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
        places[:, k] = view.in_world(coords[:, k], depth_m[:, k])
    number = np.arange(len(frames))
    gap = np.abs(number[:, None] - number) + np.where(depth_m > 0, 0, len(frames))[:, None, :]
    return np.asarray(places[np.arange(len(places))[:, None], gap.argmin(-1)])


FORM = ViewForm(
    "cotracker",
    write_cotracker,
    "CoTracker3's Kubric folders: `<house>/<house>.npy`, `frames`, `depth`; of films with `--tracks`;"
    " `--reader tapip3d` puts depth beside the frames",
    options=CoTrackerOptions,
    takes=FILMS,
    lenses=("pinhole",),
    is_of_frames=True,
    convention=Convention(
        0.5, axes="OpenGL's; world y up, m", depth="16 bit between two distances along the ray"
    ),
)
