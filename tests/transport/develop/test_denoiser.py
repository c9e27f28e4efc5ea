from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.transport.develop.denoiser import denoise_radiance
from pbrs_farm.transport.light_result import relative_noise


def grey(level: float) -> np.ndarray:
    return np.full((32, 32, 3), level, np.float32)


def test_noise_is_the_relative_error_of_the_mean_of_two_halves() -> None:
    rng = np.random.default_rng(1)
    half = [1 + 0.2 * rng.standard_normal((200, 200, 1)).repeat(3, -1) for _ in range(2)]
    # Each half has 20 %, their mean 14 %; a tenth of the level in the divisor makes it 12.9 %.
    assert relative_noise(half[0], half[1]) == pytest.approx(0.2 / math.sqrt(2) / 1.1, rel=0.05)
    assert relative_noise(np.zeros((4, 4, 3)), np.zeros((4, 4, 3))) == 0


def test_the_denoiser_removes_noise_and_keeps_black_pictures() -> None:
    pytest.importorskip("pyoidn")
    rng = np.random.default_rng(2)
    noisy = (1 + 0.5 * rng.standard_normal((64, 64, 3))).clip(0).astype(np.float32)
    flat = grey(0.5).repeat(2, 0).repeat(2, 1)
    up = np.zeros((64, 64, 3), np.float32)
    up[..., 1] = 1
    clean = denoise_radiance(noisy, flat, up)
    assert clean.std() < 0.2 * noisy.std()
    assert clean.mean() == pytest.approx(noisy.mean(), rel=0.05)
    assert not denoise_radiance(np.zeros((8, 8, 3), np.float32), grey(0)[:8, :8], up[:8, :8]).any()


def test_one_denoiser_serves_all_pictures_of_a_process(monkeypatch: pytest.MonkeyPatch) -> None:
    pyoidn = pytest.importorskip("pyoidn")
    rng = np.random.default_rng(3)
    noisy = rng.lognormal(0, 1, (48, 64, 3)).astype(np.float32)
    up = np.zeros_like(noisy)
    up[..., 1] = 1
    first = denoise_radiance(noisy, np.full_like(noisy, 0.5), up)

    def refuse(*_words: object, **_named: object) -> None:
        raise AssertionError("another device")

    monkeypatch.setattr(pyoidn.Device, "__init__", refuse)
    smaller = denoise_radiance(noisy[:32, :32], np.full((32, 32, 3), 0.5, np.float32), up[:32, :32])
    assert smaller.shape == (32, 32, 3)
    # After a picture of another size the first one still gets the same bits.
    np.testing.assert_array_equal(first, denoise_radiance(noisy, np.full_like(noisy, 0.5), up))


def test_the_denoiser_imports_no_torch_and_leaves_it_to_others(tmp_path: Path) -> None:
    pytest.importorskip("pyoidn")
    (tmp_path / "torch.py").write_text("import sys\nassert 'pyoidn' in sys.modules, 'too early'\n")
    script = """
import sys
import numpy as np
from pbrs_farm.transport.develop.denoiser import denoise_radiance
grey = np.full((16, 16, 3), 0.5, np.float32)
denoise_radiance(grey, grey, grey)
assert 'torch' not in sys.modules
import torch
assert torch.__file__.startswith(sys.argv[1])
"""
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    command = [sys.executable, "-c", script, str(tmp_path)]
    imported = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    assert imported.returncode == 0, imported.stderr
