"""Pictures with a sensor's depth and the true one, for LingBot-Depth's completion (Robbyant/lingbot-depth, examples).

    <house>/<view>/{rgb.png,raw_depth.png,depth.png,intrinsics.txt}

Effects: reads views, writes files.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.options import option
from pbrs_farm.core.record import Record
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.export.content import Files, each_view, rows
from pbrs_farm.export.form import Convention, Takes, ViewForm

SENSORS: Final = tuple(name for name in LAYER if name.startswith("depth_sensor"))


class LingbotOptions(Record):
    """The sensor of raw_depth.png."""

    sensor: str = option(
        "",
        "layer of the sensor's depth (default: the first that a view has)",
        choices=("", *SENSORS),
    )


def files_of(view: ChosenView) -> Files:
    """The files above of a view.

    raw_depth.png is the sensor's depth, uint16 mm, 0 where it has no reading: its own holes, and those of the layer
    depth_hole of that sensor if the view has it (glass, mirrors, edges ...). depth.png is the true depth, 0 for
    nothing and for 65.535 m or more. intrinsics.txt: K in pixels, three rows. left_out.txt names views without a
    picture or a sensor's depth; BadInput if none has them.
    """
    folder = f"{view.house.id}/{view.id}"
    return {
        f"{folder}/rgb.png": view.shown,
        f"{folder}/raw_depth.png": _readings(view, _sensor(view)),
        f"{folder}/depth.png": view.depth_mm,
        f"{folder}/intrinsics.txt": rows(view.facts["K"]),
    }


def _sensor(view: ChosenView) -> str:
    """The layer of the sensor's depth; "" if the view has none."""
    wanted = view.choice.of(LingbotOptions).sensor
    return next(filter(view.has, (wanted,) if wanted else SENSORS), "")


def _fitting(views: list[ChosenView]) -> list[ChosenView]:
    return [view for view in views if view.picture is not None and _sensor(view)]


def _readings(view: ChosenView, sensor: str) -> NDArray[np.uint16]:
    """(H, W) uint16 mm, 0 for a hole."""
    depth: NDArray[np.uint16] = view.array(sensor)
    hole = sensor.replace("depth_sensor", "depth_hole")
    return np.where(view.array(hole) == 0, depth, np.uint16(0)) if view.has(hole) else depth


FORM = ViewForm(
    "lingbot",
    each_view(files_of),
    "LingBot-Depth: `<house>/<view>/rgb.png`, `raw_depth.png` (of `--sensor`, with holes), `depth.png`, `intrinsics.txt`",
    options=LingbotOptions,
    takes=Takes(
        _fitting,
        "has no picture or no sensor's depth",
        "no view has a picture and a sensor's depth",
        "run with --layers depth_sensor_d455 depth_hole_d455",
    ),
    lenses=("pinhole",),
    layers=SENSORS,
    convention=Convention(0.5, axes="", depth="mm, along the axis"),
)
