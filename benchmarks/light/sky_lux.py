"""Open ground's illuminance under a clear sky against tables of daylight and twilight. Effects: writes out/bench/sky.json."""

from __future__ import annotations

import math
from typing import Final

from benchmarks.figures import write_report
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.transport.scene_tables.sky import sky_for_house

# Elevation of the sun in degrees -> lx: CIE 110 and IES by day, US Naval Observatory below the horizon.
TABLE: Final = {60: 100e3, 30: 50e3, 10: 11e3, 2: 1.5e3, 0: 600.0, -3: 40.0, -6: 3.4, -12: 0.3}

UNITS: Final = {
    "sky.lux_error": "largest |log10| of ours over the table's, at eight elevations of the sun",
    **{f"sky.lux_at_{elevation}": f"lx; {lux:g} in the tables" for elevation, lux in TABLE.items()},
}


def main() -> None:
    """Measure and write the figures."""
    figures = {}
    for elevation in TABLE:
        recipe = recipe_from_name("fast", {"sky.sun_elevation_deg": str(elevation)})
        sky = sky_for_house(recipe, "bench")
        figures[f"sky.lux_at_{elevation}"] = round(sky.sky_lx + sky.sun_lx, 2)
    errors = [abs(math.log10(figures[f"sky.lux_at_{e}"] / lux)) for e, lux in TABLE.items()]
    write_report("sky", {"sky.lux_error": round(max(errors), 3)} | figures, UNITS)


if __name__ == "__main__":
    main()
