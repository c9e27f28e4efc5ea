"""pairs.parquet against rays from each camera of a pair and what the other sees. Effects: reads files."""

from __future__ import annotations

import io
import zlib
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrs_farm.check.axes import opencv_pose
from pbrs_farm.check.cases import HouseCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.embree_caster import Rays, is_visible
from pbrs_farm.check.lens_rays import PlacedCamera, StoredLens, scaled_k
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_files import BadFile, stored_bytes, stored_object

_PAIRS = "pairs.parquet"
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
        data = io.BytesIO(stored_bytes(folder / _PAIRS))
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
        a, b = (_camera(views[row[key]]) for key in ("view_a", "view_b"))
        shares = {"a_in_b": _share(a, b, case.rest.rays), "b_in_a": _share(b, a, case.rest.rays)}
        judge("pair shares", _place(case, row), case.tally, row=row, shares=shares)
    for row in rows:
        _check_pair(case, row, [views[row["view_a"]], views[row["view_b"]]])
    # Each pair of views of a room has a row.
    counts = Counter(view["room"] for view in views.values())
    n_pairs = sum(n * (n - 1) // 2 for n in counts.values())
    fault = f"has {len(rows)} rows, views of a room make {n_pairs} pairs"
    expect(len(rows) == n_pairs, fault)


def _place(case: HouseCase, row: dict[str, Any]) -> str:
    return f"{case.house.id}: {row['view_a']}, {row['view_b']}"


def _check_pair(case: HouseCase, row: dict[str, Any], views: list[dict[str, Any]]) -> None:
    """Rooms of a pair, and the columns that follow from its shares and cameras."""
    a, b = (_camera(view) for view in views)
    cosine = float(np.clip(a.world_from_camera[:3, 2] @ b.world_from_camera[:3, 2], -1, 1))
    facts = {
        "common": (row["a_in_b"] + row["b_in_a"]) / 2,
        "baseline_m": float(np.linalg.norm(a.eye - b.eye)),
        "angle_deg": float(np.degrees(np.arccos(cosine))),
    }
    judge("pair", _place(case, row), case.tally, row=row, views=views, facts=facts)


def _camera(row: Mapping[str, Any]) -> PlacedCamera:
    """A camera of cameras.json with the grid's pixels."""
    i = row["intrinsics"]
    lens = StoredLens.of(i["lens"]) if "lens" in i else None
    return PlacedCamera(
        scaled_k(i, *_GRID), opencv_pose(row["world_from_camera_opengl"]), _GRID[::-1], lens
    )


def _share(camera: PlacedCamera, other: PlacedCamera, rays: Rays) -> float:
    """Share of the ends of one camera's rays that the other sees; 0 if they meet nothing."""
    directions = camera.ray_grid().reshape(-1, 3)
    directions = directions[directions.any(axis=1)]
    face = rays.first(camera.eye, directions)
    z = rays.distance(face, camera.eye, directions)
    points = (camera.eye + directions * z[:, None])[face >= 0]
    if not len(points):
        return 0.0
    px, depth = other.pixels(points)
    with np.errstate(invalid="ignore"):
        shown = ((px >= 0) & (px < _GRID)).all(axis=1) & (depth > 1e-3)
    visible = is_visible(rays, other.eye, points[shown], _REACH_M)
    return float(visible.sum() / len(points))


CHECKS = (Check("pairs", "views", check_pairs, 3, (_PAIRS,)),)
