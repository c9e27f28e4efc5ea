"""The table of a view's files: name, channels, dtype, unit, nodata, and the step that writes each.

No effects. The table of docs/formats.md is printed from it (`python -m pbrs_farm.core.layers`).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Final

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.plugins import plugins


@dataclass(frozen=True, slots=True)
class Layer:
    """One file of a view."""

    name: str
    file: str  # below the view's folder
    channels: str
    dtype: str
    unit: str
    nodata: str  # what a pixel holds that sees nothing
    step: str  # the step of run/plan.py that writes it
    optional: bool = False  # only when --layers names it, a plugin's picture tone.pictures
    # "next", "previous" or "stereo": the view without which there is no such file.
    partner: str = ""
    # What a lens must have: "planar depth" along its axis, "rows" that correspond in a pair.
    needs: str = ""


def _picture(name: str, step: str, *, optional: bool = False) -> Layer:
    return Layer(name, f"{name}.png", "RGB", "uint8", "sRGB", "-", step, optional)


def _label(name: str, channels: str, dtype: str, unit: str, nodata: str = "0") -> Layer:
    return Layer(name, f"{name}.png", channels, dtype, unit, nodata, "truth")


def optional_layer(
    name: str,
    channels: str,
    dtype: str,
    unit: str,
    nodata: str = "0",
    file: str = "",
    needs: str = "",
) -> Layer:
    """A label that the step `truth` writes when --layers names it, a plugin's too."""
    file = file or f"{name}.png"
    return Layer(name, file, channels, dtype, unit, nodata, "truth", optional=True, needs=needs)


def _along_axis(name: str, channels: str, dtype: str, unit: str) -> Layer:
    return optional_layer(name, channels, dtype, unit, needs="planar depth")


def _between(
    name: str,
    partner: str,
    channels: str,
    dtype: str,
    unit: str,
    nodata: str = "0",
    ending: str = "png",
    needs: str = "",
) -> Layer:
    file = f"{name}.{ending}"
    return Layer(name, file, channels, dtype, unit, nodata, "truth", True, partner, needs)


def _flow(name: str, partner: str) -> tuple[Layer, ...]:
    unit = f"px right, px down, to the {partner} frame"
    kitti = "64 x + 2^15, 64 y + 2^15, 1 = seen there (KITTI)"
    return (
        _between(f"flow_{name}", partner, "X Y", "float16", unit, "0, 0", "exr"),
        _between(f"flow_{name}_kitti", partner, "RGB", "uint16", kitti, "0 in all three"),
        _between(f"occlusion_{name}", partner, "Y", "uint8", _SEEN_THERE, "128"),
    )


_SEEN_THERE: Final = "in the other picture: 0 = seen, 128 = outside it, 255 = hidden"


def _behind_glass(name: str, channels: str, dtype: str, nodata: str = "0") -> Layer:
    unit, file = f"as {name}, first hit that is no glass", f"behind_glass/{name}.png"
    return optional_layer(f"behind_glass_{name}", channels, dtype, unit, nodata, file)


