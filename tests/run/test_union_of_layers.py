"""Optional layers of a root are a union: a run adds layers and removes none."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pbrs_farm.check import verify
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run, Summary
from pbrs_farm.run.plan import wanted

HELD = ("material", "class_source", "depth_z")
FILES = ("material.png", "class_source.png", "depth_z.exr")


def small(**settings: str) -> Recipe:
    sizes = {"image.width_px": "64", "image.height_px": "48", "cameras.cell_m": "1.0"}
    scores = {"cameras.score_width_px": "160", "cameras.score_height_px": "120"}
    return recipe_from_name("preview", {**sizes, **scores, **settings})


def run_with(
    out: Path, layers: tuple[str, ...] = (), mode: str = "opengl_dl", **more: str
) -> Summary:
    run = Run(["builtin"], str(out), small(**more), wanted([mode], layers, 1), update=bool(more))
    summary = run_local(run)
    assert summary.failures == []
    return summary


def description(out: Path) -> dict[str, object]:
    (path,) = out.glob("houses/*/views/*/view.json")
    document: dict[str, object] = json.loads(path.read_bytes())
    return document


def listed(out: Path) -> set[str]:
    lines = (out / "manifest.jsonl").read_text().splitlines()
    return {json.loads(line)["key"].rpartition("/")[2] for line in lines}


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["opengl_dl", "opengl_il"])
def test_layers_survive_later_runs_with_other_layers(tmp_path: Path, mode: str) -> None:
    run_with(tmp_path, HELD)
    first = {path: path.read_bytes() for path in tmp_path.glob("houses/*/views/*/*.*")}
    for layers in ((), ("albedo",), ("nyu13", *HELD[::-1])):
        run_with(tmp_path, layers, mode)
        assert run_with(tmp_path, layers, mode).n_done == 0, layers
        certificate = verify(tmp_path, sample=200)
        assert certificate.is_clean, certificate.text()
        assert {*FILES} <= listed(tmp_path), layers
        assert {"materials", "source_classes"} <= set(description(tmp_path)), layers
    assert {"albedo.png", "nyu13.png"} <= listed(tmp_path)
    for path, data in first.items():
        assert path.name in ("view.json", "histogram.json") or path.read_bytes() == data, path


@pytest.mark.long
def test_a_failed_layer_removes_no_existing_one(tmp_path: Path) -> None:
    fisheye = {"lens.preset": "tum_vi", "image.width_px": "48"}
    run_with(tmp_path, ("albedo",), **fisheye)
    run = Run(["builtin"], str(tmp_path), small(**fisheye), wanted(["opengl_dl"], ["hha"], 1))
    assert run_local(run).failures
    assert run_with(tmp_path, **fisheye).n_done == 0
    assert "albedo.png" in listed(tmp_path)


@pytest.mark.slow
def test_files_of_another_recipe_are_removed(tmp_path: Path) -> None:
    run_with(tmp_path, HELD)
    run_with(tmp_path, ("albedo",), **{"image.height_px": "40"})
    certificate = verify(tmp_path, sample=200)
    assert certificate.is_clean, certificate.text()
    assert not list(tmp_path.glob("houses/*/views/*/material.png"))
