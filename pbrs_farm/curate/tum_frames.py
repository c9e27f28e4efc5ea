"""Sequences in the layout of the TUM RGB-D benchmark (Sturm et al. 2012), as pairs of frames. Effects: reads files.

<sequence>/rgb.txt and depth.txt have a line `seconds file` per picture, groundtruth.txt a line
`seconds tx ty tz qx qy qz qw` per pose; other lines are headings. The colour and depth cameras are
not synchronised. Consecutive frames are nearly equal, at thirty a second, so a frame is used only
after the camera has moved.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.regular_files import text_given

DEPTH_LIST: Final = "depth.txt"
_RGB_LIST: Final = "rgb.txt"
_POSES: Final = "groundtruth.txt"
DEPTH_SCALE: Final = 5000.0  # units per metre
_APART_S: Final = 0.02  # maximum, between colour and depth of a pair, as in the benchmark's tools
_POSE_APART_S: Final = 0.05  # maximum, between a frame and its pose
_MOVED_M, _TURNED_DEG = 0.1, 10.0  # minimum motion since the last selected frame
_WAIT_S: Final = 1.0  # minimum time since the last frame, if a pose is unknown

# fx, fy, cx, cy of the colour cameras by their number (the benchmark's page of file formats).
_CAMERAS: Final = {
    "1": (517.3, 516.5, 318.6, 255.3),
    "2": (520.9, 521.0, 325.1, 249.7),
    "3": (535.4, 539.2, 320.1, 247.6),
}
_CAMERA_NAME: Final = re.compile(r"(?<![a-z])(?:freiburg|fr)([123])(?![0-9])", re.IGNORECASE)


def is_sequence(folder: Path) -> bool:
    """True if the folder has both lists."""
    return (folder / _RGB_LIST).is_file() and (folder / DEPTH_LIST).is_file()


def camera_of_sequence(folder: Path) -> tuple[float, float, float, float] | None:
    """fx, fy, cx, cy in pixels of the camera in a sequence's name ("freiburg2", "fr2"); None without one."""
    match = _CAMERA_NAME.search(folder.name) if is_sequence(folder) else None
    return _CAMERAS[match[1]] if match else None


def frames_of(folder: Path) -> list[tuple[Path, Path]]:
    """Colour and depth of each selected frame, in the order of time.

    A pair is two pictures mutually nearest in time, within 0.02 s. A frame is selected after
    the camera has moved 0.1 m or turned 10 degrees since the last one, or after a second if its pose
    is unknown. Raises BadInput naming the list and line, or if there is no pair.
    """
    rgb, depth = _listed(folder / _RGB_LIST), _listed(folder / DEPTH_LIST)
    if not rgb or not depth:
        empty = _RGB_LIST if not rgb else DEPTH_LIST
        raise BadInput(folder / empty, "", "lists no picture", hint="lines `seconds file`")
    rgb_s, depth_s = (np.array([seconds for seconds, _ in each]) for each in (rgb, depth))
    nearest = np.abs(rgb_s[:, None] - depth_s[None]).argmin(1)
    back = np.abs(depth_s[:, None] - rgb_s[None]).argmin(1)
    indices = np.arange(len(rgb))
    paired = (back[nearest] == indices) & (np.abs(depth_s[nearest] - rgb_s) <= _APART_S)
    if not paired.any():
        text = f"no picture within {_APART_S} s of one in {_RGB_LIST}"
        raise BadInput(folder / DEPTH_LIST, "", text)
    ids = indices[paired]
    ids = ids[np.argsort(rgb_s[ids], kind="stable")]
    return [(rgb[k][1], depth[nearest[k]][1]) for k in ids[_apart(rgb_s[ids], _poses(folder))]]


def _listed(path: Path) -> list[tuple[float, Path]]:
    """Seconds and file of each line that begins with a number."""
    rows = []
    for number, line in enumerate(text_given(path).splitlines(), 1):
        words = line.split(maxsplit=1)
        seconds = _number(words[0]) if words else None
        if seconds is None:
            continue
        file = path.parent / words[1].strip() if len(words) > 1 else None
        if file is None or not file.is_file():
            problem = f"no such file {words[1].strip()}" if file else "expected `seconds file`"
            raise BadInput(path, f"line {number}", problem)
        rows.append((seconds, file))
    return rows


def _number(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def _poses(folder: Path) -> F64:
    """(n, 8) seconds, position in metres and unit quaternion, by time; empty without a file."""
    path, rows = folder / _POSES, []
    if not path.is_file():
        return np.zeros((0, 8))
    for number, line in enumerate(text_given(path).splitlines(), 1):
        words = line.split()
        if not words or _number(words[0]) is None:
            continue
        values = [_number(word) for word in words]
        if len(values) != 8 or None in values or not any(values[4:]):
            raise BadInput(path, f"line {number}", "expected `seconds tx ty tz qx qy qz qw`")
        rows.append(values)
    poses = np.array(rows, np.float64).reshape(-1, 8)
    poses[:, 4:] /= np.linalg.norm(poses[:, 4:], axis=1, keepdims=True)
    return poses[np.argsort(poses[:, 0], kind="stable")]


def _apart(seconds: F64, poses: F64) -> list[int]:
    """Indices of the selected frames: the first, and each far enough from the last selected one."""
    taken: list[int] = []
    last: F64 | None = None
    for k, now in enumerate(seconds):
        pose = _pose_at(now, poses)
        if taken:
            if pose is None or last is None:
                far = now - seconds[taken[-1]] >= _WAIT_S
            else:
                turn = 2 * np.arccos(min(abs(float(pose[3:] @ last[3:])), 1.0))
                moved = float(np.linalg.norm(pose[:3] - last[:3]))
                far = moved >= _MOVED_M or np.degrees(turn) >= _TURNED_DEG
            if not far:
                continue
        taken.append(k)
        last = pose
    return taken


def _pose_at(seconds: float, poses: F64) -> F64 | None:
    """(7,) the pose nearest in time; None if it is too far."""
    if not len(poses):
        return None
    k = int(np.abs(poses[:, 0] - seconds).argmin())
    return poses[k, 1:] if abs(poses[k, 0] - seconds) <= _POSE_APART_S else None
