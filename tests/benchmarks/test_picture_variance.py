"""Errors of ways to render, told from independent pictures of noise that is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.light.picture_variance import Run, compared, relative_spread, relmse_of

LIGHT = np.linspace(1.0, 3.0, 48 * 36).reshape(36, 48)


def noisy(error: float, *, n: int = 6, seed: int = 0) -> NDArray[np.float64]:
    """Pictures of LIGHT, each pixel with a relative error of this standard deviation."""
    noise = np.random.default_rng(seed).standard_normal((n, *LIGHT.shape))
    return np.asarray(LIGHT * (1 + error * noise))


def test_relmse_is_the_variance_between_pictures() -> None:
    found = compared(Run(noisy(0.1), 1.0), Run(noisy(0.2, seed=1), 1.0))
    assert found.first.relmse == pytest.approx(0.01, rel=0.05)
    assert found.second.relmse == pytest.approx(0.04, rel=0.05)
    # The median of a variance of six pictures lies 13 % below the variance.
    assert found.second.median == pytest.approx(0.2 * np.sqrt(0.87), rel=0.05)


def test_ratios_are_those_at_equal_cpu() -> None:
    # Half the error in twice the CPU is a quarter of the variance, twice as dear.
    found = compared(Run(noisy(0.1), 2.0), Run(noisy(0.2, seed=1), 1.0))
    assert found.relmse_ratio == pytest.approx(0.5, rel=0.05)
    assert found.median_ratio == pytest.approx(np.sqrt(0.5), rel=0.05)


def test_a_long_picture_of_a_few_seeds_is_no_better_than_what_it_costs() -> None:
    found = compared(Run(noisy(0.1), 4.0), Run(noisy(0.2, seed=1), 1.0))
    assert found.relmse_ratio == pytest.approx(1.0, rel=0.05)


def test_the_spread_of_a_ratio_is_that_between_repeated_runs() -> None:
    small = [
        (noisy(0.1, seed=s)[:, :4, :4], noisy(0.2, seed=s + 1000)[:, :4, :4]) for s in range(200)
    ]
    found = [compared(Run(a, 1.0), Run(b, 1.0)) for a, b in small]
    between = np.std(np.log([c.relmse_ratio for c in found]))
    told = np.median([relative_spread(c.relmse_without) for c in found])
    assert told == pytest.approx(between, rel=0.25)


def test_one_firefly_makes_the_spread_wide() -> None:
    pictures = noisy(0.2, seed=1)
    calm = compared(Run(noisy(0.1), 1.0), Run(pictures, 1.0))
    pictures[2, 10, 10] = 1000.0
    wild = compared(Run(noisy(0.1), 1.0), Run(pictures, 1.0))
    assert relative_spread(calm.relmse_without) < 0.1
    assert relative_spread(wild.relmse_without) > 0.5
    assert wild.median_ratio == pytest.approx(calm.median_ratio, rel=0.01)


def test_the_mean_of_all_pictures_trusts_the_less_noisy_ones() -> None:
    found = compared(Run(noisy(0.01), 1.0), Run(noisy(1.0, seed=1), 1.0))
    left = relmse_of(found.truth[None], LIGHT)
    assert left == pytest.approx(0.01**2 / 6, rel=0.1)
    assert found.truth_relmse == pytest.approx(left, rel=0.25)


def test_a_biased_picture_has_its_bias_as_error() -> None:
    assert relmse_of(1.1 * LIGHT[None], LIGHT) == pytest.approx(0.01, rel=0.01)


@pytest.mark.parametrize("n", [2, 5])
def test_runs_of_other_lengths_or_of_two_pictures_are_refused(n: int) -> None:
    with pytest.raises(ValueError, match=rf"\({n}, 36, 48\).*three or more"):
        compared(Run(noisy(0.1, n=n), 1.0), Run(noisy(0.1, n=2), 1.0))
