"""The cameras that pictures are developed as, one row each: response, sharpening, errors, sensor. No effects.

`tone.camera` names a row, or `drawn`: a row that errs, another each view, by seed. A row says only what its camera does
otherwise than `neutral`, whose values are the defaults of the recipe's group `tone`. A field that
the recipe sets to another value than its default is kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from pbrs_farm.core.optics_fields import SensorFields

if TYPE_CHECKING:
    from pbrs_farm.core.recipe_fields import ToneFields

NEUTRAL: Final = "neutral"
DRAWN: Final = "drawn"


@dataclass(frozen=True, slots=True)
class CameraRow:
    """Effects of one kind of camera on a picture."""

    what: str
    tone: Mapping[str, float] = field(default_factory=dict)  # fields of the group tone
    spread: Mapping[str, float] = field(default_factory=dict)  # standard deviations, view by view
    sensor: str = "none"  # a preset of the group sensor


# Typical behaviour of each kind, none a product's measured one. Errors of exposure are in stops, of
# white balance in stops of red over blue (warmth) and of green over both (tint).
# fmt: off
CAMERAS: Final[Mapping[str, CameraRow]] = {
    NEUTRAL: CameraRow("a good camera's JPEG, the same for each view"),
    "phone": CameraRow(
        "small pixels; local contrast opens shadows and holds windows; sharpened; JPEG",
        tone={"contrast": 1.3, "flare": 0.004, "local_contrast": 0.4, "sharpening": 0.6,
              "white_balance": 0.85},
        spread={"exposure_ev": 0.25, "warmth_ev": 0.12, "tint_ev": 0.05, "contrast": 0.08},
        sensor="phone",
    ),
    "slr": CameraRow(
        "large pixels, a wide range, a firm curve, corners a little darker",
        tone={"contrast": 1.55, "flare": 0.001, "white": 8.0, "sharpening": 0.3,
              "white_balance": 0.8},
        spread={"exposure_ev": 0.35, "warmth_ev": 0.12, "tint_ev": 0.04, "contrast": 0.12},
        sensor="slr",
    ),
    "webcam": CameraRow(
        "plastic lens with veil and dark corners, strong sharpening, strong JPEG, wrong whites",
        tone={"contrast": 1.35, "flare": 0.012, "sharpening": 0.8, "white_balance": 0.6},
        spread={"exposure_ev": 0.5, "warmth_ev": 0.3, "tint_ev": 0.12, "contrast": 0.1},
        sensor="webcam",
    ),
    "kinect": CameraRow(
        "the colour camera of a first Kinect: low range, burnt windows, noise, no JPEG",
        tone={"contrast": 1.5, "flare": 0.006, "sharpening": 0.3, "white_balance": 0.5},
        spread={"exposure_ev": 0.4, "warmth_ev": 0.25, "tint_ev": 0.1, "contrast": 0.1},
        sensor="kinect",
    ),
}
# fmt: on

ERRING: Final = tuple(name for name, row in CAMERAS.items() if row.spread)
"""The cameras that `drawn` and variants choose from: all but `neutral`."""

CAMERA_NAMES: Final = (*CAMERAS, DRAWN)
"""The values of `tone.camera`."""


ERRORS: Final = ("exposure_ev", "warmth_ev", "tint_ev", "contrast")
"""The fields of the group tone in which cameras err from view to view."""


class PictureCamera(NamedTuple):
    """The camera of one picture: a row of CAMERAS with its errors drawn."""

    name: str
    tone: ToneFields
    sensor: SensorFields

    def facts(self) -> dict[str, Any]:
        """Facts of a camera with errors for view.json; none for a camera that is the same for each view."""
        if not CAMERAS[self.name].spread:
            return {}
        return {"camera": self.name, "tone": self.tone.model_dump(include=set(ERRORS))}


def picture_camera(name: str, tone: ToneFields, sensor: SensorFields, seed: int) -> PictureCamera:
    """The camera that `name` gives one picture.

    name: of CAMERA_NAMES. tone, sensor: the recipe's groups; what they set to other values than the
    defaults is kept. The same seed gives the same camera on every machine.

        >>> from pbrs_farm.core.recipe_fields import ToneFields
        >>> picture_camera("drawn", ToneFields(), SensorFields(), 7).name
        'webcam'
    """
    rng = np.random.default_rng(seed)
    if name == DRAWN:
        name = ERRING[int(rng.integers(len(ERRING)))]
    row = CAMERAS[name]
    default = type(tone)()
    values = {f: v for f, v in row.tone.items() if getattr(tone, f) == getattr(default, f)}
    # Add the errors in the row's order; errors of the contrast are in its binary logarithm.
    for f, deviation in row.spread.items():
        z = deviation * float(rng.normal())
        value = values.get(f, getattr(tone, f))
        values[f] = round(value * 2**z if f == "contrast" else value + z, 4)
    if not sensor.is_on and row.sensor != "none":
        sensor = SensorFields(preset=row.sensor, **sensor.model_dump(exclude_defaults=True))
    return PictureCamera(name, tone.model_copy(update={**values, "camera": name}), sensor)
