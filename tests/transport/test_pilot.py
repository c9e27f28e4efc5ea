"""The pilot with many lamps: weights of found lamps, its smallest size, and the choice by a trial."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.raycast.variant import choose_variant

if choose_variant().startswith("scalar"):
    pytest.skip("the kernels need LLVM or CUDA", allow_module_level=True)


def test_the_least_weights_of_many_lamps_leave_half_to_those_of_the_pilot() -> None:
    from pbrs_farm.transport.pilot import LAMP_FLOOR, lamp_floors

    assert lamp_floors(500).sum() == pytest.approx(0.5)
    assert (lamp_floors(18) == LAMP_FLOOR).all()
    assert len(lamp_floors(0)) == 0


@pytest.mark.parametrize("n_emitters", [1, 18, 170])
def test_the_pilot_of_a_home_is_whole(n_emitters: int) -> None:
    from pbrs_farm.transport.pilot import pilot_size

    assert pilot_size(n_emitters) == (32, 24)


@pytest.mark.parametrize("n_emitters", [171, 508, 2000])
def test_the_pilot_of_very_many_emitters_is_smaller(n_emitters: int) -> None:
    from pbrs_farm.transport.pilot import pilot_size

    width, height = pilot_size(n_emitters)
    assert width * height * n_emitters <= 1 << 17
    assert width * 3 == height * 4


@pytest.mark.parametrize(("bright", "is_guided"), [("outdoor", False), ("indoor", True)])
def test_a_firefly_that_guided_rays_lack_chooses_them_unless_it_is_daylight(
    bright: str, is_guided: bool
) -> None:
    from pbrs_farm.transport.path_tracer import SampleSums
    from pbrs_farm.transport.pilot import pays

    height, width = 8, 12
    n = 2 * height * width
    odd, even = np.random.default_rng(1).uniform(0.9, 1.1, (2, n, 3)).astype(np.float32)

    def chosen(firefly: str) -> bool:
        plus = {name: np.zeros((n, 3), np.float32) for name in ("outdoor", "indoor")}
        if firefly:
            plus[firefly][7] = 50
        light = {name: odd + even + x for name, x in plus.items()}
        halves = {f"{name}_even": even + x for name, x in plus.items()}
        return pays(
            SampleSums(**light, **halves, albedo=odd, normal=odd, n_bad=0), (2, height, width)
        )

    assert not chosen("")
    assert chosen(bright) is is_guided
