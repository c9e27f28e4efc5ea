"""How bright the floors of the example homes are by lamps and by daylight, room by room.

Against the ranges of one photometric scale: lamps 30 to 1,000 lx, daylight 20 to 5,000 lx.
"""

from __future__ import annotations

import statistics
from typing import Any

from benchmarks.figures import write_report
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.read.source import resolve
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore
from pbrs_farm.transport.illuminance import DAYLIGHT_LX, LAMPS_LX


def main() -> None:
    """Measure the nine homes and write out/bench/lux.json."""
    from pbrs_farm.assets import homes_package

    homes_package.fetch()
    rows: list[dict[str, Any]] = []
    for home in homes_package.example_homes():
        rows += _rooms_of(home.name)
    lamps = [r for r in rows if {"lamps", "fallback", "added"} & set(r["lit_by"])]
    day = [r for r in rows if "windows" in r["lit_by"]]
    figures: dict[str, Any] = {"lux.rooms": len(rows)}
    units = {"lux.rooms": "rooms"}
    for key, some, group, (low, high) in (
        ("lamps", lamps, "indoor", LAMPS_LX),
        ("daylight", day, "outdoor", DAYLIGHT_LX),
    ):
        values = [r[group] for r in some]
        found = {
            "rooms": (len(values), "rooms that have that light"),
            "median": (round(statistics.median(values), 1), "lx"),
            "below": (sum(v < low for v in values), f"rooms below {low:g} lx"),
            "above": (sum(v > high for v in values), f"rooms above {high:g} lx"),
        }
        for name, (value, unit) in found.items():
            figures[f"lux.{key}_{name}"], units[f"lux.{key}_{name}"] = value, unit
    write_report("lux", figures, units)


def _rooms_of(name: str) -> list[dict[str, Any]]:
    store, recipe, source = MemoryStore(), Recipe(), resolve(name)
    work = Work(store, recipe, source.house_id, HouseCache(), source=source)
    marker = run_step("house", work).marker
    lit = run_step("illuminance", work).marker.facts["floor_lux"]
    house = work.house_cache.get(store, recipe, source.house_id, marker.digest).house
    rows: list[dict[str, Any]] = []
    print(f"{name}\n  {'room':<28}{'lamps':>8}{'daylight':>10}  lit by")
    for room in house.rooms:
        lux = lit[room.id]
        print(
            f"  {room.id + ' ' + room.name[:20]:<28}{lux['indoor']:>8.1f}{lux['outdoor']:>10.1f}"
            f"  {' '.join(room.lit_by)}",
            flush=True,
        )
        rows.append({"lit_by": room.lit_by, **lux})
    work.house_cache.clear()
    return rows


if __name__ == "__main__":
    main()
