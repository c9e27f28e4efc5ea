"""The table of output layers: file, channels, dtype, unit, colour space, step, how it is checked.

No effects. README's table is printed from it (`python -m pbrs_farm.core.layers`).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Layer:
    """One file of a view. step: the step that writes it. optional: only when asked by --layers."""

    name: str
    file: str
    channels: str
    dtype: str
    unit: str
    nodata: str
    step: str
    check: str
    optional: bool = False


def _label(
    name: str, file: str, channels: str, dtype: str, unit: str, nodata: str, check: str,
    *, optional: bool = False,
) -> Layer:  # fmt: skip
    return Layer(name, file, channels, dtype, unit, nodata, "truth", check, optional)


def _more(
    name: str, file: str, channels: str, dtype: str, unit: str, nodata: str, check: str
) -> Layer:
    return _label(name, file, channels, dtype, unit, nodata, check, optional=True)


LAYERS: Final[tuple[Layer, ...]] = (
    Layer(
        "opengl_dl", "opengl_dl.png", "RGB", "uint8", "sRGB", "-", "opengl", "size, not constant"
    ),
    Layer(
        "opengl_il", "opengl_il.png", "RGB", "uint8", "sRGB", "-", "opengl", "size, not constant"
    ),
    Layer("mlt_ol", "mlt_ol.png", "RGB", "uint8", "sRGB", "-", "light", "size, not constant"),
    Layer("mlt_il_ol", "mlt_il_ol.png", "RGB", "uint8", "sRGB", "-", "light", "size, not constant"),
    Layer(
        "radiance",
        "radiance.exr",
        "outdoor.{R,G,B} indoor.{R,G,B} albedo.{R,G,B} normal.{X,Y,Z}; --groups lamps: lamp<N>.{R,G,B}",
        "float32",
        "W m-2 sr-1, linear sRGB primaries; albedo 0..1; normal: the pixel's mean, world, guides the denoiser",
        "-",
        "light",
        "finite, >= 0",
    ),
    _label(
        "depth", "depth.png", "Y", "uint16", "planar z, mm", "0", "ray through the pixel's centre"
    ),
    _label(
        "normal",
        "normal.png",
        "RGB",
        "uint16",
        "camera frame x right, y forward, z up; round((n + 1) 65535 / 2)",
        "32768 in all three, valid = 0",
        "unit length, ray",
    ),
    _label("valid", "valid.png", "Y", "uint8", "0 / 255", "0", "equals depth > 0"),
    _label("semantic", "semantic.png", "Y", "uint8", "NYU40 id", "0", "table in view.json"),
    _label(
        "instance", "instance.png", "Y", "uint16", "instance id", "0", "ray, table in view.json"
    ),
    _label("boundary", "boundary.png", "Y", "uint8", "0 / 255", "0", "recomputed from instance"),
    _more("depth_z", "depth_z.exr", "Z", "float32", "planar z, m", "0", "ray"),
    _more("position", "position.exr", "X Y Z", "float32", "world, m", "0", "ray"),
    _more(
        "normal_shading", "normal_shading.png", "RGB", "uint16", "as normal", "as normal", "unit"
    ),
    _more(
        "normal_world",
        "normal_world.png",
        "RGB",
        "uint16",
        "world frame x, y up, z; round((n + 1) 65535 / 2)",
        "as normal",
        "ray",
    ),
    _more("albedo", "albedo.png", "RGB", "uint8", "sRGB, diffuse colour", "0", "size"),
    _more("material", "material.png", "Y", "uint16", "material id, table in view.json", "0", "ray"),
    _more("nyu13", "nyu13.png", "Y", "uint8", "NYU13 id", "0", "recomputed from semantic"),
    _more(
        "class_source",
        "class_source.png",
        "Y",
        "uint16",
        "the source's class, table in view.json",
        "0",
        "table in view.json",
    ),
    _more("glass", "glass.png", "Y", "uint8", "255 = glass or pane hit first", "0", "ray"),
    *(
        _more(
            f"behind_glass_{name}",
            f"behind_glass/{name}.png",
            channels,
            dtype,
            f"as {name}, first hit that is no glass",
            nodata,
            "ray",
        )
        for name, channels, dtype, nodata in (
            ("depth", "Y", "uint16", "0"),
            ("normal", "RGB", "uint16", "as normal"),
            ("semantic", "Y", "uint8", "0"),
            ("instance", "Y", "uint16", "0"),
        )
    ),
    _more(
        "boundary_occlusion",
        "boundary_occlusion.png",
        "Y",
        "uint8",
        "255 = edge of the nearer surface, 128 = beside it on the farther",
        "0",
        "values",
    ),
    _more(
        "boundary_semantic",
        "boundary_semantic.png",
        "Y",
        "uint8",
        "0 / 255",
        "0",
        "recomputed from semantic",
    ),
    _more(
        "boundary_crease",
        "boundary_crease.png",
        "Y",
        "uint8",
        "255 = normals turn by more than 30 degrees, no depth gap",
        "0",
        "values",
    ),
    _more(
        "hha",
        "hha.png",
        "RGB",
        "uint8",
        "disparity, height in cm, angle with gravity (Gupta et al. 2014)",
        "0",
        "size",
    ),
    _more(
        "depth_sensor",
        "depth_sensor.png",
        "Y",
        "uint16",
        "planar z in mm as a Kinect measures it",
        "0",
        "size",
    ),
)
"""Layers that every view has, and (optional) those written when --layers names them."""

LAYER: Final = {layer.name: layer for layer in LAYERS}


def table() -> str:
    """The layers as a Markdown table."""
    rows = ["| file | channels | type | unit | nothing |", "|---|---|---|---|---|"]
    rows += [f"| `{x.file}` | {x.channels} | {x.dtype} | {x.unit} | {x.nodata} |" for x in LAYERS]
    return "\n".join(rows)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
