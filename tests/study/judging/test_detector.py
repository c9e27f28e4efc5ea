"""The benchmark with an object detector: counted items, matches, and nodes of its graph."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from benchmarks.study import centernet, detector, study_figures
from benchmarks.study.centernet import Detection, overlap
from benchmarks.study.detector import Thing, as_row, is_found, recall
from pbrs_farm.images import png_from_array
from pbrs_farm.store.folder import FolderStore
from tests.views.small_roots import fill

pytestmark = pytest.mark.study
CUP = Thing("h/0", "cup", 0.08, (10, 10, 20, 30))


def test_boxes_overlap_by_their_shared_area() -> None:
    assert overlap((0, 0, 10, 10), (5, 0, 15, 10)) == pytest.approx(50 / 150)
    assert overlap((0, 0, 10, 10), (20, 0, 30, 10)) == 0


@pytest.mark.parametrize(
    ("name", "box", "found"),
    [
        ("cup", (10, 10, 20, 30), True),
        ("wine glass", (10, 10, 20, 25), True),  # three quarters of it
        ("cup", (10, 10, 20, 19), False),
        ("bowl", (10, 10, 20, 30), False),
    ],
)
def test_a_detection_matches_by_name_and_half_the_box(
    name: str, box: tuple[float, float, float, float], found: bool
) -> None:
    assert is_found(CUP, [Detection(name, 0.5, box)]) == found


def test_recall_is_of_names_and_sizes() -> None:
    things = [CUP, Thing("h/0", "bowl", 0.08, CUP.box, True), Thing("h/1", "cup", 0.3, CUP.box, True)]  # fmt: skip
    assert recall(things, ("cup", "bowl"), *detector.SMALL) == (1, 2)
    assert recall(things, ("cup",)) == (1, 2)
    rows = {"views": [as_row(thing) for thing in things]}
    assert detector.detector_figures(json.loads(json.dumps(rows))) == {"study.detector_small": 0.5}
    assert "| cup, bowl, bottle, vase | - | - | 1 of 2 | - | 1 of 1 | 2 of 3 |" in detector.table(things)  # fmt: skip
    assert detector.detector_figures({"views": []}) == {}


def test_cut_or_hidden_items_do_not_count(tmp_path: Path) -> None:
    fill(FolderStore(tmp_path), {"home-0-00000000": 1}, (100, 50))
    view = next(tmp_path.rglob("view.json"))
    row = json.loads(view.read_text())
    whole = {"name": "Wine glass", "box2d": [10, 5, 20, 25], "visible_fraction": 0.9, "truncated": False}  # fmt: skip
    row["instances"] = [
        whole, whole | {"truncated": True}, whole | {"visible_fraction": 0.5}, whole | {"name": "Rug"},
    ]  # fmt: skip
    view.write_text(json.dumps(row))
    ((_, colour, things),) = detector.pictures_of_root(str(tmp_path))
    assert colour.shape == (50, 100, 3)
    # 10 x 20 of 100 x 50 pixels.
    assert things == [Thing("home-0-00000000/0_0_0", "cup", 0.2, (10, 5, 20, 25))]


def test_photographs_are_read_from_cocos_file(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png_from_array(np.zeros((50, 100, 3), np.uint8)))
    box = {"image_id": 1, "bbox": [10, 5, 10, 20], "iscrowd": 0}
    detections = {
        "images": [{"id": 1, "file_name": "a.png"}, {"id": 2, "file_name": "none.png"}],
        "categories": [{"id": 46, "name": "wine glass"}, {"id": 1, "name": "person"}],
        "annotations": [
            box | {"category_id": 46}, box | {"category_id": 1}, box | {"category_id": 46, "iscrowd": 1},
        ],
    }  # fmt: skip
    (tmp_path / "boxes.json").write_text(json.dumps(detections))
    ((name, _, things),) = detector.pictures_of_coco(tmp_path / "boxes.json", tmp_path)
    assert (name, things) == ("a.png", [Thing("a.png", "cup", 0.2, (10, 5, 20, 25))])


def test_the_bench_reports_the_recall_of_stored_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(detector, "RESULTS", tmp_path / "results.json")
    assert study_figures.detector_figures() == {}
    assert "benchmarks.study.detector" in capsys.readouterr().out
    rows = {"views": [as_row(CUP)]}
    (tmp_path / "results.json").write_text(json.dumps(rows))
    figures = study_figures.detector_figures()
    assert figures == {"study.detector_small": 0.0}
    assert figures.keys() <= study_figures.UNITS.keys()


def test_a_convolution_pads_as_tensorflows_same() -> None:
    attributes = {
        "strides": {"list": {"i": ["1", "2", "2", "1"]}},
        "fused_ops": {"list": {"s": ["Qmlhc0FkZA==", "UmVsdQ=="]}},
    }
    x = torch.arange(6.0).view(1, 1, 1, 6).expand(1, 1, 6, 6)
    kernel = torch.zeros(3, 3, 1, 1)
    kernel[0, :, 0, 0] = 1  # sums the first three rows
    y = centernet.run_node("_FusedConv2D", [x, kernel, torch.tensor([-5.0])], attributes)
    # Windows start at 0, 2 and 4: 3, 9 and 9 (the last pixel is outside), minus 5.
    assert y[0, 0, 0].tolist() == [0, 4, 4]
    alone = centernet.run_node("FusedDepthwiseConv2dNative", [x, kernel], attributes)
    assert alone[0, 0, 0].tolist() == [3, 9, 9]


def test_a_map_is_enlarged_from_its_first_pixel() -> None:
    x = torch.tensor([[0.0, 2.0], [4.0, 6.0]]).view(1, 1, 2, 2)
    y = centernet.run_node("ResizeBilinear", [x, torch.tensor([4, 4])], {})
    assert y[0, 0, 0].tolist() == [0, 1, 2, 2]
    assert y[0, 0, :, 0].tolist() == [0, 2, 4, 4]
