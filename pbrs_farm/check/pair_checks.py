"""pairs.parquet against points followed by Embree from one stored camera to the other; reads files."""

from __future__ import annotations

import io
import zlib
from collections import Counter
from typing import Any

import numpy as np

from pbrs_farm.check.axes import into_frame, opencv_pose
from pbrs_farm.check.cases import HouseCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.embree_caster import Rays, is_visible
from pbrs_farm.check.lens_rays import StoredLens
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_files import BadFile, stored_bytes, stored_object
from pbrs_farm.core.arrays import F64, Bools

_FILE = "pairs.parquet"
_GRID = (32, 24)  # rays of a view, across and down
_MOST_PAIRS = 40  # of a house, chosen by its name
_REACH_M = 1e-3  # tolerance of a ray's end before a point
_COLUMNS = ("room", "view_a", "view_b", "a_in_b", "b_in_a", "common", "baseline_m", "angle_deg")


def check_pairs(case: HouseCase) -> None:
    """Recompute the shares of at most _MOST_PAIRS pairs, drawn by the house's name, and all other columns."""
    # Loads slowly, and few homes have the file.
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder, expect = case.house.folder, case.expect("pairs")
    try:
        data = io.BytesIO(stored_bytes(folder / _FILE))
        rows = pq.read_table(data).select(list(_COLUMNS)).to_pylist()
        views = {row["id"]: row for row in stored_object(folder / "cameras.json")["views"]}
    except (BadFile, pa.ArrowException, KeyError, TypeError) as error:
        expect(False, f"cannot be read: {error}")
        return
    names = {row[key] for row in rows for key in ("view_a", "view_b")}
    if not expect(names <= views.keys(), "names unknown views"):
        return
    rng = np.random.default_rng(zlib.crc32(case.house.id.encode()))
    chosen = rng.permutation(len(rows))[:_MOST_PAIRS]
    for row in (rows[int(k)] for k in sorted(chosen)):
        a, b = (_Camera(views[row[key]]) for key in ("view_a", "view_b"))
        shares = {"a_in_b": _share(a, b, case.rest.rays), "b_in_a": _share(b, a, case.rest.rays)}
        judge("pair shares", _place(case, row), case.tally, row=row, shares=shares)
    for row in rows:
        _check_row(case, row, [views[row["view_a"]], views[row["view_b"]]])
    # Each pair of views of a room has a row.
    counts = Counter(view["room"] for view in views.values())
    n_pairs = sum(n * (n - 1) // 2 for n in counts.values())
    fault = f"has {len(rows)} rows, views of a room make {n_pairs} pairs"
    expect(len(rows) == n_pairs, fault)


def _place(case: HouseCase, row: dict[str, Any]) -> str:
    return f"{case.house.id}: {row['view_a']}, {row['view_b']}"


def _check_row(case: HouseCase, row: dict[str, Any], views: list[dict[str, Any]]) -> None:
    """Rooms of a pair, and the columns that follow from its shares and cameras."""
    a, b = (_Camera(view) for view in views)
    cosine = float(np.clip(a.rotation[:, 2] @ b.rotation[:, 2], -1, 1))
    facts = {
        "common": (row["a_in_b"] + row["b_in_a"]) / 2,
        "baseline_m": float(np.linalg.norm(a.eye - b.eye)),
        "angle_deg": float(np.degrees(np.arccos(cosine))),
    }
    judge("pair", _place(case, row), case.tally, row=row, views=views, facts=facts)


class _Camera:
    """A camera of cameras.json with the grid's pixels."""

    def __init__(self, row: dict[str, Any]) -> None:
        i = row["intrinsics"]
        x, y = _GRID[0] / i["width_px"], _GRID[1] / i["height_px"]
        self.f = np.array([i["fx"] * x, i["fy"] * y])
        self.c = np.array([i["cx"] * x, i["cy"] * y])
        self.lens = StoredLens.of(i["lens"]) if "lens" in i else None
        self.pose = opencv_pose(row["world_from_camera_opengl"])
        self.rotation, self.eye = self.pose[:3, :3], self.pose[:3, 3]

    def directions(self) -> F64:
        """(N, 3) of unit depth, through the centres of the grid's pixels that see anything."""
        columns, rows = np.meshgrid(np.arange(_GRID[0]) + 0.5, np.arange(_GRID[1]) + 0.5)
        plane = (np.stack([columns.ravel(), rows.ravel()], axis=1) - self.c) / self.f
        if self.lens is None:
            return np.asarray(np.insert(plane, 2, 1.0, axis=1) @ self.rotation.T)
        local = self.lens.rays(plane)
        return np.asarray(local[np.abs(local).sum(1) > 0] @ self.rotation.T)

    def shows(self, points: F64) -> Bools:
        """(N,) points (N, 3) inside the picture."""
        local = into_frame(self.pose, points)
        with np.errstate(divide="ignore", invalid="ignore"):
            plane, depth = local[:, :2] / local[:, 2:], local[:, 2]
            if self.lens is not None:
                plane, depth = self.lens.plane_and_depth(local)
            px = plane * self.f + self.c
            inside = ((px >= 0) & (px < _GRID)).all(axis=1)
            return np.asarray(inside & (depth > 1e-3), bool)


def _share(camera: _Camera, other: _Camera, rays: Rays) -> float:
    """Share of the ends of one camera's rays that the other sees; 0 if they meet nothing."""
    directions = camera.directions()
    face = rays.first(camera.eye, directions)
    z = rays.distance(face, camera.eye, directions)
    points = (camera.eye + directions * z[:, None])[face >= 0]
    if not len(points):
        return 0.0
    visible = is_visible(rays, other.eye, points[other.shows(points)], _REACH_M)
    return float(visible.sum() / len(points))


CHECKS = (Check("pairs", "views", check_pairs, 3, (_FILE,)),)
