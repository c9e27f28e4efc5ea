"""Forms of today's trainers, read back by readers written from each trainer's description.

They use no code of the package: their results are compared with the stored layers.
"""

from __future__ import annotations

import json
import shutil
from io import BytesIO
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.export.export_views import export, remarks_of
from pbrs_farm.formats.output_folder import ViewEntry, views_of
from pbrs_farm.formats.radiance_exr import radiance_exr
from pbrs_farm.images import array_from_png, layers_from_exr, png_from_array
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from tests.check.roots import make_root

BASELINE_M = 0.065
LAYERS = ["depth_z", "disparity"]


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stereo walk of three frames."""
    out = tmp_path_factory.mktemp("walk")
    fields = {
        "image.width_px": "64", "image.height_px": "48", "cameras.source": "walk",
        "cameras.walk_frames": "3", "cameras.walk_fps": "5", "cameras.stereo_m": str(BASELINE_M),
    }  # fmt: skip
    recipe = recipe_from_name("preview", fields)
    summary = run_local(Run(["builtin"], str(out), recipe, wanted(["opengl_dl"], LAYERS)))
    assert summary.failures == []
    return out


@pytest.fixture(scope="module")
def stills(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two views with a picture; a corner of the first one's depth is out of the range of depth.png."""
    folder = tmp_path_factory.mktemp("stills")
    house = make_root(folder)
    for k, view in enumerate(sorted((house / "views").iterdir())):
        depth = array_from_png((view / "depth.png").read_bytes())
        picture = np.random.default_rng(k).integers(90, 110, (*depth.shape, 3)).astype(np.uint8)
        (view / "opengl_dl.png").write_bytes(png_from_array(picture))
    first = next(house.glob("views/*"))
    depth = array_from_png((first / "depth.png").read_bytes()).copy()
    depth[0, :2] = 0, 65535
    (first / "depth.png").write_bytes(png_from_array(depth))
    return folder


def stored(view: ViewEntry, name: str) -> np.ndarray:
    if name == "depth_z":
        return layers_from_exr((view.folder / "depth_z.exr").read_bytes())["Z"]
    return array_from_png((view.folder / f"{name}.png").read_bytes())


def of_name(root: Path) -> dict[str, ViewEntry]:
    return {view.id: view for view in views_of(root)}


def moge_depth(file: Path) -> np.ndarray:
    """Metres: 1..65534 run from `near` to `far` of the PNG's text in equal ratios; 0 unknown, 65535 infinite."""
    image = Image.open(file)
    near, far = (float(image.info[name]) for name in ("near", "far"))
    values = np.array(image)
    assert values.dtype == np.uint16
    share = (values.astype(np.float64) - 1) / 65533
    metres = near ** (1 - share) * far**share
    return np.where(values == 0, np.nan, np.where(values == 65535, np.inf, metres))


def moge_normals(file: Path) -> np.ndarray:
    """OpenCV's axes: (v / 65535 - .5) x [2, -2, -2], NaN where all three are 0."""
    values = array_from_png(file.read_bytes())
    assert values.dtype == np.uint16
    normals = (values / 65535 - 0.5) * [2.0, -2.0, -2.0]
    normals[(values == 0).all(-1)] = np.nan
    return normals


def test_moge_reads_depth_normals_and_camera(stills: Path, tmp_path: Path) -> None:
    export(stills, tmp_path / "set", "moge")
    instances = (tmp_path / "set/.index.txt").read_text().splitlines()
    assert len(instances) == len(of_name(stills)) == 2
    for instance in instances:
        folder, view = tmp_path / "set" / instance, of_name(stills)[Path(instance).name]
        image = np.asarray(Image.open(folder / "image.jpg"))
        assert np.abs(image.astype(int) - stored(view, "opengl_dl")).mean() < 6
        millimetres, depth = stored(view, "depth"), moge_depth(folder / "depth.png")
        known = (millimetres > 0) & (millimetres < 65535)
        np.testing.assert_array_equal(np.isinf(depth), millimetres == 0)
        np.testing.assert_array_equal(np.isnan(depth), millimetres == 65535)
        np.testing.assert_allclose(depth[known], millimetres[known] / 1000, rtol=1e-4)
        normals, valid = moge_normals(folder / "normal.png"), stored(view, "valid") > 0
        np.testing.assert_array_equal(np.isnan(normals).any(-1), ~valid)
        right, forward, up = np.moveaxis(stored(view, "normal") * (2 / 65535) - 1, -1, 0)
        expected = np.stack([right, -up, forward], axis=-1)
        np.testing.assert_allclose(normals[valid], expected[valid], atol=1e-4)
        k = np.array(json.loads((folder / "meta.json").read_text())["intrinsics"])
        k[0] *= view.facts["width_px"]
        k[1] *= view.facts["height_px"]
        np.testing.assert_allclose(k, view.facts["K"])


