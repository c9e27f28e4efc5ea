"""Forms of today's trainers, read back by readers written from each trainer's description.

They use no code of the package: their results are compared with the stored layers.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.export.export_views import export, remarks_of
from pbrs_farm.formats.output_folder import ViewEntry, views_of
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
