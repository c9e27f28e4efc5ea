"""Time, equality with `run`, physics and length of the examples in Python: `make bench NAME=python` -> out/bench/python.json.

`python -m benchmarks python`: import, the first picture, equality with `run`, a warm view, physics over
PBRS_SCATTERINGS scatterings (default 10), length of the examples.
"""

from __future__ import annotations

import ast
import csv
import io
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import tokenize
import warnings
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np
import trimesh

import pbrs_farm as pf
from benchmarks.figures import write_report
from pbrs_farm.core.errors import BadInput
from pbrs_farm.formats.marker import Marker
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from pbrs_farm.scene import physics

REPO: Final = Path(__file__).parents[1]
EXAMPLES: Final = REPO / "examples"

UNITS: Final = {
    "python.import_ms": "ms of `import pbrs_farm`, median of 9 processes, the interpreter apart",
    "python.first_picture_lines": "lines of docs/python.md's first picture",
    "python.render_equal": "1 = every file of a saved frame but markers equals that of `run`",
    "python.warm_overhead": "seconds a warm view takes over those of its steps in `run`",
    "python.examples": "scripts under examples/",
    "python.shorter": "share of the peers' examples whose counterpart here has fewer lines of code",
    "python.wrong_calls": "wrong calls in tests/scene/test_wrong_calls.py",
    "python.wrong_calls_silent": "of them: accepted, or without one line that names the argument",
    "cli.wrong_lines": "wrong command lines in tests/cli/test_command_line.py",
    "cli.tracebacks": "of them: accepted, or without one line that says what is wrong",
    "python.physics_scatterings": "scatterings of 20 items on a table, seeds 0...",
    "python.physics_settled": "share of them that came to rest",
    "python.physics_penetration_mm": "mm, deepest contact of any, as MuJoCo measures it",
    "python.physics_s": "s a scattering, median",
}


def main() -> None:
    """Measure everything and write the report."""
    figures: dict[str, Any] = {
        "python.import_ms": import_ms(),
        "python.first_picture_lines": first_picture_lines(),
        "python.examples": len(list(EXAMPLES.glob("*.py"))),
        "python.shorter": shorter(),
    }
    calls = outcomes("tests/scene/test_wrong_calls.py", "names_the_argument or unknown_argument")
    lines = outcomes("tests/cli/test_command_line.py", "misspelling")
    figures |= {"python.wrong_calls": sum(calls), "python.wrong_calls_silent": calls[1]}
    figures |= {"cli.wrong_lines": sum(lines), "cli.tracebacks": lines[1]}
    figures |= against_run()
    figures |= of_physics(int(os.environ.get("PBRS_SCATTERINGS", "10")))
    write_report("python", figures, UNITS)


