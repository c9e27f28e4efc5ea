"""room_camera.txt, the published camera file (docs/spec/suncg.md section 3.3), as cameras; no effects.

Half-angles are in radians; yf is recomputed from xf and the picture's shape, and up is made
perpendicular again, as every published reader does.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.errors import BadInput

_NAME: Final = re.compile(r"Room#(.+)_\d+")  # room id, sector


@dataclass(frozen=True, slots=True, eq=False)
class RoomCamera:
    """One line of room_camera.txt: a camera, its score and the room that its name says."""

    camera: Camera
    score: float
    room_id: str | None = None  # of Room#<room id>_<sector>


def cameras_from_text(text: str, file: str, width_px: int, height_px: int) -> list[RoomCamera]:
    """The cameras of a room_camera.txt, in order, on a grid of that size.

    A line is `vx vy vz tx ty tz ux uy uz xf yf value`, and perhaps the camera's name. Raises BadInput (file
    and line) for other lines, numbers that are not finite, and impossible poses.
    """
    cameras = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            cameras.append(_camera_of_line(line.split(), file, number, width_px, height_px))
    return cameras


def with_names(text: str, names: str, file: str) -> str:
    """Lines of a room_camera.txt, each before its room_camera_name.txt line; BadInput unless as many."""
    lines = [line for line in text.splitlines() if line.strip()]
    named = [line.strip() for line in names.splitlines() if line.strip()]
    if len(lines) != len(named):
        raise BadInput(file, "", f"{len(named)} names for {len(lines)} cameras")
    return "".join(f"{line} {name}\n" for line, name in zip(lines, named, strict=True))


def _camera_of_line(
    words: list[str], file: str, line: int, width_px: int, height_px: int
) -> RoomCamera:
    place = f"line {line}"
    # Take off the name that with_names put behind the numbers.
    name = words.pop() if len(words) == 13 else ""
    room = _NAME.fullmatch(name)
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
    return RoomCamera(Camera.look(intrinsics, eye, towards, (x, y, z)), score, room and room[1])
