"""The recipe's lens: a model, K and coefficients, presets, and the Intrinsics they give; no effects."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field, model_validator

from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.core.lenses.fisheye import radius_of_angle
from pbrs_farm.core.lenses.lens import COEFFICIENTS, Lens, LensModel
from pbrs_farm.core.recipe_fields import FieldGroup

_EQUIRECT_PX: Final = (1024, 512)  # of panoramas in cameras.json; pictures are scaled from it
_CUBEMAP_PX: Final = (1536, 256)
_BORDER_POINTS: Final = 65  # of each side of a picture, where a fold is looked for
_ASPECT_ERROR: Final = 0.01  # of a picture's width, against the lens's own picture

Pixels = Annotated[float, Field(ge=0, le=1e6)]
Coefficient = Annotated[float, Field(ge=-1e3, le=1e3)]

LENS_PRESETS: Final[Mapping[str, Mapping[str, Any]]] = {
    "none": {},
    # The colour camera of NYUv2's Kinect: camera_params.m of its toolbox, Silberman et al. 2012.
    "kinect1": {
        "model": "radtan", "width_px": 640, "height_px": 480,
        "fx": 518.85790, "fy": 519.46961, "cx": 325.58245, "cy": 253.73617,
        "k1": 0.20796615, "k2": -0.58613825, "p1": 7.2231363e-4, "p2": 1.04796272e-3,
        "k3": 0.49856987,
    },
    # Camera 0 of TUM VI at 512 x 512, a lens of 195 degrees: Schubert et al. 2018.
    "tum_vi": {
        "model": "fisheye", "width_px": 512, "height_px": 512,
        "fx": 190.978477, "fy": 190.973307, "cx": 254.931706, "cy": 256.897443,
        "k1": 0.0034823894, "k2": 0.00071503485, "k3": -0.0020532361, "k4": 0.00020293674,
        "max_angle_deg": 97.5,
    },
    # Half of all directions in a circle that touches the picture's edges, equidistant.
    "fisheye180": {
        "model": "fisheye", "width_px": 512, "height_px": 512, "hfov_deg": 180.0,
        "max_angle_deg": 90.0,
    },
}  # fmt: skip
"""Fields that a preset sets where the user does not."""


class LensFields(FieldGroup):
    """The lens of every view: what bends straight lines (docs/lenses.md)."""

    preset: Literal["none", "kinect1", "tum_vi", "fisheye180"] = Field(
        "none", description="of a known camera; other fields override it"
    )
    model: LensModel = Field("pinhole", description="how directions fall on the picture")
    width_px: int = Field(640, gt=0, le=16384, description="of the picture that fx to cy are of")
    height_px: int = Field(480, gt=0, le=16384, description="scaled to image's")
    fx: Pixels = Field(0.0, description="px; 0 = by cameras.hfov_rad, of a fisheye by hfov_deg")
    fy: Pixels = Field(0.0, description="0 = fx")
    cx: Pixels = Field(0.0, description="px from the top left corner; 0 = the middle")
    cy: Pixels = 0.0
    hfov_deg: float = Field(0.0, ge=0, le=360, description="fisheye without fx: of the width")
    k1: Coefficient = Field(0.0, description="radtan and fisheye, as OpenCV has them")
    k2: Coefficient = 0.0
    k3: Coefficient = 0.0
    k4: Coefficient = Field(0.0, description="fisheye")
    p1: Coefficient = Field(0.0, description="radtan, tangential")
    p2: Coefficient = 0.0
    max_angle_deg: float = Field(
        180.0, gt=0, le=180, description="fisheye: of the image circle, from the axis; black beyond"
    )

    @model_validator(mode="before")
    @classmethod
    def _with_preset(cls, given: Any) -> Any:
        # Fill in what the preset says and the user does not; an unknown preset is judged later.
        preset = given.get("preset", "none") if isinstance(given, dict) else "none"
        known = LENS_PRESETS.get(preset, {}) if isinstance(preset, str) else {}
        return {**known, **given} if known else given

    @property
    def lens(self) -> Lens:
        """The model with its coefficients."""
        coefficients = tuple(getattr(self, name) for name in COEFFICIENTS[self.model])
        limit = math.radians(self.max_angle_deg) if self.model == "fisheye" else math.pi
        return Lens(self.model, coefficients, limit)

    def intrinsics(self, pinhole: Intrinsics) -> Intrinsics:
        """The intrinsics of a view that was sampled with a pin-hole's; itself where no lens is set.

        Raises ValueError where the distortion folds the picture, or a fisheye lacks fx and hfov_deg.
        """
        found = self._unchecked(pinhole)
        fold = None if found is pinhole else fold_of(found)
        if fold is not None:
            raise ValueError(fold)
        return found

    def aspect_fault(self, width_px: int, height_px: int) -> str | None:
        """Why a picture of that size cannot be the lens's, None where it can."""
        if self.model in ("pinhole", "radtan") and self.fx == 0:
            return None
        w, h = {"equirect": _EQUIRECT_PX, "cubemap": _CUBEMAP_PX}.get(
            self.model, (self.width_px, self.height_px)
        )
        if abs(width_px * h / (height_px * w) - 1) <= _ASPECT_ERROR:
            return None
        hint = f"--set image.width_px={w} --set image.height_px={h}"
        what = f"lens.model {self.model} is of pictures {w}:{h}"
        return f"{what}, not {width_px}x{height_px}: add {hint}"

    def _unchecked(self, pinhole: Intrinsics) -> Intrinsics:
        lens = self.lens
        if self.model == "equirect":
            w, h = _EQUIRECT_PX
            return Intrinsics(w, h, w / (2 * math.pi), h / math.pi, w / 2, h / 2, lens)
        if self.model == "cubemap":
            w, h = _CUBEMAP_PX
            return Intrinsics(w, h, w / 12, h / 2, w / 12, h / 2, lens)
        # Without a focal length the view keeps its own, but a fisheye is told by its field of view.
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


def fold_of(i: Intrinsics) -> str | None:
    """Where the distortion folds the picture inside its frame, in words; None where it does not."""
    if i.lens.model not in ("radtan", "fisheye"):
        return None
    # Look along the border: a fold moves inwards from there.
    side = np.linspace(0.0, 1.0, _BORDER_POINTS)
    zero, one = np.zeros_like(side), np.ones_like(side)
    x, y = np.concatenate([side, side, zero, one]), np.concatenate([zero, one, side, side])
    border = np.stack([x * i.width_px, y * i.height_px], axis=1)
    lost = ~i.directions(border).any(1)
    # Beyond a fisheye's image circle nothing is lost that the lens had.
    angle = i.lens.largest_angle_rad
    is_circle = i.lens.model == "fisheye" and angle == i.lens.max_angle_rad
    if is_circle or not lost.any():
        return None
    u, v = border[lost][0]
    names = " ".join(COEFFICIENTS[i.lens.model])
    where = f"no ray falls on its point ({u:.0f}, {v:.0f}) of {i.width_px}x{i.height_px}"
    more = "" if i.lens.model == "radtan" else ", or lens.max_angle_deg below it"
    hint = f"give other {names}, a larger lens.fx{more}"
    return f"the distortion folds the picture at {math.degrees(angle):.1f} degrees: {where}; {hint}"
