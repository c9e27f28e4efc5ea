"""tracks.npz against points followed again by Embree from one stored camera to others. Effects: reads files."""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.axes import dot
from pbrs_farm.check.cases import HouseCase, Scenes
from pbrs_farm.check.certificate import Expect, Tally
from pbrs_farm.check.checks import Check
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.followed_points import is_seen
from pbrs_farm.check.lens_rays import StoredCamera
from pbrs_farm.check.stored_files import BadFile, stored_bytes
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.shot import Shot

_FILE = "tracks.npz"
_MOST_FRAMES = 12  # of a film, spread over it, beside those in which points were chosen
_PX = 0.02
_VERTEX_M = 1e-6  # precision of vertices in 32-bit floats
_DEPTH = 1e-4  # tolerance as a share of the depth, and in metres
_BESIDE_M = 0.002  # around a point: if visibility differs there, either answer is right
_EDGE_ON = 0.01  # cosine of a face's normal to the ray
_MOST_LISTED = 20  # reported points of a frame
_SHAPES = {"points": 3, "occluded": 2, "depth_m": 2, "query_frame": 1, "instance": 1}


@dataclass(frozen=True, slots=True)
class _Film:
    """The tracks of a house, and the stored views by their frame's number."""

    case: HouseCase
    tracks: dict[str, NDArray[Any]]
    views: dict[int, StoredView]
    frames: list[int]  # in which points are looked at

    @property
    def tally(self) -> Tally:
        return self.case.tally

    @property
    def place(self) -> str:
        return f"{self.case.house.id}/{_FILE}"

    @property
    def expect(self) -> Expect:
        return self.tally.at("tracks", self.place)

    def scenes(self, frame: int) -> Scenes:
        return self.case.times.at(self.views[frame].table.get("time_s"))

    def list_points(self, points: I64, fault: str) -> None:
        for point in points[:_MOST_LISTED]:
            self.tally.fail("tracks", self.place, f"point {point} {fault}")


