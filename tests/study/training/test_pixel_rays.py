"""Rays as an input of networks follow the lens, also after augmentation."""

from __future__ import annotations

import json
from math import tan
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import png_from_array
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.study.judging.evaluation import open_run
from pbrs_farm.study.judging.packed_weights import model_card
from pbrs_farm.study.networks.initial_weights import start_from
from pbrs_farm.study.networks.network_choice import network_of
from pbrs_farm.study.photographs import camera_of_crop, crop_to_size
from pbrs_farm.study.pixel_rays import (
    focal_lengths,
    mirrored_rays,
    places_of_rays,
    ray_channels,
    rays_at,
    rays_of_cameras,
)
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.augmentation import augment
from pbrs_farm.study.training.checkpoint import Position, save_weights
from pbrs_farm.study.training.prediction import network_output, predict
from pbrs_farm.study.training.training_views import camera_numbers
from pbrs_farm.study.training_plan import TrainingPlan
from tests.study.networks.lite_package import write_lite_package
from tests.study.training.made_views import TINY, small_plan
from tests.views.small_roots import fill

pytestmark = pytest.mark.study

HEIGHT, WIDTH = 96, 128
# An off-centre lens of another length in each view, and pixels that are not square.
CAMERAS = torch.tensor([[110.0, 120.0, 60.0, 50.0], [150.0, 140.0, 70.0, 40.0]])


def test_the_ray_of_a_pixel_is_that_of_the_pinhole_formula() -> None:
    rays = rays_of_cameras(CAMERAS, HEIGHT, WIDTH)
    assert rays.shape == (2, HEIGHT, WIDTH, 2)
    assert rays[1, 3, 100].tolist() == pytest.approx([(100.5 - 70) / 150, (3.5 - 40) / 140])
    channels = ray_channels(rays)
    assert channels.shape == (2, 3, HEIGHT, WIDTH)
    assert channels.norm(dim=1).flatten().tolist() == pytest.approx([1.0] * (2 * HEIGHT * WIDTH))
    x, y, z = channels[0, :, 10, 20].tolist()
    assert (x / z, y / z) == pytest.approx(((20.5 - 60) / 110, (10.5 - 50) / 120))


def test_places_and_rays_go_there_and_back_beyond_the_picture_too() -> None:
    rays = rays_of_cameras(CAMERAS, HEIGHT, WIDTH)
    grid = torch.rand(2, 5, 7, 2, generator=torch.Generator().manual_seed(1)) * 3 - 1.5
    assert torch.allclose(places_of_rays(rays, rays_at(rays, grid)), grid, atol=1e-5)
    # The left edge is half a pixel before the first centre.
    edge = rays_at(rays, torch.full((2, 1, 1, 2), -1.0))[0, 0, 0]
    assert edge.tolist() == pytest.approx([-60 / 110, -50 / 120], abs=1e-6)


def sphere() -> dict[str, torch.Tensor]:
    """Inside a sphere each normal points back along its pixel's ray, for any camera."""
    rays = rays_of_cameras(CAMERAS, HEIGHT, WIDTH)
    directions = ray_channels(rays)
    normal = (-directions.permute(0, 2, 3, 1) * 32767).round().to(torch.int16)
    return {
        "colour": (directions + 1) / 2,
        "normal": normal,
        "valid": torch.ones(2, HEIGHT, WIDTH, dtype=torch.bool),
        "rays": rays,
    }


def still_plan(**changed: str) -> TrainingPlan:
    """A plan with only the given augmentation."""
    none = {"flip": "false", "turn_deg": "0", "zoom": "1", "hue": "0"}
    light = {"gain": "0", "gamma": "0", "tint": "0", "noise": "0"}
    return small_plan(rays="true", **none | light | changed)


@pytest.mark.parametrize(
    "changed",
    [
        {"flip": "true"},
        {"turn_deg": "8"},
        {"zoom": "3"},
        {"flip": "true", "turn_deg": "8", "zoom": "2"},
    ],
)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rays_stay_those_of_the_pixels_under_every_change(
    changed: dict[str, str], seed: int
) -> None:
    dice = torch.Generator().manual_seed(seed)
    new = augment(sphere(), task_of("normals"), still_plan(**changed), dice)
    normal = -new["normal"].float() / 32767
    channels = ray_channels(new["rays"]).permute(0, 2, 3, 1)
    valid = new["valid"]
    assert float(valid.float().mean()) > 0.5
    off = torch.linalg.norm(normal - channels, dim=-1)[valid]
    # Labels are the nearest pixel's each time: wrong by half its diagonal at most.
    n_times = len(changed.keys() - {"flip"})
    assert float(off.max()) < max(0.8 * n_times, 0.01) / 110