def test_moge_depth_of_a_view_of_nothing_but_sky() -> None:
    from pbrs_farm.export.forms.moge import logarithmic_png

    sky = logarithmic_png(np.zeros((2, 3)), np.ones((2, 3), bool))
    assert (array_from_png(sky) == 65535).all()


def fsd_disparity(file: Path) -> np.ndarray:
    """Pixels: the three channels are digits of base 255, red first, in thousandths."""
    digits = np.asarray(Image.open(file)).astype(np.float64)
    return (digits[..., 0] * 255 * 255 + digits[..., 1] * 255 + digits[..., 2]) / 1000


def test_fsd_reads_pairs_and_disparity(root: Path, tmp_path: Path) -> None:
    export(root, tmp_path / "set", "fsd")
    lines = [line.split() for line in (tmp_path / "set/index.txt").read_text().splitlines()]
    assert [row[1] for row in lines] == ["0000", "0001", "0002"]
    assert not (tmp_path / "set/remarks.txt").exists()
    for folder, number, _house, name in lines:
        data = tmp_path / "set" / folder
        disparity = fsd_disparity(data / f"left/disparity/{number}.png")
        left, right = of_name(root)[name], of_name(root)[f"{name}_right"]
        k_text, baseline = (data / f"left/intrinsics/{number}.txt").read_text().splitlines()
        assert float(baseline) == pytest.approx(BASELINE_M)
        k = np.array(k_text.split(), float).reshape(3, 3)
        # Its readers count pixels from the centre of the first one.
        np.testing.assert_allclose(k[:2, 2], [31.5, 23.5])
        np.testing.assert_allclose(disparity, stored(left, "disparity") / 256, atol=0.0025)
        depth = stored(left, "depth_z").astype(np.float64)
        seen = depth > 0
        exact = k[0, 0] * BASELINE_M / depth[seen]
        np.testing.assert_allclose(disparity[seen], exact, atol=0.000501)
        assert (disparity[~seen] == 0).all()
        # A point of the left picture is at x - disparity of the right one.
        y, x = np.argwhere(seen)[100]
        local = np.linalg.inv(k) @ [x, y, 1] * depth[y, x]
        poses = (v.facts["world_from_camera_opencv"] for v in (left, right))
        from_left, from_right = (np.array(pose) for pose in poses)
        in_right = k @ (np.linalg.inv(from_right) @ from_left @ [*local, 1])[:3]
        assert x - in_right[0] / in_right[2] == pytest.approx(disparity[y, x], abs=1e-3)
        for side, view in (("left", left), ("right", right)):
            picture = np.asarray(Image.open(data / f"{side}/rgb/{number}.jpg"))
            assert np.abs(picture.astype(int) - stored(view, "opengl_dl")).mean() < 5


def test_fsd_without_exact_depth_names_its_step(root: Path, tmp_path: Path) -> None:
    export(root, tmp_path / "set", "fsd", choice=Choice(layers=("disparity",)))
    assert remarks_of(tmp_path / "set")[0].startswith("disparity: steps of 1/256 px")
    with pytest.raises(BadInput, match="needs the layer depth_z or disparity"):
        export(root, tmp_path / "x", "fsd", choice=Choice(layers=("depth",)))


