"""Hypersim's layout, read back by a loader written from its documentation only, and by our reader."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pandas as pd
import pytest

import pbrs_farm as pf
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares, split_of_house
from pbrs_farm.core.optics_fields import LensFields
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.export_views import export
from pbrs_farm.export.forms import hypersim as hypersim_form
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.formats.radiance_exr import radiance_exr
from pbrs_farm.images import png_from_array
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.check.roots import SIZE, make_root
from tests.export import loaders

SHARES = SplitShares(0.5, 0.5, 0)
Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # from y up to z up


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two homes in different splits; views with pictures and light, one with a camera off the middle."""
    folder, base, done = tmp_path_factory.mktemp("finished"), builtin_home(), set[str]()
    rng = np.random.default_rng(5)
    for name in (f"home{k}" for k in range(99)):
        split = split_of_house(name, SHARES)
        if split in done:
            continue
        off = Intrinsics(*SIZE, 110.0, 120.0, 60.0, 50.0)
        plain = {f"v{k}": c for k, c in enumerate(base.cameras)}
        cameras = {
            key: Camera.look(off if key == "v1" else Intrinsics.from_hfov(*SIZE), c.eye, c.towards)
            for key, c in plain.items()
        }
        house = make_root(folder, replace(base, id=name), cameras, with_optional=not done)
        for view in sorted((house / "views").iterdir()):
            picture = np.full((SIZE[1], SIZE[0], 3), 120, np.uint8)
            (view / "mlt_il_ol.png").write_bytes(png_from_array(picture))
            light = {
                n: rng.random((SIZE[1], SIZE[0], 3), np.float32) for n in ("outdoor", "indoor")
            }
            light["outdoor"][0, 0] = 1e6  # the sun: more than a half float can hold
            light |= dict.fromkeys(("albedo", "normal"), light["indoor"])
            (view / "radiance.exr").write_bytes(radiance_exr(light))
            np.save(view / "light.npy", light["outdoor"] + light["indoor"])
        done.add(split)
        if len(done) == 2:
            break
    return folder


