"""The table of camera sources: entries, docs, and a source added in one file."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import pytest

from pbrs_farm.cli import main
from pbrs_farm.commands.completion_scripts import completion_script
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import CAMERA_SOURCES, recipe_from_name
from pbrs_farm.run.plan import check_layers, chosen_views
from pbrs_farm.run.request import Wanted
from pbrs_farm.sample import sources
from pbrs_farm.sample.camera_source import source_of, sources_table

PAGE = Path(__file__).parents[2] / "docs/cameras.md"


@pytest.mark.parametrize("name", CAMERA_SOURCES.names())
def test_an_entry_has_the_name_of_its_module(name: str) -> None:
    entry = CAMERA_SOURCES.entry(name)
    assert entry.name == name
    assert entry.help


def test_the_page_has_the_table() -> None:
    assert sources_table() in PAGE.read_text()


def test_a_file_follows_the_name_of_its_source() -> None:
    fields = recipe_from_name("fast", {"cameras.source": "trajectory,file=a,b.txt"}).cameras
    assert (fields.source, fields.file, source_of(fields).is_file) == (
        "trajectory",
        "a,b.txt",
        True,
    )


@pytest.mark.parametrize(
    ("path", "value", "text"),
    [
        ("cameras.source", "wlak", "no source 'wlak', did you mean walk"),
        ("cameras.source", "walk,turns=2", "walk has no option 'turns'"),
        ("cameras.preset", "walk", "'walk' is a source: --cameras walk"),
    ],
)
def test_an_unknown_source_or_option_is_named(path: str, value: str, text: str) -> None:
    with pytest.raises(BadRecipe, match=text):
        recipe_from_name("fast", {path: value})


MINE = """
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.options import option
from pbrs_farm.core.record import Record
from pbrs_farm.sample.camera_source import CameraSource, Sampling


class Options(Record):
    turns: int = option(1, "times round the room", ge=1)


def views(request):
    size = request.fields.score_width_px, request.fields.score_height_px
    intrinsics = Intrinsics.from_hfov(*size, request.fields.hfov_rad)
    room = request.house.rooms[0]
    x, z = room.polygon.mean(0)
    camera = Camera.look(intrinsics, (x, room.floor_y + 1.5, z), (1.0, 0.0, 0.0))
    names = [f"frame_{k:05d}" for k in range(4 * request.options.turns)]
    return Sampling.of_views(request.fields, [View(n, room.id, 0, camera, "orbit") for n in names])


SOURCE = CameraSource(
    name="orbit", views=views, help="a circle in the first room", options=Options, is_sequence=True
)
"""


@pytest.mark.kinds("camera-source")
def test_a_file_is_all_that_a_new_source_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "orbit.py").write_text(MINE)
    monkeypatch.setattr(sources, "__path__", [*sources.__path__, str(tmp_path)])
    words = ["--recipe", "preview", "--json", "--cameras"]
    assert main(["cameras", "builtin", *words, "orbit,turns=2"]) == 0
    views = json.loads(capsys.readouterr().out)["views"]
    assert [view["origin"] for view in views] == ["orbit"] * 8
    # Its option is checked, its views are frames, and it is documented and completed.
    assert main(["cameras", "builtin", *words, "orbit,turns=0"]) == 1
    assert 'orbit: turns: expected 1 or more, got "0"' in capsys.readouterr().err
    recipe = recipe_from_name("fast", {"cameras.source": "orbit,turns=3"})
    assert recipe.digest("cameras") != recipe_from_name("fast").digest("cameras")
    check_layers(Wanted(tracks=True), recipe)
    rows = [("frame_00000", "a", 1.0), ("frame_00001", "a", 2.0)]
    assert chosen_views(rows, 1, recipe) == ["frame_00000"]
    text = "a circle in the first room; `turns`: times round the room"
    assert f"| `orbit` | {text} | `--cameras orbit` |" in sources_table()
    p = argparse.ArgumentParser("run")
    p.add_argument("--cameras")
    assert "orbit" in completion_script("bash", {"run": p})
