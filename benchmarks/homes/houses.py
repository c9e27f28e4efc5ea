"""Reading and repairing: each example home on one core, a 300-node SUNCG house, and the leak meter."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.figures import write_report
from benchmarks.memory import peak_mb

SUNCG = "suncg300"


def main() -> None:
    """Measure every home in a process of its own and write out/bench/houses.json."""
    from pbrs_farm.assets import homes_package

    homes_package.fetch()
    names = [home.name for home in homes_package.example_homes()]
    print(
        f"{'home':<34}{'read s':>8}{'repair s':>9}{'all s':>7}{'MB':>6}{'triangles':>11}{'leaks':>7}{'closed':>8}"
    )
    rows = [_measured(name) for name in [*names, SUNCG]]
    real, suncg = rows[:-1], rows[-1]
    print(f"{'home':<34}{'views':>6}{'dark':>6}  left out")
    lit = [_lit(name) for name in names]
    figures = {
        "houses.worst_s": max(r["seconds"] for r in real),
        "houses.worst_mb": max(r["mb"] for r in real),
        "houses.suncg300_s": suncg["seconds"],
        "houses.leak_max": max(r["n_sky"] for r in real),
        "houses.leak_rays": sum(r["n_rays"] for r in real),
        "houses.closed_share_min": min(r["closed_share"] for r in real),
        "houses.views_lit": sum(r["views"] for r in lit),
        "houses.dark_views": sum(len(r["dark"]) for r in lit),
        "houses.walls_lost": sum(r["walls_lost"] for r in real),
    }
    units = {
        "houses.worst_s": "s, one core, read + repair + leak meter",
        "houses.worst_mb": "MB resident, one process",
        "houses.suncg300_s": "s, one core, 300 nodes, built in code",
        "houses.leak_max": "rays that reach the sky, of the worst home",
        "houses.leak_rays": "rays over all homes",
        "houses.closed_share_min": "share of the floor area in closed rooms, of the worst home",
        "houses.views_lit": "views of a preview run's choice that were looked at for light",
        "houses.dark_views": "of them black, or in a room below 1 lx by all light",
        "houses.walls_lost": "walls of which repair took more than a tenth, all homes",
    }
    write_report("houses", figures, units)


def _in_a_process(module: str, name: str) -> dict[str, Any]:
    done = subprocess.run([sys.executable, "-m", module, name], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{name}: {done.stderr.strip().splitlines()[-1:]}")
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return row


def _lit(name: str) -> dict[str, Any]:
    row = _in_a_process("benchmarks.homes.house_light", name)
    print(f"{name:<34}{row['views']:>6}{len(row['dark']):>6}  {'; '.join(row['left_out'])}")
    print(*(f"  {line}\n" for line in row["dark"]), sep="", end="", flush=True)
    return row


def _measured(name: str) -> dict[str, Any]:
    row = _in_a_process("benchmarks.homes.houses", name)
    print(
        f"{name:<34}{row['read_s']:>8.2f}{row['repair_s']:>9.2f}{row['seconds']:>7.2f}{row['mb']:>6}"
        f"{row['triangles']:>11}{row['n_sky']:>7}{row['closed_share']:>8.2f}",
        flush=True,
    )
    return row


def measure(name: str) -> dict[str, Any]:
    """Read and repair one home on one core of this process."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    from pbrs_farm.core.recipe import Recipe
    from pbrs_farm.prepare.read_source import read_house
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.raycast.variant import set_threads
    from pbrs_farm.repair import repair

    recipe = Recipe()
    with tempfile.TemporaryDirectory() as folder:
        source = _source(name, Path(folder))
        set_threads(1)
        started = time.perf_counter()
        house = read_house(source, recipe.read)
        read_s = time.perf_counter() - started
        repaired, report = repair(house, recipe.repair, occluder_from=lambda h: Caster.of_house(h))
        seconds = time.perf_counter() - started
    leaks = report.leaks
    return {
        "read_s": round(read_s, 2),
        "repair_s": round(seconds - read_s, 2),
        "seconds": round(seconds, 2),
        "mb": round(peak_mb()),
        "triangles": sum(item.n_faces for item in repaired.items),
        "n_sky": leaks.n_sky if leaks else -1,
        "n_rays": leaks.n_rays if leaks else 0,
        "closed_share": round(leaks.closed_share, 3) if leaks else 0.0,
        "walls_lost": len(report.structure.walls_lost),
    }


def _source(name: str, folder: Path) -> Any:
    from pbrs_farm.prepare.source import resolve

    if name != SUNCG:
        return resolve(name)
    from tests.read.suncg.suncg_root import write_large_root

    house_id = write_large_root(folder, n_nodes=300)
    return resolve(str(folder / "house" / house_id))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(measure(sys.argv[1])))
    else:
        main()
