"""illuminance.json: rooms, warnings, and the sky that the recipe gives a house. Effects: none beside reading documents."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrs_farm.check.cases import HouseCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.rules import judge
from pbrs_farm.core import keys

_EXPECTED_LX = {"outdoor": [20.0, 5000.0], "indoor": [30.0, 1000.0]}  # docs/formats/view_json.md
_DARK_LX = 1.0


def check_illuminance(case: HouseCase) -> None:
    """illuminance.json: rooms of house.json, their warnings by its own numbers, the recipe's sky."""
    house, document = case.house, case.house.illuminance
    if not document:
        return
    sky = document.get("sky", {})
    if "expected_lx" in document:
        judge("expected lux", house.id, case.tally, document=document, lux=_EXPECTED_LX)
    is_day = sky.get("sun_direction", [0, 1, 0])[1] >= 0
    for row in document["rooms"]:
        place = f"{house.id} room {row['room']}"
        room = house.rooms.get(str(row["room"]))
        is_room = house.rooms and case.tally.expect("illuminance", place, room is not None, "is not a room")  # fmt: skip
        if is_room:
            judge("lit room", place, case.tally, row=row, room=room)
        if "warnings" in row:
            warnings = _warnings(row, is_day=is_day, some_lamps_off=house.lamps_on < 1)
            judge("lux warnings", place, case.tally, row=row, warnings=warnings)
        in_marker = house.marker_facts("illuminance").get("floor_lux", {}).get(row["room"])
        if in_marker:
            lux = {"outdoor": row["outdoor_lx"], "indoor": row["indoor_lx"]}
            judge("lux in marker", place, case.tally, marker=in_marker, lux=lux)
    if sky and house.recipe:
        _check_sky(case, sky)


def _warnings(row: Mapping[str, Any], *, is_day: bool, some_lamps_off: bool) -> list[str]:
    """Warnings about levels out of range: docs/formats/view_json.md."""
    lit, lines = set(row["lit_by"]), []
    has = {
        "outdoor": is_day and bool(lit & {"windows", "sky"}),
        "indoor": bool(lit & {"lamps", "fallback", "added"}) and not some_lamps_off,
    }
    for group, (low, high) in _EXPECTED_LX.items():
        value = row[f"{group}_lx"]
        if (has[group] and value < low) or value > high:
            lines.append(
                f"room {row['room']}: {group} light gives {value:g} lx on the floor, "
                f"expected {low:g} to {high:g}"
            )
    total = row["outdoor_lx"] + row["indoor_lx"]
    if total < _DARK_LX:
        lines.append(
            f"room {row['room']}: {total:.2g} lx on the floor by all light, less than {_DARK_LX:g}"
        )
    return lines


def _check_sky(case: HouseCase, sky: Mapping[str, Any]) -> None:
    """The sun's direction, and the light of sky and sun on open ground, by the recipe and the house's draws."""
    house, place = case.house, case.house.id
    direction = np.array(sky["sun_direction"], np.float64)
    elevation = math.degrees(math.asin(min(max(direction[1], -1.0), 1.0)))
    length = float(np.linalg.norm(direction))
    judge("sun", place, case.tally, sky=sky, length=length, elevation=elevation)
    if house.recipe["sky"]["kind"] != "sunsky":
        return
    height, azimuth, is_overcast = _sun(house.id, house.recipe)
    flat = math.cos(height)
    sun = [flat * math.sin(azimuth), math.sin(height), -flat * math.cos(azimuth)]
    name = "sunsky"
    if is_overcast:
        name = "overcast"
    elif height < 0:
        name = "dusk" if math.degrees(-height) < 12 else "night"
    # Level ground does not see the ground's share of the dome.
    sky_lx, sun_lx = _sky_lx(height, is_overcast, house.recipe["emission"])
    recipe = {"sun": sun, "name": name, "sky_lx": sky_lx, "sun_lx": sun_lx}
    rounded = np.round(sun, 4).tolist()
    judge("sky", place, case.tally, sky=sky, recipe=recipe, rounded=rounded)


def _drawn(house: str, seed: int, name: str) -> float:
    # Edits keep the weather: the id's ending of an edited house is in no draw.
    home = re.sub(r"-e[0-9a-f]{8}$", "", house)
    return keys.seed("sky", name, home, seed) / 2**32


def _sun(house: str, recipe: Mapping[str, Any]) -> tuple[float, float, bool]:
    """(elevation, azimuth) in rad, hidden by clouds; azimuth from -z, north, towards +x (docs/light.md)."""
    fields, seed = recipe["sky"], recipe["seed"]
    share = _drawn(house, seed, "elevation")
    elevation = math.radians(15 + 45 * share)
    azimuth = 2 * math.pi * _drawn(house, seed, "azimuth")
    time, is_overcast = fields["time"], bool(fields["overcast"])
    if time == "drawn" and fields["hour"] is None and fields["sun_elevation_deg"] is None:
        hour = 6 * _drawn(house, seed, "hour")
        time = "night" if hour < 1 else "dusk" if hour < 2 else "day"
        is_overcast |= 2 <= hour < 3
    if time in ("dusk", "night"):
        elevation = math.radians(-6 + 4.5 * share if time == "dusk" else -30)
    if fields["hour"] is not None:
        # Cooper 1969.
        tilt = math.radians(23.45) * math.sin(2 * math.pi * (284 + fields["day_of_year"]) / 365)
        turn = math.radians(15 * (fields["hour"] - 12))
        north = math.radians(fields["latitude_deg"])
        up = math.sin(north) * math.sin(tilt) + math.cos(north) * math.cos(tilt) * math.cos(turn)
        away = math.cos(north) * math.sin(tilt) - math.sin(north) * math.cos(tilt) * math.cos(turn)
        elevation = math.asin(min(max(up, -1.0), 1.0))
        azimuth = math.atan2(-math.cos(tilt) * math.sin(turn), away)
    if fields["sun_elevation_deg"] is not None:
        elevation = math.radians(fields["sun_elevation_deg"])
    if fields["sun_azimuth_deg"] is not None:
        azimuth = math.radians(fields["sun_azimuth_deg"])
    return elevation, azimuth, is_overcast


# Sun's elevation in degrees -> log10 lx of a clear sky on level ground (docs/light.md).
_CLEAR = (
    (-18.0, -12.0, -6.0, -3.0, 0.0, 2.0, 10.0, 30.0, 60.0, 90.0),
    (-3.2, -2.1, 0.53, 1.6, 2.78, 3.15, 3.65, 4.0, 4.11, 4.15),
)


def _sky_lx(height: float, is_overcast: bool, light: Mapping[str, Any]) -> tuple[float, float]:
    """Lux of open level ground by the dome and by the sun (docs/light.md)."""
    degrees, scale = math.degrees(height), light["sky_lx"] / 1e4
    clear = float(10 ** np.interp(degrees, *_CLEAR))
    if is_overcast:
        level = 300 + 21_000 * math.sin(height) if height >= 0 else 0.5 * clear
        return level * scale + 0.3, 0.0
    if height < 0:
        return clear * scale + 0.3, 0.0
    mass = 1 / (math.sin(height) + 0.50572 * (degrees + 6.07995) ** -1.6364)
    normal = light["sun_lx"] * math.exp(-0.21 * (mass - 1))
    return clear * scale, normal * math.sin(height)


CHECKS = (Check("illuminance", "house", check_illuminance, 7, ("illuminance.json",)),)