def test_an_enlarged_part_is_as_exact_as_its_colour_between_pixels() -> None:
    dice = torch.Generator().manual_seed(1)
    new = augment(sphere(), task_of("normals"), still_plan(zoom="3"), dice)
    channels = ray_channels(new["rays"])
    off = (new["colour"] * 2 - 1 - channels)[:, :, 8:-8, 8:-8].abs()
    assert float(off.max()) < 1e-3


def test_a_crop_of_a_photograph_keeps_its_rays() -> None:
    size = 40, 32
    K = np.array([[500.0, 0, 310], [0, 510.0, 250], [0, 0, 1]])
    _colour, rows, columns = crop_to_size(np.zeros((480, 640, 3), np.uint8), size)
    camera = torch.from_numpy(camera_numbers(camera_of_crop(K, rows, columns, size)))[None]
    rays = rays_of_cameras(camera, 32, 40)
    # The crop is 600 x 480 from column 20 on, each pixel 15 x 15 of the photograph's.
    assert (rows, columns) == (slice(0, 480), slice(20, 620))
    x, y = 20 + 15 * 7.5, 15 * 3.5
    assert rays[0, 3, 7].tolist() == pytest.approx([(x - 310) / 500, (y - 250) / 510], abs=1e-6)


@pytest.mark.parametrize(
    "name", ["small", "residual", "efficient", "paper_tiny", "dilated_tiny", "hed_tiny"]
)
def test_every_kind_of_network_sees_its_rays(name: str) -> None:
    torch.manual_seed(0)
    network = network_of(name, 3, rays=True).eval()
    for p in network.parameters():  # a zero layer passes no gradient
        if p.ndim > 1 and not p.any():
            torch.nn.init.normal_(p, std=0.1)
    rays = ray_channels(rays_of_cameras(CAMERAS[:1], 64, 64))
    inputs = torch.cat([torch.rand(1, 3, 64, 64), rays], 1).requires_grad_()
    output = network(inputs)
    assert output.shape[-2:] == (64, 64)
    output.abs().sum().backward()
    assert inputs.grad is not None
    assert (inputs.grad.abs().amax((0, 2, 3)) > 0).all()


