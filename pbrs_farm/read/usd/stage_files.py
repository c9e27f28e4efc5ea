"""The layers of a stage and files beside them, inside one folder; opened in a process first, as USD may crash."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, Final

from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.operating_system import MEMORY_LIMIT, has_crashed
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder
from pbrs_farm.regular_files import MAX_SCENE_BYTES, real_path

LAYERS: Final = (".usd", ".usda", ".usdc", ".usdz")
MOST_PRIMS: Final = 500_000  # of a composed stage
_MOST_LAYERS: Final = 20_000
_MISSING_SHARE: Final = (
    1 / 3
)  # with more references missing, the stage names another machine's files
_SAID: Final = re.compile(r": '(.*?)'\s*$", re.DOTALL | re.MULTILINE)
_UNOPENED: Final = re.compile(r"In <([^>]*)>: Could not open asset @(.*?)@")
_PICTURE_BYTES: Final = 256 * 2**20
_HINT: Final = "`--models DIR` names a parent folder of all its files"


@dataclass(frozen=True, slots=True)
class StageFolder:
    """The folder below which a stage's files lie."""

    path: Path  # of the root layer
    root: RootFolder

    @classmethod
    def of(cls, path: Path, models: str) -> StageFolder:
        """The file's own folder, or the folder of --models if the file is inside it."""
        real = real_path(path)
        if models and real.is_relative_to(real_path(Path(models))):
            return cls(real, RootFolder(real_path(Path(models))))
        return cls(real, RootFolder(real.parent))

    def name_of(self, path: str) -> str | None:
        """Name below the root of a path resolved by the library; None if it is outside."""
        real = real_path(Path(path))
        root = real_path(self.root.root)
        return str(real.relative_to(root)) if real.is_relative_to(root) else None

    def picture(self, asset: Any) -> bytes | None:
        """The bytes of an asset resolved by the stage, also in a package; None if it does not exist."""
        resolved = str(asset.resolvedPath)
        package, is_inside, _ = resolved.partition("[")
        if not resolved or self.name_of(package) is None:
            return None
        if not is_inside:
            return self.root.read(self.name_of(resolved) or "", max_bytes=_PICTURE_BYTES)
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved))
        return bytes(opened.GetBuffer()) if opened and opened.GetSize() < _PICTURE_BYTES else None


def files_of_stage(folder: StageFolder) -> Iterator[tuple[str, bool]]:
    """(name below the root, whether it is a layer) of files that the stage may open; BadHouse if outside."""
    first = folder.name_of(str(folder.path))
    assert first is not None
    visited, todo = {first}, [first]
    while todo:
        name = todo.pop()
        yield name, True
        for asset in _with_tiles(folder.root.root / name):
            below_root = _name_below_root(folder, name, asset)
            if below_root is None or below_root in visited:
                continue
            visited.add(below_root)
            if len(visited) > _MOST_LAYERS:
                raise BadHouse(folder.path, "", f"names more than {_MOST_LAYERS} files")
            if Path(below_root).suffix.lower() in LAYERS:
                todo.append(below_root)
            else:
                yield below_root, False


def _named_in(path: Path) -> list[str]:
    try:
        return [name for kind in UsdUtils.ExtractExternalReferences(str(path)) for name in kind]
    except (RuntimeError, UnicodeDecodeError):  # a damaged layer, of which the stage will tell
        return []


def _with_tiles(layer: Path) -> Iterator[str]:
    """The names in a layer; a tiled picture (UDIM) is expanded to its existing tiles."""
    for asset in _named_in(layer):
        head, mark, tail = asset.partition("<UDIM>")
        if not mark or "://" in head:
            yield asset
            continue
        for number in range(_TILES[0], _TILES[1]):
            if (layer.parent / f"{head}{number}{tail}").exists():
                yield f"{head}{number}{tail}"


