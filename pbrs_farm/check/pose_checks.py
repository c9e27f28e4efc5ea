"""K and poses: proper by themselves, and one view's points fall on what another sees; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored_view import StoredView

SLACK_M = 0.02
# Share of points that a thin thing between two pixels may cost; a wrong pose costs far more.
MAX_SEEN_PAST = 0.002

_MIN_COSINE = 0.5  # of a surface against the other view's ray
_MIN_NEARER = 0.7  # own distance over the other view's
_STEP_PX = 16  # of the grid of points
_MAX_PARTNERS = 40  # views that one view is held against


def check_pose(view: StoredView, tally: Tally) -> None:
    """The pose is a rotation and a position, both conventions agree, and K is a pinhole's.

    K must have positive focal lengths and a principal point within the picture. After wrong shapes
    nothing else of the pose is judged.
    """
    # Shapes first: nothing else can be computed without them.
    opencv = view.world_from_camera
    opengl = np.array(view.table["world_from_camera_opengl"], np.float64)
    shaped = opencv.shape == opengl.shape == (4, 4) and view.k.shape == (3, 3)
    if not tally.expect("pose", view.place, shaped, "not (4, 4) poses and a (3, 3) K"):
        return
    rotation = opencv[:3, :3]
    proper = np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6 < np.linalg.det(rotation)
    tally.expect("pose", view.place, bool(proper), "the rotation is none")
    # The two conventions differ by the signs of y and z.
    agree = np.abs(opengl @ np.diag([1.0, -1, -1, 1]) - opencv).max() < 1e-9
    tally.expect("pose", view.place, bool(agree), "the OpenGL and OpenCV poses differ")
    height, width = view.size
    fx, fy, cx, cy = view.k[0, 0], view.k[1, 1], view.k[0, 2], view.k[1, 2]
    usable = fx > 0 and fy > 0 and 0 < cx < width and 0 < cy < height and view.k[2, 2] == 1
    tally.expect("pose", view.place, bool(usable), "K is no camera's")


@dataclass(frozen=True, slots=True, eq=False)
class SeenView:
    """A view with the layers that reprojection needs."""

    view: StoredView
    depth: NDArray[Any]  # as depth.png stores it
    normal: NDArray[Any]  # as normal.png stores it
    moves: NDArray[np.bool_] | None = (
        None  # (H, W) shows something that may be elsewhere in other views
    )


def check_reprojection(views: list[SeenView], tally: Tally) -> None:
    """Points that one view sees are nowhere in front of what another view of the house sees.

    views: of one house. A point at depth z in another view is right when that view's surface
    there is at most z + SLACK_M away (it may be nearer: the point is then hidden). Of a pixel and
    its neighbours the nearest counts, since points do not fall on pixel centres. Points of narrow
    surfaces, or that the other view sees from the side or from much farther, are left out, since
    they may fall between its pixels; up to MAX_SEEN_PAST of a pair's points may still be wrong,
    and are counted as ties. Every view is held against every other, or _MAX_PARTNERS of them.
    """
    points = [_model_points(seen) for seen in views]
    nearest = [_nearest(seen.depth) for seen in views]
    rng = np.random.default_rng(0)
    for a, seen in enumerate(views):
        # Choose the views to hold it against.
        others = np.array([b for b in range(len(views)) if b != a], np.int64)
        if len(others) > _MAX_PARTNERS:
            others = rng.choice(others, _MAX_PARTNERS, replace=False)
        for b in others:
            n, wrong = _seen_past(points[a], views[b].view, nearest[b])
            if wrong > max(2, MAX_SEEN_PAST * n):
                tally.add("reprojection", n)
                place = f"{seen.view.place} in {views[b].view.place}"
                what = f"{wrong} of {n} points lie before what is seen there"
                tally.fail("reprojection", place, what, wrong)
            else:
                tally.add("reprojection", n, ties=wrong)


def _model_points(seen: SeenView) -> NDArray[np.float64]:
    """(N, 3, 3) world positions, normals and eye of a grid of the view's pixels.

    Only pixels amid a flat patch of 5 x 5: what is thinner here may be thinner than a pixel there.
    """
    view, (height, width) = seen.view, seen.view.size
    # Normals of a grid of pixels, in the world.
    grid = np.mgrid[_STEP_PX // 2 : height : _STEP_PX, _STEP_PX // 2 : width : _STEP_PX]
    rows, columns = (g.reshape(-1) for g in grid)
    published = seen.normal[rows, columns] * (2 / 65535) - 1
    # Published axes are x right, y forward, z up; the pose's are x right, y down, z forward.
    camera = np.stack([published[:, 0], -published[:, 2], published[:, 1]], axis=1)
    normal = camera @ view.world_from_camera[:3, :3].T

    centre, eye = _positions(seen, rows, columns), view.world_from_camera[:3, 3]
    # Keep the pixels whose 5 x 5 neighbours lie on the plane of the normal.
    z = seen.depth[rows, columns] / 1000
    flat = (z > 0) & (z < 65)
    if seen.moves is not None:
        flat &= ~seen.moves[rows, columns]
    for dy, dx in np.ndindex(5, 5):
        r, c = (rows + dy - 2).clip(0, height - 1), (columns + dx - 2).clip(0, width - 1)
        off = np.einsum("ni,ni->n", _positions(seen, r, c) - centre, normal)
        flat &= np.abs(off) < SLACK_M / 2
    rows_of = np.stack([centre, normal, np.broadcast_to(eye, centre.shape)], axis=1)
    return np.asarray(rows_of[flat])


def _positions(
    seen: SeenView, rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> NDArray[np.float64]:
    origin, directions = seen.view.rays(rows, columns)
    return np.asarray(origin + directions * (seen.depth[rows, columns] / 1000)[:, None])


def _nearest(depth: NDArray[Any]) -> NDArray[np.float64]:
    """(H, W) metres of the nearest surface among a pixel and its neighbours; inf = nothing."""
    metres = np.where(depth > 0, depth / 1000, np.inf)
    return np.asarray(ndimage.minimum_filter(metres, size=3, mode="nearest"))


def _seen_past(
    points: NDArray[np.float64], view: StoredView, nearest: NDArray[np.float64]
) -> tuple[int, int]:
    """How many of the points lie in the view's picture, and in front of all it sees there."""
    # Leave out surfaces seen from the side, or from much farther than their own view.
    towards = points[:, 0] - view.world_from_camera[:3, 3]
    distance = np.linalg.norm(towards, axis=1)
    own_distance = np.linalg.norm(points[:, 0] - points[:, 2], axis=1)
    broad = np.abs(np.einsum("ni,ni->n", points[:, 1], towards)) > _MIN_COSINE * distance
    broad &= own_distance > _MIN_NEARER * distance
    # Project the others, and count those in front of what the view sees.
    camera = towards[broad] @ view.world_from_camera[:3, :3]
    pixel, depth = view.pixels_and_depths(camera)
    with np.errstate(invalid="ignore"):
        seen = (depth > 0.05) & np.isfinite(pixel).all(1)
    x, y = np.floor(pixel[seen]).astype(np.int64).T
    height, width = view.size
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    past = nearest[y[inside], x[inside]] > depth[seen][inside] + SLACK_M
    return int(inside.sum()), int(past.sum())
