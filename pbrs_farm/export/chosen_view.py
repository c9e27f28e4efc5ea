"""The exported part of a view: layers as bytes and arrays, and its table, at the size of the export.

Effects: reads the view.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import PUBLISHED_FROM_OPENGL
from pbrs_farm.core.layers import LAYER, LAYERS, Layer
from pbrs_farm.core.lenses import PINHOLE, lens_from_table
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.record import Record
from pbrs_farm.core.resampling import resized_any, resized_by_area, resized_nearest
from pbrs_farm.core.shot import Shot
from pbrs_farm.core.shown_text import hint_of_choice
from pbrs_farm.crash_notes import note_step
from pbrs_farm.formats.class_map import ClassMap
from pbrs_farm.formats.layer_file import layer_bytes, layer_from_bytes
from pbrs_farm.formats.output_folder import OutputHouse, ViewEntry
from pbrs_farm.images import png_from_array
from pbrs_farm.regular_files import read_given

# the picture of a view is the first of these that it has
PICTURES: Final = (Mode.MLT_IL_OL, Mode.MLT_OL, Mode.OPENGL_IL, Mode.OPENGL_DL)

_MODES: Final = tuple(str(mode) for mode in Mode)
_RADIANCE: Final = "radiance"  # nine tenths of a view's bytes: exported only by name
_Options = TypeVar("_Options", bound=Record)
_NEEDED: Final = ("width_px", "height_px", "instances")  # fields of view.json of every export
_CLASSES: Final = "semantic"  # the layer that a user's classes replace
# classes of NYU40 for parts of the building; all others are objects
_STRUCTURE: Final = ("wall", "floor", "ceiling", "door", "window", "otherstructure")


@dataclass(frozen=True, slots=True)
class Choice:
    """The exported layers, modes, size and classes. Raises BadInput for an unknown layer or mode.

    layers: names of core/layers.py without the modes; None for all but radiance. modes: None for all.
    size: (width, height), None as rendered. classes: None for NYU40. options: those of the form, None
    for its defaults.
    """

    layers: tuple[str, ...] | None = None
    modes: tuple[str, ...] | None = None
    size: tuple[int, int] | None = None
    classes: ClassMap | None = None
    options: Record | None = None

    def __post_init__(self) -> None:
        labels = [layer.name for layer in LAYERS if layer.name not in _MODES]
        for name in self.layers or ():
            if name not in labels:
                raise BadInput("--layers", name, "no such layer", hint=hint_of_choice(name, labels))
        for mode in self.modes or ():
            if mode not in _MODES:
                hint = f"of {', '.join(_MODES)}"
                raise BadInput("--modes", mode, "no such lighting mode", hint=hint)
        if self.size is not None and _RADIANCE in (self.layers or ()):
            raise BadInput("--size", "", "radiance.exr is not resized", hint="omit one of them")

    def of(self, kind: type[_Options]) -> _Options:
        """The form's options, of the type that its FORM names."""
        return self.options if isinstance(self.options, kind) else kind()

    def takes(self, name: str) -> bool:
        """True if a layer is exported from views that have it; valid comes with normal.

        By default all modes and all layers but radiance, which is large and must be named.
        """
        if name in _MODES:
            return self.modes is None or name in self.modes
        if self.layers is None:
            return name != _RADIANCE
        return name in self.layers or (name == "valid" and "normal" in self.layers)

    @property
    def class_names(self) -> dict[int, str]:
        """Id -> name of the exported classes, by id: NYU40's, or those of the user's table.

        Ids may have gaps; class 0, nothing, is not included.
        """
        if self.classes is not None:
            return self.classes.names
        return {k: name for k, name in enumerate(NYU40_NAMES) if k}

    def is_structure(self, class_id: int) -> bool:
        """True if a class is a part of the building."""
        if self.classes is not None:
            return class_id in self.classes.structure
        return NYU40_NAMES[class_id] in _STRUCTURE