@pytest.fixture(scope="module")
def written(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("set") / "hypersim"
    n_views, n_files = export(root, out, "hypersim", shares=SHARES)
    assert n_views == 4
    assert n_files == sum(p.is_file() for p in out.rglob("*"))
    return out


def view_of(root: Path, written: Path, frame: loaders.HypersimFrame) -> Path:
    rows = pd.read_csv(written / "index.csv")
    row_mask = (rows.scene_name == frame.scene.name) & (rows.camera_name == frame.camera)
    row = rows[row_mask & (rows.frame_id == frame.frame)].iloc[0]
    return root / "houses" / row["house"] / "views" / row["view"]


def stored(view: Path, name: str) -> np.ndarray:
    file = view / (f"{name}.png" if (view / f"{name}.png").exists() else f"{name}.exr")
    return layer_from_bytes(name, file.read_bytes(), str(file))


def test_a_scene_is_one_home_and_pinhole_and_the_table_has_the_splits(root, written):
    frames = list(loaders.hypersim(written))
    assert [f.scene.name for f in frames] == [
        "ai_001_001",
        "ai_001_002",
        "ai_001_003",
        "ai_001_004",
    ]
    for frame in frames:
        assert frame.split == split_of_house(view_of(root, written, frame).parts[-3], SHARES)
    assert sorted({p.name for p in written.iterdir() if p.is_dir()}) == [
        f.scene.name for f in frames
    ]
    card = (written / "README.md").read_text()
    assert "Frames: 4. Scenes: 4." in card
    assert "does NOT hold" in card


def test_depth_is_along_the_ray_and_positions_are_on_it(root, written):
    for frame in loaders.hypersim(written):
        view = view_of(root, written, frame)
        facts = json.loads((view / "view.json").read_text())
        exact = (view / "depth_z.exr").exists()
        depth = stored(view, "depth_z") if exact else stored(view, "depth") / 1000
        np.testing.assert_allclose(frame.planar_depth[depth > 0], depth[depth > 0], rtol=1e-6)
        assert np.isnan(frame.planar_depth[depth == 0]).all()
        # Poses and projections agree: each point projects to the centre of its pixel.
        position = frame.hdf5("geometry_hdf5", "position")
        y, x = np.nonzero(depth > 0)
        pixels = frame.pixels_of(position[y, x])
        np.testing.assert_allclose(pixels, np.stack([x + 0.5, y + 0.5], axis=1), atol=1e-3)
        pose = np.array(facts["world_from_camera_opengl"])
        np.testing.assert_allclose(frame.pose[:3, 3], Z_UP @ pose[:3, 3], atol=1e-12)
        if exact:
            np.testing.assert_allclose(
                position[y, x], stored(view, "position")[y, x] @ Z_UP.T, atol=1e-3
            )


def test_labels_are_those_of_the_view(root, written):
    for frame in loaders.hypersim(written):
        view = view_of(root, written, frame)
        for name, layer in (("semantic", "semantic"), ("semantic_instance", "instance")):
            label, mine = frame.hdf5("geometry_hdf5", name), stored(view, layer).astype(int)
            assert label.dtype == np.int16
            np.testing.assert_array_equal(label, np.where(mine > 0, mine, -1))
        entity = frame.hdf5("geometry_hdf5", "render_entity_id")
        assert (entity != 0).all()
        np.testing.assert_array_equal(entity == -1, stored(view, "instance") == 0)
        # Normals face the camera, and their rotation to the world is consistent.
        local, valid = frame.hdf5("geometry_hdf5", "normal_cam"), stored(view, "valid") > 0
        published = stored(view, "normal") * (2 / 65535) - 1
        mine = np.stack([published[..., 0], published[..., 2], -published[..., 1]], axis=-1)
        np.testing.assert_allclose(local[valid], mine[valid], atol=1e-4)
        world = frame.hdf5("geometry_hdf5", "normal_world")
        np.testing.assert_allclose(world, local @ frame.pose[:3, :3].T, atol=1e-5)
        assert (
            frame.has("geometry_hdf5", "normal_bump_cam.hdf5")
            == (view / "normal_shading.png").exists()
        )


def test_boxes_enclose_the_visible_points(written):
    n_things = 0
    for frame in loaders.hypersim(written):
        name = "mesh/metadata_semantic_instance_bounding_box_object_aligned_2d"
        centre, size, turn = (
            frame.detail(f"{name}_{x}") for x in ("positions", "extents", "orientations")
        )
        instance, points = (
            frame.hdf5("geometry_hdf5", x) for x in ("semantic_instance", "position")
        )
        for number in np.unique(instance[instance > 0]):
            assert np.linalg.det(turn[number]) == pytest.approx(1)
            assert turn[number][2, 2] > 0.7
            local = (points[instance == number] - centre[number]) @ turn[number]
            assert (np.abs(local) <= size[number] / 2 + 0.01).all()
            n_things += 1
    assert n_things > 20


def test_colour_is_the_light_of_the_picture_in_half_floats(root, written):
    for frame in loaders.hypersim(written):
        colour = frame.hdf5("final_hdf5", "color")
        assert colour.dtype == np.float16
        light = np.load(view_of(root, written, frame) / "light.npy")
        np.testing.assert_allclose(colour, np.minimum(light, 65504), rtol=1e-3)
        assert frame.preview("tonemap").mean() == pytest.approx(120, abs=1)
        # A tenth of the picture is brighter than 0.8.
        shown = frame.preview("color").astype(float)
        assert np.percentile(shown @ [0.3, 0.59, 0.11], 90) == pytest.approx(0.8 * 255, abs=12)
        assert not frame.has("final_hdf5", "residual.hdf5")


@pytest.mark.parametrize(("picture", "ending"), [("mlt_il_ol", ""), ("mlt_ol", "_outdoor")])
def test_intrinsic_layers_sum_up_to_the_colour_in_half_floats(picture: str, ending: str) -> None:
    rng = np.random.default_rng(2)
    arrays = {
        "albedo": rng.integers(0, 256, (6, 8, 3)).astype(np.uint8),
        f"shading{ending}": (40 * rng.random((6, 8, 3))).astype(np.float32),
        f"residual{ending}": (rng.random((6, 8, 3)) - 0.3).astype(np.float32),
    }
    srgb = arrays["albedo"] / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    radiance = linear * arrays[f"shading{ending}"] + arrays[f"residual{ending}"]
    view = cast(
        ChosenView,
        SimpleNamespace(has=arrays.__contains__, array=arrays.__getitem__, picture=picture),
    )
    light = hypersim_form.light_layers(view)
    assert set(light) == {"color", "diffuse_reflectance", "diffuse_illumination", "residual"}
    total = (
        light["diffuse_reflectance"].astype(float) * light["diffuse_illumination"]
        + light["residual"]
    )
    np.testing.assert_allclose(light["color"], total, rtol=1e-3, atol=1e-3)
    # The linear light, without negative values, as Marigold's preparation requires.
    np.testing.assert_allclose(light["color"], np.maximum(radiance, 0), rtol=2e-3, atol=2e-3)
    assert min(array.min() for array in light.values()) >= 0
    is_rest = arrays[f"residual{ending}"] >= 0
    for name, layer in (("diffuse_illumination", "shading"), ("residual", "residual")):
        stored = arrays[f"{layer}{ending}"]
        np.testing.assert_allclose(light[name][is_rest], stored[is_rest], rtol=1e-3)
    np.testing.assert_allclose(light["diffuse_reflectance"], linear, rtol=2e-3, atol=1e-5)


def test_our_reader_gives_the_views_again(root, written):
    frames = pf.open(written)
    assert len(frames) == 4
    for frame, loaded in zip(frames, loaders.hypersim(written), strict=True):
        view = view_of(root, written, loaded)
        facts = json.loads((view / "view.json").read_text())
        assert frame.id == f"{loaded.scene.name}/{loaded.camera}_{loaded.frame:04d}"
        np.testing.assert_allclose(frame.k, facts["K"], atol=1e-9)
        pose = facts["world_from_camera_opencv"]
        np.testing.assert_allclose(frame.world_from_camera_opencv, pose, atol=1e-12)
        for name in ("semantic", "instance", "boundary"):
            np.testing.assert_array_equal(frame.layer(name), stored(view, name))
        assert np.abs(frame.layer("depth").astype(int) - stored(view, "depth")).max() <= 1
        off = np.abs(frame.layer("normal").astype(int) - stored(view, "normal"))
        assert off[stored(view, "valid") > 0].max() <= 8
        sample = frame.sample(pf.SampleRequest(layers=("colour", "depth", "normal", "class40")))
        assert sample.colour.mean() == pytest.approx(120, abs=1)
        assert sample.depth.dtype == np.float32
        rows = {r["id"]: r for r in facts["instances"]}
        assert {r["id"] for r in frame.instances} == set(rows)
        for row in frame.instances:
            mine = rows[row["id"]]
            assert (row["pixels"], row["box2d"]) == (mine["pixels"], mine["box2d"])
            assert row["class"] == mine["class"]
            assert frame.mask(row["id"]).sum() == row["pixels"]
    assert len(frames.only(split="train")) == 2


def test_frames_that_no_pinhole_saw_or_that_are_not_released_are_left_out(written, tmp_path):
    import shutil

    folder = tmp_path / "copy"
    shutil.copytree(written, folder)
    cameras = pd.read_csv(folder / "metadata_camera_parameters.csv")
    cameras.loc[0, "M_cam_from_uv_21"] = 0.004
    cameras.to_csv(folder / "metadata_camera_parameters.csv", index=False)
    rows = pd.read_csv(folder / "metadata_images_split_scene_v1.csv")
    rows["exclude_reason"] = ["", "", "people", ""]
    rows["included_in_public_release"] = [True, True, False, True]
    rows.to_csv(folder / "metadata_images_split_scene_v1.csv", index=False)
    frames = pf.open(folder)
    assert [frame.ref.house for frame in frames] == ["ai_001_002", "ai_001_004"]
    assert "tilted projection" in frames.left_out["ai_001_001/cam_00_0000"]
    assert frames.left_out["ai_001_003/cam_00_0000"] == "people"
    # Without its table a scene has the default camera of every reader, of another size.
    (folder / "metadata_camera_parameters.csv").unlink()
    with pytest.raises(BadInput, match=r"depth_meters\.hdf5.*expected 768 x 1024"):
        pf.open(folder)[0].layer("depth")
    (folder / "ai_001_002/images/scene_cam_00_geometry_hdf5/frame.0000.semantic.hdf5").write_bytes(
        b"no"
    )
    with pytest.raises(BadInput, match=r"semantic\.hdf5"):
        pf.open(folder)[1].layer("semantic")


def test_the_preset_is_the_camera_that_readers_assume():
    lens = LensFields(preset="hypersim").intrinsics(Intrinsics.from_hfov(640, 480))
    assert (lens.width_px, lens.height_px) == (1024, 768)
    assert lens.fx == lens.fy == pytest.approx(886.81, abs=1e-3)
    assert lens.lens.is_pinhole


def test_what_the_layout_cannot_hold_is_refused(root, tmp_path):
    with pytest.raises(BadInput, match="hypersim contains radiance"):
        export(root, tmp_path / "a", "hypersim", choice=Choice(size=(64, 48)))
