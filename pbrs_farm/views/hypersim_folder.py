"""Frames of a folder in the layout of Hypersim, as views: the original set or `export --to hypersim`.

Effects: reads the folder's files on demand. Pictures are tonemap.jpg, else the linear colour with
Hypersim's own tone mapping; depth along rays becomes planar, the world gets y up, units become metres.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import (
    OPENCV_FROM_OPENGL,
    PUBLISHED_FROM_OPENGL,
    affine,
    srgb_from_linear,
)
from pbrs_farm.core.house_split import SplitShares, split_of_house
from pbrs_farm.formats import hypersim
from pbrs_farm.images import decode_photo
from pbrs_farm.regular_files import read_given
from pbrs_farm.views.stored_layers import ViewFacts, array_names, check_array, sample_of_stored
from pbrs_farm.views.view_sample import Sample, SampleRequest
from pbrs_farm.views.views import ViewRef, Views

_SCENES: Final = "ai_*"
_FRAME: Final = re.compile(r"frame\.(\d{4})\.depth_meters\.hdf5")
_MODE: Final = "mlt_il_ol"  # mode of its pictures: all light
_DEPTH_MAX_MM: Final = 65535
_TILTED: Final = "a tilted projection, which K cannot describe"


class HypersimFolder:
    """The frames of a folder of scenes; a ViewSource. A view's id is `<camera>_<frame>`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._poses: dict[tuple[str, str], tuple[F64, F64]] = {}  # by trajectory, filled on demand

    @property
    def url(self) -> str:
        return str(self._folder)

    @cached_property
    def _frames(self) -> dict[ViewRef, tuple[str, int]]:
        """View -> its camera and frame."""
        frames = {}
        for folder in sorted(self._folder.glob(f"{_SCENES}/images/scene_*_geometry_hdf5")):
            scene, camera = folder.parts[-3], folder.name[len("scene_") : -len("_geometry_hdf5")]
            for file in sorted(folder.iterdir()):
                if match := _FRAME.fullmatch(file.name):
                    ref = ViewRef(scene, f"{camera}_{match[1]}")
                    frames[ref] = (camera, int(match[1]))
        return frames

    @cached_property
    def _rows(self) -> dict[str, Mapping[str, str]]:
        """Scene -> its row of the camera parameters; {} for a folder without the table."""
        return {
            row["scene_name"]: row
            for row in hypersim.table_rows(self._folder / hypersim.CAMERAS_CSV)
        }

    @cached_property
    def _splits(self) -> dict[ViewRef, Mapping[str, str]]:
        rows = hypersim.table_rows(self._folder / hypersim.SPLIT_CSV)
        return {
            ViewRef(r["scene_name"], f"{r['camera_name']}_{int(r['frame_id']):04d}"): r
            for r in rows
        }

    @property
    def refs(self) -> tuple[ViewRef, ...]:
        """All released frames of pinhole cameras, according to the folder's table."""
        return tuple(ref for ref in self._frames if ref.id not in self.unfit)

    @cached_property
    def unfit(self) -> dict[str, str]:
        """id -> reason, for frames excluded from refs."""
        tilted = {name for name, row in self._rows.items() if _intrinsics(row) is None}
        reasons = {ref.id: _TILTED for ref in self._frames if ref.house in tilted}
        for ref, row in self._splits.items():
            if ref in self._frames and row["included_in_public_release"] != "True":
                reasons[ref.id] = row["exclude_reason"] or "not in the public release"
        return reasons

    def lacks(self, ref: ViewRef, request: SampleRequest) -> str:
        for name in array_names(request.layers):
            if name == "colour":
                if not self.modes(ref):
                    return "tonemap.jpg"
                if request.mode != _MODE:
                    return f"{request.mode}.png"
            elif name != "boundary" and not self._file(ref, _file_of_array(name)).is_file():
                return f"{_file_of_array(name)}.hdf5"
        return ""

    def modes(self, ref: ViewRef) -> tuple[str, ...]:
        has = self._preview(ref).is_file() or self._file(ref, "color").is_file()
        return (_MODE,) if has else ()

    def facts(self, ref: ViewRef) -> ViewFacts:
        i, pose = self._intrinsics_of(ref), self._pose(ref)
        k = tuple(tuple(float(x) for x in row) for row in i.k)
        rows = tuple(tuple(float(x) for x in row) for row in pose)
        return ViewFacts(ref.house, ref.view, "", (i.width_px, i.height_px), k, rows)

    def table(self, ref: ViewRef) -> dict[str, Any]:
        facts = self.facts(ref)
        pose, has = np.array(facts.world_from_camera_opencv), self.layers(ref)
        empty = np.zeros((1, 1), np.int64)
        instance = self.layer(ref, "instance") if "instance" in has else empty
        class40 = self.layer(ref, "semantic") if "semantic" in has else np.zeros_like(instance)
        return {
            "house": ref.house,
            "view": ref.view,
            "width_px": facts.size[0],
            "height_px": facts.size[1],
            "K": [list(row) for row in facts.K],
            "world_from_camera_opencv": pose.tolist(),
            "world_from_camera_opengl": (pose @ OPENCV_FROM_OPENGL).tolist(),
            "instances": [_row(int(n), instance == n, class40) for n in np.unique(instance) if n],
        }

    def read(self, ref: ViewRef, request: SampleRequest) -> Sample:
        facts, arrays = self.facts(ref), {}
        for name in array_names(request.layers):
            if name == "colour":
                arrays[name] = self._colour(ref)
            else:
                arrays[name] = self.layer(ref, _layer_of_array(name))
            arrays[name] = check_array(name, arrays[name], facts.size, f"{self.url}: {ref.id}")
        return sample_of_stored(facts, arrays, request)

    def layers(self, ref: ViewRef) -> tuple[str, ...]:
        has = [n for n, (file, _of) in _LAYERS.items() if self._file(ref, file).is_file()]
        return (*self.modes(ref), *has, *(("boundary",) if "instance" in has else ()))

    def layer(self, ref: ViewRef, name: str) -> NDArray[Any]:
        if name not in self.layers(ref):
            hint = f"of {', '.join(self.layers(ref))}"
            raise BadInput(f"{self.url}: {ref.id}", "", f"no layer {name}", hint=hint)
        if name == _MODE:
            return self._colour(ref)
        if name == "boundary":
            from pbrs_farm.truth.boundary import instance_boundary

            return instance_boundary(self.layer(ref, "instance"))
        file, pixels_of = _LAYERS[name]
        return pixels_of(self._stored(ref, file), self._intrinsics_of(ref), self._metres(ref.house))

    def kept_by(self, run: str) -> frozenset[ViewRef]:
        raise BadInput(self.url, "", f"a Hypersim folder has no selection {run}")

    def split_of(self, ref: ViewRef, shares: SplitShares | None) -> str:
        row = self._splits.get(ref)
        if shares is None and row is not None and row["split_partition_name"]:
            return row["split_partition_name"]
        return split_of_house(ref.house, shares)

    def save(self, refs: Sequence[ViewRef], place: str | Path) -> None:
        hint = "it has no house.glb: read its frames as samples"
        raise BadInput(self.url, "", "frames of Hypersim are not views of a root", hint=hint)

    def _file(self, ref: ViewRef, name: str) -> Path:
        camera, frame = self._frames[ref]
        is_light = name in ("color", "diffuse_reflectance", "diffuse_illumination", "residual")
        folder = "final_hdf5" if is_light else "geometry_hdf5"
        return self._folder / ref.house / hypersim.frame_file(camera, frame, folder, f"{name}.hdf5")

    def _preview(self, ref: ViewRef) -> Path:
        camera, frame = self._frames[ref]
        name = hypersim.frame_file(camera, frame, "final_preview", "tonemap.jpg")
        return self._folder / ref.house / name

    def _stored(self, ref: ViewRef, name: str) -> NDArray[Any]:
        file, i = self._file(ref, name), self._intrinsics_of(ref)
        array = hypersim.read_dataset(file)
        if array.shape[:2] != (i.height_px, i.width_px):
            text = f"{array.shape}, expected {i.height_px} x {i.width_px}"
            raise BadInput(file, "dataset", text)
        return array

    def _colour(self, ref: ViewRef) -> NDArray[np.uint8]:
        preview = self._preview(ref)
        if preview.is_file():
            return decode_photo(read_given(preview), str(preview))
        has_surface = np.isfinite(self._stored(ref, "depth_meters"))
        colour = self._stored(ref, "color").astype(np.float32)
        return hypersim.preview(np.nan_to_num(colour), has_surface)

    def _intrinsics_of(self, ref: ViewRef) -> Intrinsics:
        row = self._rows.get(ref.house)
        intrinsics = None if row is None else _intrinsics(row)
        return intrinsics or hypersim.usual_intrinsics(hypersim.WIDTH_PX, hypersim.HEIGHT_PX)

    def _metres(self, scene: str) -> float:
        file = self._folder / scene / "_detail/metadata_scene.csv"
        rows = {row["parameter_name"]: list(row.values())[1] for row in hypersim.table_rows(file)}
        try:
            return float(rows["meters_per_asset_unit"])
        except (KeyError, ValueError):
            raise BadInput(file, "meters_per_asset_unit", "is missing") from None

    def _pose(self, ref: ViewRef) -> F64:
        """(4, 4) world_from_camera, OpenCV's axes, metres, y up."""
        camera, frame = self._frames[ref]
        key = (ref.house, camera)
        folder = self._folder / ref.house / "_detail" / camera
        if key not in self._poses:
            self._poses[key] = (
                hypersim.read_dataset(folder / "camera_keyframe_positions.hdf5"),
                hypersim.read_dataset(folder / "camera_keyframe_orientations.hdf5"),
            )
        positions, orientations = self._poses[key]
        if frame >= len(positions) or orientations.shape != (len(positions), 3, 3):
            raise BadInput(folder, "", f"{len(positions)} poses, and a frame {frame}")
        turn = hypersim.Z_UP.T
        place = turn @ positions[frame] * self._metres(ref.house)
        return np.asarray(affine(turn @ orientations[frame], place) @ OPENCV_FROM_OPENGL)


