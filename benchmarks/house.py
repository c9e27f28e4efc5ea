"""The state of the code itself: size, names, imports, cycles, docstrings, and the time and coverage of the tests.

Effects: runs `make test`, then the tests of `make test-all` under coverage, and writes out/bench/house.json.
`python -m benchmarks.house --quick [FOLDER...]` runs no tests, writes nothing and lists the places that count against
a figure, of these folders alone if any are named.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import os
import re
import subprocess
import sys
import time
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import write_report

PACKAGES = ("pbrs_farm", "workers")
CODE = (".py", ".toml", ".lua", ".js", ".glsl")
VENDORED = "pbrs_farm/board/vendor"  # code of others
KINDS = (
    "format",
    "form",
    "pass",
    "layer",
    "thing",
    "option",
    "camera-source",
    "repair-step",
    "recipe-group",
    "check",
)
"""What comes in kinds, as tests name it: @pytest.mark.kinds("format") adds one in a file."""
NO_CODE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENCODING, tokenize.ENDMARKER,
}  # fmt: skip
"""Tokens that house.tokens leaves out."""
LONG_LINES = 80  # maximum length of a function, lines
SHARED_BY = 3  # files that define a function of one name, and it counts as shared
LINE_KINDS = (
    "lines_of_statements",
    "lines_of_imports",
    "lines_of_docstrings",
    "lines_of_comments",
    "lines_blank",
)
UNITS = {
    "house.code_lines": "lines of .py, .toml, .lua, .js and .glsl of pbrs_farm and workers, those of others apart",
    "house.shared_names": "share of module functions whose name three or more files define",
    "house.glued": "headings of chapters inside files: comments that stand alone between blank lines, below the first ten lines",
    "house.kinds": "1: each of KINDS is added in one file, a recipe group and a check of verify in two (tests marked kinds)",
    "house.docstrings": "share of public functions and methods whose docstring has more than one line",
    "house.lines": "lines of .py of pbrs_farm and workers",
    "house.lines_of_statements": "of these, neither blank, comment, docstring nor import",
    "house.lines_of_imports": "of these",
    "house.lines_of_docstrings": "of these",
    "house.lines_of_comments": "of these, comments alone",
    "house.lines_blank": "of these",
    "house.tokens": "tokens of tokenize in .py of pbrs_farm and workers; comments, newlines and indents left out, a docstring is one",
    "house.tokens_a_line": "these per line of statements and imports, so without blank lines, comments and docstrings",
    "house.long_functions": f"functions of more than {LONG_LINES} lines, from def to the last line",
    "house.files": "files of .py of pbrs_farm and workers",
    "house.imports_per_100": "lines of imports per 100 lines",
    "house.single_importer": "modules whose one importer stands in their own folder",
    "house.twice_named": "names that two or more classes have",
    "house.untyped": "functions with a parameter or result that has no annotation",
    "house.cycles": "groups of modules that import one another, type checking apart",
    "house.coverage": "% of statements run by `make test` and `make test-all`, subprocesses counted",
    "tests.minutes": "minutes of `make test` after `make setup`, on this machine",
    "tests.coverage": "% of statements run by `make test`, subprocesses counted",
}

# Module -> the modules that it imports.
Imports = Mapping[str, set[str]]


def main() -> None:
    """Measure and write out/bench/house.json."""
    figures = static_figures()
    figures["house.kinds"] = int(kinds_added() == {*KINDS})
    figures["tests.minutes"] = minutes_of_tests()
    figures["tests.coverage"], figures["house.coverage"] = coverage_percents()
    write_report("house", figures, UNITS)


def static_figures() -> dict[str, Any]:
    """Figures that follow from the source alone."""
    texts = {path: path.read_text(encoding="utf-8") for path in sources()}
    trees = [ast.parse(text) for text in texts.values()]
    kinds = sum((line_kinds(text) for text in texts.values()), Counter[str]())
    imports = imports_of_modules()
    n_tokens = sum(map(count_tokens, texts.values()))
    n_code_lines = kinds["lines_of_statements"] + kinds["lines_of_imports"]
    n_functions = sum(len(names) for names in functions_by_file(trees))
    shared = shared_names(dict(zip(texts, trees, strict=True)))
    documented = [is_long for tree in trees for _name, is_long in docstrings(tree)]
    return {
        "house.code_lines": code_lines(),
        "house.shared_names": round(sum(map(len, shared.values())) / n_functions, 4),
        "house.glued": sum(len(headings(text)) for text in texts.values()),
        "house.docstrings": round(sum(documented) / len(documented), 4),
        "house.lines": kinds.total(),
        **{f"house.{name}": kinds[name] for name in LINE_KINDS},
        "house.tokens": n_tokens,
        "house.tokens_a_line": round(n_tokens / n_code_lines, 2),
        "house.long_functions": sum(len(long_functions(tree)) for tree in trees),
        "house.files": len(texts),
        "house.imports_per_100": round(100 * kinds["lines_of_imports"] / kinds.total(), 2),
        "house.single_importer": len(single_importers(imports)),
        "house.twice_named": len(twice_named(trees)),
        "house.untyped": sum(untyped_functions(tree) for tree in trees),
        "house.cycles": import_cycles(imports),
    }


def sources() -> Iterator[Path]:
    """Every Python file of the packages."""
    for package in PACKAGES:
        yield from sorted(Path(package).rglob("*.py"))


def code_lines() -> int:
    """Lines of all code: TOML has rules, Lua the ledger, JavaScript and GLSL pictures."""
    files = [p for package in PACKAGES for p in Path(package).rglob("*") if p.suffix in CODE]
    ours = [p for p in files if not p.is_relative_to(VENDORED)]
    return sum(len(p.read_text(encoding="utf-8").splitlines()) for p in ours)


def functions_by_file(trees: Iterable[ast.Module]) -> list[list[str]]:
    """Of each module the names of its functions; methods and nested functions apart."""
    kind = ast.FunctionDef | ast.AsyncFunctionDef
    return [[node.name for node in tree.body if isinstance(node, kind)] for tree in trees]


def shared_names(trees: Mapping[Path, ast.Module]) -> dict[str, list[Path]]:
    """Name of a module function -> the files that define one, where these are SHARED_BY or more."""
    found = defaultdict(list)
    for path, names in zip(trees, functions_by_file(trees.values()), strict=True):
        for name in {*names}:
            found[name].append(path)
    return {name: files for name, files in found.items() if len(files) >= SHARED_BY}


def headings(text: str) -> list[tuple[int, str]]:
    """(line, text) of comments alone between blank lines, below a module's head."""
    lines = text.splitlines()
    comments = []
    for number, line in enumerate(lines):
        # The head of a file is no chapter: a licence, constants and their reasons.
        if number <= 10 or not line.startswith("# ") or lines[number - 1].strip():
            continue
        end = number
        while end < len(lines) and lines[end].startswith("#"):
            end += 1
        if end < len(lines) and not lines[end].strip():
            comments.append((number + 1, line))
    return comments


