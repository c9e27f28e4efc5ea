"""Lamps of a view against house.json and their layers of radiance.exr. Effects: reads files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.fact_checks import lamp_names
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_view import StoredView

SHARE = 2e-6  # of indoor light, stored to six digits
FLUX_LM = 0.06  # of a flux stored to a tenth
_LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear sRGB
_LEAST_RATIO = 0.25  # of its light that a shade is taken to let out, at least (docs/light.md)


def check_lamps(
    view: StoredView, house: StoredHouse, channels: Mapping[str, NDArray[Any]], tally: Tally
) -> None:
    """Each row of modes.light.lamps is a lamp of the house, with its flux, and its layer's share of light.

    channels: of radiance.exr. Where each lamp has a layer, indoor is their sum in the order of their
    numbers, to the bit.
    """
    rows = view.table.get("modes", {}).get("light", {}).get("lamps")
    if rows is None:
        return
    layers = [row["layer"] for row in rows if row["layer"]]
    needed = {f"{name}.{c}" for name in ("indoor", *layers) for c in "RGB"}
    lacking = needed - channels.keys()
    if not tally.expect("lamps", view.place, not lacking, f"lacks {lacking}"):
        return
    stored = {name.partition(".")[0] for name in channels if name.startswith("lamp")}
    same = stored == set(layers)
    tally.expect("lamps", view.place, same, "radiance.exr has layers of other lamps")
    # Sum in float32, one lamp after the other, as the trace does.
    for c in "RGB":
        total = np.zeros(view.size, np.float32)
        for name in layers:
            total += channels[f"{name}.{c}"]
        right = channels[f"indoor.{c}"] == total
        tally.add("indoor = sum of lamps", right.size)
        if not right.all():
            row, column = np.argwhere(~right)[0]
            what = f"row {row}, column {column}"
            tally.fail("indoor = sum of lamps", view.place, what, int((~right).sum()))
    whole = _level(channels, "indoor")
    for number, row in enumerate(rows, start=1):
        place = f"{view.place} lamp {number}"
        same = row["number"] == number and row["layer"] in (None, f"lamp{number}")
        tally.expect("lamps", place, same, f"is told to be number {row['number']}, {row['layer']}")
        share = _level(channels, row["layer"]) / whole if row["layer"] and whole > 0 else 0.0
        what = f"brings {share:.6f} of the light, told {row['share']}"
        tally.expect("lamps", place, abs(share - row["share"]) <= SHARE, what)
    if house.items:
        _check_rows(view, house, rows, tally)


def _level(channels: Mapping[str, NDArray[Any]], name: str) -> float:
    """Mean luminance of a layer."""
    means = [float(channels[f"{name}.{c}"].mean(dtype=np.float64)) for c in "RGB"]
    return float(np.dot(means, _LUMINANCE))


def _check_rows(
    view: StoredView, house: StoredHouse, rows: list[dict[str, Any]], tally: Tally
) -> None:
    """Lamps are those of house.json that have a surface to shine by, in its order."""
    lit = {
        name: (instance, k)
        for name, (instance, k) in lamp_names(house).items()
        if any(
            house.items[instance]["surfaces"][n]["n_faces"]
            for n in house.items[instance]["lights"][k]["emitting"]
        )
    }
    released = house.recipe.get("emission", {}).get("preset") == "released"
    # The published lamps' shades shine by themselves: they are lamps of their own.
    own = [row for row in rows if not (released and row["item"].endswith("/shade"))]
    same = [row["item"] for row in own] == list(lit)
    tally.expect("lamps", view.place, same, "its lamps are not those of house.json")
    for row in own:
        place, (instance, k) = f"{view.place} lamp {row['number']}", lit.get(row["item"], (0, 0))
        item = house.items.get(instance)
        if item is None:
            continue
        told = row["instance"], row["name"], row["room"]
        expected = instance, item["name"], item["room_id"]
        tally.expect("lamps", place, told == expected, f"is {told}, in house.json {expected}")
        if house.recipe and not released:
            flux = flux_lm(item["lights"][k], house.recipe["emission"])
            what = f"has {row['lm']} lm, by house.json {flux:.1f}"
            tally.expect("lamps", place, abs(row["lm"] - flux) <= FLUX_LM, what)


def flux_lm(light: Mapping[str, Any], emission: Mapping[str, Any]) -> float:
    """lm of a light of house.json under the recipe's group `emission` (docs/spec/sky.md).

    The source states what leaves the lamp; its shade keeps part of what the bulb gives.
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
