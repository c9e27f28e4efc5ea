"""The recipe's sensor: what a real camera makes of the light, off by default; presets; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Literal

from pydantic import Field, model_validator

from pbrs_farm.core.recipe_fields import FieldGroup, Share

SENSOR_PRESETS: Final[Mapping[str, Mapping[str, Any]]] = {
    "none": {},
    # The colour camera of a first Kinect: a 1/4 inch CMOS of 2.8 um at 640 x 480, no JPEG.
    "kinect1": {
        "is_on": True, "f_number": 2.4, "shutter_max_s": 1 / 30, "iso_min": 100, "iso_max": 800,
        "full_well_e": 7_000, "read_noise_e": 6.0, "bits": 10, "vignetting": 0.15,
        "aberration_px": 0.7, "headroom": 2.0,
    },
    # A telephone of about 2020: pixels of 1.4 um, JPEG of high quality.
    "phone": {
        "is_on": True, "f_number": 1.8, "shutter_max_s": 1 / 25, "iso_min": 25, "iso_max": 3200,
        "full_well_e": 6_000, "read_noise_e": 1.8, "bits": 10, "vignetting": 0.1,
        "aberration_px": 0.3, "jpeg_quality": 92, "headroom": 2.0,
    },
    # A cheap webcam: small pixels, a plastic lens, strong JPEG.
    "webcam": {
        "is_on": True, "f_number": 2.8, "shutter_max_s": 1 / 30, "iso_min": 100, "iso_max": 1600,
        "full_well_e": 4_000, "read_noise_e": 5.0, "bits": 8, "vignetting": 0.35,
        "aberration_px": 1.2, "jpeg_quality": 60, "headroom": 1.6,
    },
}  # fmt: skip
"""Typical numbers of each kind of camera, none a product's measured ones but Kinect's size and rate."""


class SensorFields(FieldGroup):
    """What a camera's sensor makes of the light modes (docs/lenses.md); labels do not change."""

    preset: Literal["none", "kinect1", "phone", "webcam"] = Field(
        "none", description="a kind of camera; other fields override it"
    )
    is_on: bool = Field(False, description="off: pictures are as the light alone makes them")
    f_number: float = Field(2.0, ge=0.5, le=64)
    shutter_s: float = Field(0.0, ge=0, le=60, description="0 = automatic, up to shutter_max_s")
    shutter_min_s: float = Field(1e-4, gt=0, le=60, description="the shortest automatic one")
    shutter_max_s: float = Field(1 / 30, gt=0, le=60, description="the longest automatic one")
    iso_min: float = Field(100.0, ge=1, le=1e6, description="the base; full_well_e is of it")
    iso_max: float = Field(1600.0, ge=1, le=1e6, description="what automatic exposure goes up to")
    compensation_ev: float = Field(0.0, ge=-10, le=10, description="stops above what is automatic")
    lag_s: float = Field(
        0.0, ge=0, le=10, description="automatic exposure follows a walk's light with this delay"
    )
    full_well_e: float = Field(6000.0, ge=10, le=1e7, description="electrons that saturate a pixel")
    read_noise_e: float = Field(3.0, ge=0, le=1e4, description="electrons, standard deviation")
    bits: int = Field(10, ge=1, le=16, description="of the raw values")
    mosaic: bool = Field(True, description="a Bayer mosaic (RGGB), demosaiced again")
    vignetting: Share = Field(0.0, description="light lost in the corners")
    aberration_px: float = Field(
        0.0, ge=0, le=50, description="lateral: red against blue in the corners, px of 640 across"
    )
    headroom: float = Field(4.0, ge=1, le=100, description="saturation over the white of the tone")
    jpeg_quality: int = Field(0, ge=0, le=100, description="0 = no JPEG")

    @model_validator(mode="before")
    @classmethod
    def _with_preset(cls, given: Any) -> Any:
        # Fill in what the preset says and the user does not; an unknown preset is judged later.
        preset = given.get("preset", "none") if isinstance(given, dict) else "none"
        known = SENSOR_PRESETS.get(preset, {}) if isinstance(preset, str) else {}
        return {**known, **given} if known else given
