"""The claims of `pbrs-farm verify --light`: each is measured and compared with a known value.

Rooms are small and built in code. Noisy claims state how many standard errors are allowed: with
other seeds a correct renderer would fail one of them about once in a thousand runs. Seeds are
fixed, so that one machine gives the same answer at every run. Effects: renders.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import House
from pbrs_farm.core.lighting import Group, Mode
from pbrs_farm.core.recipe import LightFields, Recipe
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import Sky, dark_sky, sunsky, uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms

# Standard errors allowed of one mean, its error measured by twelve runs: fails once in 2,500.
_SIGMAS: Final = 5.0
# Standard errors allowed of the worst of 16 blocks, four pooled runs: fails once in 20,000.
_BLOCK_SIGMAS: Final = 5.0
_MEASURING_SEEDS: Final = range(12)  # of the twelve runs
_LM_PER_W: Final = 179  # luminous efficacy of the lamps' white
# Fields of both integrators: no pilot and no denoiser, so that nothing but the estimator is tested.
_PATH: Final = LightFields(filter="box", pilot_spp=0, denoise=False)
_CHAINS: Final = LightFields(
    integrator="metropolis",
    filter="box",
    denoise=False,
    direct_spp=32,
    mutations_per_pixel=128,
    chains=2048,
)
# Half of the mutations, for the rooms in which every path is lit.
_FEW_CHAINS: Final = _CHAINS.model_copy(update={"mutations_per_pixel": 64})
_SKY_OF_ONE: Final = (1.0, 1.0, 1.0)  # radiance of a uniform white sky


def blocks(picture: F32, n: int = 4) -> F64:
    """(n, n) mean luminance of a radiance image (H, W, 3), nearly normal, for `z_scores`."""
    luminance = picture @ LUMINANCE
    h, w = luminance.shape
    means = luminance.reshape(n, h // n, n, w // n).mean((1, 3))
    return np.asarray(means, np.float64)


def z_scores(a: Sequence[F64], b: Sequence[F64]) -> F64:
    """z of the difference of two means, one per block; a, b: independent runs of one shape.

    The variance of a block is its own, and at least the one pooled over all blocks, each brought to
    relative terms first: a few runs may agree by chance, and a block with a bulb in it varies more
    than the others.
    """
    # Divide each block by its mean over both, so that bright blocks do not dominate.
    x, y = np.array(a), np.array(b)
    scale = 0.5 * (x.mean(0) + y.mean(0))
    x, y = x / scale, y / scale
    # Divide the difference by its standard error.
    variance = x.var(0, ddof=1) / len(x) + y.var(0, ddof=1) / len(y)
    return np.asarray((x.mean(0) - y.mean(0)) / np.sqrt(np.maximum(variance, variance.mean())))


@dataclass(frozen=True, slots=True)
class LightClaim:
    """A statement about light, its measurement, and whether it holds."""

    text: str
    measured: str
    expected: str
    passed: bool
    seconds: float = 0.0  # that the measurement took


def light_claims(variant: str) -> Iterator[LightClaim]:
    """Every claim, measured one after the other in a Mitsuba variant; raises MachineFailed in a scalar one."""
    if variant.startswith("scalar"):
        text = "the light's kernels need LLVM or CUDA, so scalar_rgb cannot be checked"
        hint = "sudo apt-get install -y libllvm19"
        raise MachineFailed(text, hint=hint)
    for measure in CLAIMS.values():
        began = time.perf_counter()
        claim = measure(variant)
        yield replace(claim, seconds=round(time.perf_counter() - began, 2))


def _rendered(
    variant: str, room: tuple[House, Camera], sky: Sky, fields: LightFields, *seeds: int
) -> list[LightResult]:
    scene = LightScene.load(room[0], {}, Recipe(), sky, variant=variant)
    return [scene.render(room[1], "0_0", fields, seed) for seed in seeds]


def _spp(n: int, **more: object) -> LightFields:
    return _PATH.model_copy(update={"spp": n, **more})


def _furnace(fields: LightFields, name: str, albedo: float) -> Callable[[str], LightClaim]:
    def measure(variant: str) -> LightClaim:
        results = _rendered(variant, rooms.furnace(albedo), dark_sky(), fields, *_MEASURING_SEEDS)
        # Compare with the geometric series, cut off at the longest path.
        means = [float((r.indoor @ LUMINANCE).mean()) for r in results]
        expected = sum(albedo**k for k in range(fields.max_depth))
        error = max(float(np.std(means, ddof=1)) / math.sqrt(len(means)), 5e-4 * expected)
        is_near = abs(float(np.mean(means)) - expected) <= _SIGMAS * error
        is_precise = error < 0.01 * expected
        return LightClaim(
            f"furnace room, {name}: the geometric series, albedo {albedo:g}",
            f"{np.mean(means):.5f}",
            f"{expected:.5f} +- {_SIGMAS * error:.5f}",
            is_near and is_precise and not any(r.outdoor.any() for r in results),
        )

    return measure


def _floor_claim(variant: str) -> LightClaim:
    ground = rooms.quad([(-50, 0, -50), (-50, 0, 50), (50, 0, 50), (50, 0, -50)], 0)
    house = rooms.house(
        [ground], [rooms.matte("floor", 0.5), rooms.BULB], lamps=[rooms.bulb((0, 1, 0), 1, 1000.0)]
    )
    camera = rooms.camera((1.5, 0.3, 0), (1, 0, 0), 8, 8, 0.01)
    (result,) = _rendered(variant, (house, camera), dark_sky(), _spp(1024), 1)
    # Expect I cos / d^2 at 1 m beside the foot point, 1 m below: I / (4 pi) / 2^1.5.
    lux = 1000 / (4 * math.pi) / 2**1.5
    measured = float((result.indoor @ LUMINANCE).mean()) * math.pi / 0.5 * _LM_PER_W
    return _claim_near(
        "a bulb of 1,000 lm lights a floor by distance and cosine", measured, lux, 0.01, "lx"
    )


def _open_ground(variant: str) -> LightClaim:
    ground = rooms.quad([(-9, 0, -9), (-9, 0, 9), (9, 0, 9), (9, 0, -9)], 0)
    # The ground is empty: every direction of the upper hemisphere sees the sky.
    house = rooms.house([ground], [rooms.matte("ground", 0.2)], size=(2.0, 2.5, 2.0))
    sky = sunsky(Recipe(), elevation_rad=math.radians(40), azimuth_rad=0.5)
    lux = LightScene.load(house, {}, Recipe(), sky, variant=variant).floor_lux(house)["0_0"]
    text = "open ground has the sky's 10,000 lx and the sun's"
    return _claim_near(text, lux["outdoor"], sky.sky_lx + sky.sun_lx, 0.02, "lx")


def _normal_map(variant: str) -> LightClaim:
    corners = [(-50.0, 0.0, 50.0), (50.0, 0.0, 50.0), (50.0, 0.0, -50.0), (-50.0, 0.0, -50.0)]
    material = replace(rooms.matte("floor", 0.5), normal_texture_id="n")
    house = rooms.house([rooms.quad(corners, 0)], [material])
    # A map of one normal, 60 degrees from upright: of the sky it sees (1 + cos) / 2.
    normal = np.array([math.sin(math.pi / 3), 0, math.cos(math.pi / 3)])
    maps = {"n": np.full((2, 2, 3), np.round((normal + 1) * 127.5), np.uint8)}
    scene = LightScene.load(house, maps, Recipe(), uniform_sky(_SKY_OF_ONE), variant=variant)
    camera = rooms.camera((0, 2, 0.01), (0, 0, 0), 8, 8, 0.3)
    result = scene.render(camera, "0_0", _spp(256), 1)
    measured = float((result.outdoor @ LUMINANCE).mean()) / 0.5
    text = "a normal map receives as much of a white sky as a tilted floor"
    return _claim_near(text, measured, (1 + math.cos(math.pi / 3)) / 2, 0.01, "of it")


def _claim_near(
    text: str, measured: float, expected: float, tolerance: float, unit: str
) -> LightClaim:
    return LightClaim(
        text,
        f"{measured:.6g} {unit}",
        f"{expected:.6g} {unit} +- {tolerance:.0%}",
        abs(measured - expected) <= tolerance * expected,
    )


def _window_room() -> tuple[House, Camera]:
    return rooms.window_room(0.7, lumen=800)


def _sun() -> Sky:
    return sunsky(Recipe(), elevation_rad=0.6, azimuth_rad=0.35)


def _metropolis_is_path(
    name: str, room: Callable[[], tuple[House, Camera]], sky: Callable[[], Sky]
) -> Callable[[str], LightClaim]:
    def measure(variant: str) -> LightClaim:
        path = _spp(256, pilot_spp=4)
        a = _rendered(variant, room(), sky(), _CHAINS, 50, 51, 52, 53)
        b = _rendered(variant, room(), sky(), path, 10, 11, 12, 13)
        return _one_mean(f"Metropolis has the mean of path: {name}", a, b)

    return measure


def _direct_and_indirect(variant: str) -> LightClaim:
    # Render with separate direct light, and all light by chains.
    whole = _CHAINS.model_copy(update={"direct_spp": 0, "mutations_per_pixel": 256})
    a = _rendered(variant, _window_room(), _sun(), _CHAINS, 20, 21, 22, 23)
    b = _rendered(variant, _window_room(), _sun(), whole, 30, 31, 32, 33)
    return _one_mean("direct by path + the rest by chains = all light by chains", a, b)


def _one_mean(text: str, a: list[LightResult], b: list[LightResult]) -> LightClaim:
    """That two lists of independent renders have one mean, block by block, in each group."""
    worst, n = 0.0, 0
    for group in Group:
        x, y = ([blocks(r.group(group)) for r in results] for results in (a, b))
        lit = (np.mean(x, 0) > 0) & (np.mean(y, 0) > 0)
        # Fail where one is black and the other is not; z is not defined there.
        if not np.array_equal(np.mean(x, 0) > 0, np.mean(y, 0) > 0):
            worst = math.inf
        if lit.any():
            z = z_scores([v[lit] for v in x], [v[lit] for v in y])
            worst, n = max(worst, float(np.abs(z).max())), n + z.size
    return LightClaim(
        text, f"worst |z| {worst:.2f} of {n} blocks", f"< {_BLOCK_SIGMAS:g}", worst < _BLOCK_SIGMAS
    )


def _groups_sum(variant: str) -> LightClaim:
    # Keep the bulb's geometry in the room without lamp light: the paths must be the same.
    dim = rooms.window_room(0.7, lumen=1e-30)
    room = _window_room()
    (sum_of_groups,) = _rendered(variant, room, uniform_sky(_SKY_OF_ONE), _spp(16), 1)
    (day,) = _rendered(variant, dim, uniform_sky(_SKY_OF_ONE), _spp(16), 1)
    (night,) = _rendered(variant, room, dark_sky(), _spp(16), 1)
    off = float(np.abs(sum_of_groups.mode(Mode.MLT_IL_OL) - (day.outdoor + night.indoor)).max())
    return LightClaim(
        "sky alone + lamps alone = both in one trace, to the bit",
        f"largest difference {off:g}",
        "0",
        off == 0 and bool(sum_of_groups.outdoor.any()) and bool(sum_of_groups.indoor.any()),
    )


def _doubled_emitters(variant: str) -> LightClaim:
    # Double the sky and the bulb: powers of two keep every bit of the mantissa.
    (single,) = _rendered(variant, _window_room(), uniform_sky((1, 1, 1)), _spp(16), 1)
    (two,) = _rendered(
        variant, rooms.window_room(0.7, lumen=1600), uniform_sky((2, 2, 2)), _spp(16), 1
    )
    a, b = single.mode(Mode.MLT_IL_OL), two.mode(Mode.MLT_IL_OL)
    off = float(np.abs(b - 2 * a).max())
    return LightClaim(
        "emitters x 2 = radiance x 2, to the bit",
        f"mean x {b.mean() / a.mean():.7f}, largest difference {off:g}",
        "x 2, 0",
        off == 0 and bool(a.any()),
    )


def _sealed_room(variant: str) -> LightClaim:
    # Close all six sides: no light may leak in at edges and corners.
    room = rooms.house(rooms.shell((4, 2.5, 4), 0), [rooms.matte("wall", 0.9)])
    camera = rooms.camera((0.5, 1.5, 0.5), (3.9, 0.2, 3.9))
    (result,) = _rendered(variant, (room, camera), _sun(), _spp(64), 1)
    top = float(max(result.outdoor.max(), result.indoor.max()))
    return LightClaim("a sealed room under a bright sky is black", f"max {top:g}", "0", top == 0)


def _window_pane(variant: str) -> LightClaim:
    away = rooms.camera((2.0, 1.5, 1.0), (2.0, 0.5, 3.9))
    bare, glazed = (rooms.window_room(0.7, lumen=800, pane=p)[0] for p in (False, True))
    (a,) = _rendered(variant, (bare, away), _sun(), _spp(16), 1)
    (b,) = _rendered(variant, (glazed, away), _sun(), _spp(16), 1)
    off = float(np.abs(a.mode(Mode.MLT_IL_OL) - b.mode(Mode.MLT_IL_OL)).max())
    return LightClaim(
        "an invisible pane changes no bit", f"largest difference {off:g}", "0", off == 0
    )


def _repeats(variant: str) -> LightClaim:
    # Render twice with one seed, then with another.
    a, b, c = _rendered(variant, _window_room(), _sun(), _spp(16), 7, 7, 8)
    off = float(np.abs(a.mode(Mode.MLT_IL_OL) - b.mode(Mode.MLT_IL_OL)).max())
    differs = bool((a.indoor != c.indoor).any())
    return LightClaim(
        "path: the same seed gives the same bits, another does not",
        f"largest difference {off:g}, other seed {'differs' if differs else 'is the same'}",
        "0, differs",
        off == 0 and differs,
    )


def _nonfinite(variant: str) -> LightClaim:
    # Hang a lamp of infinite power beside the window: every path that meets it is not finite.
    room = rooms.window_room(0.7, lumen=math.inf)
    (path,) = _rendered(variant, room, _sun(), _spp(16), 1)
    finite = bool(np.isfinite(path.outdoor).all() and np.isfinite(path.indoor).all())
    n_paths = 16 * path.outdoor.shape[0] * path.outdoor.shape[1]
    return LightClaim(
        "non-finite samples are dropped and counted",
        f"{path.n_nonfinite} of {n_paths} paths, picture {'finite' if finite else 'not finite'}",
        "> 0, finite",
        finite and 0 < path.n_nonfinite <= n_paths,
    )


CLAIMS: Final[dict[str, Callable[[str], LightClaim]]] = {
    **{f"furnace {a:g}": _furnace(_spp(128), "path", a) for a in (0.0, 0.3, 0.8)},
    **{f"chains {a:g}": _furnace(_FEW_CHAINS, "Metropolis", a) for a in (0.3, 0.8)},
    "floor": _floor_claim,
    "open ground": _open_ground,
    "normal map": _normal_map,
    "sun by chains": _metropolis_is_path("sun through a window", _window_room, _sun),
    "door by chains": _metropolis_is_path("door ajar", rooms.door_ajar, dark_sky),
    "direct and indirect": _direct_and_indirect,
    "sum of groups": _groups_sum,
    "doubled emitters": _doubled_emitters,
    "sealed room": _sealed_room,
    "window pane": _window_pane,
    "repeats": _repeats,
    "nonfinite": _nonfinite,
}
