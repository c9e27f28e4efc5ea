"""K and poses: proper by themselves, and consistent between the views of a house; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.axes import dot, is_rotation, opencv_pose, world_normals
from pbrs_farm.check.cases import HouseCase, SeenView, ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64, I64

_SLACK_M = 0.02
_MAX_WRONG = 0.002  # share of points that thin items between two pixels may cost; a wrong pose costs far more
_MIN_COSINE = 0.5  # of a surface against the other view's ray
_MIN_NEARER = 0.7  # a view's distance over the other view's
_STEP_PX = 16  # of the grid of points
_MAX_PARTNERS = 40  # views that a view is compared with


def check_pose(case: ViewCase) -> None:
    """The pose is rigid, both conventions agree, and K has a focal length and a centre within the picture."""
    view, expect = case.view, case.expect("pose")
    opencv, k = view.world_from_camera, view.k
    opengl = np.array(view.table["world_from_camera_opengl"], np.float64)
    shaped = opencv.shape == opengl.shape == (4, 4) and k.shape == (3, 3)
    if not expect(shaped, "not (4, 4) poses and a (3, 3) K"):
        return
    expect(is_rotation(opencv[:3, :3]), "the rotation is invalid")
    agree = np.abs(opencv_pose(opengl) - opencv).max() < 1e-9
    expect(agree, "the OpenGL and OpenCV poses differ")
    height, width = view.size
    fx, fy, cx, cy = k[0, 0], k[1, 1], k[0, 2], k[1, 2]
    is_camera = fx > 0 and fy > 0 and 0 < cx < width and 0 < cy < height and k[2, 2] == 1
    expect(is_camera, "K is not a camera matrix")


def check_reprojection(case: HouseCase) -> None:
    """No point of one view is in front of the surfaces that another view of the house sees.

    A point at depth z in another view is right if that view's surface there is at most z + _SLACK_M
    away (the point may be hidden). The nearest depth of a pixel and its neighbours counts,
    since points do not fall on pixel centres. Points of narrow surfaces are left out, and those that
    the other view sees from the side or from much farther: they may fall between its pixels. Up to
    _MAX_WRONG of a pair's points may still be wrong, and are counted as ties. Every view is compared
    with every other, or with _MAX_PARTNERS of them.
    """
    views = case.views
    points = [_points_of(view) for view in views]
    nearest = [_nearest(view.depth) for view in views]
    rng = np.random.default_rng(0)
    for a, first in enumerate(views):
        partners = np.array([b for b in range(len(views)) if b != a], np.int64)
        if len(partners) > _MAX_PARTNERS:
            partners = rng.choice(partners, _MAX_PARTNERS, replace=False)
        for b in partners:
            n, wrong = _count_in_front(points[a], views[b].view, nearest[b])
            place = f"{first.view.place} in {views[b].view.place}"
            fault = f"{wrong} of {n} points are in front of the visible surface"
            case.tally.tolerate("reprojection", place, n, wrong, max(2, _MAX_WRONG * n), fault)


def _points_of(seen: SeenView) -> F64:
    """(N, 3, 3) world position, normal and eye of a grid of pixels amid flat patches of 5 x 5."""
    view, (height, width) = seen.view, seen.view.size
    grid = np.mgrid[_STEP_PX // 2 : height : _STEP_PX, _STEP_PX // 2 : width : _STEP_PX]
    rows, columns = (g.reshape(-1) for g in grid)
    normal = world_normals(seen.normal[rows, columns], view.world_from_camera)
    centre, eye = _positions(seen, rows, columns), view.eye
    # Keep the pixels whose 5 x 5 neighbours are on the plane of the normal.
    z = seen.depth[rows, columns] / 1000
    flat = (z > 0) & (z < 65) & ~seen.moves[rows, columns]
    for dy, dx in np.ndindex(5, 5):
        r, c = (rows + dy - 2).clip(0, height - 1), (columns + dx - 2).clip(0, width - 1)
        off = dot(_positions(seen, r, c) - centre, normal)
        flat &= np.abs(off) < _SLACK_M / 2
    return np.asarray(np.stack([centre, normal, np.broadcast_to(eye, centre.shape)], 1)[flat])


def _positions(view: SeenView, rows: I64, columns: I64) -> F64:
    origin, directions = view.view.rays(rows, columns)
    return np.asarray(origin + directions * (view.depth[rows, columns] / 1000)[:, None])


def _nearest(depth: NDArray[Any]) -> F64:
    """(H, W) metres of the nearest surface among a pixel and its neighbours; inf = nothing."""
    metres = np.where(depth > 0, depth / 1000, np.inf)
    return np.asarray(ndimage.minimum_filter(metres, size=3, mode="nearest"))


def _count_in_front(points: F64, view: StoredView, nearest: F64) -> tuple[int, int]:
    """Numbers of points inside the view's picture, and in front of every surface that it sees there."""
    # Leave out surfaces seen from the side, or from much farther than by their own view.
    towards = points[:, 0] - view.eye
    distance = np.linalg.norm(towards, axis=1)
    first_distance = np.linalg.norm(points[:, 0] - points[:, 2], axis=1)
    broad = np.abs(dot(points[:, 1], towards)) > _MIN_COSINE * distance
    broad &= first_distance > _MIN_NEARER * distance
    pixel, depth = view.pixels_and_depths(towards[broad] @ view.world_from_camera[:3, :3])
    with np.errstate(invalid="ignore"):
        visible = (depth > 0.05) & np.isfinite(pixel).all(1)
    x, y = np.floor(pixel[visible]).astype(np.int64).T
    height, width = view.size
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    in_front = nearest[y[inside], x[inside]] > depth[visible][inside] + _SLACK_M
    return int(inside.sum()), int(in_front.sum())


CHECKS = (
    Check("pose", "camera", check_pose, 1),
    Check("reprojection", "views", check_reprojection, 1),
)
