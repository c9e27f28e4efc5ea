"""The table of a view's files: name, channels, dtype, unit, nodata, and the step that writes each.

No effects. The table of docs/formats/layers.md is printed from it (`python -m pbrs_farm.core.layers`).
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Literal, TypeAlias

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.plugins import plugins

# How pages and films draw a layer. "picture": unchanged. "classes": NYU40's colours. "ids": a
# colour per id. "mask": light on dark. "depth": a ramp of depth in mm, "depth_m" in metres,
# "disparity" the inverse. "flow", "flow_kitti": hue by direction. "high_byte": of 16 bits per
# channel. "range": each channel scaled to its range in the picture. "": not a picture.
# fmt: off
ShownAs: TypeAlias = Literal[
    "", "picture", "classes", "ids", "mask", "depth", "depth_m", "disparity", "flow", "flow_kitti",
    "high_byte", "range",
]
# fmt: on

# How an export changes its size: by the nearest pixel, by area, lines kept whole, and what measures
# pixels of the picture itself in those of the new size.
Resized: TypeAlias = Literal["nearest", "area", "lines", "pixels"]


@dataclass(frozen=True, slots=True)
class Layer:
    """One file of a view.

    The table of these is the only list of layers: files, `--layers`, what a lens must have, digests,
    pages, films, exports and `verify` read it.
    """

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
    # Required of the lens: "planar depth" along its axis, "rows" that correspond in a pair.
    needs: str = ""
    shown_as: ShownAs = ""
    resized: Resized = "nearest"
    title: str = ""  # in menus and above tiles; "" = the name's words
    # Raised when its pixels change while the step's version stays: views that have it are made anew.
    version: int = 1
    # Its pixels show the albedo, which the recipe's materials hold to a limit.
    shows_albedo: bool = False
    # Layers that are written with it, and without which it is useless.
    beside: tuple[str, ...] = ()

    @property
    def is_label(self) -> bool:
        """Whether neighbouring values must not be mixed when the picture is scaled.

        True for classes, ids and masks: scale those by the nearest pixel, never by averaging.
        """
        return self.shown_as in ("classes", "ids", "mask")

    @property
    def is_photo(self) -> bool:
        """Whether it is a picture in a light, shown as its own file."""
        return self.shown_as == "picture" and self.step != "truth"

    @property
    def shown_title(self) -> str:
        """Its name in menus."""
        return self.title or self.name.replace("_", " ").capitalize()


MOST_VARIANTS: Final = 8
"""Of a view's further pictures of `mlt_il_ol`, by other cameras (recipe: tone.variants)."""


def _truth_layer(
    name: str, channels: str, dtype: str, unit: str, nodata: str = "0", file: str = "", **more: Any
) -> Layer:
    """A label that the step `truth` writes. more: other fields of Layer."""
    return Layer(name, file or f"{name}.png", channels, dtype, unit, nodata, "truth", **more)


def _picture_layer(name: str, step: str, title: str = "", *, optional: bool = False) -> Layer:
    return Layer(
        name,
        f"{name}.png",
        "RGB",
        "uint8",
        "sRGB",
        "-",
        step,
        optional,
        shown_as="picture",
        resized="area",
        title=title,
    )


def optional_layer(
    name: str,
    channels: str,
    dtype: str,
    unit: str,
    nodata: str = "0",
    file: str = "",
    needs: str = "",
    *,
    shown_as: ShownAs = "",
    resized: Resized = "nearest",
) -> Layer:
    """A label that the step `truth` writes when --layers names it, a plugin's too.

    shown_as: "" is "picture" for uint8 and "range" for all else.

        >>> optional_layer("height", "Y", "uint16", "mm above the lowest floor").file
        'height.png'
    """
    shown_as = shown_as or ("picture" if dtype == "uint8" else "range")
    return _truth_layer(
        name,
        channels,
        dtype,
        unit,
        nodata,
        file,
        optional=True,
        needs=needs,
        shown_as=shown_as,
        resized=resized,
    )


_along_axis: Final = partial(optional_layer, needs="planar depth")


def _between(name: str, partner: str, *columns: str, ending: str = "png", **more: Any) -> Layer:
    """A label that needs another view. columns: channels, dtype, unit and perhaps nodata."""
    layer = _truth_layer(name, *columns, optional=True, partner=partner, **more)
    return replace(layer, file=f"{name}.{ending}")