def _name_below_root(folder: StageFolder, layer: str, asset: str) -> str | None:
    """The name below the root that an asset of a layer means; None where it does not exist."""
    if "://" in asset or "[" in asset or "\0" in asset:
        return None
    # Paths without a leading dot may also be relative to the layer.
    path = (folder.root.root / layer).parent / asset
    try:
        if not path.exists():
            return None
        real = real_path(path)
    except OSError:
        return None
    name = folder.name_of(str(real))
    is_layer = real.suffix.lower() in LAYERS
    if name is None:
        if is_layer:
            text = f"{asset[:80]!r} leads out of the folder"
            raise BadHouse(folder.path, layer, text, hint=_HINT)
        return None
    if not real.is_file():
        if is_layer:
            raise BadHouse(folder.path, layer, f"{asset[:80]!r} is not a regular file")
        return None
    if is_layer and real.stat().st_size > MAX_SCENE_BYTES:
        text = f"{asset[:80]!r} is larger than {MAX_SCENE_BYTES / 1e6:.0f} MB"
        raise BadHouse(folder.path, layer, text)
    return name


WARNED: Final = "library-warning"
"""Kind of the notes about warnings of the library, one for each of its places."""


@contextmanager
def diagnostics_in(folder: StageFolder, notes: Notes) -> Iterator[Any]:
    """Collect the library's warnings, which it would print, as notes without the folder's path."""
    diagnostics = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield diagnostics
    finally:
        _note_warnings(diagnostics.TakeUncoalescedDiagnostics(), folder, notes)


def _note_warnings(rows: Iterable[Any], folder: StageFolder, notes: Notes) -> None:
    """A note for each place in the library that warned, with its first warning."""
    own_path = f"{real_path(folder.root.root)}/"
    texts: dict[tuple[str, int], dict[str, None]] = {}
    for row in rows:
        place = str(row.sourceFileName), int(row.sourceLineNumber)
        text = " ".join(str(row.commentary).split()).replace(own_path, "")
        texts.setdefault(place, {})[text] = None
    for first, *others in texts.values():
        times = f"{len(others) + 1} times: " if others else ""
        notes.add(WARNED, "", f"USD warns {times}{first}")


def opened_stage(folder: StageFolder, notes: Notes, diagnostics: Any) -> Any:
    """The composed stage; unresolved references become notes.

    diagnostics: of diagnostics_in. Raises BadHouse for a damaged file, too many prims, or if a third
    of the references is missing.
    """
    path = folder.path
    if path.stat().st_size > MAX_SCENE_BYTES:
        raise BadHouse(path, "", f"is larger than {MAX_SCENE_BYTES / 1e6:.0f} MB")
    try_out(folder)
    layers = [name for name, is_layer in files_of_stage(folder) if is_layer]
    try:
        n_references = _check_size(folder, layers)
        stage = Usd.Stage.Open(str(path))
    except FAULTS as error:
        raise damaged(path, error) from None
    for layer in stage.GetUsedLayers():
        real = layer.realPath.partition("[")[0]
        if real and folder.name_of(real) is None:
            raise BadHouse(path, "", f"{real!r} leads out of the folder", hint=_HINT)
    missing = _note_missing(diagnostics, folder, notes)
    if missing > _MISSING_SHARE * max(n_references, missing):
        text = f"{missing} of {max(n_references, missing)} references do not resolve"
        hint = "they refer to files of another machine: get them; " + _HINT
        raise BadHouse(path, "", text, hint=hint)
    return stage


# Damaged binary layers may keep the library for ever, or kill it: try them in a process that may die.
_TRIAL: Final = f"""
{MEMORY_LIMIT}
import sys
from pxr import Usd, UsdUtils
try:
    UsdUtils.ExtractExternalReferences(sys.argv[1])
    Usd.Stage.Open(sys.argv[1])
except Exception:
    pass  # the process that reads says so
"""
_TILES: Final = (1001, 1101)  # numbers of UDIM's tiles: ten a row, ten rows are looked for
_TRIAL_S: Final = 8.0
_BYTES_A_SECOND: Final = 10e6
_BINARY: Final = frozenset({".usd", ".usdc", ".usdz"})


def try_out(folder: StageFolder) -> None:
    """Raise BadHouse where opening the stage does not end, or kills the process that does it."""
    layers = [folder.path]
    if folder.path.suffix.lower() == ".usda":
        below = islice(folder.root.root.rglob("*"), _MOST_LAYERS)
        layers = [p for p in below if p.suffix.lower() in _BINARY and p.is_file()]
    if layers:
        facts = folder.path.stat()
        n_bytes = sum(p.stat().st_size for p in layers)
        fault = _fault_of(str(folder.path), facts.st_size, facts.st_mtime_ns, n_bytes)
        if fault:
            raise BadHouse(folder.path, "", fault, hint="copy or export it again")


