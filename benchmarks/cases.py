"""Formerly misread files, every format end to end, and hostile inputs: `make bench NAME=cases` -> out/bench/cases.json.

The builders are those of tests/cases, tests/inputs and tests/hostile. `python -m benchmarks.cases NAME...` runs the cases
whose names contain one of the words and writes nothing.
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
from benchmarks.figures import write_report
from pbrs_farm.export.export_homes import export_house
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.cases import case
from tests.cases.table import CASES
from tests.inputs.sound_files import every_format

UNITS: Final = {
    "cases": "files that were read wrongly once",
    "cases.wrong": "of them, still read wrongly",
    "cases.wrong_names": "names of these",
    "inputs": "formats that are read",
    "inputs.run": "of them, rendered by `run`, made equally by a farm's worker, and our own export rendered again",
    "inputs.not_run": "names of the other formats",
    "hostile.inputs": "hostile files and words",
    "hostile.failures": "of them, with a fault",
}
_EXPORTS: Final = {"glTF": "gltf", "Habitat": "habitat", "OpenUSD": "usd"}
_HOME_FILES: Final = {"gltf": "*.glb", "habitat": "scenes/*.json", "usd": "*.usdc"}
_BY_WORKERS: Final = (
    "tests/prepare/test_formats.py::test_run_and_a_worker_of_a_farm_make_the_house_of_a_file"
)


def main() -> None:
    """Run every case, every format and the hostile inputs; write the report."""
    wrong = _faults({name: _asked(question) for name, question in CASES.items()})
    not_run = _faults(_trials_of_formats())
    for title, message in _not_made_by_workers().items():
        not_run.setdefault(title, message)
    n_formats = len(every_format())
    hostile_inputs, hostile_failures = hostile.counted(())
    figures: dict[str, Any] = {
        "cases": len(CASES),
        "cases.wrong": len(wrong),
        "cases.wrong_names": sorted(wrong),
        "inputs": n_formats,
        "inputs.run": n_formats - len(not_run),
        "inputs.not_run": sorted(not_run),
        "hostile.inputs": hostile_inputs,
        "hostile.failures": hostile_failures,
    }
    write_report("cases", figures, UNITS)


def _asked(question: case.Case) -> Callable[[Path], None]:
    return lambda folder: question.ask(question.write(folder))


def _trials_of_formats() -> dict[str, Callable[[Path], None]]:
    """Title of a format -> `run` of its small house and of our export of the built-in home."""

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
    """Name -> error message of each failed trial; each has its own folder."""

    def fault(name: str) -> str:
        with tempfile.TemporaryDirectory(prefix="case-") as folder:
            try:
                trials[name](Path(folder))
            except Exception as error:  # noqa: BLE001  any error makes the case wrong
                message = " ".join(str(error).split()) or type(error).__name__
                print(f"   wrong {name:24} {message[:200]}", flush=True)
                return message
            print(f"   right {name}", flush=True)
            return ""

    return {name: message for name in trials if (message := fault(name))}


def _not_made_by_workers() -> dict[str, str]:
    """Title -> message of each format whose house differs between `run` and a farm's worker."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "junit.xml"
        command = [sys.executable, "-m", "pytest", "-q", _BY_WORKERS, f"--junit-xml={report}"]
        subprocess.run(command, capture_output=True, check=False)
        rows = list(ElementTree.parse(report).iter("testcase")) if report.is_file() else []
    n_faults = {row.get("name", "").partition("[")[2].rstrip("]"): len(row) for row in rows}
    return {
        title: "a worker makes another house" for title in every_format() if n_faults.get(title, 1)
    }


if __name__ == "__main__":
    words = sys.argv[1:]
    chosen = {n: _asked(q) for n, q in CASES.items() if any(word in n for word in words)}
    sys.exit(bool(_faults(chosen)) if words else main())
