"""The recipe's blur: depth of field and motion while the shutter is open; light alone; no effects."""

from __future__ import annotations

from pydantic import Field

from pbrs_farm.core.recipe_fields import FieldGroup


class BlurFields(FieldGroup):
    """Depth of field and motion blur of light (docs/lenses.md); labels are sharp, at mid-shutter."""

    aperture_mm: float = Field(
        0.0, ge=0, le=1000, description="diameter of the entrance pupil; 0 = everything is sharp"
    )
    focus_m: float = Field(0.0, ge=0, le=1e4, description="depth; 0 = what the middle shows")
    shutter_s: float = Field(
        0.0, ge=0, le=60, description="open that long; 0 = nothing moves. Of a walk: along it"
    )
    right_mps: float = Field(0.0, ge=-1e3, le=1e3, description="motion without a walk, camera axes")
    up_mps: float = Field(0.0, ge=-1e3, le=1e3)
    forward_mps: float = Field(0.0, ge=-1e3, le=1e3)
    pan_dps: float = Field(0.0, ge=-1e4, le=1e4, description="to the right, degrees a second")
    tilt_dps: float = Field(0.0, ge=-1e4, le=1e4, description="upwards")
    roll_dps: float = Field(0.0, ge=-1e4, le=1e4, description="clockwise, of the camera")

    @property
    def is_on(self) -> bool:
        """Anything is blurred."""
        return self.aperture_mm > 0 or self.shutter_s > 0
