"""Weights of lamps and outdoor techniques for one view, from a small picture per emitter; no effects.

A home has 12 to 18 lamps and most shadow rays of a uniform choice go to other rooms.
The pilot renders 32x24 pixels with each emitter alone, in one launch, and chooses in proportion to
the root of the mean square that a path brings from it, with a floor so that nothing is forgotten.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.kernels.arrival_rates import arrival_rates
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import DOME, FIRST_PORTAL, SUN, Emitters, EmitterWeights
from pbrs_farm.transport.kernels.outdoor_choice import weights_by_place
from pbrs_farm.transport.path_tracer import Lanes, SampleSums, trace

# Least weights: what no pilot path has found may still be there. Those of many lamps are less, or
# they would leave nothing to what the pilot has found.
LAMP_FLOOR: Final = 0.01
_ALL_FLOORS: Final = 0.5
_SUN_FLOOR: Final = 0.1
_DOME_FLOOR: Final = 0.05
_PILOT_SIZE: Final = (32, 24)  # px
# A shadow ray that can bring less than this share of a view's light, group by group, is cast by chance.
SHADOW_SHARE: Final = 0.5
_MAX_LANES: Final = 1 << 17  # of the pilot: it halves its size where there are very many emitters
# Of a view's trial, which tries guided rays and counts which shadow rays arrive: its size in px and
# its samples of a pixel, the samples of a view from which it pays, the CPU of a guided sample over a
# plain one's, and the part of the mean light below which a pixel's noise counts less.
_TRIAL_SIZE: Final = (64, 48)
_TRIAL_SPP: Final = 8
MIN_SAMPLES: Final = 1 << 22
GUIDING_COST: Final = 1.1
_DARK: Final = 0.1
_NEIGHBOURS: Final = 5  # px, edge of the window whose median is the level of a pixel


def uniform_weights(n_lamps: int, n_portals: int) -> EmitterWeights:
    """Every lamp and every outdoor technique alike."""
    n_outdoor = FIRST_PORTAL + n_portals
    return EmitterWeights(np.full(n_lamps, 1 / max(n_lamps, 1)), np.full(n_outdoor, 1 / n_outdoor))


def weights_by_distance(spheres: F64, place: F64, n_portals: int) -> EmitterWeights:
    """Lamps by 1 / distance squared (1 m at least) from a place (3,), outdoor techniques alike."""
    squared = ((spheres[:, :3] - place) ** 2).sum(1)
    lamps = _with_floors(1 / np.maximum(squared, 1), lamp_floors(len(spheres)))
    return EmitterWeights(lamps, uniform_weights(0, n_portals).outdoor)


def lamp_floors(n_lamps: int) -> F64:
    """(L,) least weight of each lamp."""
    return np.full(n_lamps, min(LAMP_FLOOR, _ALL_FLOORS / max(n_lamps, 1)))


def pilot_size(n_emitters: int) -> tuple[int, int]:
    """(width, height) in px of a pilot that renders each of n_emitters alone."""
    width, height = _PILOT_SIZE
    while width * height * n_emitters > _MAX_LANES and height % 2 == 0:
        width, height = width // 2, height // 2
    return width, height


def pilot_weights(
    scene: DeviceScene,
    emitters: Emitters,
    camera: Camera,
    n_lamps: int,
    n_portals: int,
    fields: LightFields,
    seed: int,
) -> EmitterWeights:
    """Weights for a view; those that emitters carry already change the pilot's noise only."""
    # Render the view small, a lane for each pixel and emitter.
    n_outdoor = FIRST_PORTAL + n_portals
    width, height = pilot_size(n_lamps + n_outdoor)
    lanes = Lanes(
        width, height, 0, fields.pilot_spp, seed, n_only_lamps=n_lamps, n_only_outdoor=n_outdoor
    )
    sums = trace(scene, emitters, camera.with_size(width, height), lanes, fields)
    brought = ((sums.outdoor + sums.indoor) @ LUMINANCE / fields.pilot_spp).reshape(
        width * height, n_lamps + n_outdoor
    )
    # Weigh a pixel's noise relative to its brightness.
    bright = brought.sum(1, keepdims=True)
    relative = brought / (bright + max(float(bright.mean()), 1e-12))
    strength = np.sqrt((relative.astype(np.float64) ** 2).mean(0))
    lamps = _with_floors(strength[:n_lamps], lamp_floors(n_lamps))
    outdoor = outdoor_weights(strength[n_lamps:], brought[:, n_lamps:].mean(0))
    weights = EmitterWeights(lamps, outdoor)
    # Choose outdoor techniques by place, cast shadow rays that can bring little by chance; Metropolis does neither.
    if fields.integrator != "path":
        return weights
    assert sums.counts is not None
    by_place = weights_by_place(weights.outdoor, sums.counts, emitters.arrival.grid)
    thresholds = _shadow_thresholds(brought, n_lamps)
    vertices = sums.counts[0].astype(np.int64).sum(1)
    return replace(
        weights, outdoor_by_place=by_place, shadow_thresholds=thresholds, vertices=vertices
    )