@lru_cache(maxsize=64)
def _fault_of(path: str, _size: int, _changed: int, n_bytes: int) -> str:
    limit_s = _TRIAL_S + n_bytes / _BYTES_A_SECOND
    try:
        done = subprocess.run(
            [sys.executable, "-c", _TRIAL, path],
            timeout=limit_s,
            check=False,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired:
        return f"damaged: the library cannot open it within {limit_s:.0f} s"
    return "damaged: it crashes the library" if has_crashed(done.returncode) else ""


FAULTS: Final = (Tf.ErrorException, UnicodeDecodeError)
"""Errors of the library for damaged files; invalid UTF-8 raises a separate one."""


def damaged(path: Path, error: Exception) -> BadHouse:
    """The library's error message for a damaged file, in one line."""
    try:
        match = _SAID.search(str(error))
    except UnicodeDecodeError:
        match = None
    text = " ".join((match[1] if match else "is not a USD file").split())
    for path_text in {str(path), str(path.parent) + "/"}:
        text = text.replace(path_text, "")
    return BadHouse(path, "", f"damaged: {text.strip(': ')}")


def _note_missing(diagnostics: Any, folder: StageFolder, notes: Notes) -> int:
    """Number of references that the library could not open; a note each, and the other warnings'."""
    n, rest = 0, []
    for row in diagnostics.TakeUncoalescedDiagnostics():
        text = " ".join(str(row.commentary).split())
        match = _UNOPENED.search(text)
        n += match is not None
        if match is not None:
            notes.add("missing-model", match[1], f"{match[2]} does not exist; left out")
        elif "Cycle detected" in text:
            notes.add(
                "reference-cycle", text.partition(">")[0].removeprefix("In <"), "refers to itself"
            )
        else:
            rest.append(row)
    _note_warnings(rest, folder, notes)
    return n


def _check_size(folder: StageFolder, names: list[str]) -> int:
    """The number of references in the layers; BadHouse where they compose too many prims."""
    by_path: dict[str, Any] = {}
    for name in names:
        path = str(folder.root.root / name)
        layer = Sdf.Layer.FindOrOpen(path)
        if layer:
            by_path[path] = layer
    counted: dict[tuple[str, str], int] = {}
    n_references = 0

    def references(layer: Any, spec: Any) -> list[tuple[Any, str]]:
        targets = []
        for key in ("referenceList", "payloadList"):
            arcs = getattr(spec, key)
            for arc in (*arcs.explicitItems, *arcs.prependedItems, *arcs.appendedItems):
                owner = layer
                if arc.assetPath:
                    where = layer.ComputeAbsolutePath(arc.assetPath)
                    owner = by_path.get(where) or by_path.get(str(real_path(Path(where))))
                target = (
                    str(arc.primPath) if arc.primPath else f"/{getattr(owner, 'defaultPrim', '')}"
                )
                targets.append((owner, target))
        return targets

    def below(spec: Any) -> Iterator[Any]:
        yield from spec.nameChildren
        for variants in spec.variantSets.values():
            for variant in variants.variants.values():
                yield variant.primSpec

    # Count what each prim composes to, deepest first, without recursion.
    for layer in by_path.values():
        stack = [(layer, spec, False) for spec in layer.rootPrims]
        while stack:
            node, spec, is_done = stack.pop()
            key = (node.identifier, str(spec.path))
            if key in counted and not is_done:
                continue
            arcs = references(node, spec) if spec.hasReferences or spec.hasPayloads else []
            targets = [(o, s) for o, t in arcs if o is not None and (s := o.GetPrimAtPath(t))]
            if not is_done:
                n_references += len(arcs)
                counted[key] = 1  # also what a cycle sees
                stack.append((node, spec, True))
                stack += [(o, s, False) for o, s in targets]
                stack += [(node, child, False) for child in below(spec)]
                continue
            n = 1 + sum(counted.get((node.identifier, str(c.path)), 1) for c in below(spec))
            n += sum(counted.get((o.identifier, str(s.path)), 1) for o, s in targets)
            counted[key] = n
            if n > MOST_PRIMS:
                text = f"composes more than {MOST_PRIMS} prims"
                raise BadHouse(folder.path, key[1], text, hint="are references nested?")
    return n_references
