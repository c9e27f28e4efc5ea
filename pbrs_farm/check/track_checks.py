"""tracks.npz against points that are followed again: from the frame in which each was chosen through the stored frames.

Effects: reads the file. Rays are Embree's, cameras those of view.json, faces move as house.json's motions say.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Faces, Floats, Rays
from pbrs_farm.check.motion_checks import OtherView, eye_of_row, is_seen
from pbrs_farm.check.moved_house import MovedHouse
from pbrs_farm.check.stored_files import BadFile, stored_bytes
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_view import StoredView

FILE: Final = "tracks.npz"
MOST_FRAMES: Final = 12  # of a film, spread over it, beside those in which points were chosen
_PX: Final = 0.02
_VERTEX_M: Final = 1e-6  # of vertices in 32-bit floats
_DEPTH: Final = 1e-4  # of the depth, and metres
_BESIDE_M: Final = (
    0.002  # of a point: where its surroundings are seen and it is not, either is right
)
_EDGE_ON: Final = 0.01  # cosine of a face's normal to the ray
_SHAPES: Final = {"points": 3, "occluded": 2, "depth_m": 2, "query_frame": 1, "instance": 1}

Scene = tuple[MovedHouse, Rays]


def check_tracks(
    house: StoredHouse,
    views: Sequence[StoredView],
    at: Callable[[float | None], Scene],
    tally: Tally,
) -> None:
    """Follow every point of a house's tracks through stored frames; nothing where it has none.

    at: of a time, the house and rays into it. A film of which no frame is stored counts nothing.
    """
    path = house.folder / FILE
    if not path.is_file():
        return
    place = f"{house.id}/{FILE}"
    try:
        with np.load(io.BytesIO(stored_bytes(path)), allow_pickle=False) as held:
            tracks: dict[str, NDArray[Any]] = {name: held[name] for name in ("frames", *_SHAPES)}
    except (BadFile, OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        tally.expect("tracks", place, False, f"cannot be read: {error}")
        return
    n, t = len(tracks["query_frame"]), len(tracks["frames"])
    shapes = {3: (n, t, 2), 2: (n, t), 1: (n,)}
    shaped = all(tracks[name].shape == shapes[axes] for name, axes in _SHAPES.items())
    rows = [row for row in house.camera_rows.values() if "frame" in row and not eye_of_row(row)]
    film = [str(row["id"]) for row in sorted(rows, key=lambda row: int(row["frame"]))]
    if not tally.expect("tracks", place, shaped, "its arrays do not fit each other"):
        return
    if not tally.expect("tracks", place, tracks["frames"].tolist() == film, "is of other frames"):
        return
    query = tracks["query_frame"]
    if not tally.expect(
        "tracks", place, bool(((query >= 0) & (query < t)).all()), "begins nowhere"
    ):
        return
    stored = {view.folder.name: view for view in views}
    known = {k: stored[name] for k, name in enumerate(film) if name in stored}
    looked = {film.index(v.folder.name) for v in _spread(list(known.values()))}
    for q in np.unique(query).tolist():
        if q in known:
            own = np.flatnonzero(query == q)
            _check_group(tracks, own, (q, known), sorted(looked | {q}), at, (place, tally))


def _spread(views: list[StoredView]) -> list[StoredView]:
    if len(views) <= MOST_FRAMES:
        return views
    return [views[k] for k in np.linspace(0, len(views) - 1, MOST_FRAMES).round().astype(int)]


def _check_group(
    tracks: dict[str, NDArray[Any]],
    own: NDArray[np.int64],
    begin: tuple[int, dict[int, StoredView]],
    frames: list[int],
    at: Callable[[float | None], Scene],
    tell: tuple[str, Tally],
) -> None:
    """The points (N,) that were chosen in one frame, in some frames."""
    q, views = begin
    place, tally = tell
    view = views[q]
    now, rays = at(view.table.get("time_s"))
    px = tracks["points"][own, q].astype(np.float64)
    columns, rows = np.floor(px).T.astype(np.int64)
    height, width = view.size
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    centred = inside & (np.abs(px - np.floor(px) - 0.5) <= _PX).all(1) & ~tracks["occluded"][own, q]
    what = f"of {view.folder.name} have points that are no pixel's centre"
    if not tally.expect("tracks", place, bool(centred.all()), what):
        return
    origin, directions = view.rays(rows, columns)
    face = rays.first(origin, directions)
    z = rays.distance(face, origin, directions)
    # A ray through an edge may meet the other face: its depth tells.
    same = (face >= 0) & (np.abs(z - tracks["depth_m"][own, q]) <= _DEPTH * (1 + z))
    tally.add("tracks", len(own), ties=int((~same).sum()))
    if (~same).sum() > max(2, 0.005 * len(own)):
        what = f"{(~same).sum()} of {len(own)} points of {view.folder.name} lie on nothing that is there"
        tally.fail("tracks", place, what)
    own, face, z, directions = own[same], face[same], z[same], directions[same]
    points = origin + z[:, None] * directions
    wrong = now.triangles.instance[face] != tracks["instance"][own]
    tally.expect("tracks", place, not wrong.any(), f"{wrong.sum()} points are of another instance")
    for f in frames:
        _check_frame(tracks, own, views[f], f, (now, points, face), at, tell)


def _check_frame(
    tracks: dict[str, NDArray[Any]],
    own: NDArray[np.int64],
    view: StoredView,
    f: int,
    begin: tuple[MovedHouse, Floats, Faces],
    at: Callable[[float | None], Scene],
    tell: tuple[str, Tally],
) -> None:
    """Where points are in one frame, and whether they are seen there."""
    place, tally = tell
    now, points, face = begin
    there, rays = at(view.table.get("time_s"))
    moved = points if there is now else there.carried(now, points, face)
    other = OtherView(view.k, view.world_from_camera, view.size, view.lens)
    px, depth = other.pixels(moved)
    told, hidden = tracks["points"][own, f].astype(np.float64), tracks["occluded"][own, f]
    with np.errstate(invalid="ignore"):
        front = (depth > 1e-3) & np.isfinite(px).all(1)
        off = np.abs(told - px).max(1) > place_slack_px(px, depth)
        off |= np.abs(tracks["depth_m"][own, f] - depth) > _DEPTH * (1 + np.abs(depth))
        margin = np.minimum(px, np.array(view.size[::-1]) - px).min(axis=1)
    tally.add("tracks", len(own))
    for k in np.flatnonzero(front & off)[:20]:
        tally.fail("tracks", place, f"point {own[k]} is elsewhere in {view.folder.name}")
    inside = np.flatnonzero(front & (margin > 0))
    seen = np.zeros(len(own), bool)
    seen[inside] = is_seen(moved[inside], other, rays)
    wrong = np.flatnonzero(hidden == seen)
    wrong = wrong[~_may_be_either(moved[wrong], other, margin[wrong], rays)]
    # A face that is seen edge-on hides its own points, or does not.
    towards = moved[wrong] - other.world_from_camera[:3, 3]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    slant = np.einsum("ni,ni->n", rays.normal(face[wrong], towards), towards)
    wrong = wrong[np.abs(slant) > _EDGE_ON]
    tally.add("tracks", len(own))
    for k in wrong[:20]:
        word = "hidden" if hidden[k] else "seen"
        tally.fail("tracks", place, f"point {own[k]} is not {word} in {view.folder.name}")


def place_slack_px(px: Floats, depth: Floats) -> Floats:
    """(N,) px by which a place (N, 2) may be off: 32-bit floats of it, and of vertices near the camera's plane."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1e-5 + _VERTEX_M / np.abs(depth)
        return np.asarray(_PX + share * np.abs(px).max(axis=1))


def _may_be_either(
    points: Floats, other: OtherView, margin: Floats, rays: Rays
) -> NDArray[np.bool_]:
    """(N,) on the picture's border, or beside what hides a point."""
    with np.errstate(invalid="ignore"):
        tie = np.asarray(np.abs(margin) <= _PX, bool)
    if not len(points):
        return tie
    answers = [
        is_seen(points + _BESIDE_M * np.array(step, np.float64), other, rays, slack_m=0.01)
        for step in ((0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
    ]
    return np.asarray(tie | (np.ptp(np.array(answers, np.int8), axis=0) > 0), bool)
