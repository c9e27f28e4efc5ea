"""A stream whose views a farm renders: real Redis, a real worker, and the labels of the local stream."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.sets.stream import Stream
from tests.workers.redis_server import RedisServer
from tests.workers.small_farm import REAL_RUNNER, SmallFarm

pytestmark = pytest.mark.chaos

SET = """
[render]
recipe = "preview"
set = ["light.spp=2", "light.pilot_spp=0", "cameras.cell_m=1.0", "cameras.score_width_px=80", "cameras.score_height_px=60"]
[part.views]
homes = ["made:1,rooms=0..1,furniture=none"]
views = 2
"""


def test_a_farm_renders_the_views_of_a_stream(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "small.toml").write_text(SET)
    (tmp_path / "redis").mkdir()
    server = RedisServer(tmp_path / "redis")
    server.start()
    farm = SmallFarm(tmp_path, server, runner=REAL_RUNNER, lease_s=60, heartbeat_s=2, resend_s=30)
    monkeypatch.setenv("PBRS_REDIS_URL", server.url)

    def stream(name: str, url: str) -> Stream:
        layers = ("colour", "normal", "depth")
        file = tmp_path / "small.toml"
        return pf.stream(file, layers=layers, size=(64, 48), cache=tmp_path / name, farm=url)

    try:
        farm.coordinator()
        farm.worker("w1")
        remote = stream("farm", farm.store.url)
        samples = {s["id"]: s for s in remote}
        again = {s["id"]: s for s in remote.epoch(1)}
        remote.close()
    finally:
        farm.close()
        server.end()
    local = stream("local", "")
    expected = {s["id"]: s for s in local}
    local.close()
    assert len(samples) == 2
    for name, sample in samples.items():
        assert sample["colour"].std() > 0
        assert again[name]["light"] != sample["light"]
        for layer in ("normal", "depth", "K"):
            np.testing.assert_array_equal(sample[layer], expected[name][layer])
