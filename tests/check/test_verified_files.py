import json
import os
from pathlib import Path

import pytest

from pbrs_farm.check import verify
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
