"""A user's camera file: JSON of poses, intrinsics and lenses, as cameras; no effects."""

from __future__ import annotations

from typing import Annotated, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, model_validator

from pbrs_farm.core.camera import PAPER_HFOV_RAD, Camera, Intrinsics, distorted_intrinsics
from pbrs_farm.core.checked_json import checked, exactly
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import OPENCV_FROM_OPENGL, Y_UP_FROM_Z_UP
from pbrs_farm.core.lenses import COEFFICIENTS
from pbrs_farm.sample.room_camera_file import cameras_from_text

Vector = Annotated[tuple[float, float, float], exactly(3)]
Row = Annotated[tuple[float, float, float, float], exactly(4)]
Pose = Annotated[tuple[Row, Row, Row, Row], exactly(4, "rows")]
MAX_CAMERAS: Final = 10_000
"""Of one file; each is scored before any view is chosen."""


class GivenCamera(BaseModel):
    """One camera of the file: eye and towards (and up), or a 4x4 pose; hfov_rad, or K with its size.

    Metres, y up. world_from_camera has OpenGL axes (x right, y up, looking along -z), row by row;
    world_from_camera_opencv x right, y down, looking along z. K is of a picture of width_px by
    height_px, and is scaled to the image's. distortion: OpenCV's 4, 5, 8, 12 or 14 coefficients.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    eye: Vector | None = None  # metres
    towards: Vector | None = None
    up: Vector = (0.0, 1.0, 0.0)
    world_from_camera: Pose | None = None
    world_from_camera_opencv: Pose | None = None
    room: str | None = None  # id of its room; None = the room at its position
    hfov_rad: Annotated[float, Field(gt=0, lt=3.1)] = PAPER_HFOV_RAD  # of the picture's width
    K: Annotated[tuple[Vector, Vector, Vector], exactly(3, "rows")] | None = None
    width_px: Annotated[int, Field(gt=0, le=16384)] | None = None  # of K's picture
    height_px: Annotated[int, Field(gt=0, le=16384)] | None = None
    distortion: tuple[float, ...] = ()  # OpenCV's coefficients

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
                raise ValueError("world_from_camera is not a rigid pose")
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

    @model_validator(mode="after")
    def _has_a_lens(self) -> GivenCamera:
        try:
            distorted_intrinsics(self._pinhole(640, 480), self.distortion)
        except BadInput as error:
            raise ValueError(f"distortion: {error.text}") from None
        return self

    def camera(self, width_px: int, height_px: int) -> Camera:
        """On a grid of that size: K scaled, without skew, else the field of view with square pixels."""
        pinhole = self._pinhole(width_px, height_px)
        intrinsics = distorted_intrinsics(pinhole, self.distortion) if self.distortion else pinhole
        if self.world_from_camera is not None:
            return Camera(intrinsics, np.array(self.world_from_camera, np.float64))
        if self.world_from_camera_opencv is not None:
            pose = np.array(self.world_from_camera_opencv, np.float64)
            return Camera(intrinsics, pose @ OPENCV_FROM_OPENGL)
        return Camera.look(
            intrinsics, np.array(self.eye, np.float64), np.array(self.towards, np.float64), self.up
        )

    def _pinhole(self, width_px: int, height_px: int) -> Intrinsics:
        if self.K is None or self.width_px is None or self.height_px is None:
            return Intrinsics.from_hfov(width_px, height_px, self.hfov_rad)
        (fx, _skew, cx), (_zero, fy, cy), _last = self.K
        stored = Intrinsics(self.width_px, self.height_px, fx, fy, cx, cy)
        return stored.resized(width_px, height_px)


_LEAST_DETERMINANT: Final = 1e-12
_LENSES: Final = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV")


class _Optics(BaseModel):
    """Intrinsics of transforms.json: of all frames, or of one."""

    w: int | None = None
    h: int | None = None
    fl_x: float | None = None
    fl_y: float | None = None
    cx: float | None = None
    cy: float | None = None
    camera_angle_x: float | None = None  # radians
    camera_model: str = "PINHOLE"
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    p1: float = 0.0
    p2: float = 0.0

    @model_validator(mode="after")
    def _is_known(self) -> _Optics:
        if self.camera_model not in _LENSES or self.k4:
            text = f"has a lens other than {', '.join(_LENSES)} without k4"
            raise ValueError(f"{text}; --set lens.model chooses one for all cameras")
        return self


class _Frame(_Optics):
    transform_matrix: Pose


class _Transforms(_Optics):
    """transforms.json of nerfstudio and instant-ngp; `export --to nerfstudio` writes it."""

    frames: list[_Frame] = Field(min_length=1, max_length=MAX_CAMERAS)
    applied_transform: Annotated[tuple[Row, Row, Row], exactly(3, "rows")] | None = None

    @model_validator(mode="after")
    def _is_invertible(self) -> _Transforms:
        if self.applied_transform is not None:
            determinant = np.linalg.det(np.array(self.applied_transform)[:, :3])
            if not np.abs(determinant) > _LEAST_DETERMINANT:
                raise ValueError("applied_transform is flat: it has no inverse")
        return self

    def cameras(self) -> list[dict[str, object]]:
        """Each frame as a GivenCamera, in the y-up world before applied_transform."""
        world_from_file = Y_UP_FROM_Z_UP
        if self.applied_transform is not None:
            world_from_file = np.linalg.inv(np.vstack([self.applied_transform, [0, 0, 0, 1]]))
        return [
            {"world_from_camera": (world_from_file @ frame.transform_matrix).tolist()}
            | self._view_of(frame)
            for frame in self.frames
        ]

    def _view_of(self, frame: _Frame) -> dict[str, object]:
        """K and its size, else the field of view; a frame's own values come first."""
        own, of_frame = (o.model_dump(exclude_none=True, exclude_unset=True) for o in (self, frame))
        whole = own | of_frame
        w, h, fl_x = whole.get("w"), whole.get("h"), whole.get("fl_x")
        angle = whole.get("camera_angle_x")
        if w is None or h is None or fl_x is None:
            return {} if angle is None else {"hfov_rad": angle}
        k = [
            [fl_x, 0, whole.get("cx", w / 2)],
            [0, whole.get("fl_y", fl_x), whole.get("cy", h / 2)],
        ]
        distortion = [whole.get(name, 0.0) for name in COEFFICIENTS["radtan"]]
        lens = {"distortion": distortion} if any(distortion) else {}
        return {"K": [*k, [0, 0, 1]], "width_px": w, "height_px": h, **lens}