@dataclass(frozen=True, eq=False)
class ChosenView:
    """A view of an export."""

    entry: ViewEntry
    choice: Choice

    @property
    def house(self) -> OutputHouse:
        """The view's house."""
        return self.entry.house

    @property
    def id(self) -> str:
        """The view's id in its house."""
        return self.entry.id

    @property
    def shot(self) -> Shot:
        """The view's take, frame and camera of a rig."""
        return self.entry.shot

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The exported layers of the view, in the order of core/layers.py."""
        return tuple(layer for layer in LAYERS if self.has(layer.name))

    @property
    def picture(self) -> str | None:
        """The mode of the view's picture, None without any.

        Of several modes the first chosen one of PICTURES, so that an export has one picture a view.
        """
        return next((str(mode) for mode in PICTURES if self.has(mode)), None)

    @property
    def shown(self) -> bytes:
        """The file of its picture; BadInput without one."""
        return self.data(self._required_picture)

    @property
    def colours(self) -> NDArray[np.uint8]:
        """(H, W, 3) its picture; BadInput without one."""
        return np.asarray(self.array(self._required_picture)[..., :3], np.uint8)

    @property
    def _required_picture(self) -> str:
        if self.picture is None:
            hint = "run it with --modes, or export to a format without pictures"
            raise BadInput(f"{self.house.id}/{self.id}", "", "has no picture", hint=hint)
        return self.picture

    def has(self, name: str) -> bool:
        """True if a layer is exported and the view has it."""
        return self.choice.takes(name) and self.entry.file(LAYER[name].file) is not None

    @cached_property
    def facts(self) -> dict[str, Any]:
        """view.json, at the size of the export: K, boxes and pixels of instances, layout.

        With a user's classes each instance has `own_class` and `own_class_name`, too.
        """
        lacks = [name for name in _NEEDED if name not in self.entry.facts]
        if lacks:
            raise BadInput(self.entry.folder / "view.json", lacks[0], "is missing")
        facts = self.entry.facts if self.choice.size is None else self._resized_facts()
        if self.choice.classes is None:
            return facts
        names = {0: "", **self.choice.class_names}
        ids = [self.choice.classes.id_of(row) for row in facts["instances"]]
        rows = [
            row | {"own_class": k, "own_class_name": names[k]}
            for row, k in zip(facts["instances"], ids, strict=True)
        ]
        return facts | {"instances": rows}

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.facts["width_px"], self.facts["height_px"]

    @property
    def intrinsics(self) -> Intrinsics:
        """Size, K and lens of its camera; `directions` gives the rays of pixels through any lens."""
        (fx, _skew, cx), (_zero, fy, cy), _last = self.facts["K"]
        lens = lens_from_table(self.facts["lens"]) if "lens" in self.facts else PINHOLE
        return Intrinsics(*self.size, fx, fy, cx, cy, lens)

    @property
    def k_of_whole_centres(self) -> list[list[float]]:
        """K (3 x 3) for pixels whose centres are whole numbers: the principal point moves by half a pixel.

        For forms whose readers count pixels from their centres, as BOP's and KITTI's; docs/formats/export.md
        has the convention of each form.
        """
        (fx, skew, cx), (_zero, fy, cy), last = self.facts["K"]
        return [[fx, skew, cx - 0.5], [0.0, fy, cy - 0.5], list(last)]

    @property
    def pose(self) -> F64:
        """(4, 4) world_from_camera, camera axes x right, y down, z forward.

        Metres, world y up: p_world = pose @ p_camera.
        """
        return np.array(self.facts["world_from_camera_opencv"], np.float64)

    @property
    def place_and_quaternion(self) -> list[float]:
        """x y z qx qy qz qw of `pose`, qw not negative."""
        return place_and_quaternion(self.pose)

    @property
    def opengl_pose(self) -> F64:
        """(4, 4) as `pose`, camera axes x right, y up, z backward."""
        return np.array(self.facts["world_from_camera_opengl"], np.float64)

    def in_world(self, pixels: F64, depth_m: NDArray[np.floating]) -> F64:
        """(N, 3) world, metres: the points behind pixels (N, 2) at a depth (N,) along the axis."""
        pose = self.pose
        local = self.intrinsics.directions(pixels) * depth_m[:, None]
        return np.asarray(local @ pose[:3, :3].T + pose[:3, 3])

    @property
    def depth_mm(self) -> NDArray[np.uint16]:
        """(H, W) mm, 0 for nothing and for 65.535 m or more.

        For forms whose readers take every value above 0 as a measurement.
        """
        depth = self.array("depth")
        return np.where(depth < np.iinfo(np.uint16).max, depth, np.uint16(0))

    @property
    def depth_m(self) -> F64:
        """(H, W) metres: of `depth_z` if it is exported, else of depth.png; 0 for nothing or out of its range."""
        if self.has("depth_z"):
            return self.array("depth_z").astype(np.float64)
        return self.depth_mm / 1000

    def opengl_normals(self, layer: str = "normal") -> F32:
        """(H, W, 3) unit normals, camera x right, y up, z backward; (0, 0, 0) for nothing.

        layer: "normal" or "normal_shading".
        """
        published = self.array(layer) * (2 / 65535) - 1
        local = published @ PUBLISHED_FROM_OPENGL.astype(np.float64)  # columns are OpenGL's axes
        length = np.linalg.norm(local, axis=-1, keepdims=True)
        unit = local / np.where(length > 0, length, 1)
        return np.where((self.array("valid") > 0)[..., None], unit, 0).astype(np.float32)

    @property
    def opengl_normals_png(self) -> NDArray[np.uint16]:
        """(H, W, 3) uint16 of `opengl_normals`: round((n + 1) 65535 / 2), 0 for nothing."""
        normals = self.opengl_normals()
        has_one = np.asarray(normals != 0).any(-1, keepdims=True)
        return np.where(has_one, np.rint((normals + 1) / 2 * 65535), 0).astype(np.uint16)

    def class_of(self, row: dict[str, Any]) -> int:
        """The class of a row of facts' instances: NYU40's, or the user's; 0 = none."""
        return int(row["nyu40" if self.choice.classes is None else "own_class"])

    @property
    def facts_json(self) -> bytes:
        """facts as a file: the stored one unless it is resized or has classes of the user."""
        if self.choice.size is None and self.choice.classes is None:
            return read_given(self.entry.folder / "view.json")
        return json.dumps(self.facts, separators=(",", ":")).encode()

    def data(self, name: str) -> bytes:
        """The layer's file: the stored bytes unless it is resized; classes of the user as uint16.

        BadInput if it is damaged or missing.
        """
        note_step(f"{self.house.id}/{self.id}", f"export {name}")
        if name == _CLASSES and self.choice.classes is not None:
            return png_from_array(self.array(name))
        if self.choice.size is None:
            return read_given(self.entry.folder / LAYER[name].file)
        return layer_bytes(name, self.array(name), self.house.attribution)

    def array(self, name: str) -> NDArray[Any]:
        """The layer's array (H, W) or (H, W, 3), exported or not; BadInput if it is missing.

        "semantic" holds the user's classes (uint16), if given.
        """
        if name == _CLASSES and self.choice.classes is not None:
            return self.choice.classes.label(self.array("instance"), self.facts["instances"])
        file = self.entry.folder / LAYER[name].file
        array = layer_from_bytes(name, read_given(file), str(file))
        return array if self.choice.size is None else resize_layer(name, array, *self.choice.size)

    def _resized_facts(self) -> dict[str, Any]:
        facts = self.entry.facts
        width, height = self.choice.size or (0, 0)
        x, y = width / facts["width_px"], height / facts["height_px"]
        # Scale the first two rows of K: pixel centres lie at +0.5, so no shift is needed.
        scale = np.array([x, y, 1.0])
        facts = facts | {
            "width_px": width,
            "height_px": height,
            "K": (np.array(facts["K"], np.float64) * scale[:, None]).tolist(),
            "instances": _instances_in(self.array("instance"), facts["instances"]),
        }
        if "layout" in facts:
            facts["layout"] = [_layout_row_at_size(row, x, y) for row in facts["layout"]]
        return facts


