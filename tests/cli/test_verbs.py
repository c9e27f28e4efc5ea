"""The verbs doctor, homes, skies, repair, cameras, reference and select on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm import doctor, images
from pbrs_farm.assets import homes_package
from pbrs_farm.cli import main
from pbrs_farm.commands import explaining, making
from pbrs_farm.commands.making import default_output
from pbrs_farm.core import keys
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.layers import LAYERS, text_table
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.house_bundle import house_from_bundle
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.sample.camera_report import CameraReport
from pbrs_farm.sample.camera_source import Sampling
from pbrs_farm.store.folder import FolderStore
from tests.assets.debs import write_deb
from tests.example_homes import example_homes
from tests.selection.histogram_sets import record

PREVIEW = ("--recipe", "preview", "--set", "cameras.cell_m=0.5")


def printed(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> str:
    capsys.readouterr()
    assert main(list(words)) == code
    captured = capsys.readouterr()
    assert "Traceback" not in captured.out + captured.err
    return captured.err if code else captured.out


def test_doctor_finds_everything_that_other_tests_use(tmp_path, capsys):
    words = ["doctor", "--json", "--store", str(tmp_path), "--redis", "redis://127.0.0.1:1/0"]
    assert main(words) == 0
    report = json.loads(capsys.readouterr().out)
    parts = {row["part"]: row for row in report["findings"]}
    assert report["can_run"]
    for part in ("python", "packages", "GL", "denoiser", "pictures", "mitsuba scalar_rgb", "store"):
        assert parts[part]["state"] == "ok", parts[part]
    assert parts["redis"]["state"] == "degraded"
    assert "Connection refused" in parts["redis"]["text"]
    assert not any(tmp_path.rglob("probe.txt"))
    # A check that uses stale names reports an import error: none may.
    assert not [row for row in parts.values() if "cannot import" in row["text"]]


def test_doctor_gives_a_remedy_for_missing_parts(monkeypatch, capsys):
    findings = [
        doctor.Finding("denoiser", "missing", "no library", "install it", needed=True),
        doctor.Finding("LLVM", "degraded", "too old", "take 19"),
        doctor.Finding("python", "ok", "3.11", "nothing"),
    ]
    monkeypatch.setattr(doctor, "examine", lambda *_: findings)
    assert main(["doctor"]) == 1
    text = capsys.readouterr().out
    assert "MISSING   denoiser" in text
    assert "-> install it" in text
    assert "-> take 19" in text
    assert "-> nothing" not in text
    assert "cannot render yet" in text


def test_a_machine_without_opengl_can_render_by_path_tracing(monkeypatch, capsys):
    findings = [
        doctor.Finding("python", "ok", "3.11", needed=True),
        doctor.Finding(doctor.GL, "degraded", "no EGL", "install it"),
    ]
    monkeypatch.setattr(doctor, "examine", lambda *_: findings)
    assert main(["doctor"]) == 0
    text = capsys.readouterr().out
    assert "can render by path tracing; pictures of OpenGL are skipped" in text
    assert "gives the pictures opengl_dl and opengl_il" in text
    assert "cannot render" not in text


def test_a_check_that_crashes_or_exits_is_a_finding():
    crashed = doctor.probe("x", doctor.check_variant, "do this", argument="no_such_variant")
    assert (crashed.state, crashed.remedy) == ("missing", "do this")
    unknown = doctor.probe("store", doctor.check_store, "look", argument="ftp://x", needed=True)
    assert "not a store" in unknown.text
    assert "errors." not in unknown.text
    assert not doctor.can_run([unknown])


def test_missing_variants_llvm_or_redis_are_reported(monkeypatch):
    broken = doctor.Finding("x", "degraded", "does not work")
    monkeypatch.setattr(doctor, "probe", lambda *_args, **_kwargs: broken)
    assert [f.needed for f in doctor.renderer_variants()] == [False, False, True]
    monkeypatch.setattr("pbrs_farm.raycast.variant.find_llvm", lambda: None)
    old = [((15, 0, 6), Path("libLLVM-15.so"))]
    monkeypatch.setattr("pbrs_farm.raycast.variant.llvm_libraries", lambda: old)
    assert "only 15.0.6" in doctor.llvm().text
    monkeypatch.setattr("shutil.which", lambda _name: None)
    assert doctor.redis("").state == "absent"
    monkeypatch.setattr(doctor, "PACKAGES", ("numpy", "no-such-package"))
    assert doctor.packages().text == "not installed: no-such-package"


def test_homes_lists_the_nine_homes_and_how_to_fetch_them(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path))
    rows = json.loads(printed(capsys, "homes", "--json"))
    assert len(rows) == 9
    assert {"name": "Studio", "n_levels": 1, "n_rooms": 5} in rows
    text = printed(capsys, "homes")
    assert all(row["name"] in text for row in rows)
    assert "not downloaded yet: pbrs-farm homes --fetch" in text
    # Homes that need no fetching are homes, too.
    house = builtin_home()
    levels = len(house.levels)
    assert f"builtin {len(house.rooms)} rooms, {levels} level" in " ".join(text.split())
    assert "made:1..20" in text


def test_homes_fetch_without_apt_names_the_folder_for_the_package(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path))
    monkeypatch.setenv("PATH", "")
    monkeypatch.setenv("PBRS_DEBIAN_MIRROR", "http://127.0.0.1:1")
    assert "get sweethome3d_7.0.2+dfsg-3_all.deb and put it" in printed(
        capsys, "homes", "--fetch", code=1
    )


def test_homes_fetch_unpacks_the_package_and_notes_another_version(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path))
    write_deb(tmp_path / "sweethome3d_9.9-1_all.deb", {homes_package.JAR: b"a jar"})
    text = printed(capsys, "homes", "--fetch")
    assert "fetched: sweethome3d 9.9-1" in text
    assert "not the tested version" in text


@pytest.mark.homes
def test_homes_names_the_fetched_package(capsys):
    assert example_homes().label in printed(capsys, "homes")


def test_skies_unpacks_the_outdoor_panoramas_and_explains_their_use(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path))
    names = ("city", "forest", "sunrise", "sunset", "studio")
    files = {f"usr/share/studiolights/world/{name}.exr": name.encode() for name in names}
    write_deb(tmp_path / "blender-data_3.4.1+dfsg-2_all.deb", files)
    text = printed(capsys, "skies")
    assert f"--set sky.panoramas={tmp_path / 'skies'}" in text
    folders = sorted((tmp_path / "skies").iterdir())
    assert [p.stem for p in folders] == ["city", "forest", "sunrise", "sunset"]
    assert folders[1].read_bytes() == b"forest"
    assert printed(capsys, "skies") == text  # from the folder this time


def test_skies_names_a_package_without_panoramas(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path))
    write_deb(tmp_path / "blender-data_3_all.deb", {"usr/share/doc/readme": b""})
    assert "has no city.exr" in printed(capsys, "skies", code=1)


def test_repair_writes_the_bundle_the_report_and_a_cut_of_each_level(tmp_path, capsys):
    text = printed(capsys, "repair", "builtin", "--out", str(tmp_path))
    written = {p.name: p.read_bytes() for p in tmp_path.iterdir() if p.is_file()}
    assert set(written) == {"house.glb", "house.json", "repair.json", "cut_0.svg"}
    assert all(name in text for name in written)
    assert "No light leaks" in text
    house = house_from_bundle(written["house.glb"], written["house.json"])
    report = json.loads(written["repair.json"])
    assert report["house_id"] == house.id
    assert written["cut_0.svg"].startswith(b"<svg")


def test_repair_names_a_home_that_does_not_exist(tmp_path, capsys):
    assert "no.sh3d" in printed(capsys, "repair", "no.sh3d", "--out", str(tmp_path), code=1)


@pytest.fixture(scope="module")
def chosen(tmp_path_factory):
    """The chosen cameras of the built-in home: (folder of cameras.json and the map, JSON)."""
    folder = tmp_path_factory.mktemp("cameras")
    words = ["cameras", "builtin", "--out", str(folder / "cameras.json")]
    assert main([*words, "--map", str(folder / "plan.png"), *PREVIEW]) == 0
    return folder, json.loads((folder / "cameras.json").read_text())


def test_cameras_writes_the_views_and_a_map(chosen):
    folder, written = chosen
    assert {p.name for p in folder.iterdir() if p.is_file()} == {
        "cameras.json", "plan.png", "plan.svg",
    }  # fmt: skip
    assert len(written["views"]) == written["report"]["n_views"] > 0
    assert images.array_from_png((folder / "plan.png").read_bytes()).ndim == 3


@pytest.mark.parametrize(
    ("given", "name"), [("map_rel", "map_rel"), ("v1.2", "v1.2"), ("a.SVG", "a")]
)
def test_the_map_has_the_name_that_was_given(given, name, tmp_path):
    report = CameraReport(
        preset="photo", source="sampled", n_views=0, n_candidates=0, refused={}, rooms=()
    )
    explaining.write_map(tmp_path / given, builtin_home(), Sampling((), report, ()))
    assert {p.name for p in tmp_path.iterdir() if p.is_file()} == {f"{name}.png", f"{name}.svg"}


def test_cameras_prints_the_same_views_as_json(chosen, capsys):
    assert json.loads(printed(capsys, "cameras", "builtin", "--json", *PREVIEW)) == chosen[1]


def test_cameras_gives_the_reasons_of_rejection_for_each_sector(chosen, capsys):
    text = printed(capsys, "cameras", "builtin", *PREVIEW)
    report = chosen[1]["report"]
    assert text.count("  sector ") == sum(len(room["sectors"]) for room in report["rooms"])
    assert "Living room" in text
    assert "near_obstacle" in text
    assert f"{report['n_views']} views of {report['n_candidates']} candidates" in text


def test_cameras_stored_in_a_home_are_taken(capsys):
    text = printed(capsys, "cameras", "builtin", "--cameras", "stored", "--json", *PREVIEW)
    assert json.loads(text)["views"]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """An output folder of six views with histograms and no pictures."""
    store, rng = FolderStore(tmp_path / "root"), np.random.default_rng(4)
    settings = ("histogram.colour_bins=4", "histogram.depth_bins=16")
    recipe = recipe_from_name("fast", dict(pair.split("=") for pair in settings))
    store.put("recipe.json", recipe.model_dump_json().encode())
    for k in range(6):
        view = f"0_{k // 3}_{k % 3}"
        store.put(keys.view_key("a", view, "histogram.json"), record("a", view, rng).json_bytes())
    return tmp_path / "root"


@pytest.fixture
def photographs(tmp_path: Path) -> Path:
    """A folder of four RGB-D pairs."""
    for k in range(4):
        rng = np.random.default_rng(k)
        rgb = (rng.integers(40, 200, 3) + rng.integers(0, 20, (24, 32, 3))).astype(np.uint8)
        depth = rng.integers(600, 5000, (24, 32)).astype(np.uint16)
        for folder, pixels in (("rgb", rgb), ("depth", depth)):
            path = tmp_path / "photographs" / folder / f"p{k}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(images.png_from_array(pixels))
    return tmp_path / "photographs"


LOW = ("--set", "selection.min_colour=0.01", "--set", "selection.min_depth=0.01")


def test_select_by_a_reference_that_was_built_writes_the_run_and_its_report(
    root, photographs, tmp_path, capsys
):
    reference = tmp_path / "photographs.npz"
    bins = ("--set", "histogram.colour_bins=4", "--set", "histogram.depth_bins=16")
    words = ("reference", "build", str(photographs), "--out", str(reference), *bins)
    text = printed(capsys, *words)
    assert "4 photographs" in text
    assert "colour bins" in text
    words = ("select", str(root), "--reference", str(reference), *LOW)
    text = printed(capsys, *words, "--run", "low", "--report")
    summary = json.loads((root / "selection.json").read_text())
    assert f"{summary['kept']} of 6 views kept, 6 scored" in text
    assert text.splitlines()[-1] == "selection/low.html"
    assert len((root / "selection/low.jsonl").read_text().splitlines()) == 6
    assert "<h1>Selection “low”</h1>" in (root / "selection/low.html").read_text()


def test_the_report_shows_the_nearest_photographs_if_they_exist(
    root, photographs, tmp_path, capsys
):
    words = ("select", str(root), "--reference", str(photographs), *LOW, "--report")
    printed(capsys, *words, "--run", "here")
    html = (root / "selection/here.html").read_text()
    assert 'alt="photograph p' in html
    # A file of histograms has no pictures to show, unless the folder is named.
    reference = tmp_path / "photographs.npz"
    bins = ("--set", "histogram.colour_bins=4", "--set", "histogram.depth_bins=16")
    printed(capsys, "reference", "build", str(photographs), "--out", str(reference), *bins)
    words = ("select", str(root), "--reference", str(reference), *LOW, "--report", "--run", "npz")
    printed(capsys, *words)
    assert 'alt="photograph' not in (root / "selection/npz.html").read_text()
    printed(capsys, *words, "--photographs", str(photographs))
    assert 'alt="photograph p' in (root / "selection/npz.html").read_text()


def test_select_takes_photographs_and_options_and_prints_json(root, photographs, capsys):
    words = ("select", str(root), "--reference", str(photographs), *LOW, "--json")
    options = ("--per-room-cap", "1", "--balance", "none", "--score-mode", "mlt_ol")
    summary = json.loads(printed(capsys, *words, *options))
    assert (summary["views"], summary["kept"]) == (6, 2)
    assert summary["reasons"] == {"room-cap": 4}
    assert summary["fields"]["per_room_cap"] == 1
    assert summary["fields"]["score_mode"] == "mlt_ol"


def test_select_names_a_wrong_word_and_a_missing_file(root, tmp_path, capsys):
    words = ("select", str(root), "--reference", str(tmp_path / "no.npz"))
    assert "no.npz" in printed(capsys, *words, code=1)
    error = printed(capsys, *words, "--set", "light.spp=4", code=1)
    assert "expected histogram.FIELD=value or selection.FIELD=value" in error


def test_the_default_output_folder_has_the_homes_name() -> None:
    assert [default_output(h) for h in ("Studio", "some/My Home.sh3d", "made:1..5", "builtin")] == [
        "out/studio", "out/my-home", "out/made", "out/builtin",
    ]  # fmt: skip


def test_the_options_of_run_are_in_groups_before_its_examples(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    text = capsys.readouterr().out
    places = [
        text.index(f"\n{t}:") for t in ("viewpoints", "dressing", "recipe", "light", "processes")
    ]
    assert places == sorted(places)
    assert "\nexamples:\n  pbrs-farm run Studio " in text


def test_the_layers_on_a_terminal_are_columns_that_fit_it() -> None:
    lines = text_table(100).splitlines()
    assert max(map(len, lines)) <= 100
    assert len(lines) == len(LAYERS) + 1
    assert any(line.startswith("depth_z") for line in lines)


def test_a_demo_without_output_does_not_show_an_older_one(tmp_path, monkeypatch, capsys):
    (tmp_path / "sheet.png").write_bytes(b"older")
    monkeypatch.setattr(making, "run_homes", lambda *_, **__: 1)
    assert main(["demo", "--home", "builtin", "--bare", "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().out == ""
    assert (tmp_path / "sheet.png").read_bytes() == b"older"


def test_a_demo_without_a_network_names_the_missing_downloads_and_shows_the_built_in_home(
    tmp_path, monkeypatch, capsys
):
    def refuse(*_args: object) -> None:
        raise MachineFailed("https://mirror/some.deb: no route", hint="put it into the cache")

    shown: list[list[str]] = []
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("pbrs_farm.assets.debian.fetch_deb", refuse)
    monkeypatch.setattr(making, "run_homes", lambda _args, homes, **_: shown.append(homes) or 1)
    main(["demo", "--out", str(tmp_path / "out")])
    assert shown == [["builtin"]]
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "pbrs-farm: fetching the example homes, 17 MB, once",
        "pbrs-farm: the example homes cannot be fetched: https://mirror/some.deb: no route (put it into the cache)",
        "pbrs-farm: going on with the built-in home",
        "pbrs-farm: fetching the furniture, 120 MB, once",
        "pbrs-farm: the furniture cannot be fetched: https://mirror/some.deb: no route (put it into the cache)",
        "pbrs-farm: going on with the home as it was drawn",
    ]
    # With --bare only the home is fetched.
    main(["demo", "--home", "builtin", "--bare", "--out", str(tmp_path / "out")])
    assert capsys.readouterr().err == ""


def test_help_shows_a_page_or_lists_the_pages_that_have_a_word(capsys):
    assert "Install, and uninstall" in printed(capsys, "help", "install")
    listed = printed(capsys, "help", "uninstall").splitlines()
    assert listed[0].split() == ["install", "Install,", "and", "uninstall"]
    assert "howto/walk" in printed(capsys, "help")
    assert "<!--" not in printed(capsys, "help", "howto/walk")
    assert "no page has 'xyzzyx'" in printed(capsys, "help", "xyzzyx", code=1)


def test_the_cache_is_listed_with_its_size_and_deleted_by_name(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("pbrs_farm.operating_system.kernel_cache", lambda: tmp_path / "kernels")
    for name, size in {"painted/a.png": 2_000_000, "b.deb": 1_000_000}.items():
        (tmp_path / "cache" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "cache" / name).write_bytes(b"0" * size)
    lines = printed(capsys, "cache").splitlines()
    assert [line.split()[::2][:2] for line in lines[:2]] == [["1.0", "b.deb"], ["2.0", "painted"]]
    assert "did you mean painted" in printed(capsys, "cache", "--clear", "painte", code=1)
    printed(capsys, "cache", "--clear", "painted")
    assert [p.name for p in (tmp_path / "cache").iterdir()] == ["b.deb"]
    printed(capsys, "cache", "--clear")
    assert not any((tmp_path / "cache").iterdir())
