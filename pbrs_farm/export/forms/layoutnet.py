"""Corners of rooms in panoramas, the training data of LayoutNet and HorizonNet.

    img/<house>__<view>.png  label_cor/<house>__<view>.txt

Effects: reads views, writes files. Pictures are turned upright and along the room's walls, as those
programs need them; a label is the polygon of the camera's room, at its floor and at its nominal
ceiling.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.panoramas import directions_of_equirect, equirect_of_directions
from pbrs_farm.core.resampling import resized_by_area
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.export.content import Files, each_view
from pbrs_farm.export.form import Convention, Takes, ViewForm

WIDTH_PX: Final = 1024
HEIGHT_PX: Final = 512
_STRAIGHT_M: Final = 1e-3  # minimum distance of a corner from the line of its neighbours
_FIT: Final = "panorama with a picture in a room that encloses it"


def _files(view: ChosenView) -> Files:
    """img/ (1024 x 512) and label_cor/.

    A label has two lines a corner, `x y_ceiling` and `x y_floor`, corner by corner to the right, the
    least x first; pixels count from the centre of the first one. left_out.txt names views that are not
    panoramas (lens equirect), have no picture, or are outside their room's polygon; BadInput if no view
    remains.
    """
    axes = aligned_axes(view)
    picture = turned_picture(view.colours, axes.T @ view.pose[:3, :3])
    lines = [f"{x:.3f} {y:.3f}\n" for x, y in corner_pixels(view, axes).reshape(-1, 2)]
    name = f"{view.house.id}__{view.id}"
    return {f"img/{name}.png": picture, f"label_cor/{name}.txt": "".join(lines)}


def _is_fit(view: ChosenView) -> bool:
    if view.intrinsics.lens.model != "equirect" or view.picture is None:
        return False
    corners = _corners(view)
    x, _y, z = view.pose[:3, 3]
    polygon = shapely.Polygon(corners[:, 0, [0, 2]]) if len(corners) > 2 else shapely.Polygon()
    return bool(shapely.contains_xy(polygon, x, z))


def _corners(view: ChosenView) -> F64:
    """(N, 2, 3) corners of the room's ceiling and floor, world, in the order of its polygon."""
    rows: dict[str, list[list[float]]] = {"ceiling": [], "floor": []}
    for row in view.facts.get("layout", ()):
        rows[row["at"]].append(row["world"])
    rows_of_corners = np.array([rows["ceiling"], rows["floor"]], np.float64).reshape(2, -1, 3)
    plan = rows_of_corners[0][:, [0, 2]]
    before, after = np.roll(plan, 1, axis=0), np.roll(plan, -1, axis=0)
    along, offsets = after - before, plan - before
    off = np.abs(along[:, 0] * offsets[:, 1] - along[:, 1] * offsets[:, 0])
    is_bend = off > _STRAIGHT_M * np.linalg.norm(along, axis=1)
    return np.asarray(np.moveaxis(rows_of_corners, 0, 1)[is_bend])


def aligned_axes(view: ChosenView) -> F64:
    """(3, 3) right, down and forward as columns, world: upright, forward along or across the longest wall.

    Of the four such directions the nearest to the camera's.
    """
    plan = _corners(view)[:, 0][:, [0, 2]]
    walls = np.roll(plan, -1, axis=0) - plan
    x, z = walls[np.linalg.norm(walls, axis=1).argmax()]
    ahead = view.pose[:3, 2]
    wall, yaw = np.arctan2(z, x), np.arctan2(ahead[2], ahead[0])
    heading = wall + np.pi / 2 * np.round((yaw - wall) / (np.pi / 2))
    forward, down = np.array([np.cos(heading), 0, np.sin(heading)]), np.array([0, -1.0, 0])
    return np.stack([np.cross(down, forward), down, forward], axis=1)


def turned_picture(picture: NDArray[np.uint8], aligned_from_camera: F64) -> NDArray[np.uint8]:
    """(512, 1024, 3) of a panorama, seen with other axes at the same eye; (3, 3) turns directions."""
    if picture.shape[:2] != (HEIGHT_PX, WIDTH_PX):
        picture = resized_by_area(picture, WIDTH_PX, HEIGHT_PX)
    if np.allclose(aligned_from_camera, np.eye(3), atol=1e-6):
        return picture
    x, y = np.meshgrid(np.arange(WIDTH_PX) + 0.5, np.arange(HEIGHT_PX) + 0.5)
    scale = np.array([2 * np.pi / WIDTH_PX, np.pi / HEIGHT_PX])
    plane = np.stack([x.ravel() - WIDTH_PX / 2, y.ravel() - HEIGHT_PX / 2], axis=1) * scale
    # Rows of directions: the inverse of a turn is its transpose.
    pixels = equirect_of_directions(directions_of_equirect(plane) @ aligned_from_camera) / scale
    indices = np.stack([pixels[:, 1] + HEIGHT_PX / 2 - 0.5, pixels[:, 0] + WIDTH_PX / 2 - 0.5 + 1])
    # Between the four nearest pixels; the left edge adjoins the right one.
    around = np.concatenate([picture[:, -1:], picture, picture[:, :1]], axis=1).astype(np.float64)
    planes = [
        ndimage.map_coordinates(around[..., k], indices, order=1, mode="nearest") for k in range(3)
    ]
    return np.rint(np.stack(planes, axis=-1)).astype(np.uint8).reshape(HEIGHT_PX, WIDTH_PX, 3)


def corner_pixels(view: ChosenView, axes: F64) -> F64:
    """(N, 2, 2) x, y of each corner's ceiling and floor, to the right from the least x."""
    local = (_corners(view) - view.pose[:3, 3]) @ axes
    plane = equirect_of_directions(local.reshape(-1, 3)).reshape(-1, 2, 2)
    pixels = (plane / [2 * np.pi, np.pi] + 0.5) * [WIDTH_PX, HEIGHT_PX] - 0.5
    pixels[:, 1, 0] = pixels[:, 0, 0]  # exactly above each other
    # Around an eye inside it a polygon turns once: to the right, or else backwards.
    steps = np.diff(plane[:, 0, 0], append=plane[:1, 0, 0])
    turned = np.sum((steps + np.pi) % (2 * np.pi) - np.pi)
    pixels = pixels if turned > 0 else pixels[::-1]
    return np.roll(pixels, -int(pixels[:, 0, 0].argmin()), axis=0)


FORM = ViewForm(
    "layoutnet",
    each_view(_files),
    "corners of rooms in panoramas, for LayoutNet and HorizonNet: `img/<house>__<view>.png` (1024 x 512,"
    " turned upright and along the walls), `label_cor/<house>__<view>.txt` (`x y` of ceiling and floor of"
    " each corner in turn)",
    takes=Takes(
        lambda views: [view for view in views if _is_fit(view)],
        f"has no {_FIT}",
        f"no view is a {_FIT}",
        "run with --set lens.model=equirect",
    ),
    lenses=("equirect",),
    convention=Convention(0.0, axes=""),
)