def place_and_quaternion(pose: F64) -> list[float]:
    """x y z qx qy qz qw of a rigid motion (4, 4), qw not negative."""
    turn = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
    return [*pose[:3, 3].tolist(), *turn.tolist()]


def require_lens(view: ChosenView, form: str, *models: str) -> None:
    """Raise BadInput for a view through a lens that a form cannot describe.

    form: its name, for the message. models: supported lens models beside "pinhole".
    """
    model = view.facts.get("lens", {}).get("model", "pinhole")
    supported = tuple(dict.fromkeys(("pinhole", *models)))
    if model not in supported:
        text = f"lens.model {model}: this format supports {', '.join(supported)}"
        raise BadInput(f"--to {form}", view.id, text, hint="another --to")


def resize_layer(name: str, array: NDArray[Any], width: int, height: int) -> NDArray[Any]:
    """A layer on another grid, by the rule of the table of layers (Layer.resized).

    name: of core/layers.py; array: (H, W, ...) as stored. Values in px, as disparity and flow, are scaled
    with the grid. Lines keep their continuity, and the stronger value wins.
    """
    layer = LAYER[name]
    if layer.resized == "area":
        return resized_by_area(array, width, height)
    if layer.resized == "pixels":
        return _with_scaled_pixels(layer, resized_nearest(array, width, height), array.shape)
    if layer.resized == "nearest":
        return resized_nearest(array, width, height)
    lines = np.zeros((height, width), np.uint8)
    for value in np.unique(array[array > 0]):
        lines[resized_any(array == value, width, height)] = value
    return lines