def _flow(name: str, partner: str) -> tuple[Layer, ...]:
    unit = f"px right, px down, to the {partner} frame"
    kitti = "64 x + 2^15, 64 y + 2^15, 1 = seen there (KITTI)"
    return (
        _between(
            f"flow_{name}",
            partner,
            "X Y",
            "float16",
            unit,
            "0, 0",
            ending="exr",
            shown_as="flow",
            resized="pixels",
        ),
        _between(
            f"flow_{name}_kitti",
            partner,
            "RGB",
            "uint16",
            kitti,
            "0 in all three",
            shown_as="flow_kitti",
            resized="pixels",
            version=_REACH_VERSION,
        ),
        _between(
            f"occlusion_{name}",
            partner,
            "Y",
            "uint8",
            _SEEN_THERE,
            "128",
            shown_as="mask",
            version=_REACH_VERSION,
        ),
    )


_REACH_VERSION: Final = (
    2  # of layers that ask what a ray reaches: hidden by a tenth of a millimetre counts
)
_SEEN_THERE: Final = "in the other picture: 0 = seen, 128 = outside it, 255 = hidden"


def _behind(what: str, of: str) -> tuple[Layer, ...]:
    """Label layers for the second surface along the ray (behind glass or in a mirror); of: for their unit."""

    def layer(name: str, channels: str, dtype: str, nodata: str, shown_as: ShownAs) -> Layer:
        file = f"behind_{what}/{name}.png"
        unit = f"as {name}, {of}"
        name = f"behind_{what}_{name}"
        return optional_layer(name, channels, dtype, unit, nodata, file, shown_as=shown_as)

    return (
        layer("depth", "Y", "uint16", "0", "depth"),
        layer("normal", "RGB", "uint16", "as normal", "high_byte"),
        layer("semantic", "Y", "uint8", "0", "classes"),
        layer("instance", "Y", "uint16", "0", "ids"),
    )


def _intrinsic(ending: str, of: str) -> tuple[Layer, ...]:
    """Shading and residual of some light; ending: of their names."""
    shading = f"shading{ending}"

    def layer(name: str, unit: str, beside: tuple[str, ...]) -> Layer:
        return Layer(
            name,
            f"{name}.exr",
            "R G B",
            "float16",
            unit,
            "0",
            "develop",
            optional=True,
            shown_as="range",
            resized="area",
            beside=beside,
        )

    unit = f"W m-2 sr-1, linear sRGB: of {of}"
    return (
        layer(shading, f"{unit}, irradiance over pi", ()),
        layer(f"residual{ending}", f"{unit}, radiance - albedo x shading", ("albedo", shading)),
    )


