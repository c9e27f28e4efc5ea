"""Plugins by entry points: the packages under examples/plugins, installed and used."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.plugins import GROUPS, plugin, plugin_homes
from tests.scene.homes import SMALL

REPO = Path(__file__).parents[2]
FIELDS = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]
FEW = ["--modes", "opengl_dl", "--recipe", "preview", *FIELDS]


EXAMPLES = sorted((REPO / "examples/plugins").iterdir())


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a machine with all example plugins, as installed by pip."""
    site = tmp_path_factory.mktemp("plugins") / "site"
    assert sorted(p.name for p in EXAMPLES) == sorted(GROUPS)
    for example in EXAMPLES:
        project = tomllib.loads((example / "pyproject.toml").read_text())["project"]
        info = site / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
        info.mkdir(parents=True)
        head = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
        (info / "METADATA").write_text(head)
        groups = project["entry-points"].items()
        rows = [f"[{g}]\n" + "".join(f"{k} = {v}\n" for k, v in e.items()) for g, e in groups]
        (info / "entry_points.txt").write_text("\n".join(rows))
        for file in example.glob("*.py"):
            (site / file.name).write_bytes(file.read_bytes())
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(REPO)])}


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda p: p.name)
def test_pip_installs_an_example_with_its_entry_points(example: Path, tmp_path: Path) -> None:
    # Build from a copy: setuptools writes beside its sources.
    copy = tmp_path / "src"
    copy.mkdir()
    for file in example.glob("*.*"):
        (copy / file.name).write_bytes(file.read_bytes())
    words = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation"]
    words += ["--no-index", "--target", str(tmp_path / "site"), str(copy)]
    subprocess.run(words, check=True, capture_output=True, text=True)
    (entry_points,) = (tmp_path / "site").glob("*.dist-info/entry_points.txt")
    assert f"[pbrs_farm.{example.name}]" in entry_points.read_text()
    assert all((tmp_path / "site" / file.name).exists() for file in example.glob("*.py"))


def run(env: dict[str, str], folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pbrs_farm.cli", *words]
    return subprocess.run(command, env=env, cwd=folder, capture_output=True, text=True, timeout=300)


def done(env: dict[str, str], folder: Path, *words: str) -> str:
    finished = run(env, folder, *words)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    return finished.stdout


@pytest.mark.long
def test_homes_of_a_plugin_are_words(installed: dict[str, str], tmp_path: Path) -> None:
    words = ["run", "plugin:still_life,1..2,count=2", "--views", "1", "--out", "o", *FEW]
    done(installed, tmp_path, *words)
    houses = sorted((tmp_path / "o/houses").iterdir())
    assert [h.name[:13] for h in houses] == ["still-life-1-", "still-life-2-"]
    facts = json.loads((houses[0] / "house.json").read_text())
    assert sum(item["id"].startswith("still-life-box") for item in facts["items"]) == 2
    assert "0 steps done" in done(installed, tmp_path, *words)
    done(installed, tmp_path, "verify", "o")


@pytest.mark.slow
def test_a_reader_of_a_plugin_reads_its_files(installed: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "mine.room").write_text('{"width": 4, "depth": 3, "height": 2.5}')
    done(installed, tmp_path, "run", "mine.room", "--views", "1", "--out", "o", *FEW)
    assert len(list((tmp_path / "o/houses").iterdir())) == 1
    (tmp_path / "bad.room").write_text('{"width": 4}')
    bad = run(installed, tmp_path, "run", "bad.room", "--out", "p", *FEW)
    assert bad.returncode == 1
    assert "bad.room: is not a room: 'depth'" in bad.stdout + bad.stderr


@pytest.mark.slow
def test_layers_cameras_and_exports_of_plugins(installed: dict[str, str], tmp_path: Path) -> None:
    words = ["--layers", "height", "--cameras", "corners,height_m=1.2", "--out", "o", *FEW]
    done(installed, tmp_path, "run", "builtin", *words)
    views = sorted((tmp_path / "o").glob("houses/*/views/*"))
    assert [v.name for v in views] == ["0_0_0", "0_1_0"]
    assert all((v / "height.png").exists() for v in views)
    assert "mm above the lowest floor" in done(installed, tmp_path, "layers")
    done(installed, tmp_path, "verify", "o")
    done(installed, tmp_path, "export", "o", "--to", "word_list", "--out", "words")
    assert "1 bed" in (tmp_path / "words/words.tsv").read_text()


@pytest.mark.slow
def test_a_pass_of_a_plugin_dresses_homes(installed: dict[str, str], tmp_path: Path) -> None:
    words = ["--dress", "3", "--catalogue", "generated", "--set", "dress.passes=red_chairs"]
    words += [
        "--set",
        "dress.clutter=0",
        "--set",
        "dress.walls=0",
        "--set",
        "surroundings.kind=none",
    ]
    done(installed, tmp_path, "run", "builtin", *words, "--views", "1", "--out", "o", *FEW)
    report = json.loads(next((tmp_path / "o").glob("houses/*/dress.json")).read_text())
    assert report["changed"]["red_chairs"] >= 2


@pytest.mark.slow
def test_pictures_of_a_plugin_are_beside_the_modes(
    installed: dict[str, str], tmp_path: Path
) -> None:
    words = ["run", "builtin", "--views", "1", "--recipe", "preview", *FIELDS]
    words += ["--modes", "mlt_il_ol", "--out", "o"]
    done(installed, tmp_path, *words, "--set", "tone.pictures=dusk")
    (view,) = (tmp_path / "o").glob("houses/*/views/*")
    by_day, at_dusk = (np.asarray(Image.open(view / f"{n}.png")) for n in ("mlt_ol", "dusk"))
    assert at_dusk.shape == by_day.shape
    assert (at_dusk != by_day).mean() > 0.2, "the lamps light another picture than the sky"
    done(installed, tmp_path, "verify", "o")
    bad = run(installed, tmp_path, *words, "--set", "tone.pictures=dawn")
    assert bad.returncode == 1
    assert "no plugin 'dawn' for pictures" in bad.stdout + bad.stderr


def test_a_missing_plugin_is_reported() -> None:
    with pytest.raises(MachineFailed, match="no plugin 'kitchen' for homes is installed here"):
        plugin("homes", "kitchen")
    for word in ("plugin:kitchen", "plugin:kitchen,2..1", "plugin:a b,1", "plugin:kitchen,1,2"):
        with pytest.raises(BadInput):
            plugin_homes(word)
