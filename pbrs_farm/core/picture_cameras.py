"""The cameras that pictures are developed as, one row each: response, sharpening, errors, sensor. Effect: reads its table.

`tone.camera` names a row, or `drawn`: a row that errs, another each view, by seed. A row says only what its camera does
otherwise than `neutral`, whose values are the defaults of the recipe's group `tone`. A field that
the recipe sets to another value than its default is kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from pbrs_farm.core.optics_fields import SensorFields
from pbrs_farm.core.record import read_toml

if TYPE_CHECKING:
    from pbrs_farm.core.recipe_fields import ToneFields

DRAWN: Final = "drawn"


@dataclass(frozen=True, slots=True)
class CameraRow:
    """Effects of one kind of camera on a picture."""

    what: str
    tone: Mapping[str, float] = field(default_factory=dict)  # fields of the group tone
    spread: Mapping[str, float] = field(default_factory=dict)  # standard deviations, view by view
    sensor: str = "none"  # a preset of the group sensor
    dim_share: float = 0.0  # share of dim views
    dim_ev: tuple[float, float] = (0.0, 0.0)  # range of their exposure, stops


CAMERAS: Final = read_toml(Path(__file__).with_suffix(".toml"), dict[str, CameraRow])

ERRING: Final = tuple(name for name, row in CAMERAS.items() if row.sensor != "none")
"""The cameras that `drawn` and variants choose from: those with a sensor."""

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
    if row.dim_share > 0 and rng.random() < row.dim_share:
        values["exposure_ev"] = round(tone.exposure_ev + float(rng.uniform(*row.dim_ev)), 4)
    if not sensor.is_on and row.sensor != "none":
        sensor = SensorFields(preset=row.sensor, **sensor.model_dump(exclude_defaults=True))
    return PictureCamera(name, tone.model_copy(update={**values, "camera": name}), sensor)
