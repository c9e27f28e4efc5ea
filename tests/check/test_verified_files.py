import json
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.check.choice_checks import count_range
from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from tests.check.roots import changed_pixel, failed, house_of


def test_one_changed_pixel_changes_its_hash(root):
    changed_pixel(house_of(root) / "views/v0/depth.png", 48, 64, 1)
    certificate = verify(root, sample=0)
    assert certificate.counts["hashes"].failed == 1
    assert "views/v0/depth.png" in certificate.failures[0]


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(5 * 2**30)


def test_missing_and_unlisted_files_are_reported(root):
    view = house_of(root) / "views/v0"
    (view / "normal.png").unlink()
    (view / "stray.txt").write_text("?")
    certificate = verify(root, sample=0)
    assert any("normal.png: is missing" in f for f in certificate.failures)
    assert any("stray.txt: is not in manifest.jsonl" in f for f in certificate.failures)


def test_a_truncated_file_is_caught_and_the_rest_still_checked(root):
    file = house_of(root) / "views/v0/instance.png"
    file.write_bytes(file.read_bytes()[:200])
    certificate = verify(root, sample=100)
    assert certificate.counts["layers"].failed == 1
    assert certificate.counts["ray: depth"].checked == 100


def test_a_changed_house_is_caught(root):
    glb = house_of(root) / "house.glb"
    data = bytearray(glb.read_bytes())
    data[len(data) // 2] ^= 0xFF
    glb.write_bytes(bytes(data))
    assert "hashes" in failed(root, all_pixels=False)


def test_damaged_view_json_and_glb_are_failures_not_tracebacks(root):
    (house_of(root) / "views/v0/view.json").write_text("{}")
    assert "layers" in failed(root, all_pixels=False)
    (house_of(root) / "views/v0/view.json").write_text("[]")
    assert "layers" in failed(root, all_pixels=False)
    (house_of(root) / "house.glb").write_bytes(b"glTF")
    assert "layers" in failed(root, all_pixels=False)


@pytest.mark.parametrize("make", [os.mkfifo, lambda p: p.symlink_to("/dev/zero"), _sparse])
@pytest.mark.parametrize(
    ("file", "check"),
    [
        ("house.glb", "layers"),
        ("views/v0/view.json", "layers"),
        ("views/v0/depth.png", "layers"),
        ("done/house.json", "markers"),
        ("manifest.jsonl", "files"),
    ],
)
def test_pipes_devices_and_giants_in_a_root_are_failures_that_cost_nothing(root, file, check, make):
    path = house_of(root) / file
    path.unlink()
    make(path)
    assert check in failed(root, all_pixels=False)


def test_a_pipe_for_the_lux_of_rooms_counts_as_missing(root):
    os.mkfifo(house_of(root) / "illuminance.json")
    assert not failed(root, all_pixels=False)


def test_one_damaged_view_json_costs_only_its_view(root):
    (house_of(root) / "views/v0/view.json").write_text("[" * 100_000)
    certificate = verify(root, sample=10)
    assert certificate.n_views == 1
    assert any("view.json: is not valid JSON" in line for line in certificate.failures)
    assert certificate.counts["ray: depth"].checked == 10


def test_a_newline_in_a_stored_name_forges_no_line_of_the_certificate(root):
    manifest = house_of(root) / "manifest.jsonl"
    row = json.dumps({"key": "houses/x\nCLEAN", "bytes": 1, "sha256": ""})
    manifest.write_text(manifest.read_text() + row + "\n")
    assert "\nCLEAN" not in verify(root, sample=1).text()


def test_markers_that_disagree_with_the_manifest_are_caught(root):
    marker = house_of(root) / "done/truth.v0.json"
    marker.write_text(marker.read_text().replace('"n_bytes":', '"n_bytes":1', 1))
    assert failed(root, all_pixels=False) == {"markers"}


def test_a_folder_that_is_no_output_root_is_refused(tmp_path):
    with pytest.raises(BadInput, match="no houses here"):
        verify(tmp_path)


def test_a_root_without_views_is_not_clean(tmp_path):
    (tmp_path / "houses/empty").mkdir(parents=True)
    assert not verify(tmp_path).is_clean


def test_a_folder_that_a_run_still_fills_is_not_finished(root, capsys):
    house = house_of(root)
    shutil.rmtree(house / "views/v1")
    for file in (root / "manifest.jsonl", house / "manifest.jsonl", *house.glob("done/*.v1.json")):
        file.unlink()
    certificate = verify(root, all_pixels=True)
    assert certificate.verdict == "NOT FINISHED", certificate.text()
    assert not certificate.is_clean
    (line,) = certificate.unfinished
    assert line.startswith(f"{house.name}: 1")
    assert line.endswith("views are finished")
    assert main(["verify", str(root)]) == 3
    assert capsys.readouterr().out.rstrip().endswith("\nNOT FINISHED")
    # A false label is still found.
    picture = house / "views/v0/depth.png"
    picture.write_bytes((house / "views/v0/instance.png").read_bytes())
    assert verify(root).verdict == "NOT CLEAN"


def test_a_manifest_that_is_missing_from_a_finished_root_is_caught(root):
    (house_of(root) / "manifest.jsonl").unlink()
    assert "files" in failed(root, all_pixels=False)


def test_a_front_that_coincides_with_another_counts_for_either():
    quad = np.array([[-1, -1, -2], [1, -1, -2], [1, 1, -2], [-1, 1, -2]], np.float32)
    moves = np.array([[0, 0, 0], [0, 0, -0.5], [0.5, 0, 0]], np.float32)
    vertices = (quad + moves[:, None]).reshape(-1, 3)
    faces = np.array(
        [[k, k + 1, k + 2] for k in (0, 4, 8)] + [[k, k + 2, k + 3] for k in (0, 4, 8)]
    )
    triangles = SimpleNamespace(
        vertices=vertices, faces=faces, has_holes=np.zeros(6, bool),
        instance=np.array([1, 2, 3, 1, 2, 3]),
    )  # fmt: skip
    case = SimpleNamespace(rest=SimpleNamespace(triangles=triangles))
    x, y = np.meshgrid(np.linspace(-0.45, 0.45, 30), np.linspace(-0.4, 0.4, 30))
    directions = np.stack([x.ravel(), y.ravel(), -np.ones(x.size)], axis=1)
    # Item 3 shares the plane of item 1 from x = -0.5 on; item 2 is behind both.
    shared = int((x > -0.25).sum())
    ranges = [count_range(case, k, np.zeros(3), directions) for k in (1, 2, 3)]
    assert ranges == [(x.size - shared, x.size), (0, 0), (0, shared)]


def test_only_a_glazed_door_may_be_recorded_as_a_window(root):
    file = house_of(root) / "house.json"
    house = json.loads(file.read_text())
    doors = {item["id"] for item in house["items"] if item["kind"] == "door"}
    opening = next(o for o in house["openings"] if o["item_id"] in doors)
    opening["is_window"] = True
    file.write_text(json.dumps(house))
    assert "openings" in failed(root, all_pixels=False)
    door = next(item for item in house["items"] if item["id"] == opening["item_id"])
    house["materials"][door["surfaces"][0]["material"]]["kind"] = "pane"
    file.write_text(json.dumps(house))
    assert "openings" not in failed(root, all_pixels=False)
