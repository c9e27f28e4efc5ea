"""The whole pipeline on the built-in home, small: outputs of a run."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.core import layers
from pbrs_farm.core.layers import LAYER, LAYERS
from pbrs_farm.images import array_from_png, layers_from_exr
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run, Summary
from pbrs_farm.run.plan import wanted
from pbrs_farm.transport.scene_tables.sky import clear_sky_lx
from tests.inputs.small_recipes import small

OPTIONAL = [name for name in layers.OPTIONAL if not LAYER[name].partner]
ALONE = [x for x in LAYERS if not x.partner]  # layers of a view without a partner


@pytest.fixture(scope="module")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Summary]:
    out = tmp_path_factory.mktemp("out")
    return out, run_local(Run(["builtin"], str(out), small(), wanted([], OPTIONAL, 2)))


@pytest.fixture
def view(finished_run: tuple[Path, Summary]) -> Path:
    return sorted(finished_run[0].glob("houses/*/views/*"))[0]


def test_nothing_fails(finished_run: tuple[Path, Summary]) -> None:
    assert finished_run[1].failures == []
    assert finished_run[1].n_views == 2


def test_every_layer_is_stored_in_its_type(view: Path) -> None:
    for layer in ALONE:
        data = (view / layer.file).read_bytes()
        if layer.file.endswith(".png"):
            assert str(array_from_png(data).dtype) == layer.dtype, layer.name
        else:
            channels = layers_from_exr(data).values()
            assert all(np.isfinite(c).all() and c.shape == (72, 96) for c in channels), layer.name


def test_the_table_of_layers_names_the_step_that_writes_each_file(view: Path) -> None:
    for layer in ALONE:
        marker = view.parents[1] / "done" / f"{layer.step}.{view.name}.json"
        keys = [file["key"] for file in json.loads(marker.read_text())["files"]]
        assert any(key.endswith(f"/{view.name}/{layer.file}") for key in keys), layer.name


def test_the_pictures_are_lit(view: Path) -> None:
    for mode in ("opengl_dl", "opengl_il", "mlt_ol", "mlt_il_ol"):
        assert 20 < array_from_png((view / f"{mode}.png").read_bytes()).mean() < 240, mode


def test_every_rooms_illuminance_is_recorded_once_and_repeated_by_its_views(
    finished_run: tuple[Path, Summary],
) -> None:
    house = next(finished_run[0].glob("houses/*"))
    record = json.loads((house / "illuminance.json").read_text())
    rooms = {row["room"]: row for row in record["rooms"]}
    described = json.loads((house / "house.json").read_text())
    assert set(rooms) == {room["id"] for room in described["rooms"]}
    assert all(row["outdoor_lx"] + row["indoor_lx"] > 0 for row in rooms.values())
    elevation_rad = math.radians(record["sky"]["sun_elevation_deg"])
    assert record["sky"]["sky_lx"] == pytest.approx(clear_sky_lx(elevation_rad), rel=1e-3)
    assert "illuminance.json" in (house / "manifest.jsonl").read_text()
    for file in house.glob("views/*/view.json"):
        sheet = json.loads(file.read_text())
        row, light = rooms[sheet["room"]], sheet["modes"]["light"]
        assert light["floor_lux"] == {"outdoor": row["outdoor_lx"], "indoor": row["indoor_lx"]}
        assert light["warnings"] == row["warnings"]


def test_labels_agree_with_the_table(view: Path) -> None:
    table = {row["id"]: row for row in json.loads((view / "view.json").read_text())["instances"]}
    instance = array_from_png((view / "instance.png").read_bytes())
    semantic = array_from_png((view / "semantic.png").read_bytes())
    for number, pixels in zip(*np.unique(instance[instance > 0], return_counts=True), strict=True):
        assert table[number]["pixels"] == pixels
        assert set(semantic[instance == number]) == {table[number]["nyu40"]}


def test_verify_finds_nothing_wrong(finished_run: tuple[Path, Summary]) -> None:
    certificate = verify(finished_run[0], sample=500)
    assert certificate.is_clean, certificate.text()


def test_a_second_run_renders_nothing(finished_run: tuple[Path, Summary]) -> None:
    again = run_local(Run(["builtin"], str(finished_run[0]), small(), wanted([], OPTIONAL, 2)))
    assert again.n_done == 0
    assert again.failures == []


@pytest.mark.long
def test_a_view_made_again_has_the_same_bytes(
    finished_run: tuple[Path, Summary], tmp_path: Path
) -> None:
    root = tmp_path / "again"
    shutil.copytree(finished_run[0], root)
    before = (root / "manifest.jsonl").read_bytes()
    for marker in root.glob("houses/*/done/*_*.json"):
        marker.unlink()
    summary = run_local(Run(["builtin"], str(root), small(), wanted([], OPTIONAL, 2)))
    assert summary.n_done == 12
    assert (root / "manifest.jsonl").read_bytes() == before
