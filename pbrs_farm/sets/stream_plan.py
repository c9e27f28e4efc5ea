"""Plan of a streamed set: which views each epoch has, in which order, and in which light. No effects.

A unit is a group of views of one home, rendered together. Its generation grows by one every `reuse` epochs;
homes take turns, so that each epoch has 1 / reuse new units.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F32
from pbrs_farm.core.recipe import Recipe, with_settings
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.run.relight import RelightLayers
from pbrs_farm.study.samples.view_order import shard_order
from pbrs_farm.transport.scene_tables.area_emitters import rgb_from_kelvin
from pbrs_farm.views.view_sample import SampleRequest

Unit = tuple[int, int]
"""Index of a home, and its generation."""
Place = tuple[int, int, int]
"""Epoch and position of a reader, and its reuse."""

_ROUND_RAD: Final = 1e-9  # change of cameras.hfov_rad, which gives the sampler another seed
_DAY, _DUSK = 0.6, 0.8  # cumulative shares of pictures by day and at dusk; the rest are at night
_LEAST_DAYLIGHT: Final = 0.05  # share of a view's light that makes it bright without lamps
_DUSK_RGB: Final = (0.8, 0.95, 1.25)
_MEAN_KELVIN: Final = 2850.0  # colour temperature of the rendered bulbs
Rgb = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class StreamHome:
    """A home, with the number of views of a unit."""

    word: str
    source: SourceRef
    recipe: Recipe
    n_views: int

    def recipe_of(self, generation: int, cameras: int, seed: int) -> Recipe:
        """The recipe of a generation: the sun is drawn, unless the set fixes it. cameras: draw of the viewpoints."""
        rng = np.random.default_rng(keys.seed(self.source.house_id, "sun", generation, seed))
        azimuth, elevation = rng.uniform(0, 360), rng.uniform(5, 60)
        sky, settings = self.recipe.sky, dict[str, Any]()
        if sky.kind == "sunsky" and sky.hour is None:
            if sky.sun_azimuth_deg is None:
                settings["sky.sun_azimuth_deg"] = round(azimuth, 2)
            if sky.sun_elevation_deg is None and sky.time in ("day", "drawn"):
                settings["sky.sun_elevation_deg"] = round(elevation, 2)
        if cameras:
            settings["cameras.hfov_rad"] = self.recipe.cameras.hfov_rad + _ROUND_RAD * cameras
        return with_settings(self.recipe, settings)


@dataclass(frozen=True, slots=True)
class StreamPlan:
    """Everything that the bytes of a stream depend on, and where it is cached."""

    name: str  # of the set
    homes: tuple[StreamHome, ...]
    request: SampleRequest
    extra_layers: tuple[str, ...]  # beside those of the request
    seed: int
    reuse: int
    folder: Path  # of this stream's cache
    cache_bytes: int
    jobs: int
    farm: str = ""  # URL of the store of the farm that renders; "" = this machine

    def order(self, epoch: int) -> NDArray[np.intp]:
        """(n, 2) home and number of the view, in the order of an epoch."""
        return _order(tuple(home.n_views for home in self.homes), self.seed, epoch)

    def unit(self, home: int, epoch: int) -> Unit:
        """The unit of a home in an epoch."""
        return home, (epoch + home % self.reuse) // self.reuse

    def ranks(self, places: Iterable[Place]) -> dict[Unit, int]:
        """Unit -> number of units that readers use before it, the first one first.

        Reaches `reuse` epochs ahead: each home's next views, so that the renderer never idles for lack of work.
        """
        ranks: dict[Unit, int] = {}
        for epoch, position, reuse in set(places):
            plan, ahead = replace(self, reuse=reuse), dict[Unit, None]()
            for e in range(epoch, epoch + reuse + 1):
                homes = self.order(e)[position if e == epoch else 0 :, 0]
                ahead |= dict.fromkeys(plan.unit(home, e) for home in dict.fromkeys(homes.tolist()))
            for rank, unit in enumerate(ahead):
                ranks[unit] = min(rank, ranks.get(unit, rank))
        return dict(sorted(ranks.items(), key=lambda row: row[1]))

    def light(self, epoch: int, unit: Unit, view: int, light: RelightLayers) -> LightDraw:
        """The light of a view in an epoch."""
        lamps = list(light.lamps)
        means = [float(layer.mean()) for layer in (light.aovs.outdoor, *light.lamps.values())]
        has_daylight = not lamps or means[0] > _LEAST_DAYLIGHT * sum(means)
        rng = np.random.default_rng((self.seed, epoch, *unit, view))
        return drawn_light(rng, lamps, has_daylight=has_daylight)


@lru_cache(8)
def _order(counts: tuple[int, ...], seed: int, epoch: int) -> NDArray[np.intp]:
    return shard_order(counts, seed=seed, epoch=epoch)


@dataclass(frozen=True, slots=True)
class LightDraw:
    """Drawn light of a picture: factors of daylight and of each lamp, R G B, and the exposure in stops."""

    outdoor: Rgb
    lamps: dict[int, Rgb]
    exposure_ev: float

    def __str__(self) -> str:
        """The options of `pbrs-farm relight` that give this light."""
        rows = [("--outdoor ", self.outdoor), *((f"--lamp {n}=", f) for n, f in self.lamps.items())]
        return " ".join(option + ",".join(f"{x:g}" for x in rgb) for option, rgb in rows)

    @property
    def factors(self) -> dict[int, F32]:
        """Lamp's number -> (3,) factors."""
        return {number: np.array(rgb, np.float32) for number, rgb in self.lamps.items()}


def drawn_light(rng: np.random.Generator, lamps: Sequence[int], *, has_daylight: bool) -> LightDraw:
    """Draw the hour (day, dusk or night), each lamp's strength and colour, and the exposure.

    lamps: numbers of those that light the view; without any it is always day. has_daylight: False for a view that
    daylight hardly reaches. There, and at dusk and at night, at least one lamp is on.
    """
    hour, exposure_ev = rng.random(), float(np.clip(rng.normal(0, 0.5), -1.5, 1.5))
    is_day = hour < _DAY or not lamps
    sun, blue = 2 ** rng.normal(0, 0.7), 2 ** rng.normal(-5, 1)
    dusk = _rgb(blue * x for x in _DUSK_RGB) if hour < _DUSK else (0.0, 0.0, 0.0)
    is_on = rng.random(len(lamps)) < (0.4 if is_day else 0.75)
    if lamps and not (is_day and has_daylight) and not is_on.any():
        is_on[rng.integers(len(lamps))] = True
    factors: dict[int, Rgb] = {}
    for number, on in zip(lamps, is_on, strict=True):
        colour = rgb_from_kelvin(rng.uniform(2200, 4500)) / rgb_from_kelvin(_MEAN_KELVIN)
        factors[number] = _rgb(colour * (on * 2 ** rng.uniform(-2, 0.5)))
    return LightDraw(_rgb([sun] * 3) if is_day else dusk, factors, round(exposure_ev, 3))


def _rgb(values: Iterable[float]) -> Rgb:
    # Rounded, so that the options of `relight` have the same factors.
    r, g, b = (round(float(value), 4) for value in values)
    return r, g, b
