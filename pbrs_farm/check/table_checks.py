"""The table's rows of instances against the triangles of house.glb: boxes, shares seen, truncation.

Effects: holds Embree scenes of single items.
"""

from __future__ import annotations

import zlib
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats, Rays
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView

BOX_M = 0.001  # by which a side of a box may differ from its triangles
BORDER_PX = 0.02  # of the picture: a vertex there is in or out
MAX_RAYS = 2000  # of an item whose share is judged by a sample
_SIGMAS = 5.0  # of a sample's share
_EDGE = 0.004  # part of an item's pixels whose centres lie on its outline
_LENS = 0.1  # of the share, where the stored one is resampled from pin-holes (docs/lenses.md)


class HouseItems:
    """The items of a house's triangles, each asked for when a view shows it. State: what was asked."""

    def __init__(self, house: StoredHouse, triangles: Triangles) -> None:
        self._house, self._triangles = house, triangles
        self._alone: dict[int, tuple[Floats, Rays]] = {}

    def alone(self, instance: int) -> tuple[Floats, Rays]:
        """Corners (N, 3) of an item's triangles, and rays that meet nothing else.

        Kept for each item once asked, since several views show it. (0, 3) for an instance without
        triangles.
        """
        if instance not in self._alone:
            t = self._triangles
            faces = t.faces[t.instance == instance]
            used, numbers = np.unique(faces, return_inverse=True)
            n = len(faces)
            own = Triangles(
                t.vertices[used], numbers.reshape(-1, 3).astype(np.int64), np.full(n, instance),
                t.material[t.instance == instance], {}, np.zeros(n, bool), {}, t.uv[used],
                t.colours, {}, np.zeros(n, np.int64), ("",), np.zeros(n, np.int64), t.kinds, t.normals[used], t.maps,
            )  # fmt: skip
            self._alone[instance] = own.vertices.astype(np.float64), Rays(own)
        return self._alone[instance]

    def loose(self, instance: int) -> Floats:
        """(N, 3) all vertices of an item, also those that no triangle has."""
        found = self._triangles.loose.get(instance)
        return np.zeros((0, 3)) if found is None else found.astype(np.float64)

    @cached_property
    def stored_boxes(self) -> dict[int, dict[str, Any]]:
        """Instance id -> the box in house.json, of items that have one; {} without the file."""
        try:
            return {k: row["box"] for k, row in self._house.items.items() if row.get("box")}
        except (KeyError, TypeError, ValueError):
            return {}


def check_rows(
    view: StoredView, instance: NDArray[Any], items: HouseItems, n_pixels: int | None, tally: Tally
) -> None:
    """Judge box3d, visible_fraction and truncated of every row; n_pixels as of verify.

    instance is (H, W) ids as stored. An item without a triangle in house.glb fails at once;
    visible_fraction is judged only where the row has one.
    """
    for row in view.table["instances"]:
        number = int(row["id"])
        place = f"{view.place} instance {number}"
        corners, rays = items.alone(number)
        if not len(corners):
            tally.expect("box3d", place, False, "house.glb has no triangle of it")
            continue
        fault = _box_fault(row["box3d"], corners, items, number)
        tally.expect("box3d", place, fault == "", fault)
        answers = {_reaches_out(view, points) for points in (corners, items.loose(number))}
        fits = None in answers or bool(row["truncated"]) in answers
        tally.expect("truncated", place, fits, f"is {row['truncated']}")
        if row["visible_fraction"] is not None:
            fault = _share_fault(view, row, instance, corners, rays, n_pixels)
            tally.expect("visible_fraction", place, fault == "", fault)


