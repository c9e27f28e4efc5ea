"""Views that belong together, for the exports of sequences: by house, in time, with their right views; pure."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lenses import COEFFICIENTS
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    intrinsics_of,
    name_left_out,
    require_lens,
)
from pbrs_farm.images import png_from_array


@dataclass(frozen=True, slots=True, eq=False)
class SequenceFrame:
    """One moment of a house: the left view, and the right one where there is a pair."""

    left: ChosenView
    right: ChosenView | None = None

    @property
    def time_s(self) -> float | None:
        """None of a view that is no frame."""
        time = self.left.facts.get("time_s")
        return None if time is None else float(time)


def frames_by_house(views: Sequence[ChosenView]) -> dict[str, list[SequenceFrame]]:
    """House id -> its frames by number, then the views that are none by id; right views by their left."""
    rights = {(v.house.id, v.facts["left"]): v for v in views if v.facts.get("left")}
    frames: dict[str, list[SequenceFrame]] = {}
    for view in views:
        if not view.facts.get("left"):
            right = rights.get((view.house.id, view.id))
            frames.setdefault(view.house.id, []).append(SequenceFrame(view, right))

    def order(frame: SequenceFrame) -> tuple[float, str]:
        return float(frame.left.facts.get("frame", float("inf"))), frame.left.id

    return {house: sorted(own, key=order) for house, own in frames.items()}


def pose_opencv(view: ChosenView) -> F64:
    """(4, 4) world from camera, axes x right, y down, z forward."""
    return np.array(view.facts["world_from_camera_opencv"], np.float64)


def tum_row(time_s: float, world_from_camera: F64) -> str:
    """`t x y z qx qy qz qw` of an OpenCV pose, w not negative."""
    quaternion = Rotation.from_matrix(world_from_camera[:3, :3]).as_quat(canonical=True)
    numbers = [*world_from_camera[:3, 3], *quaternion]
    return f"{time_s:.6f} " + " ".join(f"{v:.9g}" for v in numbers)


def required_picture(view: ChosenView, form: str) -> str:
    """The mode of the view's picture; BadInput where it has none."""
    if view.picture is None:
        hint = "run it with --modes, or export labels in another form"
        raise BadInput(f"{view.house.id}/{view.id}", "", f"{form} needs a picture", hint=hint)
    return view.picture


# COLMAP's text model, a folder for each house. Effects: reads views, writes files.


_STEP_PX: Final = 16  # between the pixels of a view that give points


