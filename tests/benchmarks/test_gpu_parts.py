"""Parts of the GPU's bench: a failed part costs only itself, and the large home is the small one in more triangles."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import figures
from benchmarks.light import gpu
from pbrs_farm.core.house import corners_of_surfaces
from pbrs_farm.read.builtin.builtin_home import builtin_home


def areas(surfaces) -> np.ndarray:
    corners = corners_of_surfaces(surfaces)
    edges = corners[:, 1:] - corners[:, :1]
    return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2


def test_a_split_home_has_four_triangles_for_each_on_the_same_surfaces():
    house = builtin_home()
    split = gpu.split_triangles(house)
    assert gpu.count_faces(split) == 4 * gpu.count_faces(house)
    for item, split_item in zip(house.items, split.items, strict=True):
        for surface, quarter in zip(item.surfaces, split_item.surfaces, strict=True):
            before, after = areas([surface]), areas([quarter]).reshape(-1, 4)
            # Each triangle becomes four of a quarter of its area, with its orientation.
            np.testing.assert_allclose(after, np.tile(before[:, None] / 4, 4), rtol=1e-2, atol=1e-7)
            assert (quarter.uvs is None) == (surface.uvs is None)


def test_a_part_that_fails_leaves_its_figures_out_and_the_others_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> dict[str, object]:
        raise RuntimeError("no card")

    monkeypatch.setattr(figures, "FOLDER", tmp_path)
    monkeypatch.setattr(gpu, "PARTS", {"a": fail, "b": lambda: {"gpu.denoise_ms": 3.0}})
    with pytest.raises(SystemExit, match="failed: a"):
        gpu.main()
    assert "a failed: RuntimeError: no card" in capsys.readouterr().err
    stored = json.loads((tmp_path / "gpu.json").read_text())["figures"]
    assert stored["gpu.denoise_ms"] == 3.0
    assert stored["gpu.opengl_ms"] == -1
    assert set(stored) == set(gpu.UNITS)