# Layers that every view has, and (optional) those written when --layers names them.
# fmt: off
OWN_LAYERS: Final[tuple[Layer, ...]] = (
    # The pictures of the four lighting modes, and what two of them are developed from.
    _picture_layer("opengl_dl", "opengl_dl", "OpenGL, directional"),
    _picture_layer("opengl_il", "opengl_il", "OpenGL, indoor"),
    _picture_layer("mlt_ol", "develop", "Physical, outdoor"),
    _picture_layer("mlt_il_ol", "develop", "Physical, indoor + outdoor"),
    *(
        _picture_layer(f"mlt_il_ol.{n}", "develop", f"Physical, camera {n}", optional=True)
        for n in range(1, MOST_VARIANTS + 1)
    ),
    Layer(
        "radiance",
        "radiance.exr",
        "outdoor.RGB indoor.RGB albedo.RGB normal.XYZ, a channel a letter; --groups lamps: lampN.RGB;"
        " --layers shading: all but the normal also with diffuse_ before their names",
        "float32",
        "W m-2 sr-1, linear sRGB primaries; albedo 0..1; normal: the pixel's mean, world, guides the denoiser",
        "-",
        "light",
    ),
    # Labels of every view, all from one hit record.
    _truth_layer("depth", "Y", "uint16", "planar z, mm", shown_as="depth"),
    _truth_layer(
        "normal", "RGB", "uint16", "camera frame x right, y forward, z up; round((n + 1) 65535 / 2)",
        "32768 in all three, valid = 0", shown_as="high_byte", title="Normals",
    ),
    _truth_layer("valid", "Y", "uint8", "0 / 255", shown_as="mask"),
    _truth_layer("semantic", "Y", "uint8", "NYU40 id", shown_as="classes", title="Classes"),
    _truth_layer("instance", "Y", "uint16", "instance id", shown_as="ids", title="Instances"),
    _truth_layer("boundary", "Y", "uint8", "0 / 255", shown_as="mask", resized="lines", title="Boundaries"),
    # Labels that --layers asks for.
    optional_layer("depth_z", "Z", "float32", "planar z, m", file="depth_z.exr", shown_as="depth_m"),
    optional_layer("position", "X Y Z", "float32", "world, m", file="position.exr", shown_as="range"),
    optional_layer("normal_shading", "RGB", "uint16", "as normal", "as normal", shown_as="high_byte"),
    optional_layer(
        "normal_world", "RGB", "uint16", "world frame x, y up, z; round((n + 1) 65535 / 2)", "as normal",
        shown_as="high_byte",
    ),
    replace(
        optional_layer("albedo", "RGB", "uint8", "sRGB, diffuse colour", resized="area"),
        shows_albedo=True,
    ),
    optional_layer(
        "roughness", "Y", "uint8", "255 = matte, 0 = mirror, glass; root of GGX alpha (glTF's roughness)",
        resized="area",
    ),
    optional_layer("metallic", "Y", "uint8", "255 = metal or mirror", shown_as="mask"),
    optional_layer("f0", "RGB", "uint8", "sRGB, reflectance at right angles", resized="area"),
    optional_layer(
        "nocs", "RGB", "uint16",
        "point of a placed model in its own box, round(65535 c), box centre .5, diagonal 1 (Wang et al. 2019)",
        "0 in all three", shown_as="high_byte",
    ),
    optional_layer("material", "Y", "uint16", "material id, table in view.json", shown_as="ids"),
    optional_layer("nyu13", "Y", "uint8", "NYU13 id", shown_as="ids"),
    optional_layer(
        "part", "Y", "uint16", "id of the door, drawer or lid, table in articulation.json", shown_as="ids"
    ),
    optional_layer("class_source", "Y", "uint16", "the source's class, table in view.json", shown_as="ids"),
    # Light split by the albedo: of all light, and of each light group.
    *_intrinsic("", "all light"),
    *_intrinsic("_outdoor", "outdoor light"),
    *_intrinsic("_indoor", "indoor light"),
    # Surfaces behind panes and glass objects.
    optional_layer("glass", "Y", "uint8", "255 = glass or pane hit first", shown_as="mask"),
    *_behind("glass", "first hit that is no glass"),
    # Surfaces in mirrors, at their place in the picture.
    optional_layer("mirror", "Y", "uint8", "255 = mirror hit first", shown_as="mask"),
    *_behind("mirror", "of the image behind the mirror"),
    # Boundaries by their kind.
    optional_layer(
        "boundary_occlusion", "Y", "uint8",
        "255 = edge of the nearer surface, 128 = beside it on the farther",
        shown_as="mask", resized="lines",
    ),
    optional_layer("boundary_semantic", "Y", "uint8", "0 / 255", shown_as="mask", resized="lines"),
    optional_layer(
        "boundary_crease", "Y", "uint8", "255 = normals turn by more than 30 degrees, no depth gap",
        shown_as="mask", resized="lines",
    ),
    # Depth as other works encode or measure it.
    _along_axis("hha", "RGB", "uint8", "disparity, height in cm, angle with gravity (Gupta et al. 2014)"),
    replace(
        _along_axis("projector", "Y", "uint8", "dots of an infrared projector beside the camera, or amid a pair"),
        shows_albedo=True, version=_REACH_VERSION,
    ),
    replace(
        _along_axis("depth_sensor", "Y", "uint16", "planar z in mm as a Kinect measures it", shown_as="depth"),
        version=2,  # its noise is the same over patches of pixels
    ),
    _along_axis("depth_sensor_tof", "Y", "uint16", "planar z in mm as a Kinect 2 (time of flight)", shown_as="depth"),
    _along_axis("depth_sensor_stereo", "Y", "uint16", "planar z in mm as a stereo camera has it", shown_as="depth"),
    _along_axis("depth_sensor_d455", "Y", "uint16", "planar z in mm as an Intel D455 (stereo)", shown_as="depth"),
    _along_axis("depth_sensor_azure", "Y", "uint16", "planar z in mm as an Azure Kinect (time of flight)", shown_as="depth"),
    _along_axis("depth_sensor_l515", "Y", "uint16", "planar z in mm as an Intel L515 (lidar camera)", shown_as="depth"),
    # Where surfaces lie in the next and the previous frame, and in the other picture of a pair.
    *_flow("forward", "next"),
    *_flow("backward", "previous"),
    _between(
        "scene_flow", "next", "X Y Z", "float32", "m, world: what things themselves move to the next frame",
        "0, 0, 0", ending="exr", shown_as="range",
    ),
    _between("disparity", "stereo", "Y", "uint16", "256 x px between the pictures of a pair (KITTI)", needs="rows", shown_as="disparity", resized="pixels"),
    _between("occlusion_stereo", "stereo", "Y", "uint8", _SEEN_THERE, "128", shown_as="mask", version=_REACH_VERSION),
)
# fmt: on