def _with_scaled_pixels(
    layer: Layer, resized: NDArray[Any], shape: tuple[int, ...]
) -> NDArray[Any]:
    """Flow or disparity on another grid than that of shape (H, W ...), in the new grid's pixels."""
    scale = np.array([resized.shape[1] / shape[1], resized.shape[0] / shape[0]])
    if layer.shown_as == "flow_kitti":
        valid = resized[..., 2:] > 0
        steps = np.rint((resized[..., :2] - 2.0**15) * scale) + 2**15
        flow = np.where(valid, np.clip(steps, 0, 65535), 0)
        return np.concatenate([flow, resized[..., 2:]], axis=-1).astype(resized.dtype)
    if resized.ndim == 2:
        steps = np.clip(np.rint(resized * scale[0]), 1, 65535)
        return np.where(resized > 0, steps, 0).astype(resized.dtype)
    return np.asarray(resized * scale, resized.dtype)


def _instances_in(instance: NDArray[Any], rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows of the instances in a map (H, W), with their pixels and boxes."""
    visible = []
    for row in rows:
        mask = instance == row["id"]
        if not mask.any():
            continue
        # The box spans its rows and columns, the high end exclusive.
        y, x = np.nonzero(mask.any(1))[0], np.nonzero(mask.any(0))[0]
        box = [int(x[0]), int(y[0]), int(x[-1]) + 1, int(y[-1]) + 1]
        pixels = int(mask.sum())
        visible.append(row | {"pixels": pixels, "fraction": pixels / mask.size, "box2d": box})
    return visible


def _layout_row_at_size(row: dict[str, Any], x: float, y: float) -> dict[str, Any]:
    pixel = row.get("pixel")
    return row if not pixel else row | {"pixel": [pixel[0] * x, pixel[1] * y]}
