"""How many files that were read wrongly once still are: `make bench NAME=cases` -> out/bench/cases.json.

The cases are those of tests/cases. With them stand the formats that run from end to end, how far cloths
are stretched in dressed homes, and what hostile inputs do.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from benchmarks import hostile
from benchmarks.dress import cloths
from benchmarks.figures import write_report
from pbrs_farm.export.export_homes import export_house
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.cases import case
from tests.cases.table import CASES
from tests.inputs.sound_files import every_format

UNITS: Final = {
    "cases": "files that were read wrongly once",
    "cases.wrong": "of them still wrong",
    "cases.wrong_names": "their names",
    "inputs": "formats that are read",
    "inputs.run": "of them that `run`, a farm's worker and, where one is written, `run` of our own export make a home of",
    "inputs.not_run": "the others",
    "cloth.stretch_p99": cloths.UNITS["cloth.stretch_p99"],
    "hostile.inputs": "hostile files and words",
    "hostile.failures": "of them that did harm",
}
_EXPORTS: Final = {"glTF": "gltf", "Habitat": "habitat", "OpenUSD": "usd"}
_HOME_FILES: Final = {"gltf": "*.glb", "habitat": "scenes/*.json", "usd": "*.usdc"}
_BY_WORKERS: Final = (
    "tests/prepare/test_formats.py::test_run_and_a_worker_of_a_farm_make_the_house_of_a_file"
)


def main() -> None:
    """Run every case and every format, then cloths and hostile inputs; write the report."""
    wrong = _faults({one.name: _asked(one) for one in CASES.values()})
    not_run = _faults(_trials_of_formats())
    for title, said in _not_made_by_workers().items():
        not_run.setdefault(title, said)
    n_formats = len(every_format())
    hostile_inputs, hostile_failures = hostile.counted(())
    figures: dict[str, Any] = {
        "cases": len(CASES),
        "cases.wrong": len(wrong),
        "cases.wrong_names": sorted(wrong),
        "inputs": n_formats,
        "inputs.run": n_formats - len(not_run),
        "inputs.not_run": sorted(not_run),
        "cloth.stretch_p99": cloths.figures()["cloth.stretch_p99"],
        "hostile.inputs": hostile_inputs,
        "hostile.failures": hostile_failures,
    }
    write_report("cases", figures, UNITS)


def _asked(one: case.Case) -> Callable[[Path], None]:
    return lambda folder: one.ask(one.write(folder))


def _trials_of_formats() -> dict[str, Callable[[Path], None]]:
    """Title of a format -> `run` of its small house, and of the built-in home as we export it."""

    def trial(title: str, write: Callable[[Path], Path]) -> Callable[[Path], None]:
        def ran(folder: Path) -> None:
            case.run(write(folder), folder / "out")
            form = _EXPORTS.get(title)
            if form is not None:
                export_house(builtin_home(), folder / "ours", form)
                case.run(next((folder / "ours").glob(_HOME_FILES[form])), folder / "again")

        return ran

    return {title: trial(title, write) for title, write in every_format().items()}


def _faults(trials: dict[str, Callable[[Path], None]]) -> dict[str, str]:
    """Name -> what is wrong, of those that fail; each in a folder of its own."""

    def fault(name: str) -> str:
        with tempfile.TemporaryDirectory(prefix="case-") as folder:
            try:
                trials[name](Path(folder))
            except Exception as error:  # noqa: BLE001  whatever it raises, the case is wrong
                said = " ".join(str(error).split()) or type(error).__name__
                print(f"   wrong {name:24} {said[:200]}", flush=True)
                return said
            print(f"   right {name}", flush=True)
            return ""

    return {name: said for name in trials if (said := fault(name))}


def _not_made_by_workers() -> dict[str, str]:
    """Title -> fault, of the formats that a farm's worker makes another house of than `run`."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "junit.xml"
        command = [sys.executable, "-m", "pytest", "-q", _BY_WORKERS, f"--junit-xml={report}"]
        subprocess.run(command, capture_output=True, check=False)
        rows = list(ElementTree.parse(report).iter("testcase")) if report.is_file() else []
    found = {row.get("name", "").partition("[")[2].rstrip("]"): len(row) for row in rows}
    return {
        title: "a worker makes another house" for title in every_format() if found.get(title, 1)
    }
