"""A user's camera file: JSON of ours, or a published room_camera.txt; text only, no effects."""

from __future__ import annotations

from typing import Annotated, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from pbrs_farm.core.camera import PAPER_HFOV_RAD, Camera, Intrinsics
from pbrs_farm.core.errors import BadInput
from pbrs_farm.sample.room_camera import cameras_from_text

Vector = tuple[float, float, float]
Row = tuple[float, float, float, float]


class GivenCamera(BaseModel):
    """One camera of the file: eye and towards (and up), or a 4x4 world_from_camera.

    Metres, y up. world_from_camera has OpenGL axes (x right, y up, looking along -z), row by row.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    eye: Vector | None = None  # metres
    towards: Vector | None = None
    up: Vector = (0.0, 1.0, 0.0)
    world_from_camera: tuple[Row, Row, Row, Row] | None = None
    room: str | None = None  # id of the room it belongs to; None = where it stands
    hfov_rad: Annotated[float, Field(gt=0, lt=3.1)] = PAPER_HFOV_RAD  # of the picture's width

    @model_validator(mode="after")
    def _has_one_pose(self) -> GivenCamera:
        # Ask for exactly one of the two forms.
        looks = self.eye is not None and self.towards is not None
        if looks == (self.world_from_camera is not None):
            raise ValueError("give eye and towards, or world_from_camera")
        if looks and np.linalg.norm(np.cross(self.towards, self.up)) < 1e-9:  # type: ignore[arg-type]
            raise ValueError("towards and up are parallel or zero")
        if self.world_from_camera is not None:
            # Accept a rotation without mirroring or scale, to a ten-thousandth.
            rotation = np.array(self.world_from_camera)[:3, :3]
            proper = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4)
            if not proper or np.linalg.det(rotation) < 0:
                raise ValueError("world_from_camera is no rigid pose")
        return self

    def camera(self, width_px: int, height_px: int) -> Camera:
        """On a grid of that size."""
        intrinsics = Intrinsics.from_hfov(width_px, height_px, self.hfov_rad)
        if self.world_from_camera is not None:
            return Camera(intrinsics, np.array(self.world_from_camera, np.float64))
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
    try:
        given = _CAMERAS.validate_json(text)
    except ValidationError as error:
        # Name the first camera and field that pydantic rejects.
        first = error.errors()[0]
        place = "camera " + ".".join(str(part) for part in first["loc"])
        raise BadInput(file, place, first["msg"]) from None
    if not given:
        raise BadInput(file, "", "holds no camera")
    return [(camera.camera(width_px, height_px), camera.room) for camera in given]
