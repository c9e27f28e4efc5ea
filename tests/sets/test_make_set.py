"""`pbrs-farm make`: one file gives one set of bytes, for any kills and number of shards."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

import pbrs_farm
from pbrs_farm.cli import main
from pbrs_farm.core.house_split import SplitShares, split_of_house
from tests.sets.small_sets import digests, small_set, sums


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_set(tmp_path_factory.mktemp("set"))


@pytest.fixture(scope="module")
def finished_set(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("made") / "small"
    assert main(["make", str(file), "--out", str(out)]) == 0
    return out


def test_the_checksums_are_those_of_every_file(finished_set: Path) -> None:
    sums_before = digests(finished_set)
    sums_before.pop("SHA256SUMS")
    assert sums(finished_set) == sums_before
    names = [line.split("  ")[1] for line in (finished_set / "SHA256SUMS").read_text().splitlines()]
    assert names == sorted(names)


def test_the_sets_file_is_in_its_folder(file: Path, finished_set: Path) -> None:
    assert (finished_set / "small.toml").read_bytes() == file.read_bytes()


def test_the_index_has_each_view_with_its_home_s_split(finished_set: Path) -> None:
    rows = list(csv.DictReader((finished_set / "index.csv").read_text().splitlines()))
    splits = {
        (path.parts[-5], path.parts[-3], path.name)
        for path in finished_set.glob("parts/*/houses/*/views/*")
    }
    assert {(row["part"], row["house"], row["view"]) for row in rows} == splits
    assert len(rows) == len(splits) == 5
    shares = SplitShares(0.5, 0.25, 0.25)
    assert all(row["split"] == split_of_house(row["house"], shares) for row in rows)


def test_the_forms_have_the_views_that_are_kept(finished_set: Path) -> None:
    rows = list(csv.DictReader((finished_set / "index.csv").read_text().splitlines()))
    kept_views = {row["view"] for row in rows if row["part"] == "views" and not row["left_out"]}
    files = finished_set.glob("forms/coco/views/*/annotations.json")
    pictures = [row for f in files for row in json.loads(f.read_text())["images"]]
    assert len(pictures) == len([r for r in rows if r["part"] == "views" and not r["left_out"]])
    assert all(any(view in row["file_name"] for view in kept_views) for row in pictures)
    assert (finished_set / "forms/shards/views/dataset.json").is_file()
    # [form.small] names no parts, so it has all.
    assert {path.name for path in (finished_set / "forms/small").iterdir()} == {
        "views",
        "panoramas",
    }
    assert not (finished_set / "forms/coco/panoramas").exists()


def test_the_card_counts_the_views(finished_set: Path) -> None:
    card = (finished_set / "README.md").read_text()
    assert f"pbrs_farm (here {pbrs_farm.__version__})" in card
    assert card.startswith("# Small\n")
    assert "## views: 4 views" in card
    assert "## panoramas: 1 view\n" in card
    assert "Licence: CC0." in card
    assert digests(finished_set)["small.toml"] in card


def test_a_home_of_two_parts_is_prepared_once(finished_set: Path) -> None:
    (marker,) = finished_set.glob("parts/panoramas/houses/*/done/house.json")
    house = marker.parents[1].name
    # Markers hold the time of the step.
    assert (
        marker.read_bytes()
        == (finished_set / f"parts/views/houses/{house}/done/house.json").read_bytes()
    )


def test_a_second_call_does_nothing(
    file: Path, finished_set: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = digests(finished_set)
    when = {
        name: (finished_set / name).stat().st_mtime_ns for name in before if "manifest" not in name
    }
    assert main(["make", str(file), "--out", str(finished_set)]) == 0
    assert "nothing to do" in capsys.readouterr().out
    assert digests(finished_set) == before
    assert {name: (finished_set / name).stat().st_mtime_ns for name in when} == when


def test_a_file_that_is_gone_is_made_again(file: Path, finished_set: Path, tmp_path: Path) -> None:
    out = tmp_path / "small"
    shutil.copytree(finished_set, out)
    next(out.glob("forms/coco/views/*/annotations.json")).unlink()
    (out / "README.md").write_text("mine")
    assert main(["make", str(file), "--out", str(out)]) == 0
    assert digests(out) == digests(finished_set)


def test_a_damaged_file_of_a_part_is_named_and_nothing_signed(
    file: Path, finished_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "small"
    shutil.copytree(finished_set, out)
    depth = min(out.glob("parts/views/houses/*/views/*/depth.png"))
    changed = bytearray(depth.read_bytes())
    changed[-20] ^= 1
    depth.write_bytes(changed)
    # A step that makes nothing opens no part; a form that is made again does.
    shutil.rmtree(out / "forms/coco")
    before = digests(out)
    assert main(["make", str(file), "--out", str(out)]) == 1
    assert f"{depth}: is damaged: not as rendered" in capsys.readouterr().err
    assert digests(out) == before
    (out / "SHA256SUMS").unlink()
    shutil.copytree(finished_set / "forms/coco", out / "forms/coco")
    assert main(["make", str(file), "--out", str(out)]) == 1
    assert not (out / "SHA256SUMS").exists()
    shutil.rmtree(depth.parents[2])
    assert main(["make", str(file), "--out", str(out)]) == 0
    assert digests(out) == digests(finished_set)


@pytest.mark.long
def test_killed_three_times_it_has_the_bytes_of_a_run_that_was_not(
    file: Path, finished_set: Path, tmp_path: Path
) -> None:
    out = tmp_path / "small"
    command = [sys.executable, "-m", "pbrs_farm.cli", "make", str(file), "--out", str(out)]
    for is_under_way in (
        "parts/views/houses/*/done/view.*.json",
        "parts/panoramas/houses/*/done/house.json",
        "forms/coco/*",
    ):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until = time.monotonic() + 120
        while not list(out.glob(is_under_way)) and time.monotonic() < until:
            assert process.poll() is None, is_under_way
            time.sleep(0.005)
        process.kill()
        process.wait()
        assert not (out / "SHA256SUMS").exists()
    assert main(["make", str(file), "--out", str(out)]) == 0
    assert digests(out) == digests(finished_set)


@pytest.mark.long
def test_two_shards_are_the_whole(file: Path, finished_set: Path, tmp_path: Path) -> None:
    """Rendered in separate folders, with other numbers of processes, copied into one."""
    out = tmp_path / "small"
    for k, jobs in ((1, "1"), (2, "2")):
        folder = tmp_path / str(k)
        assert main(
            ["make", str(file), "--out", str(folder), "--shard", f"{k}/2", "--jobs", jobs]
        ) == 0  # fmt: skip
        assert not (folder / "SHA256SUMS").exists()
        assert len(list(folder.glob("parts/views/houses/*"))) == 1
        shutil.copytree(folder, out, dirs_exist_ok=True)
    whole = sums(finished_set)
    assert main(["make", str(file), "--out", str(out)]) == 0
    assert sums(out) == whole
    assert digests(out) == digests(finished_set)


def test_another_folder_is_refused_in_one_line(
    file: Path, finished_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "small.toml"
    other.write_text(file.read_text() + "# more\n")
    assert main(["make", str(other), "--out", str(finished_set)]) == 1
    assert "small.toml: has another set: the file differs" in capsys.readouterr().err
    renamed = tmp_path / "renamed.toml"
    renamed.write_text(file.read_text())
    assert main(["make", str(renamed), "--out", str(finished_set)]) == 1
    assert "small.toml: belongs to another set" in capsys.readouterr().err
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("")
    assert main(["make", str(file), "--out", str(tmp_path / "mine")]) == 1
    assert "thesis.tex: is not a part of this set" in capsys.readouterr().err
    assert main(["make", str(file), "--out", str(finished_set), "--shard", "3/2"]) == 1
    assert "--shard: 3/2: expected K/N (e.g. 3/16)" in capsys.readouterr().err


def test_a_view_outside_the_set_is_named(
    file: Path, finished_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "small"
    shutil.copytree(finished_set, out)
    house = next(out.glob("parts/views/houses/*"))
    (house / "views/9_9_9").mkdir()
    assert main(["make", str(file), "--out", str(out)]) == 1
    assert f"{house.name}/9_9_9: is not a view of the set" in capsys.readouterr().err


@pytest.mark.long
def test_a_home_that_fails_leaves_the_set_unwritten(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF")
    homes = re.findall(r"homes = \[.*\]", file.read_text())
    text = file.read_text().replace(homes[0], f"homes = ['{broken}']")
    (tmp_path / "small.toml").write_text(text)
    out = tmp_path / "small"
    assert main(["make", str(tmp_path / "small.toml"), "--out", str(out)]) == 1
    assert "1 failed: the set is not written" in capsys.readouterr().err
    assert not (out / "SHA256SUMS").exists()