def _row(number: int, mask: NDArray[np.bool_], class40: NDArray[Any]) -> dict[str, Any]:
    """A row of view.json's instances from the pictures alone: its class is the commonest among its pixels."""
    nyu40 = int(np.bincount(class40[mask]).argmax())
    y, x = np.nonzero(mask.any(1))[0], np.nonzero(mask.any(0))[0]
    pixels = int(mask.sum())
    return {
        "id": number,
        "item": str(number),
        "name": NYU40_NAMES[nyu40],
        "kind": "object",
        "nyu40": nyu40,
        "class": NYU40_NAMES[nyu40],
        "pixels": pixels,
        "fraction": pixels / mask.size,
        "visible_fraction": None,
        "truncated": None,
        "box2d": [int(x[0]), int(y[0]), int(x[-1]) + 1, int(y[-1]) + 1],
    }


def _intrinsics(row: Mapping[str, str]) -> Intrinsics | None:
    matrix = [[float(row[f"M_cam_from_uv_{r}{c}"]) for c in range(3)] for r in range(3)]
    width, height = (int(float(row[f"settings_output_img_{x}"])) for x in ("width", "height"))
    return hypersim.intrinsics_of_uv(np.array(matrix), width, height)


def _layer_of_array(name: str) -> str:
    return {"class40": "semantic"}.get(name, name)


