"""The step develop in isolation: exposure from earlier frames."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.radiance_exr import FILE, radiance_exr
from pbrs_farm.run import develop_step
from pbrs_farm.run.house_cache import CachedHouse, HouseCache
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.view_setup import ViewSetup
from pbrs_farm.store.memory_store import MemoryStore
from pbrs_farm.transport.develop.mode_pictures import LinearAovs

LAG = {
    "sensor.is_on": "true", "sensor.lag_s": "0.5", "sensor.iso_max": "1e6", "sensor.jpeg_quality": "0",
}  # fmt: skip
PANORAMA = {"lens.model": "equirect", "image.width_px": "64", "image.height_px": "32"}


def noisy_aovs(height: int, width: int) -> LinearAovs:
    """Noisy light, brighter on one side, from surfaces that face the eye."""
    rng = np.random.default_rng(2)
    side = 0.5 + 0.4 * np.sin(np.arange(width) / width * 2 * np.pi)
    light = side[None, :, None] * rng.gamma(0.3, 1 / 0.3, (height, width, 1)).repeat(3, -1)
    light = light.astype(np.float32)
    normal = np.zeros_like(light)
    normal[..., 2] = 1
    return LinearAovs(light, np.zeros_like(light), np.full_like(light, 0.5), normal)


def test_a_panorama_is_exposed_alike_wherever_earlier_frames_are_cut(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The edges of an earlier frame are no borders for the denoiser that computes its exposure."""
    camera = Camera(Intrinsics(64, 32, 30.0, 30.0, 32.0, 16.0), np.eye(4))
    views = {n: View(n, "r", 0, camera, time_s=t) for n, t in (("before", 0.0), ("now", 0.3))}
    store, aovs = MemoryStore(), noisy_aovs(32, 64)
    names = ("outdoor", "indoor", "albedo", "normal")
    exr = radiance_exr({name: getattr(aovs, name) for name in names})
    store.put(keys.view_key("home", "now", FILE), exr)
    small = noisy_aovs(24, 32)

    def exposure(lens: dict[str, str], shift: int) -> float:
        rolled = LinearAovs(*(np.roll(getattr(small, n), shift, 1) for n in names))
        monkeypatch.setattr(develop_step, "glance", lambda *_args: rolled)
        work = Work(
            store, recipe_from_name("fast", LAG | lens), "home", HouseCache(), view_id="now"
        )
        setup = ViewSetup(cast(CachedHouse, None), views["now"], views)
        outcome = develop_step.develop_step(work, lambda: setup)
        return float(outcome.facts["mlt_ol"]["exposure"])

    def spread(lens: dict[str, str]) -> float:
        return float(np.ptp(np.log([exposure(lens, shift) for shift in range(0, 32, 8)])))

    assert 0 < spread(PANORAMA) < 0.5 * spread({})
