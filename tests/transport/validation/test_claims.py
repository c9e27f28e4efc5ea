"""`verify --light`: its claims hold, and a renderer that is wrong fails them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.validation import claims
from pbrs_farm.transport.validation.claims import LightClaim, light_claims, z_scores

VARIANT = choose_variant()

needs_kernels = pytest.mark.skipif(
    VARIANT.startswith("scalar"), reason="the kernels need LLVM or CUDA"
)


@needs_kernels
@pytest.mark.slow
def test_every_claim_holds() -> None:
    assert [c.text for c in light_claims(VARIANT) if not c.passed] == []


def brighter(result: LightResult) -> LightResult:
    return replace(result, outdoor=result.outdoor * 1.03, indoor=result.indoor * 1.03)


def leaking(result: LightResult) -> LightResult:
    return replace(result, outdoor=result.outdoor + np.float32(1e-6))


def mixed(result: LightResult) -> LightResult:
    return replace(result, outdoor=result.outdoor + np.float32(0.01) * result.indoor)


def silent(result: LightResult) -> LightResult:
    return replace(result, n_nonfinite=0)


def noisy(result: LightResult) -> LightResult:
    some = np.random.default_rng().normal(1, 1e-6, result.outdoor.shape).astype(np.float32)
    return replace(result, outdoor=result.outdoor * some, indoor=result.indoor * some)


FAULTS = [
    (claims._furnace(claims._spp(128), "path", 0.3), brighter),
    (claims._floor_claim, brighter),
    (claims._normal_map, brighter),
    (claims._sealed_room, leaking),
    (claims._groups_sum, mixed),
    (claims._doubled_emitters, leaking),
    (claims._window_pane, noisy),
    (claims._repeats, noisy),
    (claims._nonfinite, silent),
]


@pytest.mark.quick(4)
@needs_kernels
@pytest.mark.parametrize(("prove", "fault"), FAULTS)
def test_a_claim_holds_and_fails_on_a_renderer_that_is_wrong(
    prove: Callable[[str], LightClaim],
    fault: Callable[[LightResult], LightResult],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert prove(VARIANT).passed
    right = LightScene.render

    def wrong(self: LightScene, *words: Any) -> LightResult:
        return fault(right(self, *words))

    monkeypatch.setattr(LightScene, "render", wrong)
    assert not prove(VARIANT).passed


def test_two_means_a_twentieth_apart_are_told_apart_and_equal_ones_are_not() -> None:
    rng = np.random.default_rng(0)
    a, b, c = ([level * rng.normal(1, 0.01, 16) for _ in range(4)] for level in (1, 1, 1.05))
    assert np.abs(z_scores(a, b)).max() < 5
    assert np.abs(z_scores(a, c)).max() > 5


def test_a_scalar_variant_is_told_that_there_is_nothing_to_prove() -> None:
    with pytest.raises(MachineFailed, match="need LLVM or CUDA"):
        next(light_claims("scalar_rgb"))


@pytest.mark.parametrize("passed", [True, False])
def test_the_exit_code_says_whether_all_claims_hold(
    passed: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def found(_variant: str) -> Iterator[LightClaim]:
        yield LightClaim("one", "1", "1", True, 0.5)
        yield LightClaim("two", "2", "2", passed, 0.5)

    monkeypatch.setattr(claims, "light_claims", found)
    assert main(["verify", "--light", "--json"]) == (0 if passed else 1)
    told = json.loads(capsys.readouterr().out)
    assert [c["passed"] for c in told["claims"]] == [True, passed]
    assert told["n_failed"] == (0 if passed else 1)
    assert main(["verify", "--light"]) == (0 if passed else 1)
    text = capsys.readouterr().out
    assert ("all hold" in text) == passed
    assert text.count("FAIL") == (0 if passed else 2)


def test_verify_wants_a_folder_or_light_and_not_both(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify"]) == 1
    assert "give a FOLDER, or --light" in capsys.readouterr().err
    assert main(["verify", "somewhere", "--light"]) == 1
    assert "takes no folder" in capsys.readouterr().err


def test_a_block_that_varies_more_than_the_others_is_no_difference() -> None:
    rng = np.random.default_rng(1)
    spread = np.full(16, 0.03)
    spread[2] = 0.2  # a bulb's
    worst = []
    for _ in range(200):
        a, b = (list(1 + spread * rng.standard_normal((4, 16))) for _ in range(2))
        worst.append(np.abs(z_scores(a, b)).max())
    assert np.mean(np.array(worst) > 5) < 0.02
    # A difference of a block that varies as the others do is seen.
    moved = [x + 0.2 * (np.arange(16) == 5) for x in b]
    assert np.abs(z_scores(a, moved)).max() > 5
