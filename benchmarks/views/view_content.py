"""What the views of a preset show, over the nine example homes, against NYUv2's photographs.

No effects of its own; benchmarks/views/cameras.py runs it in a process for each home.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core.camera import View
from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.geometry.plan_surfaces import room_shape
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.sample.house_sampler import sample_cameras
from pbrs_farm.sample.photo_choice import NYUV2_SHARES
from pbrs_farm.sample.photo_score import item_roles, photo_shares
from pbrs_farm.sample.view_overlap import DEPTH_SIZE, overlap

PRESETS = {"paper": "paper", "photo": "fast"}
"""Name in the figures -> the recipe whose cameras are taken."""

NEAR_M, TWIN, LEAST_ROOM_M2 = 1.5, 0.8, 4.0
SIZE = (160, 120)


def measured_home(house: House, preset: str) -> dict[str, Any]:
    """Views of one repaired home: a row of numbers for each, and how many rooms have one."""
    caster = Caster.of_house(house)
    fields = recipe_from_name(PRESETS[preset]).cameras
    sampling = sample_cameras(house, fields, 0, caster.item_counts, caster.depth_pictures)
    views = list(sampling.views)
    rows, shares = _content(house, caster, views)
    large = {r.id for r in house.rooms if shapely.area(room_shape(r)) > LEAST_ROOM_M2}
    return {
        "rows": rows,
        "shares": shares.tolist(),
        "twins": _twins(caster, views),
        "rooms": len(large),
        "rooms_with_views": len(large & {v.room_id for v in views}),
    }


def _content(
    house: House, caster: Caster, views: list[View]
) -> tuple[list[dict[str, float]], NDArray[np.float64]]:
    """Each view's shares and counts, and (N, 14) shares of the NYU13 classes."""
    roles = item_roles(house)
    if not views:
        return [], np.zeros((0, len(NYU13_NAMES)))
    counts = caster.item_counts([v.camera.with_size(*SIZE) for v in views])
    padded = np.zeros((len(views), len(house.items) + 1), np.uint32)
    padded[:, : counts.shape[1]] = counts
    depth = caster.depth_pictures([v.camera.with_size(*DEPTH_SIZE) for v in views])
    seen = photo_shares(padded, depth.reshape(len(views), -1), roles, 0.01)
    rows = [
        {
            "openings": float(seen.opening[k]),
            "furniture": float(seen.furniture[k]),
            "median_m": float(seen.median_m[k]),
            "floor": float(seen.floor[k]),
            "classes": int((seen.nyu13[k, 1:] > 0).sum()),
            "objects": int(seen.n_objects[k]),
            "tilt_deg": float(np.degrees(np.arcsin(-views[k].camera.towards[1]))),
        }
        for k in range(len(views))
    ]
    return rows, seen.nyu13


def _twins(caster: Caster, views: list[View]) -> int:
    """Pairs of a home's views of which one shows hardly anything that the other does not."""
    cameras = [v.camera.with_size(*DEPTH_SIZE) for v in views]
    depth = caster.depth_pictures(cameras)
    pairs = [(i, j) for i in range(len(views)) for j in range(i)]
    return sum(overlap(cameras[i], depth[i], cameras[j], depth[j]) > TWIN for i, j in pairs)


def content_figures(homes: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of one preset over all homes' measured_home."""
    rows = [row for home in homes for row in home["rows"]]
    shares = np.array([s for home in homes for s in home["shares"]])
    column = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    rooms, with_views = (sum(home[k] for home in homes) for k in ("rooms", "rooms_with_views"))
    return {
        "views": len(rows),
        "openings_share": round(float(np.median(column["openings"])), 3),
        "furniture_share": round(float(np.median(column["furniture"])), 3),
        "near_views": round(float((column["median_m"] < NEAR_M).mean()), 3),
        "floor_seen": round(float((column["floor"] > 0).mean()), 3),
        "classes_median": float(np.median(column["classes"])),
        "objects_median": float(np.median(column["objects"])),
        "depth_median_m": round(float(np.median(column["median_m"])), 2),
        "twins": sum(home["twins"] for home in homes),
        "share_distance": round(share_distance(shares), 3),
        "rooms_with_views": round(with_views / rooms, 3),
    }


def share_distance(shares: NDArray[np.float64]) -> float:
    """L1 distance of mean NYU13 shares (N, 14) to NYUv2's, unlabelled pixels left out of both."""
    real = np.array([NYUV2_SHARES.get(name, 0.0) for name in NYU13_NAMES])
    mean = shares.mean(0)
    mean[0] = 0
    return float(np.abs(mean / mean.sum() - real / real.sum()).sum())


UNITS = {
    "views": "views of the nine homes",
    "openings_share": "of the picture, doors and windows, median over views",
    "furniture_share": "of the picture, furniture and things, median over views",
    "near_views": "share of views with a median depth below 1.5 m",
    "floor_seen": "share of views that show floor",
    "classes_median": "NYU13 classes a view, median",
    "objects_median": "pieces of 1 % of the picture and more, median",
    "depth_median_m": "m, median of the views' median depths",
    "twins": "pairs of views of a home that share more than 0.8",
    "share_distance": "L1 distance of NYU13 pixel shares to NYUv2's",
    "rooms_with_views": "share of rooms above 4 square metres",
}
