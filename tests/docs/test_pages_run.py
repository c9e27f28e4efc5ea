"""Every page works: its commands and its Python run in order, as their marks say.

Large examples are reduced if their mark says so: two homes for twenty, a view for four, 64 pixels for
640. Commands that need a farm, a browser or Docker are run by other tests (fenced.NEEDS); everything else
runs to its end. Pages whose blocks are all marked `run` are run unchanged by test_tutorials.py.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.recipe_toml import toml_from_recipe
from tests.docs.fenced import COMMANDS, PAGES, REPO, Block, blocks_of, name_of
from tests.hostile.sound_inputs import archive
from tests.scene.homes import SMALL

pytestmark = pytest.mark.pages

AS_THEY_STAND = ("researcher", "python")  # test_tutorials.py runs these
ONE_SESSION = ("data",)  # a block of Python uses names of earlier ones
WITH_RECIPE = ("run", "scatter", "dress", "cameras", "repair")
WITH_HERE = ("run", "small", *(["needs study"] if find_spec("torch") else []))
SHRUNK = (
    (r"made:1\.\.(20|1000)\b", "made:1..2"), (r"\bmake (1000|20|6)\b", "make 2"), (r"--dress 1\.\.\d+", "--dress 1..2"), (r"--frames \d+", "--frames 3"),
    (r"--views \d+", "--views 1"), (r"--scenes \d+", "--scenes 1"), (r"--count \d+", "--count 2"),
    (r"--size 512x512", "--size 64x64"), (r"--size 1024x512", "--size 128x64"), (r"--size 320x240", "--size 48x36"),
    (r"--size (1280x720|160x120|640x480|480x360)", "--size 64x48"), (r"--recipe (preview|fast|paper)", "--recipe small.toml"),
)  # fmt: skip
SHRUNK_PYTHON = (
    (r'recipe="preview"', 'recipe="small.toml"'), (r"range\(1, 11\)", "range(1, 3)"), (r"views=4", "views=1"),
    (r"cameras_around\(n=4\)", "cameras_around(n=1)"), (r"size=\(1280, 720\)", "size=(64, 36)"),
    (r"600\.0, 0, 640\], \[0, 600, 360\]", "30.0, 0, 32], [0, 30, 18]"),
)  # fmt: skip
SHRUNK_FILE = (  # of a data set
    (r"made:1\.\.50", "made:1..2"), (r"views = 12", "views = 1"), (r'recipe = "fast"', 'recipe = "small.toml"'), (r'size = "1024x512"', 'size = "128x64"'),
)  # fmt: skip
NEEDS = {  # files that a page takes from an earlier page
    "data": ("run Studio --recipe preview --views 2 --out out/studio",),
    "study": ("run made:1..20 --recipe preview --modes mlt_il_ol --out out/homes",),
}


def _is_run(block: Block) -> bool:
    return (
        any(block.how(line) in WITH_HERE for line in block.lines or [""])
        and block.language in COMMANDS
    )


RUN = [p for p in PAGES if p.stem not in AS_THEY_STAND and any(_is_run(b) for b in blocks_of(p))]


@pytest.mark.parametrize("page", RUN, ids=name_of)
def test_a_page_runs_to_its_end(page: Path, tmp_path: Path) -> None:
    text = page.read_text(encoding="utf-8")
    _provide(tmp_path, text)
    for line in NEEDS.get(page.stem, ()):
        _command(f"pbrs-farm {line}", tmp_path, small=True)
    variables: dict[str, str] = {}
    session = ""
    for block in blocks_of(page):
        if block.language == "python" and block.how() in WITH_HERE:
            _python(session + block.text, tmp_path)
            session += block.text if page.stem in ONE_SESSION else ""
        for line in block.lines if block.language == "sh" else ():
            if block.how(line) not in WITH_HERE:
                continue
            if match := re.fullmatch(r"(\w+)=(\S+)", line):
                variables[match[1]] = match[2]
                continue
            for name, value in variables.items():
                line = line.replace(f"${name}", value)
            _command(line, tmp_path, small=block.how(line) != "run")


def _command(line: str, folder: Path, *, small: bool) -> None:
    for large, smaller in SHRUNK if small else ():
        line = re.sub(large, smaller, line)
    words = shlex.split(line, comments=True)
    if words[0] in ("eval", "(cd"):
        words = ["bash", "-ec", line]
    elif words[0] == "pip":
        words = [sys.executable, "-m", *words, "-q", "--no-deps", "--no-build-isolation"]
        words += ["--no-index", "--target", str(folder / "site")]
    else:
        words[1:] = [_placed(w, folder) for w in words[1:]]
        if small and words[1] in WITH_RECIPE and "--recipe" not in words:
            words += ["--recipe", "small.toml"]
        if small and words[1] == "run" and not {"--views", "--frames", "stored"} & {*words}:
            words += ["--views", "2"]
        if words[1] == "train" and "--set" not in words:
            words += ["--set", "steps=2"]
        words = [sys.executable, "-m", "pbrs_farm.cli", *words[1:]]
    done = subprocess.run(
        words, cwd=folder, env=_environment(folder), capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, f"{line}\n{done.stdout[-2000:]}\n{done.stderr[-3000:]}"
    if "--out" in words:
        out = folder / words[words.index("--out") + 1]
        assert out.is_file() or any(out.iterdir()), f"{line}: nothing in {out}"


def _placed(word: str, folder: Path) -> str:
    """Replacement of a page's placeholder: HOME and N of the gallery, the first view for HOUSE/views/VIEW."""
    if word == "HOME":
        return "Studio"
    if word == "docs/pictures/gallery/N.json":
        return str(REPO / "docs/pictures/gallery/04.json")  # Studio, as in the gallery
    if "*" in word:  # expanded as by a shell
        return str(next(folder.glob(word)).relative_to(folder))
    root, placeholder, _ = word.partition("/houses/HOUSE/views/VIEW")
    if not placeholder:
        return word
    view = next((folder / root).glob("houses/*/views/*"))
    return str(view.relative_to(folder))


