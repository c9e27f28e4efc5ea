"""Lamp layers: indoor light by the lamp that emits it, scaled and summed; pure numpy, no effects.

A lamp's number is its place among the scene's area emitters, counted from 1. A lamp that lights
nothing in a view has a row in the table and no layer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F32, RadianceImage
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.scene_tables.area_emitters import AreaEmitter

MAX_SUMS: Final = 2**32  # pixels x lamps x 3 of one launch: the kernel counts them in 32 bits


def add_lamp_layers(
    result: LightResult, sums: F32 | None, spp: int, lamps: Sequence[AreaEmitter]
) -> LightResult:
    """The result with a layer for each lamp that lights the view, of sums (H * W, L, 3) over spp samples."""
    shape = result.indoor.shape
    # Divide each lamp's sums by the samples; leave out lamps without any light.
    by_lamp = [] if sums is None else [sums[:, k] for k in range(sums.shape[1])]
    layers = {
        number: np.ascontiguousarray((total / np.float32(spp)).reshape(shape))
        for number, total in enumerate(by_lamp, start=1)
        if total.any()
    }
    # Sum indoor light from the layers, in the order in which relight sums it.
    indoor = indoor_from_lamps(layers, {}, shape)
    facts = {**result.facts, "lamps": lamp_table(lamps, layers, indoor)}
    return replace(result, indoor=indoor, lamps=layers, facts=facts)


def indoor_from_lamps(
    layers: Mapping[int, RadianceImage], factors: Mapping[int, F32], shape: tuple[int, ...]
) -> RadianceImage:
    """Sum of the lamps' layers (H, W, 3) in the order of their numbers, each times its factor (3,), or 1."""
    total = np.zeros(shape, np.float32)
    for number in sorted(layers):
        factor = factors.get(number)
        total += layers[number] if factor is None else layers[number] * factor
    return total


def relit_indoor(
    indoor: RadianceImage, layers: Mapping[int, RadianceImage], factors: Mapping[int, F32]
) -> RadianceImage:
    """Denoised indoor light with each lamp times its factor.

    indoor: (H, W, 3), the lamps' light denoised together. layers: each lamp's, denoised separately; they
    give each lamp's share of a pixel. With every factor 1 the result is indoor to the bit.
    """
    total = indoor_from_lamps(layers, {}, indoor.shape)
    scaled = indoor_from_lamps(layers, factors, indoor.shape)
    # Where no layer has light, all lamps have equal shares.
    unit = np.ones(3, np.float32)
    mean = np.mean([factors.get(number, unit) for number in layers] or [unit], axis=0)
    ratio = np.divide(scaled, total, out=np.zeros_like(total) + mean, where=total > 0)
    return np.asarray(indoor * ratio, np.float32)


def lamp_shares(
    indoor: RadianceImage, layers: Mapping[int, RadianceImage]
) -> dict[int, RadianceImage]:
    """Number -> the lamp's part of denoised indoor light, by its noisy layers: relit_indoor is their sum."""
    total = indoor_from_lamps(layers, {}, indoor.shape)
    equal = np.float32(1 / max(1, len(layers)))
    return {
        number: indoor * np.divide(layer, total, out=np.full_like(total, equal), where=total > 0)
        for number, layer in layers.items()
    }


def lamp_table(
    lamps: Sequence[AreaEmitter], layers: Mapping[int, RadianceImage], indoor: RadianceImage
) -> list[dict[str, Any]]:
    """A row per lamp for view.json: number, item, instance, room, lm, share, layer.

    item: id of the item that holds it, item/0, item/1 where that has several; instance: of the
    item. lm: its flux. share: of the view's indoor light, by mean luminance. layer: its name in
    radiance.exr, None when it lights nothing.
    """
    # Average in double precision, so that the shares sum to one.
    whole = float((indoor @ LUMINANCE).mean(dtype=np.float64))
    rows: list[dict[str, Any]] = []
    for number, lamp in enumerate(lamps, start=1):
        layer = layers.get(number)
        mean = 0.0 if layer is None else float((layer @ LUMINANCE).mean(dtype=np.float64))
        rows.append(
            {
                "number": number,
                "item": lamp.name,
                "instance": lamp.item + 1,
                "room": lamp.room_id,
                "lm": round(lamp.flux_lm, 1),
                "share": round(mean / whole, 6) if whole > 0 else 0.0,
                "layer": None if layer is None else layer_name(number),
            }
        )
    return rows


def layer_name(number: int) -> str:
    """The layer of a lamp in radiance.exr."""
    return f"lamp{number}"
