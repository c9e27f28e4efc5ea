"""A set's file is checked completely before any output: the shipped ones, and faulty ones."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pbrs_farm.cli import build_parser, main
from pbrs_farm.commands.arguments import recipe_of
from pbrs_farm.commands.job_file import submit_arguments
from pbrs_farm.commands.options import request_from
from pbrs_farm.commands.set_file import is_set, options_given, set_from_bytes, set_from_word
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares
from pbrs_farm.run.request import wanted_of
from pbrs_farm.sets.data_set import shard_from_text, shipped_sets
from workers.job import SubmitRequest

TEXT = """
split = "8/1/1"
[render]
recipe = "fast"
layers = ["albedo"]
set = ["light.spp=8"]
[part.views]
homes = ["made:1..6"]
dress = "1,2"
views = 3
layers = ["depth_z"]
set = ["light.spp=9"]
[part.walks]
homes = ["made:7..8"]
cameras = "walk"
frames = 12
[form.yolo-depth]
parts = ["views"]
"""


def test_a_part_has_the_options_of_all_parts_and_separate_ones() -> None:
    data_set = set_from_bytes(TEXT.encode(), "some/rooms.toml")
    assert (data_set.name, data_set.file) == ("rooms", "rooms.toml")
    assert data_set.shares == SplitShares(0.8, 0.1, 0.1)
    views, walks = data_set.parts
    assert views.homes == tuple(f"made:{k}" for k in range(1, 7))
    assert (views.dress_seeds, views.want.n_views, views.n_houses) == ((1, 2), 3, 12)
    # Lists are joined, and the last value wins.
    assert set(views.want.layers) == {"albedo", "depth_z"}
    assert (views.recipe.light.spp, walks.recipe.light.spp) == (9, 8)
    assert (walks.recipe.cameras.source, walks.recipe.cameras.walk_frames) == ("walk", 12)
    (form,) = data_set.forms
    assert (form.name, form.to, form.parts) == ("yolo-depth", "yolo-depth", ("views",))


@pytest.mark.parametrize(
    ("old", "new", "dropping"),
    [
        ("", "", ["views", "walks"]),
        ("frames = 12", "frames = 12\ndrop_radiance = false", ["views"]),
        ("[form.yolo-depth]", "[form.hypersim]", ["walks"]),
        ('parts = ["views"]', 'layers = ["depth_z", "radiance"]', []),
        ("light.spp=9", "light.groups=lamps", ["walks"]),
    ],
)
def test_a_part_stores_radiance_only_if_it_is_asked_for_or_read(
    old: str, new: str, dropping: list[str]
) -> None:
    parts = set_from_bytes(TEXT.replace(old, new).encode(), "rooms.toml").parts
    assert [part.name for part in parts if part.want.drop_radiance] == dropping
    assert [part.name for part in parts if options_given(part).get("drop_radiance")] == dropping


def test_shards_hold_each_home_once() -> None:
    (views, _walks) = set_from_bytes(TEXT.encode(), "rooms.toml").parts
    shards = [views.homes_of(shard_from_text(f"{k}/4")) for k in range(1, 5)]
    assert sorted(home for shard in shards for home in shard) == sorted(views.homes)
    assert max(map(len, shards)) - min(map(len, shards)) <= 1
    assert views.homes_of(shard_from_text(None)) == views.homes


@pytest.mark.parametrize("word", ["0/4", "5/4", "4", "1/0", "a/b", "1/2/3", "-1/2", "1..2/3"])
def test_a_shard_that_is_none_is_refused(word: str) -> None:
    with pytest.raises(BadInput, match="expected K/N"):
        shard_from_text(word)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[part.views]", "[card]", r"rooms.toml .card.: homes: no such option"),
        ('recipe = "fast"', 'recpe = "fast"', r"rooms.toml \[render\]: recpe: no such option \(did you mean recipe\?\)"),
        ('recipe = "fast"', 'recipe = "fats"', r"rooms.toml: part.views: no recipe 'fats'.*fast"),
        ("views = 3", "views = 0", r"rooms.toml \[part.views\]: views: expected 1 or more"),
        ("views = 3", 'views = "x"', r"rooms.toml \[part.views\]: views: expected a whole number"),
        ("frames = 12", "frames = 1", r"rooms.toml: part.walks: cameras.walk_frames: "),
        ('"walk"', '"wlak"', r"rooms.toml: part.walks: cameras.source: no source 'wlak'.*walk"),
        ('"albedo"', '"albdo"', r"rooms.toml: part.views: .*albdo: no such layer.*albedo"),
        ("light.spp=9", "light.sp=9", r"rooms.toml: part.views: light.sp: .*light.spp"),
        ('"made:1..6"', '"made:6..1"', r"rooms.toml: part.views: .*runs downwards"),
        ('homes = ["made:1..6"]', "", r"rooms.toml: part.views: homes: expected a list of homes"),
        ('"1,2"', '"x"', r"rooms.toml: part.views: --dress: x: expected a seed"),
        ('"8/1/1"', '"8/1"', r"rooms.toml: split: .*expected train/val/test"),
        ("[form.yolo-depth]", "[form.yolo-deep]", r"rooms.toml: form.yolo-deep: .*no such form.*yolo-depth"),
        ("[form.yolo-depth]", "[form.gltf]", r"rooms.toml: form.gltf: .*exports homes"),
        ('parts = ["views"]', 'parts = ["view"]', r"rooms.toml: form.yolo-depth: .*view: no such part.*views"),
        ('parts = ["views"]', 'size = "big"', r"rooms.toml: form.yolo-depth: --size: big"),
        ('parts = ["views"]', 'modes = ["mlt"]', r"rooms.toml: form.yolo-depth: .*no such lighting mode"),
        ("[part.walks]", "[prt.walks]", r"rooms.toml: prt: is not a table of a set .*part"),
        ("[part.walks]", '[part."A b"]', r"rooms.toml: part.A b: a name may have lower-case letters"),
        ("[part.walks]", "[part.walks", r"rooms.toml: is not valid TOML: .*line \d+"),
        ("frames = 12\n[form.yolo-depth]\nparts = [\"views\"]", "frames = 12\ndrop_radiance = true\n[form.hypersim]\n", r"rooms.toml: form.hypersim: part walks: .*radiance.exr: omit drop_radiance"),
        ("frames = 12\n[form.yolo-depth]\nparts = [\"views\"]", "frames = 12\ndrop_radiance = true\n[form.coco]\nlayers=[\"radiance\"]", r"rooms.toml: form.coco: part walks: .*radiance.exr: omit drop_radiance"),
        ("dress = ", "select = ['blck']\ndress = ", r"rooms.toml \[part.views\]: select: blck is not a choice.*black"),
    ],
)  # fmt: skip
def test_faults_are_one_line_with_file_and_place(
    old: str, new: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert old in TEXT
    (tmp_path / "rooms.toml").write_text(TEXT.replace(old, new))
    assert main(["make", str(tmp_path / "rooms.toml"), "--out", str(tmp_path / "out")]) == 1
    error = capsys.readouterr().err
    with pytest.raises(BadInput, match=message):
        raise BadInput(error.removeprefix("pbrs-farm: ").strip(), "", "")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_file_without_parts_is_no_set(tmp_path: Path) -> None:
    (tmp_path / "job.toml").write_text('homes = ["made:1"]\n')
    (tmp_path / "set.toml").write_text("[part.views]\nhomes = ['builtin']\n")
    assert is_set(str(tmp_path / "set.toml"))
    assert is_set("indoor-1k")
    assert not is_set(str(tmp_path / "job.toml"))
    assert not is_set("builtin")
    assert not is_set(str(tmp_path / "none.toml"))
    with pytest.raises(BadInput, match="homes: is not a table of a set"):
        set_from_word(str(tmp_path / "job.toml"))
    with pytest.raises(BadInput, match=r"indoor-2k: no such set .*indoor-1k.*or a FILE.toml"):
        set_from_word("indoor-2k")


def test_a_part_is_submitted_with_the_recipe_that_make_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("celery")
    file = tmp_path / "rooms.toml"
    file.write_text(TEXT)
    p = build_parser("submitting").verbs()["submit"]
    for part in set_from_word(str(file)).parts:
        job = {"homes": list(part.homes), "render": options_given(part)}
        chosen = submit_arguments(job, p.parse_args([str(file)]), p, "rooms.toml")
        request = request_from(chosen, SubmitRequest)
        assert recipe_of(request) == part.recipe
        assert wanted_of(request) == part.want
    assert main(["submit", str(file), "--dry-run"]) == 1
    assert (
        "--part: a store has one recipe, so one part (of views, walks)" in capsys.readouterr().err
    )
    assert main(["submit", str(file), "--part", "views", "--dry-run", "--json"]) == 0
    jobs = json.loads(capsys.readouterr().out)
    assert (jobs["houses"], jobs["views"]) == (12, 36)


def test_a_shipped_set_is_found_despite_a_folder_of_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "indoor-1k").mkdir()
    assert set_from_word("indoor-1k").name == "indoor-1k"


VIEWS = {"indoor-1k": 1_000, "indoor-10k": 10_000, "indoor-60k": 60_000}


def test_every_shipped_set_is_tested_here() -> None:
    assert set(shipped_sets()) == set(VIEWS)


@pytest.mark.parametrize("name", VIEWS)
def test_a_shipped_set_loads(name: str) -> None:
    data_set = set_from_word(name)
    views = next(part for part in data_set.parts if part.name == "views")
    assert views.n_houses * views.want.n_views == VIEWS[name]
    assert data_set.shares is not None
    assert data_set.card.title
    assert data_set.card.licence
    assert data_set.forms


@pytest.mark.parametrize(
    ("part", "form", "message"),
    [
        ('homes = ["made:1", "gone.sh3d"]', "", "part.views: .*gone.sh3d: no such file"),
        ('homes = ["NoSuchHome"]', "", "no example home of that name"),
        ('models = "gone"', "", "part.views: models: gone: no such folder"),
        ('set = ["dress.style=bogus"]', "", "style: bogus: no such style"),
        ('set = ["dress.catalogue=gone"]', "", "dress.catalogue: gone: no such file"),
        ('set = ["cameras.source=file", "cameras.file=gone.json"]', "", "gone.json: no such file"),
        (
            'size = "1024x512"\nset = ["lens.model=equirect"]',
            "[form.colmap]",
            "form.colmap: part views: lens.model",
        ),
        ("", "[form.layoutnet]", "lens.model pinhole: this format supports equirect"),
        ("", "[form.kitti]", "kitti needs a layer of disparity, flow_forward"),
        ("", "[form.tum]", "tum needs frames of sequences"),
    ],
)
def test_homes_files_and_forms_are_checked_before_anything_is_made(
    part: str, form: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    homes = "" if "homes" in part else 'homes = ["made:1"]\n'
    text = f"[part.views]\nviews = 1\n{homes}{part}\n{form}\n"
    with pytest.raises(BadInput, match=message):
        set_from_bytes(text.encode(), "mine.toml")
