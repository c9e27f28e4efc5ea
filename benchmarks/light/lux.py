"""How bright the floors of the example homes are by lamps and by daylight, room by room.

Against the ranges of one photometric scale: lamps 30 to 1,000 lx, daylight 20 to 5,000 lx.
"""

from __future__ import annotations

import statistics
from typing import Any

from benchmarks.figures import write_report
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore
from pbrs_farm.transport.illuminance import DAYLIGHT_LX, LAMPS_LX


def main() -> None:
    """Measure the nine homes and write out/bench/lux.json."""
    from pbrs_farm.assets import homes_package

    homes_package.fetch()
    homes = {h.name: _rooms_of(h.name) for h in homes_package.example_homes()}
    every = [room for rooms in homes.values() for room in rooms]
    figures: dict[str, Any] = {"lux.rooms": len(every)}
    units = {"lux.rooms": "rooms"}
    for name, rooms in ({"": every} | homes).items():
        prefix = f"lux.{name.lower()}_" if name else "lux."
        for end, (value, unit) in _figures_of(rooms).items():
            figures[prefix + end], units[prefix + end] = value, unit
    write_report("lux", figures, units)


def _figures_of(rooms: list[dict[str, Any]]) -> dict[str, tuple[float, str]]:
    """End of a figure's name -> (value, unit), of rooms that have lamps and of those with windows."""
    lamps = [r for r in rooms if {"lamps", "fallback", "added"} & set(r["lit_by"])]
    day = [r for r in rooms if "windows" in r["lit_by"]]
    found: dict[str, tuple[float, str]] = {}
    for key, some, group, (low, high) in (
        ("lamps", lamps, "indoor", LAMPS_LX),
        ("daylight", day, "outdoor", DAYLIGHT_LX),
    ):
        values = [r[group] for r in some] or [0.0]
        found |= {
            f"{key}_rooms": (len(some), "rooms that have that light"),
            f"{key}_least": (round(min(values), 1), "lx"),
            f"{key}_median": (round(statistics.median(values), 1), "lx"),
            f"{key}_most": (round(max(values), 1), "lx"),
            f"{key}_below": (sum(r[group] < low for r in some), f"rooms below {low:g} lx"),
            f"{key}_above": (sum(r[group] > high for r in some), f"rooms above {high:g} lx"),
        }
    return found


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