# Layers that every view has, and (optional) those written when --layers names them.
OWN_LAYERS: Final[tuple[Layer, ...]] = (
    # The pictures of the four lighting modes, and what two of them are developed from.
    _picture("opengl_dl", "opengl_dl"),
    _picture("opengl_il", "opengl_il"),
    _picture("mlt_ol", "develop"),
    _picture("mlt_il_ol", "develop"),
    Layer(
        "radiance",
        "radiance.exr",
        "outdoor.{R,G,B} indoor.{R,G,B} albedo.{R,G,B} normal.{X,Y,Z}; --groups lamps: lamp<N>.{R,G,B}",
        "float32",
        "W m-2 sr-1, linear sRGB primaries; albedo 0..1; normal: the pixel's mean, world, guides the denoiser",
        "-",
        "light",
    ),
    # Labels of every view, all from one hit record.
    _label("depth", "Y", "uint16", "planar z, mm"),
    _label(
        "normal", "RGB", "uint16", "camera frame x right, y forward, z up; round((n + 1) 65535 / 2)",
        "32768 in all three, valid = 0",
    ),
    _label("valid", "Y", "uint8", "0 / 255"),
    _label("semantic", "Y", "uint8", "NYU40 id"),
    _label("instance", "Y", "uint16", "instance id"),
    _label("boundary", "Y", "uint8", "0 / 255"),
    # Labels that --layers asks for.
    optional_layer("depth_z", "Z", "float32", "planar z, m", file="depth_z.exr"),
    optional_layer("position", "X Y Z", "float32", "world, m", file="position.exr"),
    optional_layer("normal_shading", "RGB", "uint16", "as normal", "as normal"),
    optional_layer(
        "normal_world", "RGB", "uint16", "world frame x, y up, z; round((n + 1) 65535 / 2)", "as normal"
    ),
    optional_layer("albedo", "RGB", "uint8", "sRGB, diffuse colour"),
    optional_layer(
        "nocs", "RGB", "uint16",
        "point of a placed model in its own box, round(65535 c), box centre .5, diagonal 1 (Wang et al. 2019)",
        "0 in all three",
    ),
    optional_layer("material", "Y", "uint16", "material id, table in view.json"),
    optional_layer("nyu13", "Y", "uint8", "NYU13 id"),
    optional_layer("class_source", "Y", "uint16", "the source's class, table in view.json"),
    # What lies behind panes and glass objects.
    optional_layer("glass", "Y", "uint8", "255 = glass or pane hit first"),
    _behind_glass("depth", "Y", "uint16"),
    _behind_glass("normal", "RGB", "uint16", "as normal"),
    _behind_glass("semantic", "Y", "uint8"),
    _behind_glass("instance", "Y", "uint16"),
    # Boundaries by their kind.
    optional_layer(
        "boundary_occlusion", "Y", "uint8",
        "255 = edge of the nearer surface, 128 = beside it on the farther",
    ),
    optional_layer("boundary_semantic", "Y", "uint8", "0 / 255"),
    optional_layer(
        "boundary_crease", "Y", "uint8", "255 = normals turn by more than 30 degrees, no depth gap"
    ),
    # Depth as other works encode or measure it.
    _along_axis("hha", "RGB", "uint8", "disparity, height in cm, angle with gravity (Gupta et al. 2014)"),
    _along_axis("projector", "Y", "uint8", "dots of an infrared projector beside the camera, or amid a pair"),
    _along_axis("depth_sensor", "Y", "uint16", "planar z in mm as a Kinect measures it"),
    _along_axis("depth_sensor_tof", "Y", "uint16", "planar z in mm as a Kinect 2 (time of flight)"),
    _along_axis("depth_sensor_stereo", "Y", "uint16", "planar z in mm as a stereo camera has it"),
    # Where surfaces lie in the next and the previous frame, and in the other picture of a pair.
    *_flow("forward", "next"),
    *_flow("backward", "previous"),
    _between("disparity", "stereo", "Y", "uint16", "256 x px between the pictures of a pair (KITTI)", needs="rows"),
    _between("occlusion_stereo", "stereo", "Y", "uint8", _SEEN_THERE, "128"),
)  # fmt: skip


def _of_plugins() -> tuple[Layer, ...]:
    """The layers of installed plugins, by name: optional, written by the step `truth`."""
    found = []
    for name, plugin in plugins("layers").items():
        layer = plugin.load().layer
        if layer.name != name or layer.step != "truth" or not layer.optional:
            raise MachineFailed(
                f"plugin {plugin.mark}: its layer must be optional, of the step truth, called {name}"
            )
        found.append(layer)
    return tuple(found)


def _pictures_of_plugins() -> tuple[Layer, ...]:
    """The pictures of installed plugins, by name: written by the step `develop` when asked for."""
    return tuple(_picture(name, "develop", optional=True) for name in plugins("pictures"))


LAYERS: Final[tuple[Layer, ...]] = (*OWN_LAYERS, *_of_plugins(), *_pictures_of_plugins())
"""All layers: the package's and those of plugins."""

LAYER: Final = {layer.name: layer for layer in LAYERS}

OPTIONAL: Final = tuple(x.name for x in LAYERS if x.optional and x.step == "truth")
"""The names that --layers takes."""


def table() -> str:
    """The layers as a Markdown table."""
    rows = ["| file | channels | type | unit | nothing |", "|---|---|---|---|---|"]
    rows += [f"| `{x.file}` | {x.channels} | {x.dtype} | {x.unit} | {x.nodata} |" for x in LAYERS]
    return "\n".join(rows)


def text_table(width: int) -> str:
    """The layers in columns for a terminal so wide; what does not fit is cut with an ellipsis."""
    heads = ("--layers", "file", "type", "unit")
    rows = [
        (x.name if x.optional else "-", x.file, f"{x.dtype} {x.channels.split()[0][:12]}", x.unit)
        for x in LAYERS
    ]
    widths = [max(len(row[k]) for row in (heads, *rows)) for k in range(3)]
    left = max(width - sum(widths) - 6, 16)
    lines = []
    for row in (heads, *rows):
        cells = [cell.ljust(n) for cell, n in zip(row[:3], widths, strict=True)]
        unit = row[3] if len(row[3]) <= left else row[3][: left - 1] + "\u2026"
        lines.append("  ".join([*cells, unit]).rstrip())
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