def _shadow_thresholds(brought: NDArray[np.floating], n_lamps: int) -> tuple[float, float]:
    """SHADOW_SHARE of the mean outdoor and indoor light of a view.

    brought: (N, L + outdoor techniques) luminance that each emitter alone brings to a pixel.
    """
    # Leave portals out: they are another way to draw the dome.
    outdoor = brought[:, n_lamps + SUN] + brought[:, n_lamps + DOME]
    groups = outdoor, brought[:, :n_lamps].sum(1)
    outdoor_mean, indoor_mean = (float(light.astype(np.float64).mean()) for light in groups)
    return SHADOW_SHARE * outdoor_mean, SHADOW_SHARE * indoor_mean


def trial_weights(
    scene: DeviceScene,
    emitters: Emitters,
    camera: Camera,
    weights: EmitterWeights,
    fields: LightFields,
    seed: int,
) -> EmitterWeights:
    """The weights of a view with what a trial of it says: whether guided rays cut its noise by more
    than they cost, and how often shadow rays arrive.

    Renders the view small both ways, with the weights that emitters carry: the view's, guided. A view
    of few samples is guided without a trial, which would cost as much as it saves.
    """
    i = camera.intrinsics
    if i.width_px * i.height_px * fields.spp < MIN_SAMPLES:
        return weights
    width, height = _TRIAL_SIZE
    lanes = Lanes(width, height, 0, _TRIAL_SPP, seed, is_trial=True)
    sums = trace(scene, emitters, camera.with_size(width, height), lanes, fields)
    assert sums.arrivals is not None
    rates = arrival_rates(sums.arrivals, emitters.arrival.grid)
    return replace(weights, is_guided=pays(sums, (2, height, width)), arrival_rates=rates)


def pays(sums: SampleSums, shape: tuple[int, int, int]) -> bool:
    """Whether guided rays cut the noise of a trial by more than they cost. shape: plain and guided."""
    # Judge noise by a pixel's surroundings: a firefly must not be its own reference.
    _plain, guided = _luminance(sums.outdoor + sums.indoor).reshape(shape)
    level = median_filter(guided, size=_NEIGHBOURS, mode="nearest")
    level += _DARK * max(float(level.mean()), 1e-12)
    # Daylight is nearly as noisy both ways, since rays are guided into lamps: what differs in it by
    # chance must not choose.
    halves = (sums.outdoor, sums.outdoor_even), (sums.indoor, sums.indoor_even)
    outdoor, indoor = ((_apart(*h).reshape(shape) / level) ** 2 for h in halves)
    daylight, (plain_lamps, guided_lamps) = outdoor.mean(), indoor.mean((1, 2))
    return bool(daylight + plain_lamps > GUIDING_COST * (daylight + guided_lamps))


def _luminance(rgb: F32) -> F64:
    return np.asarray(rgb.astype(np.float64) @ LUMINANCE)


def _apart(whole: F32, even: F32) -> F64:
    """Difference of the half buffers of a group, lane by lane."""
    return 2 * _luminance(even) - _luminance(whole)


def outdoor_weights(strength: F64, brought: NDArray[np.floating]) -> F64:
    """Shares of sun, dome and portals from each one's strength and mean contribution.

    Dome and portals are techniques for one emitter, the sky: the better of the two says how
    strong it is, and portals take most of it where most of its light comes through them.
    """
    portal = strength[FIRST_PORTAL:]
    by_portals = float(np.sqrt((portal**2).sum()))
    light = float(brought[DOME])
    through = min(float(brought[FIRST_PORTAL:].sum()) / light, 1.0) if light > 0 else 0.0
    share = 0.85 * through if through > 0.5 else 0.0
    # Give portals most of the sky's weight, each by its own strength.
    sky = min(float(strength[DOME]), by_portals) if share > 0 else float(strength[DOME])
    within = portal / portal.sum() if portal.sum() > 0 else np.zeros(len(portal))
    raw = np.array([float(strength[SUN]), sky * (1 - share), *(sky * share * within)])
    return _with_floors(raw, np.array([_SUN_FLOOR, _DOME_FLOOR, *[LAMP_FLOOR] * len(portal)]))


def _with_floors(strength: F64, floors: F64) -> F64:
    if not len(strength):
        return strength
    total = strength.sum()
    share = strength / total if total > 0 else np.full(len(strength), 1 / len(strength))
    floored = np.maximum(share, floors)
    # Round, so that the last bits of a sum never change a picture.
    return np.asarray(np.round(floored / floored.sum(), 6))
