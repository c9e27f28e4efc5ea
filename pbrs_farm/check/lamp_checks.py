"""Lamps of a view against house.json and their layers of radiance.exr. Effects: reads files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import LUMINANCE
from pbrs_farm.check.rules import judge

_LEAST_RATIO = 0.25  # least share of its light that a shade is assumed to let out (docs/light.md)


def check_lamps(case: ViewCase) -> None:
    """Each row of modes.light.lamps is a lamp of the house, with its flux and its layer's share of light.

    If each lamp has a layer, indoor is their sum in the order of their numbers, to the bit.
    """
    view, channels = case.view, case.light
    rows = view.table.get("modes", {}).get("light", {}).get("lamps")
    if rows is None:
        return
    expect = case.expect("lamps")
    layers = [row["layer"] for row in rows if row["layer"]]
    lacking = {f"{name}.{c}" for name in ("indoor", *layers) for c in "RGB"} - channels.keys()
    if not expect(not lacking, f"lacks {lacking}"):
        return
    stored = {name.partition(".")[0] for name in channels if name.startswith("lamp")}
    expect(stored == set(layers), "radiance.exr has layers of other lamps")
    # Sum in float32, one lamp after the other, as the trace does.
    for c in "RGB":
        total = np.zeros(view.size, np.float32)
        for name in layers:
            total += channels[f"{name}.{c}"]
        right = channels[f"indoor.{c}"] == total
        case.tally.pixels("indoor = sum of lamps", case.place, right)
    whole = _level(case, "indoor")
    for number, row in enumerate(rows, start=1):
        share = _level(case, row["layer"]) / whole if row["layer"] and whole > 0 else 0.0
        layer = row["layer"] and f"lamp{number}"
        place = f"{case.place} lamp {number}"
        judge("lamp", place, case.tally, row=row, number=number, layer=layer, share=share)
    if case.house.items:
        _check_rows(case, rows)


def _level(case: ViewCase, name: str) -> float:
    """Mean luminance of a layer."""
    means = [float(case.light[f"{name}.{c}"].mean(dtype=np.float64)) for c in "RGB"]
    return float(np.dot(means, LUMINANCE))


def _check_rows(case: ViewCase, rows: list[dict[str, Any]]) -> None:
    """Lamps are those of house.json that have a luminous surface, in its order."""
    house = case.house
    lit = {
        name: instance
        for name, (instance, _k) in house.lamps.items()
        if any(
            house.items[instance]["surfaces"][n]["n_faces"] for n in house.light(name)["emitting"]
        )
    }
    released = house.recipe.get("emission", {}).get("preset") == "released"
    # Shades of the published lamps are luminous, and separate lamps.
    rows = [row for row in rows if not (released and row["item"].endswith("/shade"))]
    same = [row["item"] for row in rows] == list(lit)
    case.expect("lamps")(same, "its lamps are not those of house.json")
    for row in rows:
        if row["item"] not in lit:
            continue
        place = f"{case.place} lamp {row['number']}"
        item = {"instance": lit[row["item"]], **house.items[lit[row["item"]]]}
        judge("lamp of an item", place, case.tally, row=row, item=item)
        if house.recipe and not released:
            flux = flux_lm(house.light(row["item"]), house.recipe["emission"])
            judge("flux of a lamp", place, case.tally, row=row, flux=flux)


def flux_lm(light: Mapping[str, Any], emission: Mapping[str, Any]) -> float:
    """Flux in lm of a light of house.json under the recipe's group `emission` (docs/light.md).

    The source states the flux that leaves the lamp, from which its shade takes a part of the bulb's.
    """
    power, share = float(light["power"]), float(light["share"])
    flux = {
        "sweethome3d": emission["lamp_lm"] * (power / 0.5) ** 2,
        "watt": power * emission["lm_per_watt"],
        "lumen": power,
    }[light["unit"]] * share
    if emission["compensate_shades"] and light["escape"] is not None and not light["is_bare"]:
        flux /= min(max(light["escape"], _LEAST_RATIO), 1.0)
    return max(float(flux), 0.0)


CHECKS = (Check("lamps", "view", check_lamps, 21, ("radiance",)),)