_CAMERAS: TypeAdapter[list[GivenCamera]] = TypeAdapter(list[GivenCamera])


def cameras_from_file_text(
    text: str, file: str, width_px: int, height_px: int
) -> list[tuple[Camera, str | None]]:
    """(camera, id of its room if the file says it) of a user's file, in order.

    The file is a JSON list of GivenCamera, a transforms.json, else a room_camera.txt.

    Raises BadInput with the file and the place.
    """
    # Tell the formats apart by their first character; count before any camera is built.
    is_json = text.lstrip().startswith(("[", "{"))
    n_cameras = text.count("{") if is_json else text.count("\n")
    if n_cameras > MAX_CAMERAS:
        raise BadInput(file, "", f"has {n_cameras} cameras; the maximum is {MAX_CAMERAS}")
    if not is_json:
        lines = cameras_from_text(text, file, width_px, height_px)
        if not lines:
            raise BadInput(file, "", "has no camera")
        return [(line.camera, line.room_id) for line in lines]
    given: object = text.encode()
    if text.lstrip().startswith("{"):
        given = checked(_Transforms, given, file).cameras()
    rows = checked(_CAMERAS, given, file, "camera")
    if not rows:
        raise BadInput(file, "", "has no camera")
    return [(camera.camera(width_px, height_px), camera.room) for camera in rows]
