"""Run benches by name: `python -m benchmarks [NAME...]`; the short ones if none is named, --list prints all names.

Each bench is a module with main(), whose folder says its subject; a bench that fails does not stop
the others.
"""

from __future__ import annotations

import importlib
import sys
import time
import traceback
from typing import Final

# The module of each bench, below this folder.
DEFAULT: Final = {
    "demo": "views.demo",
    "view": "views.view",
    "houses": "homes.houses",
    "cameras": "views.cameras",
    "labels": "views.labels",
    "gl": "views.gl",
    "lux": "light.lux",
    "selection": "selection",
}
OWN_TARGET: Final = {
    "house": "house",
    "bytes": "stored_bytes",
    "dress": "dress.dress",
    "cloths": "dress.cloths",
    "house_cost": "homes.house_cost",
    "made": "homes.made",
    "variety": "homes.variety",
    "joints": "homes.joints",
    "light": "light.equal_time",
    "light_pictures": "light.light_pictures",
    "sky": "light.sky_lux",
    "outside": "views.outside",
    "lab_tables": "lab_tables",
    "denoised": "light.denoised",
    "growth": "light.growth",
    "guided": "light.guided",
    "gpu": "light.gpu",
    "presets": "light.presets",
    "cycles": "renderers.cycles",
    "farm": "farm.farm_cost",
    "cases": "cases",
    "hostile": "hostile",
    "loading": "study.loading",
    "study": "study.study_figures",
    "lived_in": "study.lived_in",
    "tone": "study.picture_tone",
    "board": "board.board_pages",
    "motion": "motion.motion",
    "moving": "motion.moving",
    "python": "python_api",
    "truth": "truth",
    "sets": "sets",
    "inputs": "inputs",
    "docs": "docs_figures",
    "release": "release",
    "startup": "startup",
    "anywhere": "anywhere",
    "robots": "homes.robots",
}


def main(names: list[str]) -> int:
    """Run the named benches; 1 if any failed, 2 for a name that is none."""
    modules = DEFAULT | OWN_TARGET
    if names == ["--list"]:
        print(*modules, sep="\n")
        return 0
    unknown = [n for n in names if n not in modules]
    if unknown:
        print(f"no bench {unknown[0]!r}; of {', '.join(modules)}", file=sys.stderr)
        return 2
    failed = []
    for name in names or DEFAULT:
        print(f"== {name}", flush=True)
        started = time.monotonic()
        try:
            importlib.import_module(f"benchmarks.{modules[name]}").main()
        except Exception:  # noqa: BLE001  one bench's fault is told, the others still run
            traceback.print_exc()
            failed.append(name)
        print(f"== {name}: {time.monotonic() - started:.1f} s\n", flush=True)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
