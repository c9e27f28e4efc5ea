"""illuminance.json: rooms, warnings, and the sky that the recipe gives a house. Effects: none beside reading documents."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.core import keys

SKY_LX = 0.06  # of illuminances stored to a tenth
SKY_SHARE = 0.02  # of the dome's: it is summed over texels
SUN_SHARE = 0.005  # of the sun's: its direction is rounded to a texel or not
DIRECTION = 2e-6  # of a direction stored to six digits
EXPECTED_LX = {"outdoor": [20.0, 5000.0], "indoor": [30.0, 1000.0]}  # docs/formats/view_json.md
DARK_LX = 1.0


def check_illuminance(house: StoredHouse, tally: Tally) -> None:
    """illuminance.json: rooms of house.json, their warnings by its own numbers, the recipe's sky."""
    held = house.illuminance
    if not held:
        return
    sky = held.get("sky", {})
    if "expected_lx" in held:
        same = held["expected_lx"] == EXPECTED_LX
        tally.expect("illuminance", house.id, same, "expects other light than it should")
    is_day = sky.get("sun_direction", [0, 1, 0])[1] >= 0
    for row in held["rooms"]:
        place = f"{house.id} room {row['room']}"
        room = house.rooms.get(str(row["room"]))
        if house.rooms and tally.expect("illuminance", place, room is not None, "is no room"):
            assert room is not None
            same = row.get("name") == room["name"] and row["lit_by"] == room["lit_by"]
            tally.expect("illuminance", place, same, "is another room in house.json")
        if "warnings" in row:
            same = row["warnings"] == _warnings(row, is_day=is_day)
            tally.expect("illuminance", place, same, "its warnings are not those of its numbers")
        told = house.told_by_marker("illuminance").get("floor_lux", {}).get(row["room"])
        if told:
            same = told == {"outdoor": row["outdoor_lx"], "indoor": row["indoor_lx"]}
            tally.expect("illuminance", place, same, "has another light in the step's marker")
    if sky and house.recipe:
        _check_sky(house, sky, tally)


def _warnings(row: Mapping[str, Any], *, is_day: bool) -> list[str]:
    """Lines for what is out of range: docs/formats/view_json.md."""
    lit, lines = set(row["lit_by"]), []
    has = {
        "outdoor": is_day and bool(lit & {"windows", "sky"}),
        "indoor": bool(lit & {"lamps", "fallback", "added"}),
    }
    for group, (low, high) in EXPECTED_LX.items():
        value = row[f"{group}_lx"]
        if (has[group] and value < low) or value > high:
            lines.append(
                f"room {row['room']}: {group} light gives {value:g} lx on the floor, "
                f"expected {low:g} to {high:g}"
            )
    total = row["outdoor_lx"] + row["indoor_lx"]
    if total < DARK_LX:
        lines.append(
            f"room {row['room']}: {total:.2g} lx on the floor by all light, less than {DARK_LX:g}"
        )
    return lines


def _check_sky(house: StoredHouse, sky: Mapping[str, Any], tally: Tally) -> None:
    """Where the sun stands, and what sky and sun give open ground: by the recipe and the house's draws."""
    direction = np.array(sky["sun_direction"], np.float64)
    same = bool(abs(np.linalg.norm(direction) - 1) <= 5 * DIRECTION)
    tally.expect("sky", house.id, same, "its sun's direction has not length 1")
    elevation = math.degrees(math.asin(min(max(direction[1], -1.0), 1.0)))
    same = abs(elevation - sky["sun_elevation_deg"]) <= 0.01
    tally.expect("sky", house.id, same, f"its sun stands at {elevation:.3f} degrees")
    fields, light = house.recipe["sky"], house.recipe["emission"]
    if fields["kind"] != "sunsky":
        return
    height, azimuth, is_overcast = _sun(house.id, house.recipe)
    flat = math.cos(height)
    expected = [flat * math.sin(azimuth), math.sin(height), -flat * math.cos(azimuth)]
    same = bool(np.abs(direction - expected).max() <= DIRECTION)
    tally.expect(
        "sky",
        house.id,
        same,
        f"its sun is not that of the recipe, {np.round(expected, 4).tolist()}",
    )
    name = "sunsky"
    if is_overcast:
        name = "overcast"
    elif height < 0:
        name = "dusk" if math.degrees(-height) < 12 else "night"
    same = (sky["name"], sky["rotation_deg"]) == (name, 0.0)
    tally.expect("sky", house.id, same, f"is told to be {sky['name']}, the recipe gives {name}")
    # The ground's share of the dome is not seen by level ground.
    level, sun = _sky_lx(height, is_overcast, light)
    same = abs(sky["sky_lx"] - level) <= SKY_LX + SKY_SHARE * level
    tally.expect("sky", house.id, same, f"gives {sky['sky_lx']} lx, by its tables {level:.1f}")
    same = abs(sky["sun_lx"] - sun) <= SKY_LX + SUN_SHARE * sun
    tally.expect(
        "sky", house.id, same, f"its sun gives {sky['sun_lx']} lx, by its tables {sun:.1f}"
    )


def _drawn(house: str, seed: int, what: str) -> float:
    return keys.seed("sky", what, house, seed) / 2**32


def _sun(house: str, recipe: Mapping[str, Any]) -> tuple[float, float, bool]:
    """(elevation, azimuth) in rad, whether clouds hide it; azimuth from -z, north, towards +x (docs/light.md)."""
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


# Sun's elevation in degrees -> log10 lx of a clear sky on level ground (docs/spec/sky.md).
_CLEAR = (
    (-18.0, -12.0, -6.0, -3.0, 0.0, 2.0, 10.0, 30.0, 60.0, 90.0),
    (-3.2, -2.1, 0.53, 1.6, 2.78, 3.15, 3.65, 4.0, 4.11, 4.15),
)


def _sky_lx(height: float, is_overcast: bool, light: Mapping[str, Any]) -> tuple[float, float]:
    """Lux of open level ground by the dome and by the sun (docs/spec/sky.md)."""
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
