"""Single objects: 20 views, no label where the ray misses, light only from the sky."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.images import array_from_png, layers_from_exr
from pbrs_farm.prepare.home_kinds import object_source
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.objects.model_folders import find_models
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run, Summary
from pbrs_farm.run.plan import wanted

CUBE = """
v -1 0 -1
v 1 0 -1
v 1 2 -1
v -1 2 -1
v -1 0 1
v 1 0 1
v 1 2 1
v -1 2 1
f 1 4 3 2
f 5 6 7 8
f 1 5 8 4
f 2 3 7 6
f 4 8 7 3
f 1 2 6 5
"""


@pytest.fixture(scope="module")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Summary]:
    folder = tmp_path_factory.mktemp("models")
    (folder / "chair").mkdir()
    (folder / "chair" / "cube.obj").write_text(CUBE)
    out = tmp_path_factory.mktemp("out")
    recipe = recipe_from_name(
        "preview", {"light.spp": "4", "image.width_px": "64", "image.height_px": "48"}
    )
    source = object_source(find_models([folder])[0])
    assert resolve(source.location) == source
    return out, run_local(Run([], str(out), recipe, wanted([], [], 2), sources=[source]))


def test_a_model_has_twenty_cameras(finished_run: tuple[Path, Summary]) -> None:
    assert finished_run[1].failures == []
    (cameras,) = finished_run[0].glob("objects/*/cameras.json")
    assert len(json.loads(cameras.read_text())["views"]) == 20


def test_pixels_that_miss_are_zero_in_every_layer(finished_run: tuple[Path, Summary]) -> None:
    view = sorted(finished_run[0].glob("objects/*/views/*"))[0]
    missed = array_from_png((view / "valid.png").read_bytes()) == 0
    assert missed.any()
    assert not missed.all()
    for name in ("depth", "instance", "semantic", "mlt_ol", "mlt_il_ol", "opengl_dl", "opengl_il"):
        assert not array_from_png((view / f"{name}.png").read_bytes())[missed].any(), name
    for name, channel in layers_from_exr((view / "radiance.exr").read_bytes()).items():
        assert not channel[missed].any(), name


def test_only_the_sky_lights_it(finished_run: tuple[Path, Summary]) -> None:
    view = sorted(finished_run[0].glob("objects/*/views/*"))[0]
    assert (view / "mlt_ol.png").read_bytes() == (view / "mlt_il_ol.png").read_bytes()
    visible = array_from_png((view / "valid.png").read_bytes()) > 0
    assert np.median(array_from_png((view / "mlt_ol.png").read_bytes())[visible]) > 30
    assert "no lamps" in json.loads((view / "view.json").read_text())["modes"]["light"]["note"]


def test_verify_takes_objects_too(finished_run: tuple[Path, Summary]) -> None:
    certificate = verify(finished_run[0], sample=300)
    assert certificate.is_clean, certificate.text()
