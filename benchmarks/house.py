"""The state of the code itself: size, comments, folders, functions, import cycles, coverage.

Effects: runs the test suite under coverage (about six minutes) and writes out/bench/house.json.
`python -m benchmarks.house --quick` leaves the tests out and writes nothing.
"""

from __future__ import annotations

import ast
import io
import json
import os
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import write_report

PACKAGES = ("pbrs_farm", "workers")
MARKERS = "not slow and not gpu and not chaos and not infra and not web and not sweethome3d"
PRAGMAS = ("noqa", "type:", "fmt:", "pragma:")
# Parts that came after a number of lines was wished for.
LATER_PARTS = tuple(
    Path("pbrs_farm") / part for part in ("dress", "read/catalogue", "generate", "board", "study")
)
LINE_KINDS = (
    "lines_of_statements",
    "lines_of_imports",
    "lines_of_docstrings",
    "lines_of_comments",
    "lines_blank",
)
UNITS = {
    "house.lines": "lines of .py of pbrs_farm and workers",
    "house.lines_of_statements": "of these, neither blank, comment, docstring nor import",
    "house.lines_of_imports": "of these",
    "house.lines_of_docstrings": "of these",
    "house.lines_of_comments": "of these, comments alone",
    "house.lines_blank": "of these",
    "house.lines_of_later_parts": "of these, in dress, read/catalogue, generate, board and study",
    "house.comments_per_100": "lines with a comment, pragmas apart, per 100 lines",
    "house.max_folder_files": "files of the fullest folder, one level, __init__ apart",
    "house.function_p90": "lines, 90th percentile of all functions, docstrings included",
    "house.function_max": "lines of the longest function",
    "house.file_max": "lines of the longest file",
    "house.import_cycles": "groups of modules that import one another, type checking apart",
    "house.coverage": "% of statements run by the tests, subprocesses counted",
}


def main() -> None:
    """Measure and write out/bench/house.json."""
    figures = static_figures()
    figures["house.coverage"] = coverage_percent()
    write_report("house", figures, UNITS)


def static_figures() -> dict[str, Any]:
    """What the source says by itself."""
    texts = {path: path.read_text(encoding="utf-8") for path in sources()}
    n_lines = sum(len(text.splitlines()) for text in texts.values())
    n_comments = sum(commented_lines(text) for text in texts.values())
    lengths = [n for text in texts.values() for n in function_lengths(text)]
    kinds = sum((line_kinds(text) for text in texts.values()), Counter[str]())
    later = [t for path, t in texts.items() if any(d in path.parents for d in LATER_PARTS)]
    return {
        "house.lines": n_lines,
        **{f"house.{name}": kinds[name] for name in LINE_KINDS},
        "house.lines_of_later_parts": sum(len(t.splitlines()) for t in later),
        "house.comments_per_100": round(100 * n_comments / n_lines, 2),
        "house.max_folder_files": max(folder_files().values()),
        "house.function_p90": int(np.percentile(lengths, 90)),
        "house.function_max": max(lengths),
        "house.file_max": max(len(text.splitlines()) for text in texts.values()),
        "house.import_cycles": import_cycles(),
    }


def sources() -> Iterator[Path]:
    """Every Python file of the packages."""
    for package in PACKAGES:
        yield from sorted(Path(package).rglob("*.py"))


def commented_lines(text: str) -> int:
    """Lines that carry a comment which says something to a reader."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    comments = (t for t in tokens if t.type == tokenize.COMMENT)
    return len({t.start[0] for t in comments if not t.string.lstrip("# ").startswith(PRAGMAS)})


def line_kinds(text: str) -> Counter[str]:
    """How many lines of each of LINE_KINDS a module has; every line counts once."""
    # Mark the lines of imports and docstrings, then tell the others by how they begin.
    kind: dict[int, str] = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            kind |= dict.fromkeys(_lines(node), "lines_of_imports")
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            kind |= dict.fromkeys(_lines(node), "lines_of_docstrings")
    found = Counter[str]()
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            found["lines_blank"] += 1
        elif line.lstrip().startswith("#"):
            found["lines_of_comments"] += 1
        else:
            found[kind.get(number, "lines_of_statements")] += 1
    return found


def _lines(node: ast.stmt) -> range:
    return range(node.lineno, (node.end_lineno or node.lineno) + 1)


def function_lengths(text: str) -> Iterator[int]:
    """Lines of each function and method, from `def` to its last line."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield (node.end_lineno or node.lineno) - node.lineno + 1


def folder_files() -> Counter[Path]:
    """Files per folder of the packages, caches and __init__.py apart."""
    found: Counter[Path] = Counter()
    for package in PACKAGES:
        for path in Path(package).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts and path.name != "__init__.py":
                found[path.parent] += 1
    return found


def import_cycles() -> int:
    """Strongly connected groups of more than one module."""
    import grimp
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True, cache_dir=None)
    number = {name: k for k, name in enumerate(sorted(graph.modules))}
    pairs = [
        (number[a], number[b]) for a in number for b in graph.find_modules_directly_imported_by(a)
    ]
    rows, columns = np.array(pairs).T
    matrix = coo_array((np.ones(len(pairs)), (rows, columns)), shape=(len(number),) * 2)
    _, label = connected_components(matrix, directed=True, connection="strong")
    return int((np.bincount(label) > 1).sum())


def coverage_percent() -> float:
    """Statements run by the tests, those that kill processes included. Raises if a test fails."""
    folder = Path("out/bench/coverage").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob(".coverage*"):
        old.unlink()
    # What .ci/run runs: all but the study on two processes, then the study alone. Loaders of torch
    # end their workers by a signal and take a handler of coverage's for a crash.
    counted = "sigterm = true\nconcurrency = multiprocessing,thread\n"
    others = _settings(folder / "others.rc", counted)
    study = _settings(folder / "study.rc", "concurrency = thread\n")
    coverage = [sys.executable, "-m", "coverage"]
    env = os.environ | {"COVERAGE_FILE": f"{folder}/.coverage"}
    for rc, words in ((others, ["-n", "2", "-m", f"{MARKERS} and not study"]),
                      (study, ["-m", f"{MARKERS} and study"])):  # fmt: skip
        tests = ["-m", "pytest", *words]
        subprocess.run([*coverage, "run", f"--rcfile={rc}", *tests], check=True, env=env)
    options = [f"--rcfile={others}"]
    subprocess.run([*coverage, "combine", "-q", *options], check=True, env=env)
    report = folder / "coverage.json"
    subprocess.run([*coverage, "json", "-q", *options, "-o", str(report)], check=True, env=env)
    totals = json.loads(report.read_text())["totals"]
    return round(float(totals["percent_covered"]), 2)


def _settings(path: Path, counted: str) -> Path:
    path.write_text(
        f"[run]\nparallel = true\npatch = subprocess\n{counted}source = {','.join(PACKAGES)}\n"
        f"data_file = {path.parent}/.coverage\n"
        "[report]\nexclude_also =\n    if TYPE_CHECKING:\n    @overload\n    \\.\\.\\.$\n"
    )
    return path


if __name__ == "__main__":
    if "--quick" in sys.argv:
        for name, value in static_figures().items():
            print(f"{name:<26}{value}")
    else:
        main()