def test_views_without_a_partner_are_no_stereo_set(stills: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no view has a right one"):
        export(stills, tmp_path / "x", "fsd")


def wai_overlap(scene: Path, frames: list[dict]) -> np.ndarray:
    """Shares by the rule of the repository, for pictures of less than 224 px: nearest depth at integer pixels."""
    depths = [layers_from_exr((scene / f["depth"]).read_bytes())["Y"] for f in frames]
    shares = np.zeros((len(frames), len(frames)))
    for i, frame in enumerate(frames):
        h, w = depths[i].shape
        v, u = np.mgrid[:h, :w]
        z = depths[i]
        local = np.stack([
            (u - frame["cx"]) * z / frame["fl_x"], (v - frame["cy"]) * z / frame["fl_y"], z,
        ], -1)  # fmt: skip
        pose = np.array(frame["transform_matrix"])
        world = local @ pose[:3, :3].T + pose[:3, 3]
        for j, other in enumerate(frames):
            inverse = np.linalg.inv(np.array(other["transform_matrix"]))
            seen = world @ inverse[:3, :3].T + inverse[:3, 3]
            expected = seen[..., 2]
            with np.errstate(divide="ignore", invalid="ignore"):
                x = other["fl_x"] * seen[..., 0] / np.abs(expected) + other["cx"]
                y = other["fl_y"] * seen[..., 1] / np.abs(expected) + other["cy"]
            inside = (x >= 0) & (x < w) & (y >= 0) & (y < h) & (expected > 0.04) & (z > 0)
            column = np.rint(np.clip(np.nan_to_num(x), 0, w - 1)).astype(int)
            row = np.rint(np.clip(np.nan_to_num(y), 0, h - 1)).astype(int)
            allowed = 0.1 + 0.005 * expected - np.log(0.5) * 0.1
            shares[i, j] = (inside & (np.abs(depths[j][row, column] - expected) < allowed)).mean()
    return shares


def test_wai_has_frames_depth_and_covisibility(root: Path, tmp_path: Path) -> None:
    export(root, tmp_path / "set", "wai", shares=SplitShares(1, 0, 0))
    split = tmp_path / "set/train"
    (scene_name,) = np.load(split / "pbrs_farm_scene_list_train.npy")
    scene = split / scene_name
    meta = json.loads((scene / "scene_meta.json").read_text())
    assert (meta["camera_convention"], meta["scale_type"]) == ("opencv", "metric")
    assert len(meta["frames"]) == len(of_name(root)) == 6
    for frame in meta["frames"]:
        view = of_name(root)[frame["frame_name"]]
        np.testing.assert_allclose(
            frame["transform_matrix"], view.facts["world_from_camera_opencv"]
        )
        assert (frame["w"], frame["h"]) == (64, 48)
        # Its loaders count pixels from the centre of the first one.
        assert (frame["cx"], frame["cy"]) == pytest.approx((31.5, 23.5))
        picture = array_from_png((scene / frame["file_path"]).read_bytes())
        np.testing.assert_array_equal(picture, stored(view, "opengl_dl"))
        depth = layers_from_exr((scene / frame["depth"]).read_bytes())["Y"]
        np.testing.assert_array_equal(depth, stored(view, "depth_z"))
    # As its loader maps the file: float32 from byte 128, the shape in its name.
    file = scene / meta["scene_modalities"]["pairwise_covisibility"]["scene_key"]
    shape = tuple(int(n) for n in file.stem.split("--")[1].split("x"))
    matrix = np.memmap(file, np.float32, "r", offset=128, shape=shape)
    assert shape == (6, 6)
    has_depth = [
        (stored(of_name(root)[f["frame_name"]], "depth_z") > 0).mean() for f in meta["frames"]
    ]
    np.testing.assert_allclose(matrix.diagonal(), has_depth, atol=1e-6)
    assert 0.2 < matrix.min() < 0.999
    # Points on the border round to outside in its rule.
    np.testing.assert_allclose(matrix, wai_overlap(scene, meta["frames"]), atol=0.03)


def test_covisibility_ends_at_a_wall() -> None:
    """Two cameras 4 m from each other look at the two sides of a wall, 2 m away from either."""
    from pbrs_farm.export.forms.wai import FramePoints, pairwise_covisibility

    k = np.array([[10.0, 0, 5], [0, 10, 5], [0, 0, 1]])
    turned = np.diag([-1.0, 1, -1, 1])
    turned[2, 3] = 4
    x, y = (g.ravel() for g in np.meshgrid(np.arange(10) + 0.5, np.arange(10) + 0.5))
    wall = np.stack([(x - 5) / 5, (y - 5) / 5, np.full(100, 2.0)], 1)
    depth = np.full((10, 10), 2, np.float32)
    same = FramePoints(depth, k, np.eye(4), wall, 100)
    thick = wall * [0.875, 0.875, 1] + np.array([0, 0, 0.25])
    opposite = FramePoints(depth - np.float32(0.25), k, np.linalg.inv(turned), thick, 100)
    shares = pairwise_covisibility([same, same, opposite])
    np.testing.assert_array_equal(shares, [[1, 1, 0], [1, 1, 0], [0, 0, 1]])
    # Frames without a surface see nothing.
    none = FramePoints(np.zeros_like(depth), k, np.eye(4), np.zeros((0, 3)), 100)
    np.testing.assert_array_equal(pairwise_covisibility([same, none]), [[1, 0], [0, 0]])


def test_points_outside_a_frames_pyramid_are_left_out_unseen() -> None:
    from pbrs_farm.export.forms.wai import FramePoints, box_corners, may_see, n_seen

    rng = np.random.default_rng(4)
    k = np.array([[10.0, 0, 5], [0, 10, 5], [0, 0, 1]])
    n_left_out = 0
    for _ in range(200):
        pose = np.eye(4)
        pose[:3, :3] = Rotation.random(rng=rng).as_matrix()
        frame = FramePoints(np.full((10, 10), 2, np.float32), k, pose, np.zeros((0, 3)), 1)
        points = rng.normal(size=(20, 3)) * 0.5 + rng.normal(size=3) * 3
        if not may_see(box_corners(points), frame):
            n_left_out += 1
            assert n_seen(points, frame) == 0
    assert n_left_out > 50


def test_nerfstudios_normals_and_linear_pictures(stills: Path, tmp_path: Path) -> None:
    first = views_of(stills)[0]
    light = np.random.default_rng(3).random((2, *stored(first, "depth").shape, 3), np.float32)
    images = {"outdoor": light[0], "indoor": light[1], "albedo": light[0], "normal": light[0]}
    (first.folder / "radiance.exr").write_bytes(radiance_exr(images))
    choice = Choice(layers=("depth", "normal", "radiance"))
    try:
        export(stills, tmp_path / "set", "nerfstudio", choice=choice)
    finally:
        (first.folder / "radiance.exr").unlink()
    house = tmp_path / "set" / first.house.id
    frames = json.loads((house / "transforms.json").read_text())["frames"]
    assert len(frames) == 2
    for frame in frames:
        view = of_name(stills)[Path(frame["file_path"]).stem]
        values = array_from_png((house / frame["normal_file_path"]).read_bytes())
        valid = stored(view, "valid") > 0
        right, forward, up = np.moveaxis(stored(view, "normal") * (2 / 65535) - 1, -1, 0)
        expected = np.stack([right, up, -forward], axis=-1)
        np.testing.assert_allclose(values[valid] * (2 / 65535) - 1, expected[valid], atol=1e-4)
        assert (values[~valid] == 0).all()
    (frame,) = json.loads((house / "transforms_radiance.json").read_text())["frames"]
    planes = layers_from_exr((house / frame["file_path"]).read_bytes())
    # The picture of this view is OpenGL's, so all its light counts.
    picture = np.stack([planes[c] for c in "RGB"], -1)
    np.testing.assert_allclose(picture, light.sum(0), rtol=1e-6)


def interiorverse(root: Path, split: str) -> list[tuple[str, dict[str, np.ndarray]]]:
    """The samples of a list: three channels of all but the mask; other paths replace `_im` by the layer's name."""
    samples = []
    for scene in (root / f"{split}.txt").read_text().split():
        for file in sorted((root / scene).glob("*_im.exr")):
            sample = {}
            for name in ("im", "albedo", "material", "normal", "depth", "mask"):
                data = Path(str(file).replace("_im", f"_{name}")).read_bytes()
                planes = layers_from_exr(data)
                channels = "Y" if name == "mask" else "RGB"
                assert sorted(planes) == sorted(channels)
                sample[name] = np.stack([planes[c] for c in channels], -1)
            samples.append((f"{Path(scene).name}/{file.stem[:-3]}", sample))
    return samples


@pytest.fixture
def materials(stills: Path, tmp_path: Path) -> Path:
    """The stills with albedo, roughness, metal and a mirror; the first has traced light, too."""
    folder = Path(shutil.copytree(stills, tmp_path / "materials"))
    rng = np.random.default_rng(5)
    for k, view in enumerate(views_of(folder)):
        shape = stored(view, "depth").shape
        colours = rng.integers(0, 256, (*shape, 3)).astype(np.uint8)
        (view.folder / "albedo.png").write_bytes(png_from_array(colours))
        for name in ("roughness", "metallic", "mirror"):
            grey = rng.integers(0, 2, shape).astype(np.uint8) * 255
            (view.folder / f"{name}.png").write_bytes(png_from_array(grey))
        if k == 0:
            light = rng.random((2, *shape, 3), np.float32)
            images = {"outdoor": light[0], "indoor": light[1], "albedo": light[0]}
            images["normal"] = light[0]
            (view.folder / "radiance.exr").write_bytes(radiance_exr(images))
            (view.folder / "mlt_il_ol.png").write_bytes(png_from_array(colours))
            facts = json.loads((view.folder / "view.json").read_text())
            develop = {"mlt_il_ol": {"gains": [1.0, 0.5, 2.0], "exposure": 0.25}}
            facts["modes"] = {"develop": {"denoised": False} | develop}
            (view.folder / "view.json").write_text(json.dumps(facts))
            np.save(tmp_path / "light.npy", light.sum(0) * [0.25, 0.125, 0.5])
    return folder


@pytest.mark.parametrize("split", ["train", ""])
def test_interiorverse_reads_light_materials_and_geometry(
    materials: Path, tmp_path: Path, split: str
) -> None:
    shares = SplitShares(1, 0, 0) if split else None
    export(materials, tmp_path / "set", "interiorverse", shares=shares)
    folder = tmp_path / "set" / split
    lines = [line.split(",") for line in (folder / "index.csv").read_text().splitlines()[1:]]
    samples = dict(interiorverse(tmp_path / "set", "train"))
    assert len(samples) == len(lines) == 2
    for k, (scene, number, _house, name) in enumerate(lines):
        sample, view = samples[f"{scene}/{number}"], of_name(materials)[name]
        if k == 0:
            np.testing.assert_allclose(sample["im"], np.load(tmp_path / "light.npy"), rtol=1e-5)
        else:
            srgb = stored(view, "opengl_dl") / 255
            linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
            np.testing.assert_allclose(sample["im"], linear, atol=1e-6)
        srgb = stored(view, "albedo") / 255
        linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        np.testing.assert_allclose(sample["albedo"], linear, atol=1e-6)
        for channel, layer in enumerate(("roughness", "metallic")):
            np.testing.assert_allclose(sample["material"][..., channel] * 255, stored(view, layer))
        valid, millimetres = stored(view, "valid") > 0, stored(view, "depth")
        opaque = valid & (stored(view, "mirror") == 0)
        np.testing.assert_array_equal(sample["mask"][..., 0] > 0.5, opaque)
        depth = sample["depth"]
        assert (depth == depth[..., :1]).all()
        unknown = (millimetres == 0) | (millimetres == 65535)
        np.testing.assert_array_equal(np.isinf(depth[..., 0]), unknown)
        np.testing.assert_allclose(depth[~unknown][:, 0], millimetres[~unknown])
        right, forward, up = np.moveaxis(stored(view, "normal") * (2 / 65535) - 1, -1, 0)
        expected = np.stack([right, up, -forward], axis=-1)
        np.testing.assert_allclose(sample["normal"][valid], expected[valid], atol=1e-4)


def test_interiorverse_needs_materials(stills: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no view has a picture and materials"):
        export(stills, tmp_path / "x", "interiorverse")


def film_of(file: Path) -> np.ndarray:
    """(T, H, W, 3) the frames of an mp4."""
    import av

    with av.open(str(file)) as container:
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])


