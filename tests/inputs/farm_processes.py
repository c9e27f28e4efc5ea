"""Processes of a farm's workers."""

from __future__ import annotations

import json
import os
from pathlib import Path

from benchmarks.memory import descendants
from tests.workers.small_farm import SmallFarm


def renderers(farm: SmallFarm, worker: str) -> list[int]:
    """Process ids of a worker's renderers."""
    renderer_ids = []
    for pid in descendants(farm.processes[worker].pid):
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        if b"workers.node.renderer:make_handler" in words:
            renderer_ids.append(pid)
    return renderer_ids


def note(fault: str, farm: SmallFarm, repeated: int, seconds: float) -> None:
    """Add a line to the chaos table; at this point nothing was lost."""
    path = os.environ.get("PBRS_CHAOS_TABLE")
    if path:
        row = {
            "fault": fault, "tasks": sum(farm.starts().values()) - repeated, "lost": 0,
            "repeated": repeated, "seconds": round(seconds, 1),
        }  # fmt: skip
        with Path(path).open("a") as file:
            file.write(json.dumps(row) + "\n")
