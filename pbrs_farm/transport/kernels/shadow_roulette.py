"""Russian roulette of shadow rays: one that can bring little is cast by chance; kernels, no effects.

A shadow ray costs the same whatever it can bring. What it would bring if nothing stood in its
way is known before it is cast, and how often one like it arrives is, too (arrival_rates.py).
Where the product of both lies below a threshold it is cast with a chance in proportion to that,
and what it brings is divided by the chance, so that the mean stays (Arvo and Kirk 1990). The
chance has a least value: without it dark corners of a bright view had spots as bright as the
threshold. What a ray cast by chance brings is at most the threshold over the share of such rays
that arrives (0.02 at least), and at most ten times what it would bring if all were cast.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.transport.kernels.bsdf import luminance
from pbrs_farm.transport.kernels.sampler import Sampler

LEAST_CHANCE: Final = 0.1
# Random dimensions beyond all of the vertices' own: Metropolis, which has no such roulette, keeps its
# stored numbers.
FREE_DIM: Final = 1 << 16


class ShadowRoulette(NamedTuple):
    """Whether a shadow ray is cast at a vertex."""

    beta: Any  # Color3f, throughput of the path up to the vertex
    threshold: Any  # expected luminance from which on every ray is cast; 0 = every ray is
    u: Any  # random number

    def cast_by_chance(self, unshadowed: Any, rate: Any) -> tuple[Any, Any]:
        """(Bool: the ray is cast, chance of that) by what it would bring, before the throughput.

        rate: share of such rays that arrive.
        """
        expected = luminance(self.beta * unshadowed) * rate
        chance = dr.maximum(expected / self.threshold, LEAST_CHANCE)
        chance = dr.select(expected < self.threshold, chance, mi.Float(1))
        return self.u < chance, chance


def shadow_roulette(
    beta: Any, threshold: Any, sampler: Sampler, dim: Any, number: int
) -> ShadowRoulette | None:
    """The roulette of one of a vertex's shadow rays; none without a throughput.

    dim: the first random dimension of the vertex. number: of the shadow ray, each its own.
    """
    if beta is None:
        return None
    return ShadowRoulette(beta, threshold, sampler.get_1d(dim + (FREE_DIM + number)))