def _python(block: str, folder: Path) -> None:
    for large, small in SHRUNK_PYTHON:
        block = re.sub(large, small, block)
    block += "\nif 'first_row' in globals():\n    assert first_row()\n"
    # A spawned process reads the script again.
    (folder / "page.py").write_text(f"if __name__ == '__main__':\n{_indented(block)}")
    words = [sys.executable, "page.py"]
    done = subprocess.run(
        words, cwd=folder, env=_environment(folder), capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, f"{block}\n{done.stderr[-3000:]}"


def _indented(block: str) -> str:
    return "".join(f"    {line}\n" for line in block.splitlines())


def _environment(folder: Path) -> dict[str, str]:
    """The environment of a shell: this tree's packages, those that a page installed, and pbrs-farm as a command."""
    command = folder / "bin/pbrs-farm"
    if not command.exists():
        command.parent.mkdir()
        command.write_text(f'#!/bin/sh\nexec {sys.executable} -m pbrs_farm.cli "$@"\n')
        command.chmod(0o755)
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(folder / "site"), str(REPO)]),
        "PATH": os.pathsep.join([str(command.parent), os.environ["PATH"]]),
    }


def _provide(folder: Path, text: str) -> None:
    """Provide for a page: a small recipe, the files that it shows, and a user's models and photographs."""
    small = recipe_from_name("preview", {name: str(value) for name, value in SMALL.items()})
    (folder / "small.toml").write_text(toml_from_recipe(small))
    # A block under a sentence that names a file is that file.
    for name, block in re.findall(
        r"`((?:mine|rig)\.\w+)`[^`]*?```\w*\n(.*?)^```", text, re.M | re.S
    ):
        for large, smaller in SHRUNK_FILE:
            block = re.sub(large, smaller, block)
        (folder / name).write_text(block)
    if not (folder / "mine.csv").exists():
        (folder / "mine.csv").write_text("from,id,name\nchair,1,seat\nsofa,1,seat\nbed,2,bed\n")
    for models in ("my_furniture", "my_objects"):
        (folder / models).mkdir()
        for name, edge in (("mug", 0.1), ("carton", 0.14)):
            trimesh.creation.box([edge, edge, 1.2 * edge]).export(folder / models / f"{name}.glb")
    (folder / "my-home.sh3d").write_bytes(archive())
    camera = {"fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0, "width": 64, "height": 48}
    (folder / "camera.json").write_text(json.dumps({**camera, "depth_scale": 1.0}))
    pose = np.diag([1.0, -1, -1, 1])
    pose[:3, 3] = 1.5, 1.5, 2.0
    row = {"world_from_camera_opencv": pose.tolist(), "K": [[40.0, 0, 32], [0, 40, 24], [0, 0, 1]]}
    (folder / "cameras.json").write_text(json.dumps([{**row, "width_px": 64, "height_px": 48}]))
    way = ("0.0 1.5 1.5 2.0 0 0 0 1", "0.5 1.6 1.5 2.0 0 0 0 1", "1.0 1.7 1.5 2.0 0 0 0 1")
    (folder / "way.txt").write_text("\n".join(way) + "\n")
    (folder / "my-photos").mkdir()
    pixels = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    for path in (folder / "my-photos/one.jpg", folder / "kitchen.jpg"):
        Image.fromarray(pixels).save(path)
    shutil.copytree(REPO / "examples/plugins/layers", folder / "my_plugin")