def docstrings(tree: ast.Module) -> Iterator[tuple[str, bool]]:
    """(name, whether its docstring has more than one line) of each public function and method."""
    kind = ast.FunctionDef | ast.AsyncFunctionDef
    classes = [n for n in tree.body if isinstance(n, ast.ClassDef) and not n.name.startswith("_")]
    for owner, nodes in (("", tree.body), *((f"{c.name}.", c.body) for c in classes)):
        for node in nodes:
            if isinstance(node, kind) and not node.name.startswith("_"):
                text = (ast.get_docstring(node) or "").strip()
                yield owner + node.name, "\n" in text


def kinds_added() -> set[str]:
    """The kinds of which a test marked so adds one and passes; fails loudly where such a test fails."""
    words = [sys.executable, "-c", _RUN_KINDS]
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
    return {*done.stdout.splitlines()[-1].split()}


# Runs the tests marked kinds; its last line names the kinds of those that passed.
_RUN_KINDS = """
import pytest
class Kinds:
    def __init__(self):
        self.of, self.passed = {}, set()
    def pytest_collection_modifyitems(self, items):
        self.of = {i.nodeid: m.args for i in items for m in i.iter_markers("kinds")}
    def pytest_runtest_logreport(self, report):
        if report.when == "call" and report.passed:
            self.passed |= {*self.of[report.nodeid]}
kinds = Kinds()
code = pytest.main(["-q", "-m", "kinds", "tests"], plugins=[kinds])
print(*kinds.passed)
raise SystemExit(0 if code in (0, 5) else code)
"""


def line_kinds(text: str) -> Counter[str]:
    """Number of lines of each of LINE_KINDS in a module; every line counts once."""
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


def count_tokens(text: str) -> int:
    """Number of tokens in a module, without those of NO_CODE."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return sum(token.type not in NO_CODE for token in tokens)


def long_functions(tree: ast.Module) -> list[tuple[str, int]]:
    """(name, line) of the functions and methods of more than LONG_LINES lines."""
    kind = ast.FunctionDef | ast.AsyncFunctionDef
    functions = [node for node in ast.walk(tree) if isinstance(node, kind)]
    return [(node.name, node.lineno) for node in functions if len(_lines(node)) > LONG_LINES]


def _lines(node: ast.stmt) -> range:
    return range(node.lineno, (node.end_lineno or node.lineno) + 1)


def imports_of_modules() -> Imports:
    """The packages' modules, each with those it imports; imports for type checking apart."""
    import grimp

    graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True, cache_dir=None)
    return {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}


def single_importers(imports: Imports) -> list[str]:
    """Modules with a single importer, in the same folder."""
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


