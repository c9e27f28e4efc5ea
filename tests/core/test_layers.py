"""The table of layers is the only list: one file adds a layer."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from pydantic import TypeAdapter

from pbrs_farm.core import layers
from pbrs_farm.core.layers import LAYER, OWN_LAYERS, Layer, layers_in_digest
from tests.scene.homes import SMALL

REPO = Path(__file__).parents[2]
SLOPE = """
import numpy as np
from pbrs_farm.core.layers import optional_layer


class Slope:
    layer = optional_layer("slope", "Y", "uint8", "degrees from level", shown_as="mask")

    @staticmethod
    def label(inputs):
        up = np.abs(inputs.hit.geo_normal_world[..., 1]).clip(0, 1)
        return np.where(inputs.hit.valid, np.degrees(np.arccos(up)), 0).astype(np.uint8)


SLOPE = Slope()
"""
SHOW = """
from pathlib import Path
from pbrs_farm.board.pictures import shown_pixels, title_of
file, = Path("o").glob("houses/*/views/*/slope.png")
print(title_of("slope"), shown_pixels("slope", file.read_bytes(), "").max())
"""


@pytest.mark.long
@pytest.mark.kinds("layer")
def test_a_file_is_all_that_a_new_layer_takes(tmp_path: Path) -> None:
    (tmp_path / "slope.py").write_text(SLOPE)
    info = tmp_path / "slope-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: slope\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pbrs_farm.layers]\nslope = slope:SLOPE\n")
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(REPO)])}

    def output_of(*words: str) -> str:
        command = [sys.executable, *words]
        done = subprocess.run(command, env=env, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    few = ["--recipe", "preview", "--modes", "opengl_dl", "--views", "1", "--out", "o"]
    few += [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]
    # It is written, listed, checked by verify, and shown by the board.
    output_of("-m", "pbrs_farm.cli", "run", "builtin", "--layers", "slope", *few)
    assert "degrees from level" in output_of("-m", "pbrs_farm.cli", "layers")
    assert "slope.png (1): hash, size and type alone" in output_of(
        "-m", "pbrs_farm.cli", "verify", "o"
    )
    assert output_of("-c", SHOW).split() == ["Slope", "244"]


def test_each_cell_of_the_table_is_a_value_of_its_field():
    # layers.py reads the table without pydantic, so a wrong value in a cell would pass unnoticed.
    rows = [TypeAdapter(Layer).validate_python(asdict(layer)) for layer in OWN_LAYERS]
    assert rows == list(OWN_LAYERS)


def test_a_digest_knows_the_version_of_a_layer_and_the_limit_of_its_albedo(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert layers_in_digest(["depth_z", "nocs"], 0.9) == []
    shown = ["albedo 0.9", "projector 0.9", f"projector {LAYER['projector'].version}"]
    assert layers_in_digest(["albedo", "projector"], 0.9) == shown
    changed = tuple(replace(x, version=3) if x.name == "hha" else x for x in layers.LAYERS)
    monkeypatch.setattr(layers, "LAYERS", changed)
    assert layers_in_digest(["hha", "depth_z"], 1.0) == ["hha 3"]
    assert LAYER["hha"].version == 1
