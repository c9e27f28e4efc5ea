"""Rows of instances of view.json against house.glb: box, visible share, cut by the picture. Effects: holds Embree scenes of items."""

from __future__ import annotations

import zlib
from functools import cached_property
from typing import Any

import numpy as np
from scipy import stats

from pbrs_farm.check.axes import into_frame
from pbrs_farm.check.cases import Pixels, ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64

_BOX_M = 0.001  # tolerance of a box's sides
_BORDER_PX = 0.02  # within this of the picture's border a vertex is in or out
_MAX_RAYS = 2000  # of an item whose share is judged by a sample
_CHANCE = 3e-7  # of a true sample with so few hits, or so many: five sigmas
_EDGE = 0.004  # share of an item's pixels whose centres are on its outline
_LENS = 0.1  # tolerance of a share resampled from pinholes (docs/lenses.md)


class HouseItems:
    """The items of a house, each prepared for rays when a view first shows it. State: these items."""

    def __init__(self, house: StoredHouse, triangles: Triangles) -> None:
        self._house, self._triangles = house, triangles
        self._alone: dict[int, tuple[F64, Rays]] = {}

    def alone(self, instance: int) -> tuple[F64, Rays]:
        """Corners (N, 3) of an item's triangles, and rays that meet nothing else."""
        if instance not in self._alone:
            item = self._triangles.only(instance)
            self._alone[instance] = item.vertices.astype(np.float64), Rays(item)
        return self._alone[instance]

    def loose(self, instance: int) -> F64:
        """(N, 3) all vertices of an item, also those of no triangle."""
        return self._triangles.loose.get(instance, np.zeros((0, 3))).astype(np.float64)

    @cached_property
    def boxes(self) -> dict[int, dict[str, Any]]:
        """Instance id -> the box in house.json, of items that have one; {} without the file."""
        try:
            return {k: row["box"] for k, row in self._house.items.items() if row.get("box")}
        except (KeyError, TypeError, ValueError):
            return {}


def check_rows(case: ViewCase) -> None:
    """Judge box3d, visible_fraction (if stored) and truncated of every row, whose item must have a triangle."""
    items = case.now.shared(HouseItems)
    for row in case.view.table["instances"]:
        number = int(row["id"])
        place = f"{case.place} instance {number}"
        corners, rays = items.alone(number)
        if not len(corners):
            case.tally.expect("box3d", place, False, "house.glb has no triangle of it")
            continue
        fault = _box_fault(row["box3d"], corners, items, number)
        case.tally.expect("box3d", place, fault == "", fault)
        answers = {_is_truncated(case.view, points) for points in (corners, items.loose(number))}
        fits = None in answers or bool(row["truncated"]) in answers
        case.tally.expect("truncated", place, fits, f"is {row['truncated']}")
        if row["visible_fraction"] is not None:
            fault = _share_fault(case, row, corners, rays)
            case.tally.expect("visible_fraction", place, fault == "", fault)


def _box_fault(box: dict[str, Any], corners: F64, items: HouseItems, number: int) -> str:
    """The fault of a box; "" if it is right."""
    axes, centre, half = (np.array(box[k], np.float64) for k in ("axes", "centre", "half"))
    if axes.shape != (3, 3) or np.abs(axes @ axes.T - np.eye(3)).max() > 1e-6:
        return "its axes are not orthonormal"
    # Rows are columns in house.json.
    stored = items.boxes.get(number)
    if stored is not None and np.abs(axes - np.array(stored["axes"], np.float64).T).max() > 1e-6:
        return "its axes are not those of house.json"
    off = np.inf
    for points in (corners, items.loose(number)):
        local = points @ axes.T
        low, high = axes @ centre - half, axes @ centre + half
        off = min(off, float(np.abs([local.min(0) - low, local.max(0) - high]).max()))
    return "" if off <= _BOX_M else f"differs by {off * 1000:.1f} mm from its triangles"


def _is_truncated(view: StoredView, points: F64) -> bool | None:
    """True if a vertex is outside the picture; None if one is on its border."""
    if view.lens is not None and view.lens.model in ("equirect", "cubemap"):
        return False
    pixel, _depth = view.pixels_and_depths(into_frame(view.world_from_camera, points))
    margin = np.minimum(pixel, np.array(view.size[::-1]) - pixel).min(axis=1)
    if not np.isfinite(margin).all():
        return True
    return None if abs(margin.min()) <= _BORDER_PX else bool(margin.min() < 0)


def _share_fault(case: ViewCase, row: dict[str, Any], corners: F64, rays: Rays) -> str:
    """The fault of visible_fraction; "" if it is right."""
    view, instance, n_pixels = case.view, case.arrays["instance"], case.n_pixels
    visible, share = int((instance == int(row["id"])).sum()), float(row["visible_fraction"])
    if not 0 < share <= 1:
        return f"{share:g} is not a share"
    # Pixels where the item alone might be visible, beside those where it is.
    rows, columns = _reach(view, corners)
    beside = instance[rows, columns] != int(row["id"])
    rows, columns = rows[beside], columns[beside]
    n_all = len(rows)
    rng = np.random.default_rng(zlib.crc32(f"{view.place} {row['id']}".encode()))
    most = _MAX_RAYS if n_pixels is None else min(_MAX_RAYS, n_pixels)
    if n_pixels is not None and n_all > most:
        chosen = rng.choice(n_all, most, replace=False)
        rows, columns = rows[chosen], columns[chosen]
    n = len(rows)
    hits = int((rays.first(*view.rays(rows, columns)) >= 0).sum()) if n else 0
    hidden = hits * n_all / max(n, 1)
    # Compare counts of pixels, within the error of the sample and of the outline.
    stored = visible / share - visible
    slack = 2 + _EDGE * (visible + hidden)
    if view.lens is not None:
        slack += _LENS * (visible + hidden) + 4 * np.sqrt(visible)
    if n == n_all:
        is_right = abs(stored - hidden) <= slack
    else:
        low, high = (float(np.clip((stored + s) / n_all, 0, 1)) for s in (-slack, slack))
        fewest, most_hits = stats.binom.ppf(_CHANCE, n, low), stats.binom.isf(_CHANCE, n, high)
        is_right = bool(fewest <= hits <= most_hits)
    if is_right:
        return ""
    return f"is {share:.4f}, here {visible / (visible + hidden):.4f}"


def _reach(view: StoredView, corners: F64) -> Pixels:
    """Rows and columns of the pixels that an item's triangles may cover."""
    local = into_frame(view.world_from_camera, corners)
    low, high = np.zeros(2, int), np.array(view.size[::-1])
    # In front of a pinhole, the triangles are within the rectangle of their corners.
    if view.lens is None and local[:, 2].min() > 1e-3:
        pixel, _depth = view.pixels_and_depths(local)
        low = np.clip(np.floor(pixel.min(0)) - 1, 0, high).astype(int)
        high = np.clip(np.ceil(pixel.max(0)) + 1, 0, high).astype(int)
    rows, columns = np.mgrid[low[1] : high[1], low[0] : high[0]]
    return rows.reshape(-1), columns.reshape(-1)


CHECKS = (Check("table of items", "view", check_rows, 80),)
