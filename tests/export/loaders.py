"""Loaders for the formats of training programs, written only from those programs' documentation.

They use no code of the package: their results are compared with the stored layers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import OpenImageIO
import pandas as pd
import yaml
from PIL import Image


@dataclass
class Example:
    """One sample from a loader."""

    name: str  # of its picture file
    rgb: np.ndarray  # (H, W, 3) uint8
    target: np.ndarray | tuple[np.ndarray, ...]


def picture(file: Path) -> np.ndarray:
    """A picture as its program opens it; the caller checks its type and size."""
    return np.asarray(Image.open(file))


def pictures_of_yolo(yaml_file: Path, split: str) -> tuple[dict, list[Path]]:
    """data.yaml and the pictures of a split: folders are relative to `path`, else to the file."""
    fields = yaml.safe_load(yaml_file.read_text())
    root = Path(fields.get("path", yaml_file.parent))
    files = sorted((root / fields[split]).iterdir())
    assert files
    return fields, files


def beside(file: Path, folder: str) -> Path:
    """The file at the same place with the last path component `images` replaced."""
    parts = list(file.parts)
    index = len(parts) - 1 - parts[::-1].index("images")
    return Path(*parts[:index], folder, *parts[index + 1 :])


def yolo_depth(yaml_file: Path, split: str) -> Iterator[Example]:
    """Depth in metres, with 0 and below invalid: PNG (2D uint16 over depth_scale), else NPY (2D floats)."""
    fields, files = pictures_of_yolo(yaml_file, split)
    assert fields["nc"] == 1
    assert fields["names"] == {0: "depth"}
    for file in files:
        rgb, png = picture(file), beside(file, "depth").with_suffix(".png")
        if png.is_file():
            stored = picture(png)
            assert stored.dtype == np.uint16
            depth = stored / float(fields.get("depth_scale", 1000))
        else:
            depth = np.load(png.with_suffix(".npy"))
            assert np.issubdtype(depth.dtype, np.floating)
        assert depth.shape == rgb.shape[:2]
        yield Example(file.stem, rgb, depth)


def yolo_semantic(yaml_file: Path, split: str) -> Iterator[Example]:
    """Class name of each pixel, "" where ignored: one channel of indices of `names`, 255 = ignored."""
    fields, files = pictures_of_yolo(yaml_file, split)
    names = np.array([fields["names"].get(k, "unknown") for k in range(255)] + [""])
    for file in files:
        mask = picture(beside(file, fields["masks_dir"]).with_suffix(".png"))
        assert mask.dtype == np.uint8
        assert mask.ndim == 2
        yield Example(file.stem, picture(file), names[mask])


def marigold(folder: Path, list_file: str) -> Iterator[Example]:
    """Depth in metres from 16-bit PNG of millimetres, or normals from NPY; one line per sample."""
    for line in (folder / list_file).read_text().splitlines():
        rgb_path, path = line.split()
        rgb = picture(folder / rgb_path)
        assert rgb.dtype == np.uint8
        if path.endswith(".npy"):
            yield Example(rgb_path, rgb, np.load(folder / path))
        else:
            stored = picture(folder / path)
            assert stored.dtype == np.uint16
            yield Example(rgb_path, rgb, stored / 1000.0)


def marigold_lighting(folder: Path, list_file: str) -> Iterator[Example]:
    """Albedo, shading and residual, linear (H, W, 3), from NPY files without pickles."""
    for line in (folder / list_file).read_text().splitlines():
        rgb_path, *targets = line.split()
        assert [Path(p).name.split("_")[0] for p in targets] == ["albedo", "shading", "residual"]
        arrays = tuple(np.load(folder / path) for path in targets)
        assert all(a.ndim == 3 and a.dtype == np.float32 for a in arrays)
        yield Example(rgb_path, picture(folder / rgb_path), arrays)


def marigold_appearance(folder: Path, list_file: str) -> Iterator[Example]:
    """Albedo in sRGB, roughness in red, metallic in green, and the validity mask of three channels."""
    for line in (folder / list_file).read_text().splitlines():
        rgb_path, albedo, material, mask = line.split()
        exr = OpenImageIO.ImageBuf(str(folder / material))
        pixels = np.asarray(exr.get_pixels(OpenImageIO.FLOAT))
        planes = {name: pixels[..., k] for k, name in enumerate(exr.spec().channelnames)}
        three = picture(folder / mask)
        assert three.ndim == 3
        parts = picture(folder / albedo), planes["R"], planes["G"], three.all(axis=-1)
        yield Example(rgb_path, picture(folder / rgb_path), parts)


def horizonnet(folder: Path) -> Iterator[Example]:
    """Corners (2 N, 2) in pixels of 1024 x 512: odd rows are on the ceiling, even ones on the floor.

    Longitude is ((x + 0.5) / W - 0.5) 2 pi, latitude downwards ((y + 0.5) / H - 0.5) pi.
    """
    for file in sorted((folder / "img").iterdir()):
        rgb = picture(file)
        assert rgb.shape == (512, 1024, 3)
        text = (folder / "label_cor" / f"{file.name[:-4]}.txt").read_text()
        corners = np.array([line.split() for line in text.splitlines() if line.strip()], np.float32)
        assert (corners[0::2, 0] == corners[1::2, 0]).all()
        assert (corners[0::2, 1] < corners[1::2, 1]).all()
        yield Example(file.stem, rgb, corners)


@dataclass
class HypersimFrame:
    """A frame of Hypersim with its camera; world and positions in asset units, z up."""

    scene: Path
    camera: str
    frame: int
    split: str
    row: pd.Series  # of the camera parameters

    def hdf5(self, folder: str, name: str) -> np.ndarray:
        """A data set of one of the frame's files."""
        file = f"images/scene_{self.camera}_{folder}/frame.{self.frame:04d}.{name}.hdf5"
        with h5py.File(self.scene / file, "r") as opened:
            assert list(opened) == ["dataset"]
            return opened["dataset"][:]

    def has(self, folder: str, name: str) -> bool:
        """Whether the frame has that file."""
        file = f"images/scene_{self.camera}_{folder}/frame.{self.frame:04d}.{name}"
        return (self.scene / file).is_file()

    def preview(self, name: str) -> np.ndarray:
        """A lossy preview picture."""
        file = f"images/scene_{self.camera}_final_preview/frame.{self.frame:04d}.{name}.jpg"
        return picture(self.scene / file)

    def detail(self, name: str) -> np.ndarray:
        """A data set of the scene."""
        with h5py.File(self.scene / "_detail" / f"{name}.hdf5", "r") as opened:
            return opened["dataset"][:]

    @property
    def metres(self) -> float:
        """Length of an asset unit in metres."""
        table = pd.read_csv(self.scene / "_detail/metadata_scene.csv", index_col="parameter_name")
        return float(table.loc["meters_per_asset_unit"].iloc[0])

    @property
    def pose(self) -> np.ndarray:
        """(4, 4) world_from_camera, camera x right, y up, z backward."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.detail(f"{self.camera}/camera_keyframe_orientations")[self.frame]
        matrix[:3, 3] = self.detail(f"{self.camera}/camera_keyframe_positions")[self.frame]
        return matrix

    def matrix(self, name: str, n: int) -> np.ndarray:
        """A matrix of the camera parameters."""
        return np.array([[self.row[f"{name}_{r}{c}"] for c in range(n)] for r in range(n)])

    @property
    def rays(self) -> np.ndarray:
        """(H, W, 3) rays through the pixels' centres, camera axes: v counts upwards."""
        h, w = (int(self.row[f"settings_output_img_{x}"]) for x in ("height", "width"))
        u = (np.arange(w) + 0.5) / w * 2 - 1
        v = 1 - (np.arange(h) + 0.5) / h * 2
        uv = np.stack([*np.meshgrid(u, v), np.ones((h, w))], axis=-1)
        return uv @ self.matrix("M_cam_from_uv", 3).T

    @property
    def planar_depth(self) -> np.ndarray:
        """(H, W) metres along the axis, NaN without a surface."""
        rays = self.rays
        return (
            -rays[..., 2]
            / np.linalg.norm(rays, axis=-1)
            * self.hdf5("geometry_hdf5", "depth_meters")
        )

    def pixels_of(self, points: np.ndarray) -> np.ndarray:
        """(N, 2) pixel coordinates of world points by M_proj, from the corner of the picture."""
        h, w = (int(self.row[f"settings_output_img_{x}"]) for x in ("height", "width"))
        local = np.linalg.inv(self.pose) @ np.concatenate([points, np.ones((len(points), 1))], 1).T
        clip = self.matrix("M_proj", 4) @ local
        ndc = clip[:2] / clip[3]
        return np.stack([(ndc[0] + 1) / 2 * w, (1 - ndc[1]) / 2 * h], axis=1)