def _file_of_array(name: str) -> str:
    return _LAYERS[_layer_of_array(name)][0]


def _planar(stored: NDArray[Any], i: Intrinsics, _metres: float) -> NDArray[np.float32]:
    """(H, W) metres along the axis, 0 = nothing."""
    z = stored.astype(np.float64) / hypersim.ray_lengths(i)
    return np.where(np.isfinite(z) & (z > 0), z, 0).astype(np.float32)


def _millimetres(stored: NDArray[Any], i: Intrinsics, metres: float) -> NDArray[np.uint16]:
    z = _planar(stored, i, metres)
    rounded = np.clip(np.rint(z.astype(np.float64) * 1000), 1, _DEPTH_MAX_MM)
    return np.where(z > 0, rounded, 0).astype(np.uint16)


def _position(stored: NDArray[Any], _i: Intrinsics, metres: float) -> NDArray[np.float32]:
    world = stored.astype(np.float64) @ hypersim.Z_UP * metres
    return world.astype(np.float32)


def _unit(stored: NDArray[Any], i: Intrinsics) -> F64:
    """(H, W, 3) unit normals towards the camera, (0, 0, 0) for pixels without a normal."""
    normal = np.nan_to_num(stored.astype(np.float64))
    x, y = np.meshgrid(np.arange(i.width_px) + 0.5, np.arange(i.height_px) + 0.5)
    rays = np.stack([(x - i.cx) / i.fx, -(y - i.cy) / i.fy, -np.ones_like(x)], axis=-1)
    normal = np.where((normal * rays).sum(-1, keepdims=True) > 0, -normal, normal)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.asarray(np.where(length > 0.5, normal / np.maximum(length, 0.5), 0))