def check_tracks(case: HouseCase) -> None:
    """Follow every point of a house's tracks through the stored frames."""
    house, expect = case.house, case.tally.at("tracks", f"{case.house.id}/{_FILE}")
    try:
        data = io.BytesIO(stored_bytes(house.folder / _FILE))
        with np.load(data, allow_pickle=False) as arrays:
            tracks: dict[str, NDArray[Any]] = {n: arrays[n] for n in ("frames", *_SHAPES)}
    except (BadFile, OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        expect(False, f"cannot be read: {error}")
        return
    n, t = len(tracks["query_frame"]), len(tracks["frames"])
    shapes = {3: (n, t, 2), 2: (n, t), 1: (n,)}
    shaped = all(tracks[name].shape == shapes[axes] for name, axes in _SHAPES.items())
    rows = [
        row
        for row in house.camera_rows.values()
        if "frame" in row and not Shot.of_row(row["id"], row).eye
    ]
    film = [str(row["id"]) for row in sorted(rows, key=lambda row: int(row["frame"]))]
    if not expect(shaped, "its arrays have inconsistent shapes"):
        return
    if not expect(tracks["frames"].tolist() == film, "is of other frames"):
        return
    query = tracks["query_frame"]
    if not expect(((query >= 0) & (query < t)).all(), "has no start"):
        return
    stored = {v.view.folder.name: v.view for v in case.views}
    views = {k: stored[name] for k, name in enumerate(film) if name in stored}
    # Views come by name, which need not be the order of frames.
    chosen = {film.index(v.folder.name) for v in _spread([*views.values()])}
    for frame in np.unique(query).tolist():
        if frame in views:
            frames = sorted(chosen | {frame})
            _check_group(_Film(case, tracks, views, frames), frame, np.flatnonzero(query == frame))


def _spread(views: list[StoredView]) -> list[StoredView]:
    if len(views) <= _MOST_FRAMES:
        return views
    return [views[k] for k in np.linspace(0, len(views) - 1, _MOST_FRAMES).round().astype(int)]


def _check_group(film: _Film, frame: int, index: I64) -> None:
    """The points (N,) chosen in one frame, in all frames to look at."""
    tracks, view, scenes = film.tracks, film.views[frame], film.scenes(frame)
    px = tracks["points"][index, frame].astype(np.float64)
    columns, rows = np.floor(px).T.astype(np.int64)
    height, width = view.size
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    centred = inside & (np.abs(px - np.floor(px) - 0.5) <= _PX).all(1)
    centred &= ~tracks["occluded"][index, frame]
    name = view.folder.name
    if not film.expect(centred.all(), f"of {name} have points off pixel centres"):
        return
    origin, directions = view.rays(rows, columns)
    face = scenes.rays.first(origin, directions)
    z = scenes.rays.distance(face, origin, directions)
    # A ray through an edge may meet the other face, with another depth.
    same = (face >= 0) & (np.abs(z - tracks["depth_m"][index, frame]) <= _DEPTH * (1 + z))
    n_other = int((~same).sum())
    film.tally.add("tracks", len(index), ties=n_other)
    if n_other > max(2, 0.005 * len(index)):
        fault = f"{n_other} of {len(index)} points of {name} are on no surface"
        film.tally.fail("tracks", film.place, fault)
    index, face, z, directions = index[same], face[same], z[same], directions[same]
    points = origin + z[:, None] * directions
    wrong = scenes.triangles.instance[face] != tracks["instance"][index]
    film.expect(not wrong.any(), f"{wrong.sum()} points are of another instance")
    for later in film.frames:
        moved, then = points, film.scenes(later)
        if then is not scenes:
            moved = then.moved.carried(scenes.moved, points, face)
        _check_frame(film, later, index, moved, face)


def _check_frame(film: _Film, frame: int, index: I64, points: F64, face: I64) -> None:
    """The places of points (N, 3) in one frame, and whether they are visible there."""
    tracks, view, rays = film.tracks, film.views[frame], film.scenes(frame).rays
    px, depth = view.pixels(points)
    stored, hidden = tracks["points"][index, frame].astype(np.float64), tracks["occluded"][index, frame]  # fmt: skip
    with np.errstate(invalid="ignore"):
        front = (depth > 1e-3) & np.isfinite(px).all(1)
        off = np.abs(stored - px).max(1) > place_slack_px(px, depth)
        off |= np.abs(tracks["depth_m"][index, frame] - depth) > _DEPTH * (1 + np.abs(depth))
    margin, name = view.margin(px), view.folder.name
    film.tally.add("tracks", len(index))
    film.list_points(index[front & off], f"is elsewhere in {name}")
    inside = np.flatnonzero(front & (margin > 0))
    visible = np.zeros(len(index), bool)
    visible[inside] = is_seen(points[inside], view, rays)
    wrong = np.flatnonzero(hidden == visible)
    wrong = wrong[~_may_be_either(points[wrong], view, margin[wrong], rays)]
    # A face seen edge-on may hide its own points.
    towards = points[wrong] - view.eye
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    slant = dot(rays.normal(face[wrong], towards), towards)
    wrong = wrong[np.abs(slant) > _EDGE_ON]
    film.tally.add("tracks", len(index))
    for k in wrong[:_MOST_LISTED]:
        fault = f"is not {'hidden' if hidden[k] else 'seen'} in {name}"
        film.list_points(index[[k]], fault)


def place_slack_px(px: F64, depth: F64) -> F64:
    """(N,) tolerance in px of a place (N, 2): 32-bit floats, of it and of vertices near the camera's plane."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1e-5 + _VERTEX_M / np.abs(depth)
        return np.asarray(_PX + share * np.abs(px).max(axis=1))


def _may_be_either(points: F64, other: StoredCamera, margin: F64, rays: Rays) -> Bools:
    """(N,) True on the picture's border, or beside an obstacle."""
    with np.errstate(invalid="ignore"):
        is_tie = np.asarray(np.abs(margin) <= _PX, bool)
    if not len(points):
        return is_tie
    answers = [
        is_seen(points + _BESIDE_M * np.array(step, np.float64), other, rays, slack_m=0.01)
        for step in ((0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
    ]
    return np.asarray(is_tie | (np.ptp(np.array(answers, np.int8), axis=0) > 0), bool)


CHECKS = (Check("tracks", "views", check_tracks, 4, (_FILE,)),)
