"""Where every bench puts its figures: out/bench/<name>.json. Effects: writes that file."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pbrs_farm.operating_system import processor_name

FOLDER = Path("out/bench")
PACKAGES = (
    "numpy", "scipy", "mitsuba", "drjit", "moderngl", "pyoidn", "OpenImageIO", "pyarrow",
    "faiss-cpu", "celery", "redis",
)  # fmt: skip


def write_report(name: str, figures: Mapping[str, Any], units: Mapping[str, str]) -> Path:
    """Write out/bench/<name>.json and print its figures; the file's path.

    figures: name -> measured value. units: name -> unit, for every figure.
    """
    missing = sorted(set(figures) - set(units))
    if missing:
        raise ValueError(f"figures without a unit: {', '.join(missing)}")
    report = {
        "figures": dict(figures),
        "units": dict(units),
        "machine": machine(),
        "versions": versions(),
        "commit": commit(),
    }
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{name}.json"
    path.write_text(json.dumps(report, indent=1) + "\n")
    width = max((len(k) for k in figures), default=0)
    for key, value in figures.items():
        print(f"{key:<{width}}  {value} {units[key]}")
    return path


def machine() -> dict[str, Any]:
    """Processor, cores, memory, system, and how busy the machine is with other work."""
    return {
        "cpu": processor_name(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1),
        "system": platform.platform(),
        "load_1min": round(os.getloadavg()[0], 2),
    }


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that do the work, where installed."""
    versions_by_package = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions_by_package[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions_by_package


def commit() -> str:
    """The checkout's commit, with "+" when files differ from it; "" outside a checkout."""
    try:
        head = _git("rev-parse", "--short=12", "HEAD")
        return head + ("+" if _git("status", "--porcelain") else "")
    except (OSError, subprocess.CalledProcessError):
        return ""


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], capture_output=True, text=True, check=True)
    return done.stdout.strip()
