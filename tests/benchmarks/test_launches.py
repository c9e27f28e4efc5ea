"""The launches of a view, reckoned from counts of small ones."""

from __future__ import annotations

import pytest

from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.raycast.variant import choose_variant

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)

MAX_LAUNCHES = 200


@pytest.mark.slow
def test_launches_are_as_many_as_reckoned_and_few(monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks.light.launches import SIZE, counted, counts_of, reckoned, sunny_shade
    from pbrs_farm.transport.metropolis import metropolis_view

    shot, paper = sunny_shade(), recipe_from_name("paper").light
    counts = counts_of(shot, paper)
    some = paper.model_copy(update={"mutations_per_pixel": 32, "chains": 64, "direct_spp": 4})
    chain_rounds = 14 * 64  # 54 rounds are four launches; 14 rounds have the same prefixes
    monkeypatch.setattr(metropolis_view, "chain_rounds_per_launch", lambda: chain_rounds)
    assert counted(shot, some) == reckoned(counts, some, (48, 36), chain_rounds)
    assert reckoned(counts, paper, SIZE) <= MAX_LAUNCHES
