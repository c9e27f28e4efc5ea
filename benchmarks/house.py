"""The state of the code itself: size, imports, crumbs, names, import cycles, coverage.

Effects: runs the test suite under coverage (about six minutes) and writes out/bench/house.json.
`python -m benchmarks.house --quick` leaves the tests out, writes nothing and lists what it counted.
"""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import write_report

PACKAGES = ("pbrs_farm", "workers")
MARKERS = "not slow and not gpu and not chaos and not infra and not kube and not web and not sweethome3d and not notebooks"
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
    "house.files": "files of .py of pbrs_farm and workers",
    "house.imports_per_100": "lines of imports per 100 lines",
    "house.single_importer": "modules whose one importer stands in their own folder",
    "house.twice_named": "names that two or more classes have",
    "house.untyped": "functions with a parameter or result that has no annotation",
    "house.import_cycles": "groups of modules that import one another, type checking apart",
    "house.coverage": "% of statements run by the tests, subprocesses counted",
}

# Module -> the modules that it imports.
Imports = Mapping[str, set[str]]


def main() -> None:
    """Measure and write out/bench/house.json."""
    figures = static_figures()
    figures["house.coverage"] = coverage_percent()
    write_report("house", figures, UNITS)


def static_figures() -> dict[str, Any]:
    """What the source says by itself."""
    texts = {path: path.read_text(encoding="utf-8") for path in sources()}
    trees = [ast.parse(text) for text in texts.values()]
    kinds = sum((line_kinds(text) for text in texts.values()), Counter[str]())
    imports = imports_of_modules()
    return {
        "house.lines": kinds.total(),
        **{f"house.{name}": kinds[name] for name in LINE_KINDS},
        "house.files": len(texts),
        "house.imports_per_100": round(100 * kinds["lines_of_imports"] / kinds.total(), 2),
        "house.single_importer": len(single_importers(imports)),
        "house.twice_named": len(twice_named(trees)),
        "house.untyped": sum(untyped_functions(tree) for tree in trees),
        "house.import_cycles": import_cycles(imports),
    }


def sources() -> Iterator[Path]:
    """Every Python file of the packages."""
    for package in PACKAGES:
        yield from sorted(Path(package).rglob("*.py"))


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


def imports_of_modules() -> Imports:
    """The packages' modules, each with those it imports; imports for type checking apart."""
    import grimp

    graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True, cache_dir=None)
    return {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}


def single_importers(imports: Imports) -> list[str]:
    """Modules that one other imports, which stands in the same folder."""
    importers = defaultdict(set)
    for importer, modules in imports.items():
        for module in modules:
            importers[module].add(importer)
    return sorted(
        module
        for module, found in importers.items()
        if len(found) == 1 and next(iter(found)).rpartition(".")[0] == module.rpartition(".")[0]
    )


def twice_named(trees: list[ast.Module]) -> list[str]:
    """Names of classes that two or more modules define."""
    names = Counter(
        node.name for tree in trees for node in tree.body if isinstance(node, ast.ClassDef)
    )
    return sorted(name for name, n in names.items() if n > 1)


def untyped_functions(tree: ast.Module) -> int:
    """Functions with a parameter or a result without annotation; self, cls and lambdas apart."""
    found = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            named = [*given.posonlyargs, *given.args, *given.kwonlyargs]
            named += [a for a in (given.vararg, given.kwarg) if a is not None]
            bare = [a for a in named if a.annotation is None and a.arg not in ("self", "cls")]
            found += bool(bare) or node.returns is None
    return found


def import_cycles(imports: Imports) -> int:
    """Strongly connected groups of more than one module."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    number = {name: k for k, name in enumerate(sorted(imports))}
    pairs = [(number[a], number[b]) for a, modules in imports.items() for b in modules]
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
        print("single importers:", *single_importers(imports_of_modules()), sep="\n  ")
        classes = twice_named([ast.parse(p.read_text(encoding="utf-8")) for p in sources()])
        print("twice named:", *classes, sep="\n  ")
    else:
        main()