def outcomes(file: str, words: str) -> tuple[int, int]:
    """Passed and failed tests of a file whose names have the words."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        command = ["-m", "pytest", "-q", file, "-k", words, f"--junitxml={report}"]
        subprocess.run([sys.executable, *command], cwd=REPO, capture_output=True)
        (suite,) = ElementTree.parse(report).getroot()
    failed = int(suite.get("failures", 0)) + int(suite.get("errors", 0))
    return int(suite.get("tests", 0)) - failed, failed


def import_ms() -> float:
    """Milliseconds that importing the package adds to a process."""

    def seconds(code: str) -> float:
        started = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        return time.perf_counter() - started

    bare = statistics.median(seconds("pass") for _ in range(9))
    return round(
        1000 * (statistics.median(seconds("import pbrs_farm") for _ in range(9)) - bare), 1
    )


def first_picture_lines() -> int:
    """Lines of the first block of docs/python.md until the frame is there."""
    text = (REPO / "docs/python.md").read_text(encoding="utf-8")
    match = re.search(r"```python\n(.*?frame = [^\n]*)\n", text, re.DOTALL)
    return len([line for line in match[1].splitlines() if line.strip()]) if match else 0


def shorter() -> float:
    """Share of the rows of peer_examples.csv with an answer of ours that has fewer lines of code."""
    with (REPO / "benchmarks/peer_examples.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["ours"]]
    return round(
        sum(code_lines(EXAMPLES / f"{r['ours']}.py") < int(r["lines"]) for r in rows) / len(rows), 3
    )


def code_lines(path: Path) -> int:
    """Lines that hold code: no blank ones, comments or docstrings."""
    text = path.read_text(encoding="utf-8")
    nothing = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    code = {
        line for t in tokens if t.type not in nothing | {tokenize.ENDMARKER}
        for line in range(t.start[0], t.end[0] + 1)
    }  # fmt: skip
    for node in ast.walk(ast.parse(text)):
        value = node.value if isinstance(node, ast.Expr) else None
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            code -= set(range(value.lineno, (value.end_lineno or value.lineno) + 1))
    return len(code)


def against_run() -> dict[str, Any]:
    """The same views in memory and by `run`: bytes, and seconds of a view once all is warm."""
    home = pf.load("builtin", recipe="preview")
    with tempfile.TemporaryDirectory() as scratch:
        mine, theirs = Path(scratch) / "mine", Path(scratch) / "run"
        cameras = home.cameras(n=4)
        pf.render(home, cameras[0])
        started = time.perf_counter()
        frames = pf.render(home, cameras[1:])
        warm_s = (time.perf_counter() - started) / (len(cameras) - 1)
        frames.save(mine)
        pf.render(home, cameras[0]).save(mine)
        run_local(Run(["builtin"], str(theirs), home.recipe, wanted(["mlt_il_ol"], [], 4)))
        run_s = [_seconds_of_steps(theirs, one.id) for one in cameras[1:]]
        equal = _files(mine) == _files(theirs)
    return {
        "python.render_equal": int(equal),
        "python.warm_overhead": round(warm_s / statistics.mean(run_s), 3),
    }


def _seconds_of_steps(root: Path, view: str) -> float:
    markers = root.glob(f"houses/*/done/*.{view}.json")
    return sum(Marker.model_validate_json(path.read_bytes()).seconds for path in markers)


def _files(root: Path) -> dict[str, bytes]:
    files = (p for p in root.rglob("*") if p.is_file() and p.parent.name != "done")
    return {str(p.relative_to(root)): p.read_bytes() for p in files}


def of_physics(n: int) -> dict[str, Any]:
    """Share of scatterings of 20 items that come to rest, and their deepest contact."""
    home = pf.load("builtin", recipe="preview")
    house, table = home.house, home.items.named("dining table")
    depths, times, n_settled = [], [], 0
    with tempfile.TemporaryDirectory() as folder:
        models = _models(Path(folder))
        for seed in range(n):
            started = time.perf_counter()
            try:
                placed = physics.settled_poses(house, models, 20, list(table), seed)
            except BadInput as error:
                warnings.warn(f"seed {seed}: {error}", stacklevel=1)
                continue
            times.append(time.perf_counter() - started)
            n_settled += 1
            depths.append(physics.penetration_m(house, placed, list(table)))
    return {
        "python.physics_scatterings": n,
        "python.physics_settled": round(n_settled / n, 4),
        "python.physics_penetration_mm": round(1000 * max(depths, default=float("nan")), 3),
        "python.physics_s": round(statistics.median(times), 2) if times else None,
    }


def _models(folder: Path) -> list[pf.Model]:
    meshes = {
        "can": trimesh.creation.cylinder(0.033, 0.122),
        "crate": trimesh.creation.box((0.08, 0.05, 0.12)),
        "ring": trimesh.creation.annulus(0.03, 0.04, 0.05),
        "ball": trimesh.creation.icosphere(radius=0.035),
        "flask": trimesh.creation.revolve(
            np.array([[0, 0], [0.03, 0], [0.03, 0.12], [0.012, 0.17], [0.012, 0.22], [0, 0.22]])
        ),
    }
    for name, mesh in meshes.items():
        mesh.export(folder / f"{name}.ply")
    return [pf.model(folder / f"{name}.ply") for name in meshes]


if __name__ == "__main__":
    main()
