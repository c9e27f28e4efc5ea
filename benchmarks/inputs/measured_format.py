"""`python -m benchmarks.inputs.measured_format TITLE`: one format's house, read and repaired; a JSON line."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.inputs.sound_files import sound_files


def measure(title: str) -> dict[str, Any]:
    """Counts of the repaired house, and seconds."""
    from pbrs_farm.core.house import Enclosure
    from pbrs_farm.core.recipe import recipe_from_name
    from pbrs_farm.prepare.finished_house import repaired_house
    from pbrs_farm.prepare.source import resolve

    sound = sound_files()[title]
    with tempfile.TemporaryDirectory() as folder:
        path = sound.write(Path(folder))
        models = str(sound.models(path)) if sound.models else ""
        started = time.perf_counter()
        house, report = repaired_house(resolve(str(path), models=models), recipe_from_name("fast"))
        seconds = time.perf_counter() - started
    return {
        "seconds": round(seconds, 2),
        "triangles": sum(item.n_faces for item in house.items),
        "rooms": len(house.rooms),
        "closed_rooms": sum(r.enclosure is Enclosure.CLOSED for r in house.rooms),
        "told": sound.n_openings,
        "openings": len(house.openings),
        "leaks": report.leaks.n_sky if report.leaks is not None else 0,
        "walls_lost": len(report.structure.walls_lost),
        "items": len(house.items),
    }


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1])))
