"""pairs.parquet against points that are followed from one stored camera to the other, by Embree.

Effects: reads files.
"""

from __future__ import annotations

import io
import zlib
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats, Rays
from pbrs_farm.check.lens_rays import StoredLens
from pbrs_farm.check.stored_files import BadFile, stored_bytes, stored_object

SHARE = 0.01  # of 768 points: those on edges may fall either way
GRID = (32, 24)  # rays of a view, across and down
MOST_PAIRS = 40  # of a house, chosen by its name
PAIR_REACH_M = 1e-3  # how far before a point the ray to it may end
COLUMNS = ("room", "view_a", "view_b", "a_in_b", "b_in_a", "common", "baseline_m", "angle_deg")


def check_pairs(house: Path, rays: Rays, tally: Tally) -> None:
    """Recompute the shares of some pairs of a house that has the file.

    At most MOST_PAIRS, drawn by the house's name, so the same each time. A house without
    pairs.parquet counts nothing; one that cannot be read is a failure.
    """
    file = house / "pairs.parquet"
    if not file.is_file():
        return
    # Here, since it loads slowly and few homes have the file.
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        rows = pq.read_table(io.BytesIO(stored_bytes(file))).select(list(COLUMNS)).to_pylist()
        views = {row["id"]: row for row in stored_object(house / "cameras.json")["views"]}
    except (BadFile, pa.ArrowException, KeyError, TypeError) as error:
        tally.expect("pairs", house.name, False, f"cannot be read: {error}")
        return
    named = {row[key] for row in rows for key in ("view_a", "view_b")}
    if not tally.expect("pairs", house.name, named <= views.keys(), "names views that are none"):
        return
    rng = np.random.default_rng(zlib.crc32(house.name.encode()))
    chosen = rng.permutation(len(rows))[:MOST_PAIRS]
    for row in (rows[int(k)] for k in sorted(chosen)):
        a, b = views[row["view_a"]], views[row["view_b"]]
        for key, one, other in (("a_in_b", a, b), ("b_in_a", b, a)):
            share = _share(_Camera(one), _Camera(other), rays)
            place = f"{house.name}: {row['view_a']}, {row['view_b']}"
            right = abs(row[key] - share) <= SHARE
            tally.expect("pairs", place, right, f"{key} is {row[key]:.3f}, here {share:.3f}")
    for row in rows:
        _check_row(house, row, views[row["view_a"]], views[row["view_b"]], tally)
    # Each pair of views of a room has a row.
    counts = Counter(view["room"] for view in views.values())
    expected = sum(n * (n - 1) // 2 for n in counts.values())
    what = f"has {len(rows)} rows, views of a room make {expected} pairs"
    tally.expect("pairs", house.name, len(rows) == expected, what)


def _check_row(
    house: Path, row: dict[str, Any], a: dict[str, Any], b: dict[str, Any], tally: Tally
) -> None:
    """Both views are of the room that is told; what follows from their shares and cameras."""
    place = f"{house.name}: {row['view_a']}, {row['view_b']}"
    same = row["room"] == a["room"] == b["room"]
    tally.expect("pairs", place, same, f"are not both of room {row['room']}")
    one, other = _Camera(a), _Camera(b)
    cosine = float(np.clip(one.rotation[:, 2] @ other.rotation[:, 2], -1, 1))
    expected = {
        "common": (row["a_in_b"] + row["b_in_a"]) / 2,
        "baseline_m": float(np.linalg.norm(one.eye - other.eye)),
        "angle_deg": float(np.degrees(np.arccos(cosine))),
    }
    for key, value in expected.items():
        # Stored as 32-bit floats; an angle near 0 is the arc of a cosine near 1.
        right = abs(row[key] - value) <= 1e-3 + 1e-5 * abs(value)
        tally.expect("pairs", place, right, f"{key} is {row[key]:.4f}, here {value:.4f}")


class _Camera:
    """A camera of cameras.json with the grid's pixels."""

    def __init__(self, row: dict[str, Any]) -> None:
        i = row["intrinsics"]
        x, y = GRID[0] / i["width_px"], GRID[1] / i["height_px"]
        self.f = np.array([i["fx"] * x, i["fy"] * y])
        self.c = np.array([i["cx"] * x, i["cy"] * y])
        self.lens = StoredLens.of(i["lens"]) if "lens" in i else None
        # OpenGL axes to x right, y down, z forward.
        pose = np.array(row["world_from_camera_opengl"], np.float64) @ np.diag([1.0, -1, -1, 1])
        self.rotation, self.eye = pose[:3, :3], pose[:3, 3]

    def directions(self) -> Floats:
        """(N, 3) through the middles of the grid's pixels that see anything, of unit depth."""
        columns, rows = np.meshgrid(np.arange(GRID[0]) + 0.5, np.arange(GRID[1]) + 0.5)
        plane = (np.stack([columns.ravel(), rows.ravel()], axis=1) - self.c) / self.f
        if self.lens is None:
            return np.asarray(np.insert(plane, 2, 1.0, axis=1) @ self.rotation.T)
        local = self.lens.rays(plane)
        return np.asarray(local[np.abs(local).sum(1) > 0] @ self.rotation.T)

    def shows(self, points: Floats) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(N,) points (N, 3) that fall into the picture."""
        local = (points - self.eye) @ self.rotation
        with np.errstate(divide="ignore", invalid="ignore"):
            plane, depth = local[:, :2] / local[:, 2:], local[:, 2]
            if self.lens is not None:
                plane, depth = self.lens.plane_and_depth(local)
            px = plane * self.f + self.c
            inside = ((px >= 0) & (px < GRID)).all(axis=1)
            return np.asarray(inside & (depth > 1e-3), bool)


def _share(one: _Camera, other: _Camera, rays: Rays) -> float:
    """The part of the ends of one's rays that other sees; 0 where they meet nothing."""
    directions = one.directions()
    face = rays.first(one.eye, directions)
    z = rays.distance(face, one.eye, directions)
    points = (one.eye + directions * z[:, None])[face >= 0]
    if not len(points):
        return 0.0
    inside = points[other.shows(points)]
    to = inside - other.eye
    face = rays.first(other.eye, to)
    t = rays.distance(face, other.eye, to)
    seen = (face < 0) | ((1 - t) * np.linalg.norm(to, axis=1) <= PAIR_REACH_M)
    return float(seen.sum() / len(points))
