"""What a process of light has loaded before it has a task."""

import subprocess
import sys
from pathlib import Path

import pytest

# Makes a house in a process that is ready for light, then prints what light loads beside.
_CODE = """
import sys
from pathlib import Path
from pbrs_farm.read.source import resolve
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.run_task import make_light_handler
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import store_from_url
from tests.run.test_pipeline import small

make_light_handler(print)
source = resolve("builtin")
work = Work(store_from_url(sys.argv[1]), small(), source.house_id, HouseCache(), source)
for step in ("house", "cameras"):
    views = run_step(step, work).marker.facts.get("views")
before = set(sys.modules)
run_step("illuminance", work)
run_step("light", Work(work.store, work.recipe, work.house_id, work.house_cache, view_id=views[0][0]))
print(*sorted(m for m in set(sys.modules) - before if m.startswith("pbrs_farm")))
"""


def test_light_waits_for_no_module_of_ours(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")
    done = subprocess.run(
        [sys.executable, "-c", _CODE, str(tmp_path)], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == []
