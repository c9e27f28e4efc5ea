"""What a mutation costs, and what another camera compiles: two figures of the bench `light`."""

from __future__ import annotations

import time
from typing import Final

from benchmarks.light.shots import METROPOLIS, PLAIN, room_shot, timed
from pbrs_farm.core.lighting import Group

SIZE: Final = (64, 48)
_SPP: Final = 512


def mutation_cost() -> float:
    """CPU time of a mutation over that of a path sample, both of freshly drawn paths.

    With 99 % large steps a proposal is a path like any other, so that depths are the same.
    """
    from pbrs_farm.transport.metropolis.film import ROUND_STEPS
    from pbrs_farm.transport.metropolis.integrator import chain_run
    from pbrs_farm.transport.sample_passes import SampledView

    fields = METROPOLIS.model_copy(
        update={"spp": _SPP, "large_step": 0.99, "rr_depth": 3, "tail_pixels": 0}
    )
    shot = room_shot("sunlit", SIZE)
    alike = PLAIN.model_copy(update={"spp": _SPP, "rr_depth": fields.rr_depth})
    _result, path_s = timed(shot, alike, seed=1)
    emitters, _weights = shot.scene.emitters(shot.camera, fields, 1)

    def mutate(n: int) -> int:
        some = fields.model_copy(update={"mutations_per_pixel": n})
        view = SampledView(shot.scene.device_scene, emitters, shot.camera, some, 1)
        run = chain_run(view, Group.OUTDOOR, min_segments=1)
        assert run is not None
        while run.n_steps < run.n_wanted:
            run.advance(min(ROUND_STEPS, run.n_wanted - run.n_steps))
        return run.estimate().n_mutations

    # The bootstrap is the same for both counts and drops out of the difference.
    mutate(1)
    counts, spent = [], []
    for per_pixel in (256, 1024):
        began = time.process_time()
        counts.append(mutate(per_pixel))
        spent.append(time.process_time() - began)
    mutation_s = (spent[1] - spent[0]) / (counts[1] - counts[0])
    return mutation_s / (path_s / (_SPP * SIZE[0] * SIZE[1]))


def compiled_by_another_camera() -> float:
    """Kernels that a second camera of a loaded room compiles, both integrators."""
    import drjit as dr

    shot = room_shot("sunlit", SIZE)
    few = METROPOLIS.model_copy(update={"mutations_per_pixel": 8, "direct_spp": 1})
    fields = (PLAIN.model_copy(update={"spp": 1}), few)
    for some in fields:
        shot.scene.render(shot.camera, "-", some, 1)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for some in fields:
            shot.scene.render(shot.camera.with_size(SIZE[1], SIZE[0]), "-", some, 2)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    misses = sum(not k["cache_hit"] for k in kernels)
    print(f"another camera: {len(kernels)} kernels launched, {misses} compiled", flush=True)
    return float(misses)
