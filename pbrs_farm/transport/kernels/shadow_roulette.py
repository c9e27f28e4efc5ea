"""Russian roulette of shadow rays: rays with a small possible contribution are cast by chance; kernels, no effects.

A shadow ray costs the same whatever its contribution. Its unoccluded contribution is known before it is
cast, and so is its arrival rate (arrival_rates.py). If their product is below a threshold, the ray is cast
with a probability in proportion to it, and its contribution is divided by the probability, which keeps
the mean (Arvo and Kirk 1990). The probability has a lower bound: without one, dark corners of a bright
view had spots as bright as the threshold. The contribution of a ray cast by chance is at most the
threshold over its arrival rate (at least 0.02), and at most ten times its unweighted one.
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
        """(Bool: the ray is cast, its probability), from its light unshadowed and such rays' arrival rate."""
        expected = luminance(self.beta * unshadowed) * rate
        chance = dr.maximum(expected / self.threshold, LEAST_CHANCE)
        chance = dr.select(expected < self.threshold, chance, mi.Float(1))
        return self.u < chance, chance


def shadow_roulette(
    beta: Any, threshold: Any, sampler: Sampler, dim: Any, number: int
) -> ShadowRoulette | None:
    """Roulette of a vertex's shadow ray by its number; dim: the vertex's first; None without throughput."""
    if beta is None:
        return None
    return ShadowRoulette(beta, threshold, sampler.get_1d(dim + (FREE_DIM + number)))
