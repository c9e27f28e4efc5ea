"""Photographs become a reference from a folder of pairs or NYUv2's .mat; every fault names its file."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from pbrs_farm import images
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import HistogramFields, SelectionFields
from pbrs_farm.curate.photographs import NyuMat, pairs_in, photo_from_pair
from pbrs_farm.curate.reference_build import PhotoOptions, build_reference, read_reference
from pbrs_farm.selection.reference_set import (
    bytes_from_reference,
    registration_border,
    sun_rgbd_depth,
)

FIELDS, LIMITS = HistogramFields(), SelectionFields()


def photo(seed: int, size: tuple[int, int] = (24, 32)) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    rgb = (rng.integers(40, 200, 3) + rng.integers(0, 20, (*size, 3))).astype(np.uint8)
    return rgb, rng.integers(600, 5000, size).astype(np.uint16)


def write_pair(root: Path, name: str, seed: int) -> None:
    rgb, depth = photo(seed)
    for folder, pixels in (("rgb", rgb), ("depth", depth)):
        (root / folder).mkdir(parents=True, exist_ok=True)
        (root / folder / f"{name}.png").write_bytes(images.png_from_array(pixels))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k in range(3):
        write_pair(tmp_path / "photos", f"p{k}", k)
    return tmp_path / "photos"


def write_mat(path: Path, n: int = 3, **change: np.ndarray) -> Path:
    pairs = [photo(k) for k in range(n)]
    tables = {
        "images": np.stack([rgb.transpose(2, 1, 0) for rgb, _ in pairs]),
        "depths": np.stack([depth.T.astype(np.float32) / 1000 for _, depth in pairs]),
    }
    with h5py.File(path, "w") as file:
        for name, table in (tables | change).items():
            file[name] = table
    return path


def test_a_folder_and_a_mat_of_the_same_photographs_give_the_same_histograms(
    folder: Path, tmp_path: Path
) -> None:
    a = build_reference(folder, FIELDS, LIMITS)
    b = build_reference(write_mat(tmp_path / "nyu.mat"), FIELDS, LIMITS)
    assert a.facts.ids == ("p0", "p1", "p2")
    assert b.facts.ids == ("0001", "0002", "0003")
    assert np.array_equal(a.colour, b.colour)
    assert np.array_equal(a.depth, b.depth)
    assert a.colour.sum(axis=1).tolist() == [24 * 32] * 3


def test_the_reference_file_is_small_and_the_same_each_time(folder: Path) -> None:
    data = bytes_from_reference(build_reference(folder, FIELDS, LIMITS))
    assert data == bytes_from_reference(build_reference(folder, FIELDS, LIMITS))
    assert len(data) < 20_000
    (folder / "ref.npz").write_bytes(data)
    assert read_reference(folder / "ref.npz").facts.source == "photos"


def test_the_source_hash_changes_with_any_file(folder: Path) -> None:
    before = build_reference(folder, FIELDS, LIMITS).facts.source_sha256
    write_pair(folder, "p1", 77)
    assert build_reference(folder, FIELDS, LIMITS).facts.source_sha256 != before


def test_pairs_are_found_by_folder_by_suffix_and_as_sun_rgbd(tmp_path: Path) -> None:
    rgb, depth = photo(0)
    for name, pixels in (
        ("a/color/1.png", rgb), ("a/depth/1.png", depth),
        ("b/7_rgb.png", rgb), ("b/7_depth.png", depth), ("b/8.png", rgb), ("b/8_depth.png", depth),
        ("kv2/s1/image/0000101.jpg", rgb), ("kv2/s1/depth/0000101-x.png", depth),
        ("kv2/s1/depth_bfx/0000101-x.png", depth),
    ):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        encode = images.jpeg_from_array if name.endswith("jpg") else images.png_from_array
        (tmp_path / name).write_bytes(encode(pixels))
    (tmp_path / "b/notes.txt").write_text("not a picture")
    pairs = pairs_in(tmp_path)
    assert [p.id for p in pairs] == ["a/1", "b/7", "b/8", "kv2/s1"]
    assert pairs[3].depth.parent.name == "depth_bfx"


def test_sun_rgbd_bits_are_rotated_back() -> None:
    mm = np.array([[1234, 8000, 0, 65528]], np.uint16)
    stored = (mm << np.uint16(3)) | (mm >> np.uint16(13))
    assert np.array_equal(sun_rgbd_depth(stored), mm)


def test_depth_scale_and_floats_become_millimetres(tmp_path: Path) -> None:
    rgb, _ = photo(0)
    (tmp_path / "x_rgb.png").write_bytes(images.png_from_array(rgb))
    np.save(tmp_path / "x_depth.npy", np.full((24, 32), 1.5, np.float32))
    (pair,) = pairs_in(tmp_path)
    assert (photo_from_pair(pair, depth_scale=None, sun_rgbd=False).depth_mm == 1500).all()
    (tmp_path / "x_depth.npy").unlink()
    (tmp_path / "x_depth.png").write_bytes(
        images.png_from_array(np.full((24, 32), 7500, np.uint16))
    )
    (pair,) = pairs_in(tmp_path)
    assert (photo_from_pair(pair, depth_scale=5000, sun_rgbd=False).depth_mm == 1500).all()


def test_white_and_black_borders_are_cropped_and_nothing_else() -> None:
    rgb = np.full((80, 96, 3), 120, np.uint8)
    rgb[:5], rgb[-7:], rgb[:, :3], rgb[:, -8:] = 255, 0, 252, 4
    assert registration_border(rgb) == (slice(5, 73), slice(3, 88))
    assert registration_border(np.full((80, 96, 3), 120, np.uint8)) == (slice(0, 80), slice(0, 96))
    white = np.full((80, 96, 3), 255, np.uint8)
    assert registration_border(white) == (slice(10, 70), slice(12, 84))


def test_the_border_is_excluded_from_the_histogram_by_default(tmp_path: Path) -> None:
    for k in range(2):
        rgb, depth = photo(k)
        rgb[:2] = 255
        for name, pixels in (("rgb", rgb), ("depth", depth)):
            (tmp_path / f"{k}_{name}.png").write_bytes(images.png_from_array(pixels))
    cropped = build_reference(tmp_path, FIELDS, LIMITS)
    whole = build_reference(tmp_path, FIELDS, LIMITS, PhotoOptions(crop=False))
    assert cropped.depth.sum() == 2 * 22 * 32
    assert whole.depth.sum() == 2 * 24 * 32


def test_half_a_pair_is_named(folder: Path) -> None:
    (folder / "depth/p1.png").unlink()
    with pytest.raises(BadInput, match=r"rgb/p1\.png.*only one half"):
        build_reference(folder, FIELDS, LIMITS)


def test_half_a_pair_by_suffix_is_named(tmp_path: Path) -> None:
    (tmp_path / "k_depth.png").write_bytes(images.png_from_array(photo(0)[1]))
    with pytest.raises(BadInput, match=r"k_depth\.png.*only one half"):
        pairs_in(tmp_path)


def test_sizes_that_differ_are_named(folder: Path) -> None:
    (folder / "depth/p2.png").write_bytes(images.png_from_array(np.ones((10, 12), np.uint16)))
    with pytest.raises(BadInput, match=r"depth/p2\.png.*12x10, the picture 32x24"):
        build_reference(folder, FIELDS, LIMITS)


def test_nan_depth_is_named(folder: Path, tmp_path: Path) -> None:
    (folder / "depth/p0.png").unlink()
    np.save(folder / "depth/p0.npy", np.full((24, 32), np.nan, np.float32))
    with pytest.raises(BadInput, match=r"p0\.npy.*not finite"):
        build_reference(folder, FIELDS, LIMITS)
    depths = np.ones((3, 32, 24), np.float32)
    depths[1, 5, 5] = np.nan
    mat = write_mat(tmp_path / "nyu.mat", depths=depths)
    with pytest.raises(BadInput, match=r"nyu\.mat: image 2: 1 pixels"):
        build_reference(mat, FIELDS, LIMITS)


def test_damaged_pictures_are_named(folder: Path) -> None:
    data = (folder / "rgb/p1.png").read_bytes()
    (folder / "rgb/p1.png").write_bytes(data[:60])
    with pytest.raises(BadInput, match=r"rgb/p1\.png"):
        build_reference(folder, FIELDS, LIMITS)


def test_empty_and_missing_sources_are_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="has no RGB-D pairs"):
        build_reference(tmp_path, FIELDS, LIMITS)
    with pytest.raises(BadInput, match=r"nowhere.*no such"):
        build_reference(tmp_path / "nowhere", FIELDS, LIMITS)
    with pytest.raises(BadInput, match="has no image"):
        build_reference(write_mat_empty(tmp_path / "empty.mat"), FIELDS, LIMITS)
    with pytest.raises(BadInput, match=r"ref\.npz.*no such file"):
        read_reference(tmp_path / "ref.npz")


def write_mat_empty(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        file["images"] = np.zeros((0, 3, 32, 24), np.uint8)
        file["depths"] = np.zeros((0, 32, 24), np.float32)
    return path


def test_the_fault_of_a_wrong_mat_is_named(tmp_path: Path) -> None:
    good = write_mat(tmp_path / "good.mat").read_bytes()
    cases = {
        "cut.mat": (good[: len(good) // 2], "truncated"),
        "five.mat": (b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(200), "MATLAB 5 file"),
        "text.mat": (b"hello" * 100, r"not a MATLAB 7\.3"),
    }
    for name, (data, text) in cases.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(BadInput, match=rf"{name}.*{text}"):
            NyuMat(tmp_path / name)


def test_a_mat_with_other_tables_is_named(tmp_path: Path) -> None:
    other_mat = write_mat(tmp_path / "a.mat", images=np.zeros((3, 32, 24), np.uint8))
    with pytest.raises(BadInput, match=r"images.*expected 4 axes"):
        NyuMat(other_mat)
    other_mat = write_mat(tmp_path / "b.mat", depths=np.zeros((3, 32, 25), np.float32))
    with pytest.raises(BadInput, match=r"depths.*sizes differ"):
        NyuMat(other_mat)
    with h5py.File(tmp_path / "c.mat", "w") as file:
        file["labels"] = np.zeros(3)
    with pytest.raises(BadInput, match="images: missing"):
        NyuMat(tmp_path / "c.mat")


def test_the_mat_is_read_one_image_at_a_time(tmp_path: Path) -> None:
    with NyuMat(write_mat(tmp_path / "nyu.mat")) as mat:
        first = next(mat.photos())
        assert len(mat) == 3
    rgb, depth = photo(0)
    assert np.array_equal(first.rgb, rgb)
    assert np.array_equal(first.depth_mm, depth)