def _of_plugins() -> tuple[Layer, ...]:
    """The layers of installed plugins, by name: optional, written by the step `truth`."""
    layers = []
    for name, plugin in plugins("layers").items():
        layer = plugin.load().layer
        if layer.name != name or layer.step != "truth" or not layer.optional:
            raise MachineFailed(
                f"plugin {plugin.mark}: its layer must be optional, of the step truth, called {name}"
            )
        layers.append(layer)
    return tuple(layers)


def _pictures_of_plugins() -> tuple[Layer, ...]:
    """The pictures of installed plugins, by name: written by the step `develop` when asked for."""
    return tuple(_picture_layer(name, "develop", optional=True) for name in plugins("pictures"))


LAYERS: Final[tuple[Layer, ...]] = (*OWN_LAYERS, *_of_plugins(), *_pictures_of_plugins())
"""All layers: the package's and those of plugins."""

LAYER: Final = {layer.name: layer for layer in LAYERS}

_VARIANTS: Final = {LAYER[f"mlt_il_ol.{n}"].file for n in range(1, MOST_VARIANTS + 1)}

LIGHT_LAYERS: Final = tuple(
    name + ending for ending in ("", "_outdoor", "_indoor") for name in ("shading", "residual")
)
"""The names of --layers that are made of traced light."""

OPTIONAL: Final = tuple(
    x.name for x in LAYERS if x.optional and (x.step == "truth" or x.name in LIGHT_LAYERS)
)
"""The names that --layers takes."""


def layers_in_digest(names: Iterable[str], max_albedo: float) -> list[str]:
    """Inputs of these layers for the digest of the step `truth`, beside their names and plugins.

    max_albedo: the recipe's limit of albedo. A layer of version 1 adds nothing.
    """
    named_layers = [layer for layer in LAYERS if layer.name in set(names)]
    shown = [f"{layer.name} {max_albedo}" for layer in named_layers if layer.shows_albedo]
    return [
        *shown,
        *(f"{layer.name} {layer.version}" for layer in named_layers if layer.version > 1),
    ]


def layer_table() -> str:
    """The layers as a Markdown table; further pictures by other cameras share a row."""
    rows = ["| file | channels | type | unit | nothing |", "|---|---|---|---|---|"]
    first, last = (LAYER[f"mlt_il_ol.{n}"] for n in (1, MOST_VARIANTS))
    for x in LAYERS:
        if x.file in _VARIANTS and x is not first:
            continue
        file = f"`{first.file}` to `{last.file}`" if x is first else f"`{x.file}`"
        rows.append(f"| {file} | {x.channels} | {x.dtype} | {x.unit} | {x.nodata} |")
    return "\n".join(rows)


def text_table(width: int) -> str:
    """The layers in columns for a terminal so wide; what does not fit is cut with an ellipsis."""
    heads = ("--layers", "file", "type", "unit")
    rows = [
        (x.name if x.optional else "-", x.file, f"{x.dtype} {x.channels.split()[0][:12]}", x.unit)
        for x in LAYERS
    ]
    widths = [max(len(row[k]) for row in (heads, *rows)) for k in range(3)]
    unit_width = max(width - sum(widths) - 6, 16)
    lines = []
    for row in (heads, *rows):
        cells = [cell.ljust(n) for cell, n in zip(row[:3], widths, strict=True)]
        unit = row[3] if len(row[3]) <= unit_width else row[3][: unit_width - 1] + "\u2026"
        lines.append("  ".join([*cells, unit]).rstrip())
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(layer_table() + "\n")
