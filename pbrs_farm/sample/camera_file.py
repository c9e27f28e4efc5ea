"""A user's camera file: JSON of ours, or a published room_camera.txt; text only, no effects."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, model_validator

from pbrs_farm.core.camera import PAPER_HFOV_RAD, Camera, Intrinsics
from pbrs_farm.core.checked_json import checked, exactly
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import OPENCV_FROM_OPENGL

# room_camera.txt, the published camera file (docs/spec/suncg.md section 3.3), as cameras.
# Half-angles are in radians; yf is recomputed from xf and the picture's shape, and up is made
# perpendicular again, as every published reader does.


_NAME: Final = re.compile(r"Room#(.+)_\d+")  # room id, sector


@dataclass(frozen=True, slots=True, eq=False)
class RoomCamera:
    """One line of room_camera.txt: a camera, its score and the room that its name says."""

    camera: Camera
    score: float
    room_id: str | None = None  # of Room#<room id>_<sector>


def cameras_from_text(text: str, file: str, width_px: int, height_px: int) -> list[RoomCamera]:
    """The cameras of a room_camera.txt, in order, on a grid of that size.

    A line is `vx vy vz tx ty tz ux uy uz xf yf value`, and the camera's name where room_camera_name.txt
    was joined to it; empty lines are passed over. Raises BadInput (file and line) for other lines,
    numbers that are not finite, and impossible poses.
    """
    cameras = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            cameras.append(_camera(line.split(), file, number, width_px, height_px))
    return cameras


def with_names(text: str, names: str, file: str) -> str:
    """The lines of a room_camera.txt, each followed by its line of room_camera_name.txt."""
    lines = [line for line in text.splitlines() if line.strip()]
    named = [line.strip() for line in names.splitlines() if line.strip()]
    if len(lines) != len(named):
        raise BadInput(file, "", f"{len(named)} names for {len(lines)} cameras")
    return "".join(f"{line} {name}\n" for line, name in zip(lines, named, strict=True))


def _camera(words: list[str], file: str, line: int, width_px: int, height_px: int) -> RoomCamera:
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


# A user's camera file.


Vector = Annotated[tuple[float, float, float], exactly(3)]
Row = Annotated[tuple[float, float, float, float], exactly(4)]
Pose = Annotated[tuple[Row, Row, Row, Row], exactly(4, "rows")]


class GivenCamera(BaseModel):
    """One camera of the file: eye and towards (and up), or a 4x4 pose; hfov_rad, or K with its size.

    Metres, y up. world_from_camera has OpenGL axes (x right, y up, looking along -z), row by row;
    world_from_camera_opencv x right, y down, looking along z. K is of a picture of width_px by
    height_px, and is scaled to the image's.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    eye: Vector | None = None  # metres
    towards: Vector | None = None
    up: Vector = (0.0, 1.0, 0.0)
    world_from_camera: Pose | None = None
    world_from_camera_opencv: Pose | None = None
    room: str | None = None  # id of the room it belongs to; None = where it stands
    hfov_rad: Annotated[float, Field(gt=0, lt=3.1)] = PAPER_HFOV_RAD  # of the picture's width
    K: Annotated[tuple[Vector, Vector, Vector], exactly(3, "rows")] | None = None
    width_px: Annotated[int, Field(gt=0, le=16384)] | None = None  # of K's picture
    height_px: Annotated[int, Field(gt=0, le=16384)] | None = None

    @model_validator(mode="after")
    def _has_one_pose(self) -> GivenCamera:
        # Ask for exactly one of the three forms.
        looks = self.eye is not None and self.towards is not None
        poses = [p for p in (self.world_from_camera, self.world_from_camera_opencv) if p]
        if looks + len(poses) != 1:
            forms = "eye and towards, world_from_camera or world_from_camera_opencv"
            raise ValueError(f"give one of {forms}")
        if looks and np.linalg.norm(np.cross(self.towards, self.up)) < 1e-9:  # type: ignore[arg-type]
            raise ValueError("towards and up are parallel or zero")
        if poses:
            # Accept a rotation without mirroring or scale, to a ten-thousandth.
            rotation = np.array(poses[0])[:3, :3]
            proper = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4)
            if not proper or np.linalg.det(rotation) < 0:
                raise ValueError("world_from_camera is no rigid pose")
        return self

    @model_validator(mode="after")
    def _has_one_field_of_view(self) -> GivenCamera:
        has_size = self.width_px is not None and self.height_px is not None
        if (self.K is not None) != has_size:
            raise ValueError("K needs width_px and height_px, and they need K")
        if self.K is not None and "hfov_rad" in self.model_fields_set:
            raise ValueError("give K or hfov_rad")
        if self.K is not None:
            (fx, skew, _cx), (_zero, fy, _cy), last = self.K
            if min(fx, fy) <= 0 or abs(skew) > 1e-9 or last != (0, 0, 1):
                raise ValueError("K is fx 0 cx, 0 fy cy, 0 0 1")
        return self

    def camera(self, width_px: int, height_px: int) -> Camera:
        """On a grid of that size."""
        if self.K is None or self.width_px is None or self.height_px is None:
            intrinsics = Intrinsics.from_hfov(width_px, height_px, self.hfov_rad)
        else:
            (fx, _skew, cx), (_zero, fy, cy), _last = self.K
            own = Intrinsics(self.width_px, self.height_px, fx, fy, cx, cy)
            intrinsics = own.resized(width_px, height_px)
        if self.world_from_camera is not None:
            return Camera(intrinsics, np.array(self.world_from_camera, np.float64))
        if self.world_from_camera_opencv is not None:
            pose = np.array(self.world_from_camera_opencv, np.float64)
            return Camera(intrinsics, pose @ OPENCV_FROM_OPENGL)
        return Camera.look(
            intrinsics, np.array(self.eye, np.float64), np.array(self.towards, np.float64), self.up
        )


MAX_CAMERAS: Final = 10_000
"""Of one file; each is scored before any view is chosen."""

_CAMERAS: TypeAdapter[list[GivenCamera]] = TypeAdapter(list[GivenCamera])


def cameras_from_file_text(
    text: str, file: str, width_px: int, height_px: int
) -> list[tuple[Camera, str | None]]:
    """(camera, id of its room if the file says it) of a user's file, in order.

    The file is a JSON list of GivenCamera, else a room_camera.txt.

    Raises BadInput with the file and the place.
    """
    # Tell the two formats apart by their first character; count before any camera is built.
    is_json = text.lstrip().startswith("[")
    n_cameras = text.count("{") if is_json else text.count("\n")
    if n_cameras > MAX_CAMERAS:
        raise BadInput(file, "", f"holds {n_cameras} cameras, at most {MAX_CAMERAS} are read")
    if not is_json:
        lines = cameras_from_text(text, file, width_px, height_px)
        if not lines:
            raise BadInput(file, "", "holds no camera")
        return [(line.camera, line.room_id) for line in lines]
    given = checked(_CAMERAS, text.encode(), file, "camera")
    if not given:
        raise BadInput(file, "", "holds no camera")
    return [(camera.camera(width_px, height_px), camera.room) for camera in given]
