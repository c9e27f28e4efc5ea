"""The farm's pages follow and steer a real farm, one of whose workers is killed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pbrs_farm.board.live_farm import LiveFarm
from tests.board.served import TOKEN, served
from tests.board.web.browser import until
from tests.workers.conftest import redis_server
from tests.workers.redis_server import RedisServer
from tests.workers.small_farm import SmallFarm

__all__ = ["redis_server"]

pytestmark = pytest.mark.web


def test_a_job_is_watched_through_a_killed_worker_paused_and_done(
    tab: Any, redis_server: RedisServer, tmp_path: Path
) -> None:
    farm = SmallFarm(tmp_path / "farm", redis_server)
    try:
        (farm.control / "slow").write_text("0.4")
        farm.submit(4)
        farm.coordinator()
        farm.worker("w1")
        farm.worker("w2")
        with served(farm.store.url, tmp_path / "cache", LiveFarm(farm.farm)) as client:
            base = str(client.base_url).rstrip("/")
            tab.goto(f"{base}/login")
            tab.fill("input[name=token]", TOKEN)
            tab.click("button.main")
            tab.goto(f"{base}/farm")
            # Both workers and their tasks appear without a reload.
            until(
                tab,
                "document.getElementById('farm').textContent.match(/w1/)"
                " && document.getElementById('farm').textContent.match(/geometry|gl|light/)",
                timeout=30_000,
            )
            assert tab.inner_text("#live") == "live"
            farm.kill("w1")
            tab.click(f"text={farm.job}")
            # Pause with two clicks: page and ledger agree.
            tab.click("text=Pause")
            tab.click("text=Yes, pause")
            tab.wait_for_selector(".state.paused")
            assert farm.state() == "paused"
            tab.click("text=Resume")
            tab.click("text=Yes, resume")
            tab.select_option("select[name=to]", "1")
            tab.click("button:has-text('Change')")
            tab.click("text=Yes, priority")
            until(tab, "document.querySelector('select[name=to]')?.value === '1'")
            assert farm.farm.view(farm.job).fields["priority"] == "1"
            (farm.control / "slow").unlink()
            tab.wait_for_selector(".state.done", timeout=60_000)
            farm.wait_done()
            tab.goto(f"{base}/farm")
            assert "pause" in tab.inner_text("body")
            tab.goto("about:blank")  # ends the stream here instead of with the server
    finally:
        farm.close()
