"""K and poses: proper by themselves, and one view's points fall on what another view sees.

No effects but reading what it is given.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored import StoredView

SLACK_M = 0.02
_STEP_PX = 7


def check_pose(view: StoredView, tally: Tally) -> None:
    """The pose is a rotation and a position, both conventions agree, and K is a pinhole's."""
    opencv = view.world_from_camera
    opengl = np.array(view.table["world_from_camera_opengl"], np.float64)
    shaped = opencv.shape == opengl.shape == (4, 4) and view.k.shape == (3, 3)
    if not tally.expect("pose", view.place, shaped, "not (4, 4) poses and a (3, 3) K"):
        return
    rotation = opencv[:3, :3]
    proper = np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6 < np.linalg.det(rotation)
    tally.expect("pose", view.place, bool(proper), "the rotation is none")
    agree = np.abs(opengl @ np.diag([1.0, -1, -1, 1]) - opencv).max() < 1e-9
    tally.expect("pose", view.place, bool(agree), "the OpenGL and OpenCV poses differ")
    height, width = view.size
    fx, fy, cx, cy = view.k[0, 0], view.k[1, 1], view.k[0, 2], view.k[1, 2]
    pinhole = fx > 0 and fy > 0 and 0 < cx < width and 0 < cy < height and view.k[2, 2] == 1
    tally.expect("pose", view.place, bool(pinhole), "K is no pinhole camera's")


def check_reprojection(
    a: StoredView,
    b: StoredView,
    depths: tuple[NDArray[Any], NDArray[Any]],
    tally: Tally,
) -> None:
    """Points that a sees, in b's picture, are never in front of b's surfaces' back: b would see past.

    depths: depth.png of a and b. A point at depth z in b is right when b's surface there is at
    most z + SLACK_M away (it may be nearer: the point is then hidden). The nearest surface among
    the pixel and its neighbours is taken, since points do not fall on pixel centres.
    """
    depth_a, depth_b = (d.astype(np.float64) / 1000 for d in depths)
    rows, columns = (
        g.reshape(-1) for g in np.mgrid[0 : a.size[0] : _STEP_PX, 0 : a.size[1] : _STEP_PX]
    )
    z = depth_a[rows, columns]
    origin, directions = a.rays(rows, columns)
    world = (origin + directions * z[:, None])[(z > 0) & (z < 65)]

    camera = (world - b.world_from_camera[:3, 3]) @ b.world_from_camera[:3, :3]
    camera = camera[camera[:, 2] > 0.05]
    pixel = camera @ b.k.T
    x, y = np.floor(pixel[:, :2] / pixel[:, 2:]).astype(np.int64).T
    height, width = b.size
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    nearest = ndimage.minimum_filter(np.where(depth_b > 0, depth_b, np.inf), size=3, mode="nearest")
    seen_past = nearest[y[inside], x[inside]] > camera[inside, 2] + SLACK_M
    tally.add("reprojection", int(inside.sum()))
    if seen_past.any():
        tally.fail(
            "reprojection", f"{a.place} in {b.place}", "sees past its points", int(seen_past.sum())
        )
