"""Kernels that a view launches: counted in small views, reckoned for one of 640x480; two figures of the bench `light`.

What a view launches does not depend on its size but by the number of its launches of samples and of chains.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from benchmarks.light.shots import Shot
from pbrs_farm.core.recipe import LightFields, Recipe, recipe_from_name
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sunsky
from tests.transport import hard_rooms

SIZE: Final = (640, 480)
_SMALL: Final = (48, 36)
_NEVER: Final = 1e-4  # a noise that is never reached: each round of the chains is a launch


class Counts(NamedTuple):
    """What makes up the kernels that a view of both groups launches by Metropolis."""

    without: float  # all but the launches of chains, with one launch of direct samples
    of_chains: float  # a launch of chains
    of_samples: float  # a launch of direct samples


def sunny_shade() -> Shot:
    """A room with light of both groups and a lamp that rays are guided to."""
    house, camera = hard_rooms.open_shade()
    sky = sunsky(Recipe(), elevation_rad=0.6, azimuth_rad=0.35)
    scene = LightScene.load(house, {}, Recipe(), sky)
    shot = Shot("sunny", "lamp in an open shade by day", scene, camera.with_size(*_SMALL))
    scene.render(shot.camera, "-", LightFields(spp=1), 1)  # what is made once for a scene
    return shot


def counted(shot: Shot, fields: LightFields) -> int:
    """The kernels that a view launches, as Dr.Jit's history has them."""
    import drjit as dr

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        shot.scene.render(shot.camera, "-", fields, 2)
        return sum(k["type"] == dr.KernelType.JIT for k in dr.kernel_history())


def counts_of(shot: Shot, paper: LightFields) -> Counts:
    """Counted in small views."""
    # Count what a round of the chains brings, as a launch of its own, and what is there without any.
    i = shot.camera.intrinsics
    n_pixels = i.width_px * i.height_px
    few = paper.model_copy(update={"direct_spp": 1, "noise": _NEVER, "chains": n_pixels})
    counts, rounds = [], []
    for n in (64, 80):
        fields = few.model_copy(update={"mutations_per_pixel": n})
        counts.append(counted(shot, fields))
        rounds.append(rounds_of(fields, n_pixels)[0])
    of_chains = (counts[1] - counts[0]) / (rounds[1] - rounds[0])
    # Count what a launch of samples brings: passes of `path` to a noise are a launch each.
    plain = paper.model_copy(update={"integrator": "path", "spp": 1, "noise": _NEVER})
    passes = [counted(shot, plain.model_copy(update={"max_spp": n})) for n in (2, 4)]
    return Counts(counts[0] - rounds[0] * of_chains, of_chains, (passes[1] - passes[0]) / 2)


def reckoned(
    counts: Counts, paper: LightFields, size: tuple[int, int], chain_rounds: int | None = None
) -> int:
    """Kernels that a view of a size launches, at most: some launches have the prefixes of the last.

    chain_rounds: chains times rounds of a launch, None: as on a GPU.
    """
    from pbrs_farm.transport.metropolis.metropolis_view import GPU_CHAIN_ROUNDS, rounds_of_a_launch
    from pbrs_farm.transport.sample_passes import samples_per_launch

    n_pixels = size[0] * size[1]
    n_rounds, n_chains = rounds_of(paper, n_pixels)
    per_launch = rounds_of_a_launch(n_chains, n_pixels, chain_rounds or GPU_CHAIN_ROUNDS)
    n_launches = -(-n_rounds // per_launch)
    more_samples = -(-paper.direct_spp // samples_per_launch(n_pixels)) - 1
    n = counts.without + n_launches * counts.of_chains + more_samples * counts.of_samples
    return round(n)


def rounds_of(fields: LightFields, n_pixels: int) -> tuple[int, int]:
    """(rounds of a view's chains, number of chains)."""
    from pbrs_farm.transport.metropolis.film import ROUND_STEPS
    from pbrs_farm.transport.metropolis.integrator import n_chains_of

    wanted = n_pixels * fields.mutations_per_pixel
    n_chains = n_chains_of(wanted, fields)
    n_steps = -(-wanted // n_chains)
    return -(-n_steps // ROUND_STEPS), n_chains


def launch_figures() -> dict[str, float]:
    """light.paper_launches and light.fast_launches: kernels of a view of 640x480 with both groups, on a GPU."""
    shot = sunny_shade()
    paper, fast = recipe_from_name("paper").light, recipe_from_name("fast").light
    # As many samples as the view of 640x480 has, so that its guided rays are tried, too.
    spp = fast.spp * SIZE[0] * SIZE[1] // (_SMALL[0] * _SMALL[1])
    return {
        "light.paper_launches": float(reckoned(counts_of(shot, paper), paper, SIZE)),
        "light.fast_launches": float(counted(shot, fast.model_copy(update={"spp": spp}))),
    }