def hypersim(root: Path) -> Iterator[HypersimFrame]:
    """The frames of the public release, as the split table lists them."""
    rows = pd.read_csv(root / "metadata_images_split_scene_v1.csv")
    cameras = pd.read_csv(root / "metadata_camera_parameters.csv", index_col="scene_name")
    for row in rows[rows.included_in_public_release].itertuples():
        scene = root / row.scene_name
        names = pd.read_csv(scene / "_detail/metadata_cameras.csv").camera_name
        assert row.camera_name in set(names)
        split = row.split_partition_name
        yield HypersimFrame(
            scene, row.camera_name, row.frame_id, split, cameras.loc[row.scene_name]
        )


def ply_cloud(file: Path) -> pd.DataFrame:
    """The vertices of a binary PLY, read according to its specification."""
    kinds = {"float": "<f4", "uchar": "u1", "ushort": "<u2"}
    head, _, body = file.read_bytes().partition(b"end_header\n")
    words = [line.split() for line in head.decode().splitlines()]
    assert words[:2] == [["ply"], ["format", "binary_little_endian", "1.0"]]
    (n,) = [int(w[2]) for w in words if w[0] == "element"]
    dtype = np.dtype([(w[2], kinds[w[1]]) for w in words if w[0] == "property"])
    assert len(body) == n * dtype.itemsize
    return pd.DataFrame(np.frombuffer(body, dtype))


def pcd_cloud(file: Path) -> tuple[pd.DataFrame, np.ndarray]:
    """The points of a binary PCD 0.7, and its viewpoint (4, 4), according to PCL's page of the format."""
    head, _, body = file.read_bytes().partition(b"DATA binary\n")
    rows = [line.split() for line in head.decode().splitlines() if not line.startswith("#")]
    fields = {row[0]: row[1:] for row in rows}
    assert fields["VERSION"] == ["0.7"]
    letters = {"F": "f", "U": "u", "I": "i"}
    assert set(fields["COUNT"]) == {"1"}
    dtype = np.dtype([
        (name, f"<{letters[kind]}{size}")
        for name, kind, size in zip(fields["FIELDS"], fields["TYPE"], fields["SIZE"], strict=True)
    ])  # fmt: skip
    n = int(fields["WIDTH"][0]) * int(fields["HEIGHT"][0])
    assert n == int(fields["POINTS"][0])
    assert len(body) == n * dtype.itemsize
    tx, ty, tz, w, x, y, z = map(float, fields["VIEWPOINT"])
    pose = np.eye(4)
    pose[:3, :3] = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    pose[:3, 3] = tx, ty, tz
    return pd.DataFrame(np.frombuffer(body, dtype)), pose