def write_colmap(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """<house>/images/<view>.png and sparse/0/{cameras,images,points3D}.txt; the number of files.

    Poses are world to camera with OpenCV axes, in the home's world (metres, y up). Points are
    surfaces behind every 16th pixel, with its colour and without tracks.
    """
    n_files = 0
    for house in dict.fromkeys(view.house.id for view in views):
        own = [view for view in views if view.house.id == house]
        (out / house / "images").mkdir(parents=True)
        (out / house / "sparse/0").mkdir(parents=True)
        cameras: dict[str, int] = {}
        images, points = [], []
        for number, view in enumerate(own, start=1):
            picture = required_picture(view, "colmap")
            (out / house / "images" / f"{view.id}.png").write_bytes(view.data(picture))
            camera = cameras.setdefault(_camera(view), len(cameras) + 1)
            # A line of its pose and an empty one: no points of it are named.
            images.append(f"{number} {_pose(view)} {camera} {view.id}.png\n\n")
            points += _points(view, picture)
        _write(out / house / "sparse/0/cameras.txt", (f"{n} {c}\n" for c, n in cameras.items()))
        _write(out / house / "sparse/0/images.txt", images)
        numbered = (f"{n} {point} 0\n" for n, point in enumerate(points, start=1))
        _write(out / house / "sparse/0/points3D.txt", numbered)
        n_files += len(own) + 3
    return n_files


def _write(file: Path, lines: Iterable[str]) -> None:
    file.write_text("".join(lines))


def _camera(view: ChosenView) -> str:
    require_lens(view, "colmap", "radtan", "fisheye")
    i = intrinsics_of(view.facts)
    # FULL_OPENCV has k1 k2 p1 p2 k3 and three more, which are 0.
    model, more = {
        "radtan": ("FULL_OPENCV", (0.0, 0.0, 0.0)), "fisheye": ("OPENCV_FISHEYE", ()),
    }.get(i.lens.model, ("PINHOLE", ()))  # fmt: skip
    numbers = (i.fx, i.fy, i.cx, i.cy, *i.lens.coefficients, *more)
    return f"{model} {i.width_px} {i.height_px} " + " ".join(f"{v:.9g}" for v in numbers)


def _pose(view: ChosenView) -> str:
    """`qw qx qy qz tx ty tz`, camera from world."""
    camera_from_world = np.linalg.inv(pose_opencv(view))
    x, y, z, w = Rotation.from_matrix(camera_from_world[:3, :3]).as_quat(canonical=True)
    return " ".join(f"{v:.9g}" for v in (w, x, y, z, *camera_from_world[:3, 3]))


def _points(view: ChosenView, picture: str) -> list[str]:
    """`x y z r g b` of a grid of the view's pixels."""
    depth, rgb = view.array("depth"), view.array(picture)
    height, width = depth.shape
    grid = np.mgrid[_STEP_PX // 2 : height : _STEP_PX, _STEP_PX // 2 : width : _STEP_PX]
    rows, columns = (g.ravel() for g in grid)
    z = depth[rows, columns] / 1000
    rows, columns, z = rows[z > 0], columns[z > 0], z[z > 0]
    # From pixel centres through the lens into the world.
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=1)
    local = intrinsics_of(view.facts).directions(pixels) * z[:, None]
    pose = pose_opencv(view)
    world = local @ pose[:3, :3].T + pose[:3, 3]
    colours = rgb[rows, columns]
    return [
        f"{x:.4f} {y:.4f} {z:.4f} {r} {g} {b}"
        for (x, y, z), (r, g, b) in zip(world.tolist(), colours.tolist(), strict=True)
    ]


# nerfstudio's transforms.json, a folder for each house. Effects: reads views, writes files.


# z up, as nerfstudio has it  <-  y up.
Z_UP_FROM_Y_UP: Final[F64] = np.array(
    [[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]], np.float64
)


_MODELS: Final = {
    "pinhole": "PINHOLE", "radtan": "OPENCV", "fisheye": "OPENCV_FISHEYE",
    "equirect": "EQUIRECTANGULAR",
}  # fmt: skip
"""What nerfstudio calls each lens model; a run has one."""


def write_nerfstudio(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """<house>/transforms.json, images/<view>.png and depth/<view>.png (mm); the number of files.

    Poses are camera to world with OpenGL axes in a world with z up; applied_transform is the turn
    from the home's y up. Views without a picture are an error.
    """
    n_files = 0
    for house in dict.fromkeys(view.house.id for view in views):
        own = [view for view in views if view.house.id == house]
        frames = []
        for view in own:
            row, n = _frame(view, out / house)
            frames.append(row)
            n_files += n
        transforms = {
            "camera_model": _MODELS[intrinsics_of(own[0].facts).lens.model],
            "orientation_override": "none",
            "depth_unit_scale_factor": 0.001,
            "applied_transform": Z_UP_FROM_Y_UP[:3].tolist(),
            "frames": frames,
        }
        (out / house / "transforms.json").write_text(json.dumps(transforms, indent=1) + "\n")
        n_files += 1
    return n_files


def _frame(view: ChosenView, folder: Path) -> tuple[dict[str, Any], int]:
    # Write the picture and, where it is exported, the depth.
    require_lens(view, "nerfstudio", *_MODELS)
    picture, n_files = required_picture(view, "nerfstudio"), 1
    facts = view.facts
    pose = Z_UP_FROM_Y_UP @ np.array(facts["world_from_camera_opengl"], np.float64)
    k = np.array(facts["K"], np.float64)
    row: dict[str, Any] = {
        "file_path": f"images/{view.id}.png",
        "transform_matrix": pose.tolist(),
        "w": facts["width_px"], "h": facts["height_px"],
        "fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2], "cy": k[1, 2],
    }  # fmt: skip
    # Coefficients go by OpenCV's names.
    lens = intrinsics_of(facts).lens
    row |= dict(zip(COEFFICIENTS[lens.model], lens.coefficients, strict=True))
    files = {"images": view.data(picture)}
    if view.has("depth"):
        files["depth"] = view.data("depth")
        row["depth_file_path"] = f"depth/{view.id}.png"
        n_files += 1
    if facts.get("time_s") is not None:
        row["time"] = facts["time_s"]
    for name, data in files.items():
        (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / name / f"{view.id}.png").write_bytes(data)
    return row, n_files


# TUM's RGB-D form: pictures, depth and the trajectory by time. Effects: reads views, writes
# files.


_STEPS_PER_M: Final = 5000  # of TUM's depth


def write_tum(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """<house>/rgb/, depth/, rgb.txt, depth.txt and groundtruth.txt; the number of files.

    groundtruth.txt has rows t x y z qx qy qz qw in the home's world (metres, y up), OpenCV axes:
    what `--trajectory` reads. Depth is 5000 a metre, 0 = nothing or beyond 13.1 m. Right views of
    pairs have all five with `_right` behind their names. Frames of a sequence alone: other views
    are named in left_out.txt; BadInput where there is none.
    """
    n_files, written = 0, set[tuple[str, str]]()
    for house, frames in frames_by_house(views).items():
        timed = [(f, f.time_s) for f in frames if f.time_s is not None]
        lefts = [(f.left, time) for f, time in timed]
        rights = [(f.right, time) for f, time in timed if f.right is not None]
        n_files += _write_trajectory(out / house, "", lefts)
        n_files += _write_trajectory(out / house, "_right", rights)
        written |= {(house, view.id) for view, _time in (*lefts, *rights)}
    if not n_files:
        hint = "pbrs-farm run HOME --cameras walk"
        raise BadInput("--to", "tum", "no view is a frame of a sequence", hint=hint)
    others = [view for view in views if (view.house.id, view.id) not in written]
    return n_files + name_left_out(out, others, "has no frame of a sequence that is exported")


def _write_trajectory(folder: Path, side: str, timed: Sequence[tuple[ChosenView, float]]) -> int:
    """What TUM's form holds of one camera that moves; the number of files."""
    if not timed:
        return 0
    rows: dict[str, list[str]] = {"rgb": [], "depth": [], "groundtruth": []}
    for name in ("rgb", "depth"):
        (folder / f"{name}{side}").mkdir(parents=True)
    for view, time in timed:
        require_lens(view, "tum", "radtan")
        files = {"rgb": view.data(required_picture(view, "tum")), "depth": _depth(view)}
        for name, data in files.items():
            at = f"{name}{side}/{time:.6f}.png"
            (folder / at).write_bytes(data)
            rows[name].append(f"{time:.6f} {at}")
        rows["groundtruth"].append(tum_row(time, pose_opencv(view)))
    for name, lines in rows.items():
        (folder / f"{name}{side}.txt").write_text("\n".join(lines) + "\n")
    return 2 * len(timed) + 3


def _depth(view: ChosenView) -> bytes:
    steps = view.array("depth").astype(np.int64) * _STEPS_PER_M // 1000
    return png_from_array(np.where(steps > 65535, 0, steps).astype(np.uint16))


# KITTI 2015's layout of stereo and flow. Effects: reads views, writes files.


_SEEN: Final = 0  # of the layers of occlusion


def write_kitti(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """image_2/ (left) and image_3/ (right), disp_*_0/, flow_*/, calib/; the number of files.

    <6 digits>_10.png is a frame, <6 digits>_11.png the next one of its sequence. `occ` has every
    surface, `noc` those that the other picture sees. index.txt: number, house, view. Whatever a
    view lacks is left out; BadInput where none has flow or disparity.
    """
    n_files = 0
    rows: list[str] = []
    for house, frames in frames_by_house(views).items():
        for k, frame in enumerate(frames):
            files = _labels(frame.left)
            if not files:
                continue
            number = f"{len(rows):06d}"
            following = frames[k + 1] if k + 1 < len(frames) else None
            files |= _pictures(frame, "10") | (_pictures(following, "11") if following else {})
            files["calib/{}.txt"] = _calibration(frame).encode()
            for name, data in files.items():
                target = out / name.format(number)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(data)
            n_files += len(files)
            rows.append(f"{number} {house} {frame.left.id}")
    if not rows:
        hint = "run with --stereo 0.065 --layers disparity occlusion_stereo flow_forward"
        raise BadInput("--to", "kitti", "no view has flow or disparity", hint=hint)
    (out / "index.txt").write_text("\n".join(rows) + "\n")
    return n_files + 1


def _pictures(frame: SequenceFrame, which: str) -> dict[str, bytes]:
    files = {f"image_2/{{}}_{which}.png": frame.left.data(required_picture(frame.left, "kitti"))}
    if frame.right is not None:
        picture = required_picture(frame.right, "kitti")
        files[f"image_3/{{}}_{which}.png"] = frame.right.data(picture)
    return files


def _labels(view: ChosenView) -> dict[str, bytes]:
    files = {}
    if view.has("disparity"):
        disparity = view.array("disparity")
        files["disp_occ_0/{}_10.png"] = png_from_array(disparity)
        if view.has("occlusion_stereo"):
            seen = view.array("occlusion_stereo") == _SEEN
            files["disp_noc_0/{}_10.png"] = png_from_array(np.where(seen, disparity, np.uint16(0)))
    if view.has("flow_forward"):
        flow, there = view.array("flow_forward"), view.array("depth") > 0
        files["flow_occ/{}_10.png"] = png_from_array(kitti_flow(flow, there))
        if view.has("occlusion_forward"):
            seen = view.array("occlusion_forward") == _SEEN
            files["flow_noc/{}_10.png"] = png_from_array(kitti_flow(flow, seen))
    return files


def kitti_flow(flow: NDArray[np.float32], valid: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """(H, W, 3) uint16: 64 x + 2**15, 64 y + 2**15, 1; 0 in all three where not valid (H, W)."""
    steps = np.rint(flow.astype(np.float64) * 64) + 2**15
    valid = valid & ((steps >= 0) & (steps <= 65535)).all(-1)
    png = np.concatenate([steps.clip(0, 65535), np.ones((*valid.shape, 1))], axis=-1)
    return np.where(valid[..., None], png, 0).astype(np.uint16)


def _calibration(frame: SequenceFrame) -> str:
    """P2 and P3: (3, 4) projections of both pictures in the left camera's frame."""
    require_lens(frame.left, "kitti")
    k = np.array(frame.left.facts["K"], np.float64)
    lines = [_projection("P2", k, 0.0)]
    if frame.right is not None:
        eyes = [
            np.array(v.facts["world_from_camera_opencv"])[:3, 3] for v in (frame.left, frame.right)
        ]
        lines.append(_projection("P3", k, float(np.linalg.norm(eyes[1] - eyes[0]))))
    return "".join(lines)


def _projection(name: str, k: NDArray[np.float64], baseline_m: float) -> str:
    column = k @ np.array([[-baseline_m], [0.0], [0.0]])
    return f"{name}: " + " ".join(f"{v:.9e}" for v in np.hstack([k, column]).ravel()) + "\n"
