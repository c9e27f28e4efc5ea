"""COLMAP's text model, a folder for each house. Effects: reads views, writes files."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import numbers, write_files
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.sequences import by_house

_STEP_PX: Final = 16  # spacing of the pixels of a view with points
_NO_POINT: Final = ("0.5 0.5 -1",)  # points of a view without a surface: a pixel without a point


def write_colmap(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """<house>/images/<view>.png and sparse/0/{cameras,images,points3D}.txt.

    Poses are world to camera with OpenCV axes, in the home's world (metres, y up). Points are
    surfaces behind every 16th pixel, with its colour and that pixel as their track. Views of a rig have
    rigs.txt and frames.txt beside them, as COLMAP 3.12 and later read them.
    """
    for house, shots in by_house(views).items():
        cameras: dict[tuple[str, str], int] = {}
        lists: dict[str, list[str]] = {"images": [], "points3D": []}
        sensors: list[int] = []
        for number, view in enumerate(shots, start=1):
            # Each camera of a rig is a sensor, even if two are alike.
            key = view.shot.eye, colmap_camera_line(view)
            camera = cameras.setdefault(key, len(cameras) + 1)
            sensors.append(camera)
            pixels, lines = _points_of(view)
            # A line of its pose and one of its points. COLMAP allows an empty one, but readers of gsplat
            # and pycolmap take it for the end of the file.
            first = len(lists["points3D"]) + 1
            tracked = [f"{x:g} {y:g} {n}" for n, (x, y) in enumerate(pixels, start=first)]
            track = " ".join(tracked or _NO_POINT)
            lists["images"].append(
                f"{number} {_pose_words(view)} {camera} {view.id}.png\n{track}\n"
            )
            lists["points3D"] += [
                f"{n} {line} 0 {number} {k}\n"
                for k, (n, line) in enumerate(enumerate(lines, first))
            ]
        lists["cameras"] = [f"{n} {line}\n" for (_eye, line), n in cameras.items()]
        if any("rig" in view.facts for view in shots):
            lists["rigs"], lists["frames"] = _rig_lines(shots, sensors)
        texts = {f"sparse/0/{name}.txt": "".join(lines) for name, lines in lists.items()}
        pictures = ({f"images/{view.id}.png": view.shown} for view in shots)
        write_files(out / house, pictures, texts)


def _rig_lines(views: list[ChosenView], sensors: list[int]) -> tuple[list[str], list[str]]:
    """Lines of rigs.txt and frames.txt. sensors: of each view, the id of its camera.

    The first camera of an instant is the rig's frame, as COLMAP has it.
    """
    instants: dict[str, list[tuple[int, int, ChosenView]]] = {}
    for image, (view, sensor) in enumerate(zip(views, sensors, strict=True), start=1):
        instants.setdefault(view.shot.first.id, []).append((image, sensor, view))
    rigs: dict[str, int] = {}
    frames: list[str] = []
    for number, taken in enumerate(instants.values(), start=1):
        taken.sort(key=lambda row: (row[2].shot.eye != "", row[1]))
        rig_from_first = _rig_from_camera(taken[0][2])
        line = f"{len(taken)} CAMERA {taken[0][1]}"
        for _image, sensor, view in taken[1:]:
            camera_from_first: F64 = np.linalg.inv(_rig_from_camera(view)) @ rig_from_first
            line += f" CAMERA {sensor} 1 {_motion_words(np.asarray(camera_from_first))}"
        rig = rigs.setdefault(line, len(rigs) + 1)
        data = " ".join(f"CAMERA {sensor} {image}" for image, sensor, _view in taken)
        frames.append(f"{number} {rig} {_pose_words(taken[0][2])} {len(taken)} {data}\n")
    return [f"{n} {line}\n" for line, n in rigs.items()], frames


def _rig_from_camera(view: ChosenView) -> F64:
    rig = view.facts.get("rig")
    return np.eye(4) if rig is None else np.array(rig["rig_from_camera_opencv"], np.float64)


def colmap_camera_line(view: ChosenView) -> str:
    i = view.intrinsics
    # FULL_OPENCV has OpenCV's first eight numbers.
    bent = i.lens.coefficients
    if i.lens.bends_lines:
        if any(bent[8:]):
            text = "COLMAP's FULL_OPENCV has k1 to k6, p1 and p2, no prism (s1 to s4) and no tilt (tau)"
            raise BadInput("--to colmap", view.id, text, hint="another --to")
        bent = (*bent[:8], *([0.0] * (8 - len(bent))))
    model = {8: "FULL_OPENCV", 4: "OPENCV_FISHEYE"}.get(len(bent), "PINHOLE")
    return f"{model} {i.width_px} {i.height_px} {numbers((i.fx, i.fy, i.cx, i.cy, *bent))}"


def _pose_words(view: ChosenView) -> str:
    """`qw qx qy qz tx ty tz`, camera from world."""
    return _motion_words(np.asarray(np.linalg.inv(view.pose)))


def _motion_words(motion: F64) -> str:
    x, y, z, w = Rotation.from_matrix(motion[:3, :3]).as_quat(canonical=True)
    return numbers((w, x, y, z, *motion[:3, 3]))


def _points_of(view: ChosenView) -> tuple[list[list[float]], list[str]]:
    """The pixels (x, y) of a grid over the view, and the line `x y z r g b` of each."""
    depth, rgb = view.array("depth"), view.colours
    height, width = depth.shape
    grid = np.mgrid[_STEP_PX // 2 : height : _STEP_PX, _STEP_PX // 2 : width : _STEP_PX]
    rows, columns = (g.ravel() for g in grid)
    z = depth[rows, columns] / 1000
    rows, columns, z = rows[z > 0], columns[z > 0], z[z > 0]
    # From pixel centres through the lens into the world.
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=1)
    world = view.in_world(pixels, z)
    colours = rgb[rows, columns]
    rows_of_pixels: list[list[float]] = pixels.tolist()
    return rows_of_pixels, [
        f"{x:.4f} {y:.4f} {z:.4f} {r} {g} {b}"
        for (x, y, z), (r, g, b) in zip(world.tolist(), colours.tolist(), strict=True)
    ]


FORM = ViewForm(
    "colmap",
    write_colmap,
    "a text model: cameras, images, points from depth; of a rig also rigs and frames",
    lenses=("pinhole", "radtan", "opencv", "fisheye"),
    convention=Convention(0.5, axes="OpenCV's; world y up, m"),
)
