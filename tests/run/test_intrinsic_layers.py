"""Shading and residual are requested by --layers: dependent layers, cost, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.images import array_from_png, layers_from_exr
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run, Summary
from pbrs_farm.run.plan import wanted

TINY: Recipe = recipe_from_name(
    "preview",
    {
        "image.width_px": "32", "image.height_px": "24", "light.spp": "2", "light.pilot_spp": "0",
        "cameras.cell_m": "1.0", "cameras.score_width_px": "64", "cameras.score_height_px": "48",
    },
)  # fmt: skip


def run(root: Path, *layers: str) -> Summary:
    summary = run_local(Run(["builtin"], str(root), TINY, wanted(["mlt_il_ol"], layers, 1)))
    assert summary.failures == []
    return summary


def test_a_residual_brings_albedo_and_shading_along():
    assert wanted([], ["residual"]).layers == ("albedo", "shading", "residual")
    assert wanted([], ["residual_indoor"]).layers == ("albedo", "shading_indoor", "residual_indoor")


def test_what_is_made_of_light_is_refused_where_there_is_none(tmp_path, capsys):
    with pytest.raises(BadInput, match="--layers: shading: needs a path-traced mode"):
        wanted(["opengl_dl"], ["shading"])
    words = ["run", "builtin", "--recipe", "preview", "--out", str(tmp_path / "out")]
    assert main([*words, "--layers", "residual", "--set", "light.integrator=metropolis"]) != 0
    error = capsys.readouterr().err
    assert "shading: needs light by `path`, but the recipe has metropolis" in error
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_layers_of_light_are_added_to_a_view_and_stay(tmp_path):
    run(tmp_path)
    (view,) = tmp_path.glob("houses/*/views/*")
    plain = {name: (view / name).read_bytes() for name in ("radiance.exr", "depth.png")}
    assert not any(n.startswith("diffuse_") for n in layers_from_exr(plain["radiance.exr"]))
    # The light is rendered again; labels are added; house and cameras stay.
    added = run(tmp_path, "residual")
    assert added.n_done == 4
    assert (view / "depth.png").read_bytes() == plain["depth.png"]
    planes = layers_from_exr((view / "radiance.exr").read_bytes())
    assert {f"diffuse_{n}.G" for n in ("outdoor", "indoor", "albedo")} <= planes.keys()
    shading, residual = (
        layers_from_exr((view / f"{n}.exr").read_bytes()) for n in ("shading", "residual")
    )
    srgb = array_from_png((view / "albedo.png").read_bytes()) / 255
    albedo = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    total = albedo[..., 1] * shading["G"] + residual["G"]
    assert (total > -0.01 * total.max()).all()
    # A run without them renders nothing; one with other layers does not split light again.
    assert run(tmp_path).n_done == 0
    before = (view / "radiance.exr").read_bytes()
    assert run(tmp_path, "shading_indoor").n_done == 2
    assert (view / "radiance.exr").read_bytes() == before
    assert (view / "residual.exr").exists()
    assert (view / "shading_indoor.exr").exists()
