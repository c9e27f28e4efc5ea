"""The table of the steps of repair, and a step added in one file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.repair import repair_house
from pbrs_farm.repair.repair_report import RepairReport, StructureReport

# Run repair_house.py with two more functions and a row.
ADDED = '''
import sys

from pbrs_farm.repair import repair_house

text = open(sys.argv[1]).read()
function = """
def _without_rugs(work):
    rugs = [item for item in work.house.items if item.name == "rug"]
    house = work.house.with_items(item for item in work.house.items if item not in rugs)
    return work.after(house, rugs=f"{len(rugs)} rugs rolled up.")


STEPS: Final = (
    RepairStep("rugs", _without_rugs),
"""
code = compile(text.replace("STEPS: Final = (\\n", function), sys.argv[1], "exec")
exec(code, repair_house.__dict__)

from pbrs_farm.cli import main

raise SystemExit(main(["repair", "builtin", "--out", "o"]))
'''


@pytest.mark.kinds("repair-step")
def test_a_step_added_in_one_file_runs_and_is_reported(tmp_path: Path) -> None:
    words = [sys.executable, "-c", ADDED, str(repair_house.__file__)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "- 1 rugs rolled up." in done.stdout
    report = RepairReport.model_validate_json((tmp_path / "o/repair.json").read_text())
    assert report.model_extra == {"rugs": "1 rugs rolled up."}


def test_every_fact_of_a_step_is_a_field_of_the_report() -> None:
    work = repair_house.Repairing(builtin_home(), RepairFields(), None)
    names = set()
    for step in repair_house.STEPS:
        work = step.run(work)
        names |= set(work.facts)
    assert names <= {*RepairReport.model_fields, *StructureReport.model_fields}
    assert len({step.name for step in repair_house.STEPS}) == len(repair_house.STEPS)