def test_cosmos_reads_films_controls_and_captions(root: Path, tmp_path: Path) -> None:
    export(root, tmp_path / "set", "cosmos")
    names = of_name(root)
    for control in ("depth", "seg"):
        lines = (tmp_path / f"set/{control}.jsonl").read_text().splitlines()
        rows = [json.loads(line) for line in lines]
        assert len(rows) == 2
        for row in rows:
            assert (row["width"], row["height"], row["nb_frames"], row["framerate"]) == (
                64,
                48,
                3,
                5,
            )
            assert row["duration"] == pytest.approx(0.6)
            assert row["control_type"] == control
            (window,) = row["t2w_windows"]
            assert (window["start_frame"], window["end_frame"]) == (0, 2)
            assert window["caption"].startswith("The picture shows ")
            eye = "_right" if row["uuid"].endswith("_right") else ""
            views = [names[f"frame_{k:05d}{eye}"] for k in range(3)]
            pictures = film_of(tmp_path / "set" / row["vision_path"])
            controls = film_of(tmp_path / "set" / row["control_path"])
            assert pictures.shape == controls.shape == (3, 48, 64, 3)
            expected = np.stack([stored(view, "opengl_dl") for view in views]).astype(int)
            assert np.abs(pictures - expected).mean() < 6
            if control == "depth":
                metres = np.stack([stored(view, "depth_z") for view in views])
                near = metres[metres > 0].min()
                bright = np.where(metres > 0, near / np.where(metres > 0, metres, 1), 0) * 255
                assert np.abs(controls.mean(-1) - bright).mean() < 3
            else:
                # An item has one colour in all frames.
                ids = np.stack([stored(view, "instance") for view in views])
                common = np.bincount(ids[ids > 0]).argmax()
                colours = [np.median(controls[k][ids[k] == common], 0) for k in range(3)]
                assert np.ptp(colours, axis=0).max() < 12
    remarks = remarks_of(tmp_path / "set")
    assert remarks[0] == "its loader drops films below 61 frames or over 61 s:"
    assert "3 frames of 0.6 s" in remarks[1]


