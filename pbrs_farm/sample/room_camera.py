"""room_camera.txt and its companions, the published camera files (docs/spec/suncg.md section 3.3): text only.

No effects: text in, text out. Half-angles are in radians; yf is recomputed from xf and the
picture's shape, and up is made perpendicular again, as every published reader does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.errors import BadInput


@dataclass(frozen=True, slots=True, eq=False)
class RoomCamera:
    """One line of room_camera.txt: a camera and its score."""

    camera: Camera
    score: float


def cameras_from_text(text: str, file: str, width_px: int, height_px: int) -> list[RoomCamera]:
    """The cameras of a room_camera.txt, in order, on a grid of that size.

    A line is `vx vy vz tx ty tz ux uy uz xf yf value`; empty lines are passed over. Raises
    BadInput (file and line) for other lines, numbers that are not finite, and impossible poses.
    """
    cameras = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            cameras.append(_camera(line.split(), file, number, width_px, height_px))
    return cameras


def _camera(words: list[str], file: str, line: int, width_px: int, height_px: int) -> RoomCamera:
    place = f"line {line}"
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise BadInput(file, place, "expected numbers") from None
    if len(numbers) != 12:
        raise BadInput(file, place, f"expected 12 numbers, got {len(numbers)}")
    if not np.isfinite(numbers).all():
        raise BadInput(file, place, "a number is not finite")
    # Read vx vy vz, tx ty tz, ux uy uz, xf, yf, value.
    eye, towards, up = (np.array(numbers[k : k + 3]) for k in (0, 3, 6))
    half_angle, score = numbers[9], numbers[11]  # yf follows from xf and the shape of the picture
    if not 0 < half_angle < math.pi / 2:
        raise BadInput(file, place, f"half angle {half_angle} is not within 0..pi/2")
    # Reject an up vector along the view.
    across = np.linalg.norm(np.cross(towards, up))
    if across <= 1e-6 * np.linalg.norm(towards) * np.linalg.norm(up):
        raise BadInput(file, place, "towards and up are parallel or zero")
    intrinsics = Intrinsics.from_hfov(width_px, height_px, 2 * half_angle)
    x, y, z = (float(u) for u in up)
    return RoomCamera(Camera.look(intrinsics, eye, towards, (x, y, z)), score)


def text_from_views(views: Sequence[View]) -> str:
    """room_camera.txt of views, a line each, numbers to six digits as the published files have."""
    lines = []
    for view in views:
        i, pose = view.camera.intrinsics, view.camera.world_from_camera
        xf = math.atan(0.5 * i.width_px / i.fx)  # half the horizontal field of view, radians
        yf = math.atan(0.5 * i.height_px / i.fy)
        groups = (view.camera.eye, view.camera.towards, pose[:3, 1], (xf, yf), (view.score,))
        lines.append("  ".join(" ".join(f"{float(x):g}" for x in group) for group in groups))
    return "".join(line + "\n" for line in lines)


def names_from_views(views: Sequence[View]) -> str:
    """room_camera_name.txt of views: `Room#<level>_<room>_<sector>`, a line each."""
    return "".join(f"Room#{view.room_id}_{view.sector}\n" for view in views)


def names_from_text(text: str, file: str) -> list[tuple[str, int]]:
    """(room id, sector) of each line of a room_camera_name.txt. Raises BadInput."""
    names = []
    for number, line in enumerate(text.split(), 1):
        # Split at the last underscore: room ids contain some.
        room, _, sector = line.removeprefix("Room#").rpartition("_")
        if not line.startswith("Room#") or not room or not sector.isdigit():
            raise BadInput(file, f"line {number}", f"expected Room#<room>_<sector>, got {line!r}")
        names.append((room, int(sector)))
    return names


def good_from_text(text: str, file: str) -> list[bool]:
    """room_camera_good.txt: per camera whether its room has a lamp, window or door. BadInput."""
    words = text.split()
    for number, word in enumerate(words, 1):
        if word not in ("0", "1"):
            raise BadInput(file, f"line {number}", f"expected 0 or 1, got {word!r}")
    return [word == "1" for word in words]


def nodes_from_text(text: str, file: str) -> dict[int, str]:
    """room_camera_node.txt: value in the published node.png -> node name. Raises BadInput."""
    nodes: dict[int, str] = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split(maxsplit=1)
        if not words:
            continue
        if len(words) != 2 or not words[0].isdigit():
            raise BadInput(file, f"line {number}", "expected `<number> <node name>`")
        nodes[int(words[0])] = words[1].strip()
    return nodes
