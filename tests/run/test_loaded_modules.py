"""Modules that the processes of a run load."""

import subprocess
import sys
from pathlib import Path

import pytest

# A separate process makes a house and its cameras; then one prepared for light renders
# light, and prints the modules that this loads in addition.
_BEGIN = """
import sys
from pathlib import Path
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.run_task import make_light_handler
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import store_from_url
from tests.inputs.small_recipes import small

source = resolve("builtin")
work = Work(store_from_url(sys.argv[1]), small(), source.house_id, HouseCache(), source)
"""
_HOUSE = """
run_step("house", work)
print(run_step("cameras", work).marker.facts["views"][0][0])
"""
_LIGHT = """
make_light_handler(print)
before = set(sys.modules)
run_step("illuminance", work)
run_step("light", Work(work.store, work.recipe, work.house_id, work.house_cache, view_id=sys.argv[2]))
print(*sorted(m for m in set(sys.modules) - before if m.startswith("pbrs_farm")))
"""


@pytest.mark.slow
def test_light_waits_for_no_module_of_ours(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")

    def output_of(code: str, *words: str) -> str:
        command = [sys.executable, "-c", _BEGIN + code, str(tmp_path), *words]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    assert output_of(_LIGHT, output_of(_HOUSE)) == ""


def test_the_process_that_supervises_a_run_loads_no_scipy() -> None:
    code = (
        "import sys, pbrs_farm.run.local; print('scipy' in sys.modules, 'shapely' in sys.modules)"
    )
    command = [sys.executable, "-c", code]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert output.split() == ["False", "False"]
