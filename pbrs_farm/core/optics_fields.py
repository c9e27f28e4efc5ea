"""The recipe's groups of the camera itself: blur, lens and sensor, with their presets; effect: reads its presets."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from pbrs_farm.core.camera import Intrinsics, fold_of
from pbrs_farm.core.distortion import radius_of_angle
from pbrs_farm.core.lenses import COEFFICIENTS, Lens, LensModel
from pbrs_farm.core.recipe_fields import FieldGroup, Share, field
from pbrs_farm.core.record import read_toml


class BlurFields(FieldGroup):
    """Depth of field, motion blur and rolling shutter of light (docs/lenses.md); labels are sharp, at mid-shutter."""

    steps = ("light",)

    aperture_mm: float = field(
        0.0, "diameter of the entrance pupil; 0 = everything in focus", 0, 1000
    )
    focus_m: float = field(0.0, "focus distance; 0 = depth at the picture's centre", 0, 1e4)
    shutter_s: float = field(
        0.0,
        "exposure time; 0 = no motion blur. The camera moves along the walk, moving objects too",
        0,
        60,
    )
    rolling_s: float = field(
        0.0, "readout time from the top to the bottom row; 0 = global shutter", 0, 60
    )
    right_mps: float = field(0.0, "camera velocity without a walk, camera axes", -1e3, 1e3)
    up_mps: float = field(0.0, "metres per second", -1e3, 1e3)
    forward_mps: float = field(0.0, low=-1e3, high=1e3)
    pan_dps: float = field(0.0, "to the right, degrees per second", -1e4, 1e4)
    tilt_dps: float = field(0.0, "upwards", -1e4, 1e4)
    roll_dps: float = field(0.0, "clockwise, of the camera", -1e4, 1e4)

    @property
    def is_on(self) -> bool:
        """Anything is blurred or sheared."""
        return self.aperture_mm > 0 or self.shutter_s > 0 or self.rolling_s > 0


_EQUIRECT_PX: Final = (1024, 512)  # of panoramas in cameras.json; pictures are scaled from it
_CUBEMAP_PX: Final = (1536, 256)
_ASPECT_ERROR: Final = 0.01  # of a picture's width, against the lens's own picture

Pixels = Annotated[float, Field(ge=0, le=1e6)]
Coefficient = Annotated[float, Field(ge=-1e3, le=1e3)]
Tilt = Annotated[float, Field(ge=-1, le=1)]
_OF_OPENCV: Final = ("k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y")

_PRESETS: Final = read_toml(
    Path(__file__).with_name("optics_presets.toml"), dict[str, dict[str, dict[str, Any]]]
)
LENS_PRESETS: Final = _PRESETS["lens"]
SENSOR_PRESETS: Final = _PRESETS["sensor"]


class LensFields(FieldGroup):
    """The lens of every view: projection and distortion (docs/lenses.md)."""

    steps = ("cameras",)

    preset: Literal["none", "kinect", "tum_vi", "hypersim", "d435", "d455", "fisheye180"] = field(
        "none", "a known camera; other fields override it"
    )
    model: LensModel = field("pinhole", "projection model")
    width_px: int = field(
        640, "picture width for fx to cy; scaled to image.width_px", high=16384, above=0
    )
    height_px: int = field(480, "picture height for fx to cy", high=16384, above=0)
    fx: Pixels = field(0.0, "px; 0 = from cameras.hfov_rad, for a fisheye from hfov_deg")
    fy: Pixels = field(0.0, "0 = fx")
    cx: Pixels = field(0.0, "px from the top left corner; 0 = the middle")
    cy: Pixels = 0.0
    hfov_deg: float = field(0.0, "fisheye without fx: horizontal field of view", 0, 360)
    k1: Coefficient = field(0.0, "radtan, opencv and fisheye, as OpenCV has them")
    k2: Coefficient = 0.0
    k3: Coefficient = 0.0
    k4: Coefficient = field(0.0, "fisheye; opencv: k4 to k6 of the divisor")
    p1: Coefficient = field(0.0, "radtan and opencv, tangential")
    p2: Coefficient = 0.0
    k5: Coefficient = 0.0
    k6: Coefficient = 0.0
    s1: Coefficient = field(0.0, "opencv, thin prism")
    s2: Coefficient = 0.0
    s3: Coefficient = 0.0
    s4: Coefficient = 0.0
    tau_x: Tilt = field(0.0, "opencv, tilt of the sensor, rad")
    tau_y: Tilt = 0.0
    max_angle_deg: float = field(
        180.0, "fisheye: angle of the image circle from the axis; black beyond", high=180, above=0
    )

    @model_validator(mode="before")
    @classmethod
    def _with_preset(cls, given: Any) -> Any:
        # Fill in what the preset says and the user does not; an unknown preset is judged later.
        preset = given.get("preset", "none") if isinstance(given, dict) else "none"
        preset_values = LENS_PRESETS.get(preset, {}) if isinstance(preset, str) else {}
        return {**preset_values, **given} if preset_values else given

    @model_serializer(mode="wrap")
    def _without_unused(self, fields: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # Recipes of other lenses keep the digest that they had before these fields, and so their seeds.
        return {k: v for k, v in fields(self).items() if v or k not in _OF_OPENCV}

    @property
    def lens(self) -> Lens:
        """The model with its coefficients."""
        coefficients = tuple(getattr(self, name) for name in COEFFICIENTS[self.model])
        limit = math.radians(self.max_angle_deg) if self.model == "fisheye" else math.pi
        return Lens(self.model, coefficients, limit)

    def intrinsics(self, pinhole: Intrinsics) -> Intrinsics:
        """Intrinsics of a view sampled with a pin-hole's; ValueError for a fold or a fisheye without fx."""
        intrinsics = self._unchecked(pinhole)
        fold = None if intrinsics is pinhole else fold_of(intrinsics)
        if fold is not None:
            raise ValueError(fold)
        return intrinsics

    def aspect_fault(self, width_px: int, height_px: int) -> str | None:
        """Why a picture of that size cannot be the lens's, None where it can.

        The text names the --set options that mend it. Panoramas have a fixed aspect (2:1, six faces
        in a row); a lens that states fx has that of the size it was calibrated at; any size fits a
        lens with planar depth without fx.
        """
        if self.lens.depth_is_planar and self.fx == 0:
            return None
        w, h = {"equirect": _EQUIRECT_PX, "cubemap": _CUBEMAP_PX}.get(
            self.model, (self.width_px, self.height_px)
        )
        if abs(width_px * h / (height_px * w) - 1) <= _ASPECT_ERROR:
            return None
        hint = f"--set image.width_px={w} --set image.height_px={h}"
        fault = f"lens.model {self.model} needs pictures of {w}:{h}"
        return f"{fault}, not {width_px}x{height_px}: add {hint}"

    def _unchecked(self, pinhole: Intrinsics) -> Intrinsics:
        lens = self.lens
        if self.model == "equirect":
            w, h = _EQUIRECT_PX
            return Intrinsics(w, h, w / (2 * math.pi), h / math.pi, w / 2, h / 2, lens)
        if self.model == "cubemap":
            w, h = _CUBEMAP_PX
            return Intrinsics(w, h, w / 12, h / 2, w / 12, h / 2, lens)
        # Without a focal length the view keeps its own; a fisheye has a field of view instead.
        if self.fx == 0 and self.model != "fisheye":
            return pinhole if lens.is_pinhole else replace(pinhole, lens=lens)
        fx = self.fx or self._focal_length_of_field()
        cx, cy = self.cx or self.width_px / 2, self.cy or self.height_px / 2
        return Intrinsics(self.width_px, self.height_px, fx, self.fy or fx, cx, cy, lens)

    def _focal_length_of_field(self) -> float:
        if self.hfov_deg == 0:
            raise ValueError("a fisheye needs lens.fx (px) or lens.hfov_deg")
        half = np.array(math.radians(self.hfov_deg) / 2)
        radius = float(radius_of_angle(half, self.lens.coefficients))
        if not radius > 0:
            raise ValueError(f"the distortion folds the picture within {self.hfov_deg:g} degrees")
        return self.width_px / 2 / radius


class SensorFields(FieldGroup):
    """Camera sensor of the light modes (docs/lenses.md); labels do not change."""

    steps = ("develop",)

    preset: Literal["none", "kinect", "phone", "slr", "webcam"] = field(
        "none", "a type of camera; other fields override it"
    )
    is_on: bool = field(False, "simulate the sensor; off = noise-free pictures")
    f_number: float = field(2.0, "of the lens", 0.5, 64)
    shutter_s: float = field(0.0, "0 = automatic, up to shutter_max_s", 0, 60)
    shutter_min_s: float = field(1e-4, "minimum automatic shutter time", high=60, above=0)
    shutter_max_s: float = field(1 / 30, "maximum automatic shutter time", high=60, above=0)
    iso_min: float = field(100.0, "base ISO, at which full_well_e holds", 1, 1e6)
    iso_max: float = field(1600.0, "maximum ISO of automatic exposure", 1, 1e6)
    compensation_ev: float = field(0.0, "exposure compensation, stops", -10, 10)
    lag_s: float = field(0.0, "delay of automatic exposure along a walk", 0, 10)
    full_well_e: float = field(6000.0, "electrons that saturate a pixel", 10, 1e7)
    read_noise_e: float = field(3.0, "electrons, standard deviation", 0, 1e4)
    bits: int = field(10, "bits of the raw values", 1, 16)
    black_level: float = field(1 / 16, "raw value of no light, share of the range", 0, 0.5)
    mosaic: bool = field(True, "simulate a Bayer mosaic (RGGB) and demosaicing")
    vignetting: Share = field(0.0, "share of light lost in the corners")
    aberration_px: float = field(
        0.0, "lateral chromatic aberration in the corners, px at a width of 640", 0, 50
    )
    headroom: float = field(4.0, "saturation level relative to white", 1, 100)
    jpeg_quality: int = field(0, "0 = no JPEG", 0, 100)

    @model_validator(mode="before")
    @classmethod
    def _with_preset(cls, given: Any) -> Any:
        # Fill in what the preset says and the user does not; an unknown preset is judged later.
        preset = given.get("preset", "none") if isinstance(given, dict) else "none"
        preset_values = SENSOR_PRESETS.get(preset, {}) if isinstance(preset, str) else {}
        return {**preset_values, **given} if preset_values else given
