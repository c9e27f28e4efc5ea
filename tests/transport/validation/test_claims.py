"""The claims of `verify --light` hold, and a faulty renderer fails them."""

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
from pbrs_farm.transport.validation.claims import CLAIMS, LightClaim, light_claims, z_scores

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
    ("furnace 0.3", brighter),
    ("floor", brighter),
    ("normal map", brighter),
    ("sealed room", leaking),
    ("sum of groups", mixed),
    ("doubled emitters", leaking),
    ("window pane", noisy),
    ("repeats", noisy),
    ("nonfinite", silent),
]


@pytest.mark.quick(4)
@needs_kernels
@pytest.mark.parametrize(("name", "fault"), FAULTS)
def test_a_claim_holds_and_fails_on_a_renderer_that_is_wrong(
    name: str, fault: Callable[[LightResult], LightResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert CLAIMS[name](VARIANT).passed
    right = LightScene.render

    def wrong(self: LightScene, *words: Any) -> LightResult:
        return fault(right(self, *words))

    monkeypatch.setattr(LightScene, "render", wrong)
    assert not CLAIMS[name](VARIANT).passed


def test_means_that_differ_by_five_percent_are_distinguished_and_equal_ones_are_not() -> None:
    rng = np.random.default_rng(0)
    a, b, c = ([level * rng.normal(1, 0.01, 16) for _ in range(4)] for level in (1, 1, 1.05))
    assert np.abs(z_scores(a, b)).max() < 5
    assert np.abs(z_scores(a, c)).max() > 5


def test_a_scalar_variant_has_no_claims_to_test() -> None:
    with pytest.raises(MachineFailed, match="need LLVM or CUDA"):
        next(light_claims("scalar_rgb"))


@pytest.mark.parametrize("passed", [True, False])
def test_the_exit_code_reports_whether_all_claims_hold(
    passed: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def two_claims(_variant: str) -> Iterator[LightClaim]:
        yield LightClaim("one", "1", "1", True, 0.5)
        yield LightClaim("two", "2", "2", passed, 0.5)

    monkeypatch.setattr(claims, "light_claims", two_claims)
    assert main(["verify", "--light", "--json"]) == (0 if passed else 1)
    report = json.loads(capsys.readouterr().out)
    assert [c["passed"] for c in report["claims"]] == [True, passed]
    assert report["n_failed"] == (0 if passed else 1)
    assert main(["verify", "--light"]) == (0 if passed else 1)
    text = capsys.readouterr().out
    assert ("all hold" in text) == passed
    assert text.count("FAIL") == (0 if passed else 2)


def test_verify_takes_a_folder_or_light(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify"]) == 1
    assert "give a FOLDER, or --light" in capsys.readouterr().err


def test_a_block_that_varies_more_than_the_others_is_no_difference() -> None:
    rng = np.random.default_rng(1)
    spread = np.full(16, 0.03)
    spread[2] = 0.2  # a bulb's
    worst = []
    for _ in range(200):
        a, b = (list(1 + spread * rng.standard_normal((4, 16))) for _ in range(2))
        worst.append(np.abs(z_scores(a, b)).max())
    assert np.mean(np.array(worst) > 5) < 0.02
    # A difference in a single block is detected.
    moved = [x + 0.2 * (np.arange(16) == 5) for x in b]
    assert np.abs(z_scores(a, moved)).max() > 5
