"""A rig: several cameras fixed to each other that take pictures at the same instants; no effects."""

from __future__ import annotations

from typing import Annotated, Final, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.core.checked_json import exactly
from pbrs_farm.core.optics_fields import LensFields
from pbrs_farm.core.recipe_fields import FieldGroup, field

_UNIT: Final = 0.01  # a quaternion's length may differ from 1 by so much
Metres = Annotated[float, Field(ge=-100, le=100)]
Degrees = Annotated[float, Field(ge=-360, le=360)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,31}$")]


class RigCamera(FieldGroup):
    """One camera: its position and turn in the rig, and its lens.

    The rig's frame is that of the walking or chosen camera: x right, y down, z forward.
    """

    name: Name
    translation_m: Annotated[tuple[Metres, Metres, Metres], exactly(3)] = (0.0, 0.0, 0.0)
    rotation_wxyz: Annotated[tuple[float, float, float, float], exactly(4)] | None = field(
        None, "unit quaternion, rig from camera; replaces the three angles"
    )
    yaw_deg: Degrees = field(0.0, "to the right")
    pitch_deg: Degrees = field(0.0, "up, after yaw")
    roll_deg: Degrees = field(0.0, "clockwise, after yaw and pitch")
    hfov_deg: float = field(0.0, "horizontal field of view; 0 = the recipe's", 0, below=175)
    lens: LensFields | None = field(None, "lens of this camera, as the recipe's group lens")

    @field_validator("rotation_wxyz")
    @classmethod
    def _is_unit(
        cls, value: tuple[float, float, float, float] | None
    ) -> tuple[float, float, float, float] | None:
        length = 1.0 if value is None else float(np.linalg.norm(value))
        if abs(length - 1) > _UNIT:
            raise ValueError(f"is not a rotation: its length is {length:.4g}, not 1")
        return value

    @model_validator(mode="after")
    def _says_each_thing_once(self) -> Self:
        angles = self.yaw_deg, self.pitch_deg, self.roll_deg
        if self.rotation_wxyz is not None and any(angles):
            raise ValueError("give rotation_wxyz or yaw_deg, pitch_deg and roll_deg")
        if self.hfov_deg and self.lens is not None:
            raise ValueError("give hfov_deg or lens")
        return self

    @property
    def rig_from_camera(self) -> F64:
        """(4, 4) rigid, metres; both frames x right, y down, z forward (OpenCV's).

        >>> RigCamera(name="right", translation_m=(0.1, 0, 0)).rig_from_camera[0].tolist()
        [1.0, 0.0, 0.0, 0.1]
        """
        # Imported where needed: every program reads recipes, few have a rig.
        from scipy.spatial.transform import Rotation

        matrix = np.eye(4)
        if self.rotation_wxyz is not None:
            w, x, y, z = self.rotation_wxyz
            matrix[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
        elif self.yaw_deg or self.pitch_deg or self.roll_deg:
            angles = [self.yaw_deg, self.pitch_deg, self.roll_deg]
            matrix[:3, :3] = Rotation.from_euler("YXZ", angles, degrees=True).as_matrix()
        matrix[:3, 3] = self.translation_m
        return matrix

    def intrinsics(self, chosen: Intrinsics, lens: LensFields) -> Intrinsics:
        """Intrinsics of a view chosen through a pin-hole; lens: the recipe's, for a camera without its own.

        Raises ValueError if a distortion folds the picture.
        """
        if self.hfov_deg:
            size = chosen.width_px, chosen.height_px
            return Intrinsics.from_hfov(*size, float(np.radians(self.hfov_deg)))
        return (self.lens or lens).intrinsics(chosen)


class RigFields(FieldGroup):
    """The cameras that take each view together; the first has the view's own id (docs/cameras.md)."""

    steps = ("cameras",)

    name: Name = "rig"
    cameras: tuple[RigCamera, ...] = Field(min_length=1, max_length=64)

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [camera.name for camera in self.cameras]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"two cameras are named {twice}")
        return self

    @property
    def eyes(self) -> tuple[str, ...]:
        """`Shot.eye` of each camera: "" for the first, else its name."""
        return ("", *(camera.name for camera in self.cameras[1:]))


def stereo_rig(baseline_m: float) -> RigFields:
    """The rig of a stereo pair: a camera and one so far to its right."""
    right = RigCamera(name="right", translation_m=(baseline_m, 0.0, 0.0))
    return RigFields(name="stereo", cameras=(RigCamera(name="left"), right))