def test_imagenets_start_ignores_rays_at_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = write_lite_package(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    network = network_of("efficient", 3, rays=True)
    start_from(network, "imagenet")
    kernel = network.encoder.stem[0].weight
    assert torch.equal(kernel[:, :3], state["_conv_stem.weight"])
    assert not kernel[:, 3:].any()


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root, out = (tmp_path_factory.mktemp("rays") / name for name in ("root", "run"))
    fill(FolderStore(root), {f"home-{k}-00000000": 2 for k in range(3)}, (40, 32))
    words = ["train", "normals", str(root), "--out", str(out), "--hold-out", "home-2", *TINY]
    assert main([*words, "--set", "rays=true", "--set", "turn_deg=6", "--set", "zoom=1.5"]) == 0
    assert main(["evaluate", str(out), "--on", f"held={root}"]) == 0
    return out


def test_a_run_with_rays_needs_cameras_and_its_card_states_it(run: Path) -> None:
    trained = open_run(run)
    assert trained.plan.rays
    colour = np.zeros((1, 32, 40, 3), np.uint8)
    with pytest.raises(BadInput, match="these pictures have no camera"):
        next(predict(trained.network, colour, trained.task, trained.plan))
    record = trained.record | {"step": 3, "weights_sha256": "0"}
    assert "and the direction of each pixel's ray" in model_card(trained, record, [])


def photograph(path: Path, focal_35mm: int = 0) -> None:
    exif = Image.Exif()
    if focal_35mm:
        exif.get_ifd(0x8769)[0xA405] = focal_35mm
    colour = np.random.default_rng(0).integers(0, 256, (90, 120, 3)).astype(np.uint8)
    Image.fromarray(colour).save(path, "JPEG", exif=exif)


def test_a_photographs_lens_is_given_found_or_assumed_and_its_row_records_it(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    places = {name: tmp_path / "photos" / name for name in ("bare", "exif", "beside")}
    for name, folder in places.items():
        folder.mkdir(parents=True)
        photograph(folder / f"{name}.jpg", 36 if name == "exif" else 0)
    camera = {"fx": 60.0, "fy": 60.0, "cx": 60.0, "cy": 45.0}
    (places["beside"] / "intrinsics.json").write_text(json.dumps(camera))

    def rows(*words: str) -> dict[str, tuple[float, str]]:
        out = tmp_path / f"out{len(words)}"
        files = [str(f / f"{name}.jpg") for name, f in places.items()]
        assert main(["predict", str(run), *files, "--out", str(out), *words]) == 0
        table = json.loads((out / "predictions.json").read_text())
        return {row["photograph"]: (row["hfov_deg"], row["camera"]) for row in table}

    rows_of_run = rows()
    assert rows_of_run["bare"] == (60.0, "assumed")
    assert rows_of_run["beside"] == (90.0, "intrinsics")
    # 36 mm of film 43.27 mm across, in a picture 150 pixels across and 120 wide.
    f = 36 / np.hypot(36, 24) * 150
    assert rows_of_run["exif"] == (round(float(np.degrees(2 * np.arctan(60 / f))), 1), "EXIF")
    assert "bare_normal.png: " in (text := capsys.readouterr().out)
    assert "60.0 degrees wide (assumed)" in text
    assert set(rows("--hfov", "75").values()) == {(75.0, "told")}


def test_depth_with_rays_grows_with_the_focal_length() -> None:
    plan = small_plan("depth", rays="true")
    network = network_of(plan.network, 1, rays=True).eval()
    with torch.no_grad():
        network.head.weight.zero_()  # the lens alone decides
    rays = rays_of_cameras(CAMERAS, HEIGHT, WIDTH)
    lengths = [(110 * 120) ** 0.5, (150 * 140) ** 0.5]
    assert focal_lengths(rays).tolist() == pytest.approx(lengths, rel=1e-5)
    assert torch.allclose(
        focal_lengths(mirrored_rays(rays, torch.ones(2) > 0)), focal_lengths(rays)
    )
    colour = torch.zeros(2, 3, HEIGHT, WIDTH)
    depth = torch.exp(network_output(network, colour, plan, rays).detach())[:, 0, 0, 0]
    assert float(depth[1] / depth[0]) == pytest.approx(lengths[1] / lengths[0], rel=1e-5)


def test_metres_need_a_lens_and_one_error_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root, run = tmp_path / "root", tmp_path / "run"
    fill(FolderStore(root), {"home-1-00000000": 2}, (40, 32))
    words = ["train", "depth", str(root), "--out", str(run), "--hold-out", "none", *TINY]
    assert main([*words, "--set", "rays=true"]) == 0
    photograph(tmp_path / "room.jpg")
    words = ["predict", str(run), str(tmp_path / "room.jpg"), "--out", str(tmp_path / "out")]
    assert main(words) == 1
    assert "room.jpg: no field of view known, which metres need" in capsys.readouterr().out
    assert main([*words, "--hfov", "60"]) == 0
    assert (tmp_path / "out/room_depth.png").exists()


def test_a_run_without_rays_starts_a_network_with_rays(tmp_path: Path) -> None:
    plain, network = (network_of("efficient", n, rays=n == 1) for n in (3, 1))
    save_weights(tmp_path / "weights.safetensors", plain, Position(0, "normals", "", "", 0))
    start_from(network, str(tmp_path / "weights.safetensors"))
    kernel = network.encoder.stem[0].weight
    assert torch.equal(kernel[:, :3], plain.encoder.stem[0].weight)
    assert not kernel[:, 3:].any()


def test_a_network_without_rays_takes_no_field_of_view(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "room.png"
    picture.write_bytes(png_from_array(np.zeros((40, 40, 3), np.uint8)))
    words = ["predict", "--task", "boundaries", str(picture), "--out", str(tmp_path / "out")]
    assert main([*words, "--hfov", "60"]) == 1
    assert "--hfov: 60: this network does not use rays" in capsys.readouterr().err


def test_another_lens_changes_a_runs_predictions(run: Path) -> None:
    trained = open_run(run)
    colour = np.random.default_rng(0).integers(0, 256, (1, 32, 40, 3)).astype(np.uint8)
    f = 20 / tan(np.radians(30))
    cameras = [np.array([[k * f, k * f, 20, 16]], np.float32) for k in (1, 2)]
    narrow, wide = (
        next(predict(trained.network, colour, trained.task, trained.plan, cameras=c))
        for c in cameras
    )
    assert np.abs(narrow - wide).max() > 1e-4