def minutes_of_tests() -> float:
    """Wall minutes of `make test`. Raises if it fails."""
    started = time.monotonic()
    subprocess.run(["make", "test"], check=True)
    return round((time.monotonic() - started) / 60, 2)


def coverage_percents() -> tuple[float, float]:
    """% of statements run by `make test`, and by it and `make test-all`. Raises if a test fails.

    The tests of a browser and those that kill processes of a farm are left out.
    """
    folder = Path("out/bench/coverage").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*/.coverage*"):
        old.unlink()
    # Loaders of torch end their workers by a signal and take a handler of coverage's for a crash.
    others = "sigterm = true\nconcurrency = multiprocessing,thread\n"
    study = "concurrency = thread\n"
    quick, rest = markers("QUICK"), markers("REST")
    _run_tests(folder / "quick", others, "-n", "2", "-m", quick)
    _run_tests(folder / "rest", others, "-n", "2", "-m", f"{rest} and not study")
    _run_tests(folder / "study", study, "-m", f"{rest} and study")
    return _covered(folder / "quick"), _covered(folder / "quick", folder / "rest", folder / "study")


def markers(name: str) -> str:
    """The expression for pytest's -m that the Makefile has under a name."""
    text = Path("Makefile").read_text(encoding="utf-8")
    apart, value = (
        re.findall(rf"^{word} := (.*)$", text, re.MULTILINE)[0] for word in ("APART", name)
    )
    return str(value.replace("$(APART)", apart))


def _run_tests(folder: Path, counted: str, *words: str) -> None:
    folder.mkdir(exist_ok=True)
    rc = folder / "coverage.rc"
    rc.write_text(
        f"[run]\nparallel = true\npatch = subprocess\n{counted}source = {','.join(PACKAGES)}\n"
        f"data_file = {folder}/.coverage\n"
        "[report]\nexclude_also =\n    if TYPE_CHECKING:\n    @overload\n    \\.\\.\\.$\n"
    )
    env = os.environ | {"COVERAGE_FILE": f"{folder}/.coverage"}
    coverage = [sys.executable, "-m", "coverage", "run", f"--rcfile={rc}"]
    subprocess.run([*coverage, "-m", "pytest", *words], check=True, env=env)


def _covered(*folders: Path) -> float:
    # The data files stay, since another call combines them too.
    rc, total = f"--rcfile={folders[0]}/coverage.rc", f"{folders[0].parent}/.coverage.total"
    env = os.environ | {"COVERAGE_FILE": total}
    coverage = [sys.executable, "-m", "coverage"]
    combine = [*coverage, "combine", "-q", "--keep", rc, f"--data-file={total}"]
    # Of a folder, coverage takes only files named after the data file.
    data_files = [str(path) for folder in folders for path in sorted(folder.glob(".coverage*"))]
    subprocess.run([*combine, *data_files], check=True, env=env)
    report = folders[0].parent / "coverage.json"
    json_words = ["json", "-q", rc, f"--data-file={total}", "-o", str(report)]
    subprocess.run([*coverage, *json_words], check=True, env=env)
    return round(float(json.loads(report.read_text())["totals"]["percent_covered"]), 2)


def offenders(folders: list[str]) -> Iterator[str]:
    """The places behind the figures, a line each: headings, shared names, short docstrings by file, crumbs."""
    texts = {path: path.read_text(encoding="utf-8") for path in sources()}
    trees = {path: ast.parse(text) for path, text in texts.items()}

    def is_asked(path: Path) -> bool:
        return not folders or any(path.is_relative_to(folder) for folder in folders)

    for path, text in texts.items():
        for number, line in headings(text) if is_asked(path) else ():
            yield f"heading {path}:{number} {line}"
    for path, tree in trees.items():
        for function, number in long_functions(tree) if is_asked(path) else ():
            yield f"long function {path}:{number} {function}"
    for name, files in sorted(shared_names(trees).items(), key=lambda pair: -len(pair[1])):
        if any(map(is_asked, files)):
            yield f"shared {name} {len(files)}: {' '.join(map(str, filter(is_asked, files)))}"
    for path, tree in trees.items():
        short = [name for name, is_long in docstrings(tree) if not is_long]
        if short and is_asked(path):
            yield f"one line {path}: {' '.join(short)}"
    yield from (f"single importer {name}" for name in single_importers(imports_of_modules()))
    yield from (f"twice named {name}" for name in twice_named([*trees.values()]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Measure the code itself.")
    parser.add_argument(
        "--quick", nargs="*", metavar="FOLDER",
        help="without the tests: list what the figures count, of these folders alone",
    )  # fmt: skip
    asked = parser.parse_args().quick
    if asked is None:
        main()
    else:
        for line in offenders(asked):
            print(line)
        for name, value in static_figures().items():
            print(f"{name:<26}{value}")