def _box_fault(box: dict[str, Any], corners: Floats, items: HouseItems, number: int) -> str:
    """What is wrong with a box; "" where nothing is."""
    axes, centre, half = (np.array(box[k], np.float64) for k in ("axes", "centre", "half"))
    if axes.shape != (3, 3) or np.abs(axes @ axes.T - np.eye(3)).max() > 1e-6:
        return "its axes are no frame"
    # Rows here are columns in house.json.
    stored = items.stored_boxes.get(number)
    if stored is not None and np.abs(axes - np.array(stored["axes"], np.float64).T).max() > 1e-6:
        return "its axes are not those of house.json"
    off = np.inf
    for points in (corners, items.loose(number)):
        local = points @ axes.T
        low, high = axes @ centre - half, axes @ centre + half
        off = min(off, float(np.abs([local.min(0) - low, local.max(0) - high]).max()))
    return "" if off <= BOX_M else f"differs by {off * 1000:.1f} mm from its triangles"


def _reaches_out(view: StoredView, points: Floats) -> bool | None:
    """Whether a vertex lies outside the picture; None where one is on its border."""
    if view.lens is not None and view.lens.model in ("equirect", "cubemap"):
        return False
    local = (points - view.world_from_camera[:3, 3]) @ view.world_from_camera[:3, :3]
    pixel, _depth = view.pixels_and_depths(local)
    height, width = view.size
    margin = np.minimum(pixel, np.array([width, height]) - pixel).min(axis=1)
    if not np.isfinite(margin).all():
        return True
    return None if abs(margin.min()) <= BORDER_PX else bool(margin.min() < 0)


def _share_fault(
    view: StoredView,
    row: dict[str, Any],
    instance: NDArray[Any],
    corners: Floats,
    rays: Rays,
    n_pixels: int | None,
) -> str:
    """What is wrong with visible_fraction; "" where nothing is."""
    seen, share = int((instance == int(row["id"])).sum()), float(row["visible_fraction"])
    if not 0 < share <= 1:
        return f"{share:g} is no share"
    # Where it might be seen alone, beside where it is seen.
    rows, columns = _reach(view, corners)
    other = instance[rows, columns] != int(row["id"])
    rows, columns = rows[other], columns[other]
    n_all = len(rows)
    rng = np.random.default_rng(zlib.crc32(f"{view.place} {row['id']}".encode()))
    most = MAX_RAYS if n_pixels is None else min(MAX_RAYS, n_pixels)
    if n_pixels is not None and n_all > most:
        chosen = rng.choice(n_all, most, replace=False)
        rows, columns = rows[chosen], columns[chosen]
    hits = 0
    if len(rows):
        origin, directions = view.rays(rows, columns)
        hits = int((rays.first(origin, directions) >= 0).sum())
    hidden = hits * n_all / max(len(rows), 1)
    # Compare counts of pixels: what a sample of so many may miss, and what lies on the outline.
    stated = seen / share - seen
    part = max(min(stated / n_all, 1.0), 1 / len(rows)) if len(rows) else 0.0
    spread = n_all * np.sqrt(part * (1 - part) / len(rows)) if 0 < len(rows) < n_all else 0.0
    slack = _SIGMAS * spread + 2 + _EDGE * (seen + hidden)
    if view.lens is not None:
        slack += _LENS * (seen + hidden) + 4 * np.sqrt(seen)
    if abs(stated - hidden) <= slack:
        return ""
    return f"is {share:.4f}, here {seen / (seen + hidden):.4f}"


def _reach(view: StoredView, corners: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the pixels that an item's triangles may cover."""
    height, width = view.size
    local = (corners - view.world_from_camera[:3, 3]) @ view.world_from_camera[:3, :3]
    low, high = np.zeros(2, int), np.array([width, height])
    # Before a pin-hole, the triangles lie within the rectangle of their corners.
    if view.lens is None and local[:, 2].min() > 1e-3:
        pixel, _depth = view.pixels_and_depths(local)
        low = np.clip(np.floor(pixel.min(0)) - 1, 0, high).astype(int)
        high = np.clip(np.ceil(pixel.max(0)) + 1, 0, high).astype(int)
    rows, columns = np.mgrid[low[1] : high[1], low[0] : high[0]]
    return rows.reshape(-1), columns.reshape(-1)
