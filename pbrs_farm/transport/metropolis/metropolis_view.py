"""A view by Metropolis: direct light by `path`, the rest by chains of both groups in turns.

Effects: reads the clock where there is a time budget.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.lighting import Group
from pbrs_farm.transport.light_result import LightResult, join_results, result_from_sums
from pbrs_farm.transport.metropolis.film import ROUND_STEPS
from pbrs_farm.transport.metropolis.integrator import MIN_STEPS, ChainRun, Estimate, chain_run
from pbrs_farm.transport.render_checkpoint import Arrays, RenderCheckpoint
from pbrs_farm.transport.sample_passes import SampledView, direct_sums
from pbrs_farm.transport.time_budget import TimeBudget

_DIRECT_COST: Final = 0.05  # of a direct sample, in mutations of both groups; for the share done
GPU_CHAIN_ROUNDS: Final = 1 << 20  # suffixes of 160 bytes, 0.2 GB
_PIXEL_ROUNDS: Final = 1 << 24  # pixels times rounds: groups of 8 bytes, 16 more on the host
_CHAIN_ROUNDS_PER_THREAD: Final = 1 << 16  # some ten seconds
_NO_END: Final = 1 << 31  # steps of a chain where time alone decides

Runs = Mapping[Group, ChainRun]


def render_groups(
    view: SampledView, checkpoint: RenderCheckpoint
) -> tuple[LightResult, dict[Group, Estimate]]:
    """(direct light with the denoiser's guides, each group's estimate of the remaining light by chains).

    Without direct samples the chains estimate all light. Ends after fields.mutations_per_pixel, earlier if
    fields.noise is reached, or with fields.time_budget_s.
    """
    fields = view.fields
    budget = TimeBudget(fields.time_budget_s, checkpoint.spent_s)
    direct_cost = _DIRECT_COST * fields.direct_spp
    direct_share = direct_cost / (direct_cost + fields.mutations_per_pixel)
    sums = direct_sums(view, checkpoint, share=direct_share)
    direct = result_from_sums(sums, view.camera, max(fields.direct_spp, 1), {})

    # Run the chains of both groups in turns, so that the noise of their sum can decide.
    runs = _chain_runs(view, checkpoint.kept("chains"))
    n_steps = min((run.n_steps for run in runs.values()), default=0)
    n_wanted = max((run.n_wanted for run in runs.values()), default=0)
    goal = _NO_END if runs and budget.is_limited else n_wanted
    noise = _noise_left(view, direct, runs, n_steps)
    steps = ROUND_STEPS * _rounds_per_launch(view, runs)
    while n_steps < goal and noise > 1 and (n_steps == 0 or budget.left_s > 0):
        n = min(steps, goal - n_steps)
        for run in runs.values():
            run.advance(n)
        n_steps += n
        noise = _noise_left(view, direct, runs, n_steps)
        share = max(n_steps / goal, budget.share, 1 / max(noise, 1) ** 2)
        share = direct_share + (1 - direct_share) * min(share, 1.0)
        checkpoint.keep("chains", share, _state_of(runs))
    return direct, {g: _estimate(view, runs, g) for g in Group}


def _chain_runs(view: SampledView, stored: Arrays) -> dict[Group, ChainRun]:
    """The chains of each group that has light, started or as they were kept."""
    first = 3 if view.fields.direct_spp > 0 else 1
    runs = {}
    for k, group in enumerate(Group):
        prefix = f"{group.value}."
        part = {n.removeprefix(prefix): a for n, a in stored.items() if n.startswith(prefix)}
        own_view = replace(view, seed=view.seed + k)
        run = chain_run(own_view, group, min_segments=first, kept=part)
        if run is not None:
            runs[group] = run
    return runs


def _rounds_per_launch(view: SampledView, runs: Runs) -> int:
    """Rounds of the chains per launch; the picture is the same to 1e-5 for any number."""
    if view.fields.noise > 0 or view.fields.time_budget_s > 0:
        return 1  # either may end the chains after any round
    i = view.camera.intrinsics
    n_chains = max((run.n_chains for run in runs.values()), default=1)
    return rounds_of_a_launch(n_chains, i.width_px * i.height_px, chain_rounds_per_launch())


def rounds_of_a_launch(n_chains: int, n_pixels: int, chain_rounds: int) -> int:
    """Rounds per launch: at most chain_rounds of all chains, each with its own groups."""
    return max(min(chain_rounds // n_chains, _PIXEL_ROUNDS // n_pixels), 1)


def chain_rounds_per_launch() -> int:
    """Chains times rounds of a launch: on a GPU as memory allows, on a CPU some seconds of work."""
    is_gpu = dr.backend_v(mi.Float) == dr.JitBackend.CUDA
    if is_gpu:
        return GPU_CHAIN_ROUNDS
    return min(_CHAIN_ROUNDS_PER_THREAD * int(dr.thread_count()), GPU_CHAIN_ROUNDS)


def _state_of(runs: Runs) -> Callable[[], Arrays]:
    return lambda: {f"{g.value}.{n}": a for g, run in runs.items() for n, a in run.state().items()}


def _noise_left(view: SampledView, direct: LightResult, runs: Runs, n_steps: int) -> float:
    """The noise so far over the one asked for; infinite where mutations or time alone decide."""
    if view.fields.noise <= 0 or n_steps < MIN_STEPS:
        return np.inf
    halves = {g: _estimate(view, runs, g).halves for g in Group}
    base = direct if view.fields.direct_spp > 0 else None
    return join_results(base, direct, halves, 0, {}).noise["sum"] / view.fields.noise


def _estimate(view: SampledView, runs: Runs, group: Group) -> Estimate:
    """Estimate of a group's chains; black without any."""
    if group in runs:
        return runs[group].estimate()
    i = view.camera.intrinsics
    black = np.zeros((i.height_px, i.width_px, 3), np.float32)
    return Estimate((black, black), 0.0, 0.0, 0, 0)