def _normal(stored: NDArray[Any], i: Intrinsics, _metres: float) -> NDArray[np.uint16]:
    published = _unit(stored, i) @ PUBLISHED_FROM_OPENGL.T
    return np.rint((published + 1) * (65535 / 2)).clip(0, 65535).astype(np.uint16)


def _valid(stored: NDArray[Any], i: Intrinsics, _metres: float) -> NDArray[np.uint8]:
    return np.where(_unit(stored, i).any(-1), 255, 0).astype(np.uint8)


def _class40(stored: NDArray[Any], _i: Intrinsics, _metres: float) -> NDArray[np.uint8]:
    return np.where((stored > 0) & (stored <= 40), stored, 0).astype(np.uint8)


def _instance(stored: NDArray[Any], _i: Intrinsics, _metres: float) -> NDArray[np.uint16]:
    return np.where(stored > 0, stored, 0).astype(np.uint16)


def _albedo(stored: NDArray[Any], _i: Intrinsics, _metres: float) -> NDArray[np.uint8]:
    linear = np.clip(np.nan_to_num(stored.astype(np.float64)), 0, 1)
    return np.rint(255 * srgb_from_linear(linear)).astype(np.uint8)


_LayerOf = Callable[[NDArray[Any], Intrinsics, float], NDArray[Any]]
_LAYERS: Final[Mapping[str, tuple[str, _LayerOf]]] = {
    "depth": ("depth_meters", _millimetres),
    "depth_z": ("depth_meters", _planar),
    "position": ("position", _position),
    "normal": ("normal_cam", _normal),
    "valid": ("normal_cam", _valid),
    "normal_shading": ("normal_bump_cam", _normal),
    "semantic": ("semantic", _class40),
    "instance": ("semantic_instance", _instance),
    "albedo": ("diffuse_reflectance", _albedo),
}
"""Layer of core/layers.py -> its file in a frame, and its pixels from that."""


def is_hypersim(folder: Path) -> bool:
    """True if a folder holds scenes in that layout."""
    return next(folder.glob(f"{_SCENES}/images/scene_*_geometry_hdf5"), None) is not None


def views_of_hypersim(folder: Path) -> Views:
    """The frames of a folder of scenes; unreleased frames and those without a pinhole are in left_out."""
    source = HypersimFolder(folder)
    if not source.refs:
        why = next(iter(source.unfit.values()), "no frame has depth_meters")
        raise BadInput(folder, "", f"no view of Hypersim: {why}")
    return Views(source, source.refs, source.unfit)
