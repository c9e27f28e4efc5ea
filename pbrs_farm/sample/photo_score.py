"""Score of a view's likeness to a photograph that a person would take of a room; no effects.

The paper's score (section 3.1) counts the pixels of all objects, including doors and windows, and is
highest close to one. People photograph furniture from across the room. The terms and weights were
fitted by eye on the example homes to the class shares of NYUv2's photographs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I64, Bools
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.classes import (
    BLINDS,
    CURTAIN,
    DOOR,
    FLOOR_MAT,
    NYU13_FROM_NYU40,
    NYU13_NAMES,
    OTHERSTRUCTURE,
    WINDOW,
)
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.geometry.surface_points import item_triangles, surface_points

# NYU40 classes of what hangs at openings or is built in: no furniture.
NO_FURNITURE: Final = (BLINDS, CURTAIN, OTHERSTRUCTURE)

# Shares of the picture above which furniture and floor earn nothing more.
MOST_FURNITURE: Final = 0.45
MOST_FLOOR: Final = 0.08
# Score per object and class, and the maximum number that counts.
SCORE_OF_OBJECT, MOST_OBJECTS = 0.05, 8
SCORE_OF_CLASS, MOST_CLASSES = 0.06, 8
LEAST_CLASS_SHARE: Final = 0.005  # a class that covers less of the picture does not count as seen
# Shares from which doors and windows, one piece, one wall cost.
MOST_OPENING, OPENING_COST = 0.10, 1.5
MOST_OF_ONE, MOST_OF_A_WALL = 0.30, 0.50
# The median depth that costs nothing, and what a metre out of it costs.
NEAR_M, FAR_M, NEAR_COST, FAR_COST = 1.6, 4.5, 0.5, 0.1
# Beside likeness: the upper quartile of NYUv2's tilts and what a degree beyond it costs; what a
# metre below NEAR_M costs; doors and windows, which the score lets go up to MOST_OPENING.
MOST_TILT_DEG, TILT_COST = 12.0, 0.05
CLOSE_COST: Final = 2.0
FREE_OPENING, FRAMED_OPENING_COST = 0.06, 1.5


class Foreground(NamedTuple):
    """A cost for objects closer than a distance that cover more than a free share of the picture."""

    nearer_m: float
    free: float
    cost: float  # a unit of share beyond it


FOREGROUND: Final = (
    # A lampshade, a door's edge, the side of a wardrobe: people step past it.
    Foreground(nearer_m=0.6, free=0.01, cost=3.0),
    # A corner of a table or the back of a chair leads into a room; half of one hides it.
    Foreground(nearer_m=0.9, free=0.05, cost=3.0),
)
"""Costs of close objects; all of them are added."""

# Furniture that the picture's edge cuts: a photographer steps aside or back. Its share of the picture is weighted
# by the part of its surface outside the picture beyond CUT_AWAY, so that large pieces mostly inside cost nothing.
CUT_AWAY, CUT_FREE, CUT_COST = 0.25, 0.03, 6.0
# The largest item cut nearer than CLOSE_CUT_M costs by its whole share, at most CUT_MOST: enough to leave a view
# out that is not its room's best.
CLOSE_CUT_M, CLOSE_CUT_FREE, CLOSE_CUT_COST, CUT_MOST = 1.0, 0.12, 20.0, 1.5
_LEAST_CUT: Final = 0.01  # share of the picture; smaller pieces do not count as cut
_SPACINGS: Final = 10  # of the points on an item's surface, along its longest extent


@dataclass(frozen=True, slots=True, eq=False)
class ItemRoles:
    """Role in a photograph, and NYU13 class, of each instance id (n_items + 1,); index 0 = nothing."""

    furniture: Bools
    opening: Bools
    wall: Bools
    floor: Bools
    structure: Bools
    nyu13: I64


@dataclass(frozen=True, slots=True, eq=False)
class PhotoShares:
    """Contents of N pictures, as shares of the picture; each array (N,) except for the last two.

    largest: of the largest piece of furniture. wall: of the largest wall. n_objects: pieces that cover the
    minimum share. n_classes: visible NYU13 classes. median_m: median planar depth. cut, close_cut: of
    cut_shares. foreground: (N, K) of objects closer than each row of FOREGROUND. nyu13: (N, 14) of each
    class, column 0 of unclassified pixels.
    """

    furniture: F64
    opening: F64
    largest: F64
    wall: F64
    floor: F64
    n_objects: I64
    n_classes: I64
    median_m: F64
    cut: F64
    close_cut: F64
    foreground: F64
    nyu13: F64


def item_roles(house: House) -> ItemRoles:
    """Roles by kind and class, entry 0 nothing: openings, curtains, built-in parts are no furniture."""
    items = house.items
    return ItemRoles(
        furniture=_flags([_is_furniture(item) for item in items]),
        opening=_flags([_is_opening(item) for item in items]),
        wall=_flags([item.kind is ItemKind.WALL for item in items]),
        floor=_flags([item.kind is ItemKind.FLOOR for item in items]),
        structure=~_flags([not item.kind.is_structure for item in items]),
        nyu13=NYU13_FROM_NYU40[np.array([0, *(item.nyu40 for item in items)])].astype(np.int64),
    )


def photo_shares(
    counts: NDArray[np.integer],
    depth_m: F32,
    roles: ItemRoles,
    least: float,
    cut: tuple[F64, F64] | None = None,
) -> PhotoShares:
    """Contents of each picture.

    counts: (N, n_items + 1) pixels of each instance. depth_m: (N, K) planar depth at K pixels spread over
    the picture, 0 = nothing. least: minimum share of the picture for an object. cut: of cut_shares;
    None = nothing is cut.
    """
    # Turn pixels into shares, of instances and of classes.
    all_cut, close_cut = cut or (np.zeros(len(counts)), np.zeros(len(counts)))
    pixels = np.maximum(counts.sum(1, dtype=np.int64), 1)
    share = counts / pixels[:, None]
    classes = np.stack([share[:, roles.nyu13 == k].sum(1) for k in range(len(NYU13_NAMES))], 1)
    return PhotoShares(
        furniture=share[:, roles.furniture].sum(1),
        opening=share[:, roles.opening].sum(1),
        largest=share[:, roles.furniture].max(1, initial=0),
        wall=share[:, roles.wall].max(1, initial=0),
        floor=share[:, roles.floor].sum(1),
        n_objects=(share[:, roles.furniture] >= least).sum(1),
        n_classes=(classes[:, 1:] >= LEAST_CLASS_SHARE).sum(1),
        median_m=_median_depth(depth_m),
        cut=all_cut,
        close_cut=close_cut,
        foreground=np.stack(
            [
                ((depth_m > 0) & (depth_m < f.nearer_m)).sum(1) / max(depth_m.shape[1], 1)
                for f in FOREGROUND
            ],
            1,
        ),
        nyu13=classes,
    )


def item_pixels(seen_items: NDArray[np.uint32], n_ids: int) -> I64:
    """(N, n_ids) pixels of each instance id in pictures (N, H, W)."""
    n = len(seen_items)
    name = np.arange(n)[:, None, None] * n_ids + seen_items  # of each item in each picture
    return np.bincount(name.ravel(), minlength=n * n_ids).reshape(n, n_ids)


def furniture_points(house: House) -> list[F64]:
    """Points on the surface of each instance that can be cut, (K, 3) in the world; none on rugs and structure."""
    none = np.zeros((0, 3))
    points = [none]
    for item in house.items:
        is_framed = _is_furniture(item) and item.nyu40 != FLOOR_MAT and item.n_faces > 0
        spacing = float(np.ptp(item.bounds, axis=0).max()) / _SPACINGS if is_framed else 0.0
        points.append(surface_points(item_triangles(item), spacing) if spacing > 0 else none)
    return points


def cut_shares(
    cameras: Sequence[Camera],
    depth_m: F32,
    seen_items: NDArray[np.uint32],
    roles: ItemRoles,
    points: Sequence[F64],
) -> tuple[F64, F64]:
    """(N,) share of each picture of furniture that its edge cuts, and (N,) of the largest close item cut.

    The first is a sum of shares, each weighted by the part of the item outside the picture. depth_m,
    seen_items: (N, H, W) planar depth and instance id at each pixel, 0 = nothing. points: of
    furniture_points.
    """
    n, height, width = seen_items.shape
    if not n:
        return np.zeros(0), np.zeros(0)
    n_ids = len(roles.nyu13)
    name = np.arange(n)[:, None, None] * n_ids + seen_items  # of each item in each picture
    share = item_pixels(seen_items, n_ids).ravel() / max(height * width, 1)
    is_close = np.zeros(n * n_ids, np.bool_)
    is_close[name[(depth_m > 0) & (depth_m < CLOSE_CUT_M)]] = True
    is_at_edge = np.zeros(n * n_ids, np.bool_)
    for edge in (name[:, 0], name[:, -1], name[:, :, 0], name[:, :, -1]):
        is_at_edge[edge] = True
    is_cut = (is_at_edge & (share >= _LEAST_CUT)).reshape(n, n_ids) & ~roles.structure
    share = share.reshape(n, n_ids)
    close = np.where(is_cut & is_close.reshape(n, n_ids), share, 0).max(1, initial=0)
    cut = np.zeros(n)
    pixels = _pixel_matrices(cameras)
    for item in np.flatnonzero(is_cut.any(0)).tolist():
        if len(points[item]):
            which = np.flatnonzero(is_cut[:, item])
            away = 1 - _parts_inside(pixels[which], points[item], width, height)
            cut[which] += share[which, item] * np.maximum(away - CUT_AWAY, 0) / (1 - CUT_AWAY)
    return cut, np.asarray(close)


def _pixel_matrices(cameras: Sequence[Camera]) -> F32:
    """(N, 3, 4) from a point in the world to its pixel: (x z, y z, z), z in metres in front of the eye."""
    poses = np.stack([camera.world_from_camera for camera in cameras])
    to_pixel = np.stack([c.intrinsics.k * np.array((1.0, -1, -1)) for c in cameras])
    turned = to_pixel @ poses[:, :3, :3].swapaxes(1, 2)
    return np.concatenate([turned, -turned @ poses[:, :3, 3:]], 2).astype(np.float32)


def _parts_inside(pixels: F32, points: F64, width: int, height: int) -> F64:
    """(N,) part of points (K, 3) inside each picture, hidden or not; pixels: of _pixel_matrices."""
    projected = pixels[:, :, :3] @ points.T.astype(np.float32) + pixels[:, :, 3:]
    x, y, z = projected.swapaxes(0, 1)
    inside = (z > 0) & (x > 0) & (x < width * z) & (y > 0) & (y < height * z)
    return np.asarray(inside.mean(1))


def _median_depth(depth_m: F32) -> F64:
    """(N,) median of the nonzero values in each row; 0 without any."""
    # Sort all rows at once, zeros last: nanmedian processes them one by one.
    n_seen = (depth_m > 0).sum(1)
    ordered = np.sort(np.where(depth_m > 0, depth_m, np.float32(np.inf)), axis=1)
    some = np.flatnonzero(n_seen)
    n = n_seen[some]
    median = np.zeros(len(depth_m))
    median[some] = (ordered[some, (n - 1) // 2] + ordered[some, n // 2]) / 2
    return median


def photo_score(shares: PhotoShares) -> F64:
    """(N,) score, by differences: furniture, items, classes count; doors, close-ups, bare walls cost."""
    # Reward typical subjects of photographs, up to a maximum.
    score = np.minimum(shares.furniture, MOST_FURNITURE)
    score += SCORE_OF_OBJECT * np.minimum(shares.n_objects, MOST_OBJECTS)
    score += SCORE_OF_CLASS * np.minimum(shares.n_classes, MOST_CLASSES)
    score += np.minimum(shares.floor, MOST_FLOOR)
    # Charge what fills a picture without showing the room.
    score -= OPENING_COST * np.maximum(shares.opening - MOST_OPENING, 0)
    score -= np.maximum(shares.largest - MOST_OF_ONE, 0)
    score -= np.maximum(shares.wall - MOST_OF_A_WALL, 0)
    score -= np.minimum(CLOSE_CUT_COST * np.maximum(shares.close_cut - CLOSE_CUT_FREE, 0), CUT_MOST)
    # Prefer the distance across a room.
    score -= NEAR_COST * np.maximum(NEAR_M - shares.median_m, 0)
    score -= FAR_COST * np.maximum(shares.median_m - FAR_M, 0)
    return score


def framing_cost(shares: PhotoShares, tilt_deg: F64) -> F64:
    """(N,) cost of steep and close views and of doors, which likeness would prefer; tilt_deg: downwards."""
    cost = TILT_COST * np.maximum(tilt_deg - MOST_TILT_DEG, 0)
    cost += CLOSE_COST * np.maximum(NEAR_M - shares.median_m, 0)
    cost += FRAMED_OPENING_COST * np.maximum(shares.opening - FREE_OPENING, 0)
    return cost


def foreground_cost(shares: PhotoShares) -> F64:
    """(N,) cost, which rejects no view, of close objects by FOREGROUND and of cut furniture."""
    nearer = zip(FOREGROUND, shares.foreground.T, strict=True)
    costs = [f.cost * np.maximum(share - f.free, 0) for f, share in nearer]
    costs.append(CUT_COST * np.maximum(shares.cut - CUT_FREE, 0))
    return np.asarray(np.sum(costs, axis=0))


def _is_opening(item: Item) -> bool:
    return item.kind in (ItemKind.DOOR, ItemKind.WINDOW) or item.nyu40 in (DOOR, WINDOW)


def _is_furniture(item: Item) -> bool:
    built_in = item.kind.is_structure or item.kind is ItemKind.STAIRS
    return not (built_in or _is_opening(item) or item.nyu40 in NO_FURNITURE)


def _flags(values: list[bool]) -> Bools:
    return np.array([False, *values], np.bool_)