def test_cosmos_cuts_long_films_into_windows() -> None:
    from pbrs_farm.export.forms.cosmos import window_starts

    for n in (61, 100, 121, 122, 300):
        starts = window_starts(n)
        lengths = np.diff(starts)
        assert (starts[0], starts[-1]) == (0, n)
        assert lengths.min() >= 61
        assert lengths.max() <= 121
    assert window_starts(10) == [0, 10]


def openspatial_corners(box: list[float]) -> np.ndarray:
    """(8, 3) corners: centre, full size, and angles that scipy calls "zxy"."""
    signs = np.array(list(product((-0.5, 0.5), repeat=3)))
    turn = Rotation.from_euler("zxy", box[6:]).as_matrix()
    return signs * box[3:6] @ turn.T + box[:3]


def test_openspatial_reads_rows_of_views_and_of_homes(
    stills: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    export(stills, tmp_path / "set", "openspatial")
    # Its engine opens relative paths.
    monkeypatch.chdir(tmp_path / "set")
    rows = pd.read_parquet("singleview.parquet").to_dict("records")
    (scene,) = pd.read_parquet("multiview.parquet").to_dict("records")
    assert len(rows) == len(scene["image"]) == 2
    for k, row in enumerate(rows):
        view = of_name(stills)[Path(row["image"]).stem]
        assert row["is_metric_depth"]
        assert scene["pose"][k] == row["pose"]
        np.testing.assert_array_equal(Image.open(row["image"]), stored(view, "opengl_dl"))
        millimetres = stored(view, "depth")
        depth = np.asarray(Image.open(row["depth_map"])).astype(float) / row["depth_scale"]
        np.testing.assert_allclose(depth, np.where(millimetres < 65535, millimetres, 0) / 1000)
        things = {r["id"]: r for r in view.facts["instances"] if r["nyu40"] and r["box3d"]}
        assert len(row["obj_tags"]) == len(row["masks"]) == len(things)
        assert [list(b) for b in scene["bboxes_2d"][k]] == [list(b) for b in row["bboxes_2d"]]
        pose, intrinsic = np.loadtxt(row["pose"]), np.loadtxt(row["intrinsic"])
        # The camera's height is the third coordinate.
        opencv = np.array(view.facts["world_from_camera_opencv"])
        assert pose[2, 3] == pytest.approx(opencv[1, 3])
        for mask_path, box, box2d in zip(
            row["masks"], row["bboxes_3d_world_coords"], row["bboxes_2d"], strict=True
        ):
            number = int(Path(mask_path).stem)
            mask = np.asarray(Image.open(mask_path)) > 0
            np.testing.assert_array_equal(mask, stored(view, "instance") == number)
            y, x = np.nonzero(mask)
            assert list(box2d) == [x.min(), y.min(), x.max(), y.max()]
            stated = things[number]["box3d"]
            signs = np.array(list(product((-1, 1), repeat=3)))
            corners = signs * stated["half"] @ np.array(stated["axes"]) + stated["centre"]
            turned = np.stack([corners[:, 0], -corners[:, 2], corners[:, 1]], 1)
            gaps = np.linalg.norm(openspatial_corners(box)[:, None] - turned, axis=-1)
            assert gaps.min(1).max() < 1e-6
            # Pixels of the mask, taken into the world, are in the box.
            z = depth[y, x]
            local = np.stack([
                (x - intrinsic[0, 2]) * z / intrinsic[0, 0],
                (y - intrinsic[1, 2]) * z / intrinsic[1, 1], z, np.ones(len(z)),
            ])  # fmt: skip
            world = (pose @ local)[:3, z > 0].T
            low, high = turned.min(0) - 0.01, turned.max(0) + 0.01
            assert ((world >= low) & (world <= high)).all()


def test_lerobot_reads_episodes_with_depth_k_and_poses(root: Path, tmp_path: Path) -> None:
    export(root, tmp_path / "set", "lerobot")
    folder = tmp_path / "set"
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_frames"]) == ("v3.0", 5, 3)
    # As `meta.tasks.iloc[index].name`.
    tasks = pd.read_parquet(folder / "meta/tasks.parquet")
    assert tasks.iloc[0].name == "Walk through the home."
    episodes = pd.read_parquet(folder / "meta/episodes/chunk-000/file-000.parquet")
    (episode,) = episodes.to_dict("records")
    assert (episode["dataset_from_index"], episode["dataset_to_index"]) == (0, 3)
    place = {name: episode[f"data/{name}"] for name in ("chunk_index", "file_index")}
    rows = pd.read_parquet(folder / info["data_path"].format(**place)).to_dict("records")
    assert set(rows[0]) == set(info["features"])
    images = [name for name, f in info["features"].items() if f["dtype"] == "image"]
    assert images == [
        f"observation.images.{name}{end}" for name in ("first", "right") for end in ("", "_depth")
    ]
    for number, row in enumerate(rows):
        assert (row["frame_index"], row["index"], row["episode_index"]) == (number, number, 0)
        assert row["timestamp"] == pytest.approx(number / info["fps"])
        for name in ("first", "right"):
            end = "" if name == "first" else "_right"
            view = of_name(root)[f"frame_{number:05d}{end}"]
            image = Image.open(BytesIO(row[f"observation.images.{name}"]["bytes"]))
            np.testing.assert_array_equal(image, stored(view, "opengl_dl"))
            depth = Image.open(BytesIO(row[f"observation.images.{name}_depth"]["bytes"]))
            assert (depth.format, depth.mode) == ("TIFF", "I;16")
            millimetres = stored(view, "depth")
            np.testing.assert_array_equal(depth, np.where(millimetres < 65535, millimetres, 0))
            k = row[f"observation.{name}.K"].reshape(3, 3)
            np.testing.assert_allclose(k[:2, 2], (31.5, 23.5))
            pose = row[f"observation.{name}.pose"].astype(float)
            matrix = np.eye(4)
            matrix[:3, :3] = Rotation.from_quat(pose[3:]).as_matrix()
            matrix[:3, 3] = pose[:3]
            np.testing.assert_allclose(matrix, view.facts["world_from_camera_opencv"], atol=1e-6)
        np.testing.assert_array_equal(row["observation.state"], row["observation.first.pose"])
        np.testing.assert_array_equal(row["action"], rows[min(number + 1, 2)]["observation.state"])
    stats = json.loads((folder / "meta/stats.json").read_text())
    assert set(stats) == set(info["features"])
    pictures = [stored(of_name(root)[f"frame_{k:05d}"], "opengl_dl") / 255 for k in range(3)]
    of_first = stats["observation.images.first"]
    assert np.shape(of_first["mean"]) == (3, 1, 1)
    np.testing.assert_allclose(np.ravel(of_first["mean"]), np.mean(pictures, axis=(0, 1, 2)))
    np.testing.assert_allclose(np.ravel(of_first["std"]), np.std(pictures, axis=(0, 1, 2)))
    assert of_first["count"] == [3]


@pytest.mark.study
def test_lerobots_table_library_opens_the_episodes(root: Path, tmp_path: Path) -> None:
    """With the features that LeRobot derives from info.json."""
    import datasets

    export(root, tmp_path / "set", "lerobot")
    info = json.loads((tmp_path / "set/meta/info.json").read_text())
    features = {}
    for name, feature in info["features"].items():
        kind = datasets.Value(dtype=feature["dtype"]) if feature["dtype"] != "image" else None
        vector = datasets.Sequence(length=feature["shape"][0], feature=kind)
        features[name] = datasets.Image() if kind is None else vector
        if feature["shape"] == [1]:
            features[name] = kind
    files = [str(file) for file in sorted((tmp_path / "set/data").rglob("*.parquet"))]
    rows = datasets.Dataset.from_parquet(
        files, features=datasets.Features(features), cache_dir=str(tmp_path / "cache")
    )
    view = of_name(root)["frame_00001"]
    np.testing.assert_array_equal(rows[1]["observation.images.first"], stored(view, "opengl_dl"))
    np.testing.assert_array_equal(rows[1]["observation.images.first_depth"], stored(view, "depth"))
    assert len(rows[1]["observation.first.K"]) == 9


def test_layered_depth_counts_fronts_behind_clear_surfaces(stills: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(stills, tmp_path / "glass"))
    first, second = views_of(folder)
    shape = stored(first, "depth").shape
    # A pane, a glass block (front, back), a hollow glass (four surfaces), a wall, and a surface behind it.
    ray = [(1000, 5, 1), (1500, 6, 1), (1600, 6, 1), (2000, 7, 1), (2010, 7, 1), (2090, 7, 1), (2100, 7, 1), (3000, 8, 0)]  # fmt: skip
    # A wall alone; a block at the wall; a pane before the open sky; nothing.
    others = [
        [(900, 8, 0), (950, 8, 0)],
        [(700, 6, 1), (800, 6, 1), (801, 8, 0)],
        [(600, 5, 1)],
        [],
    ]
    planes = [np.zeros((8, *shape), np.uint16) for _ in range(3)]
    for column, surfaces in enumerate([ray, *others]):
        for k, values in enumerate(surfaces):
            for plane, value in zip(planes, values, strict=True):
                plane[k, :, column] = value
    (first.folder / "depth_layers").mkdir()
    names = ("depth", "instance", "clear")
    for name, plane in zip(names, planes, strict=True):
        stacked = np.concatenate(plane)
        stacked = (stacked * 255).astype(np.uint8) if name == "clear" else stacked
        (first.folder / f"depth_layers/{name}.png").write_bytes(png_from_array(stacked))
    export(folder, tmp_path / "set", "layered-depth")
    # `<i>_<j>.png` of the picture `<i>.png`, in millimetres.
    layers = [np.asarray(Image.open(tmp_path / f"set/0_{j}.png")) for j in (1, 3, 5, 7)]
    assert layers[0].dtype == np.uint16
    columns = np.stack(layers)[:, 10, :5].T.tolist()
    assert columns == [
        [1000, 1500, 2000, 2090], [900, 0, 0, 0], [700, 801, 0, 0], [600, 0, 0, 0], [0, 0, 0, 0],
    ]  # fmt: skip
    np.testing.assert_array_equal(Image.open(tmp_path / "set/0.png"), stored(first, "opengl_dl"))
    index = (tmp_path / "set/index.csv").read_text()
    assert index == f"number,house,view\n0,{first.house.id},{first.id}\n"
    assert (
        f"{second.id}: has no picture or no layers" in (tmp_path / "set/left_out.txt").read_text()
    )
    with pytest.raises(BadInput, match="no view has a picture and layers"):
        export(stills, tmp_path / "x", "layered-depth")


def test_lingbot_reads_a_sensors_depth_with_holes(stills: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(stills, tmp_path / "sensor"))
    rng = np.random.default_rng(7)
    for view in views_of(folder):
        shape = stored(view, "depth").shape
        for name in ("depth_sensor", "depth_sensor_d455"):
            sensed = rng.integers(0, 9000, shape).astype(np.uint16)
            (view.folder / f"{name}.png").write_bytes(png_from_array(sensed))
        holes = rng.integers(0, 3, shape).astype(np.uint8)
        (view.folder / "depth_hole_d455.png").write_bytes(png_from_array(holes))
    for sensor, end in (("", ""), ("depth_sensor_d455", "_d455")):
        out = tmp_path / f"set{end}"
        export(folder, out, "lingbot", sensor=sensor)
        for view in views_of(folder):
            sample = out / view.house.id / view.id
            # As its example: millimetres over 1000, K over the picture's size.
            raw = np.asarray(Image.open(sample / "raw_depth.png")).astype(np.float32) / 1000
            expected = stored(view, f"depth_sensor{end}") / np.float32(1000)
            if end:
                expected[stored(view, "depth_hole_d455") > 0] = 0
            np.testing.assert_allclose(raw, expected)
            true, millimetres = np.asarray(Image.open(sample / "depth.png")), stored(view, "depth")
            np.testing.assert_array_equal(true, np.where(millimetres < 65535, millimetres, 0))
            np.testing.assert_array_equal(Image.open(sample / "rgb.png"), stored(view, "opengl_dl"))
            np.testing.assert_allclose(np.loadtxt(sample / "intrinsics.txt"), view.facts["K"])
    with pytest.raises(BadInput, match="no view has a picture and a sensor's depth"):
        export(stills, tmp_path / "x", "lingbot")
