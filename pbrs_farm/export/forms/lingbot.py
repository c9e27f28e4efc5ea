"""Pictures with a sensor's depth and the true one, for LingBot-Depth's completion (Robbyant/lingbot-depth, examples).

    <house>/<view>/{rgb.png,raw_depth.png,depth.png,intrinsics.txt}

Effects: reads views, writes files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.options import option
from pbrs_farm.core.record import Record
from pbrs_farm.export.chosen_view import Choice, ChosenView, depth_within_png, require_lens
from pbrs_farm.export.form import Convention, ViewForm, name_left_out, write_file
from pbrs_farm.images import png_from_array

SENSORS: Final = tuple(name for name in LAYER if name.startswith("depth_sensor"))


class LingbotOptions(Record):
    """The sensor of raw_depth.png."""

    sensor: str = option(
        "",
        "layer of the sensor's depth (default: the first that a view has)",
        choices=("", *SENSORS),
    )


def write_lingbot(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """Write the files above.

    raw_depth.png is the sensor's depth, uint16 mm, 0 where it has no reading: its own holes, and those of the layer
    depth_hole of that sensor if the view has it (glass, mirrors, edges ...). depth.png is the true depth, 0 for
    nothing and for 65.535 m or more. intrinsics.txt: K in pixels, three rows. left_out.txt names views without a
    picture or a sensor's depth; BadInput if none has them.
    """
    wanted = choice.of(LingbotOptions).sensor
    sensors = (wanted,) if wanted else SENSORS
    left_out: list[ChosenView] = []
    for view in views:
        sensor = next(filter(view.has, sensors), "")
        if not sensor or view.picture is None:
            left_out.append(view)
            continue
        require_lens(view, "lingbot", *FORM.lenses)
        folder = out / view.house.id / view.id
        write_file(folder / "rgb.png", view.data(view.picture))
        write_file(folder / "raw_depth.png", png_from_array(_readings(view, sensor)))
        write_file(folder / "depth.png", png_from_array(depth_within_png(view)))
        rows = [" ".join(f"{v:.9g}" for v in row) + "\n" for row in view.facts["K"]]
        write_file(folder / "intrinsics.txt", "".join(rows).encode())
    if len(left_out) == len(views):
        hint = "run with --layers depth_sensor_d455 depth_hole_d455"
        raise BadInput("--to", "lingbot", "no view has a picture and a sensor's depth", hint=hint)
    name_left_out(out, left_out, "has no picture or no sensor's depth")


def _readings(view: ChosenView, sensor: str) -> NDArray[np.uint16]:
    """(H, W) uint16 mm, 0 for a hole."""
    depth: NDArray[np.uint16] = view.array(sensor)
    hole = sensor.replace("depth_sensor", "depth_hole")
    return np.where(view.array(hole) == 0, depth, np.uint16(0)) if view.has(hole) else depth


FORM = ViewForm(
    "lingbot",
    write_lingbot,
    "LingBot-Depth: `<house>/<view>/rgb.png`, `raw_depth.png` (of `--sensor`, with holes), `depth.png`, `intrinsics.txt`",
    options=LingbotOptions,
    lenses=("pinhole",),
    layers=SENSORS,
    convention=Convention(0.5, axes="", depth="mm, along the axis"),
)
