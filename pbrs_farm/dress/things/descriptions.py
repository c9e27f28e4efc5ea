"""Things described in TOML: what an entry may say, read, checked and made; no effects but reading.

A file holds one table a thing. Its `make` lists steps, carried out in the order they are written,
and so is every random number drawn:

    "r, tall = uniform(0.03, 0.04), uniform(0.09, 0.14)"      names for values; also "y += tall"
    { turned = "[(0, 0), (r, 0), (r, tall), (0, tall)]", of = "glass()", at = "0, 0.01, 0" }

A step that is a table has one solid (its arguments, as of a function), or `do` with further steps.
`of` is its material, or that of all steps in it; `turn` is a rotation and `at` a place to move to;
`named` the surface's name. `for` (names) and `in`, `while`, or `when` (and `else`, steps) before
them repeat or choose. An entry without a group is a part that others use like a solid: `takes`
names its arguments. `variants` (how many) and `size` (width, depth, height, an expression) make it a
family of the generated catalogue, its steps then know `size`; `set` names an entry whose values are
drawn first, the same for all families of a set that have one number. docs/dress.md lists the words that expressions know; they are Python's
arithmetic, comparisons, `a if b else c`, tuples, lists and calls, and nothing else.
"""

from __future__ import annotations

import ast
import inspect
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import CodeType
from typing import Any, Final

import numpy as np

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Material, Surface, Texture
from pbrs_farm.core.shown_text import did_you_mean
from pbrs_farm.dress.style import Style, style_for
from pbrs_farm.dress.things.assembly import Made, hung, made, transformed

Scope = dict[str, Any]
Loose = list[tuple[Surface, Material | None]]  # parts; None: of the step that puts them there
Step = Callable[[Scope, Loose], None]
Words = Callable[[np.random.Generator, Style], Scope]

_ALLOWED: Final = (
    ast.Constant, ast.Name, ast.Load, ast.Tuple, ast.List, ast.BinOp, ast.UnaryOp, ast.BoolOp,
    ast.Compare, ast.IfExp, ast.Call, ast.keyword, ast.Subscript, ast.operator, ast.unaryop,
    ast.boolop, ast.cmpop,
)  # fmt: skip
_HEADER: Final = (
    "about", "group", "class", "place", "family", "takes", "make", "variants", "size", "set",
)  # fmt: skip
_STEP: Final = ("for", "in", "while", "when", "else", "do", "of", "turn", "at", "named")
_LET: Final = re.compile(r"\s*(\w+(?:\s*,\s*\w+)*)\s*(\+?)=(?!=)(.*)", re.DOTALL)
_OWN: Final = ("__builtins__", "family")
_WRONG: Final = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)


@dataclass(frozen=True, slots=True)
class Description:
    """One thing of a file, or a part that its things use."""

    file: str
    name: str
    steps: tuple[Step, ...]
    takes: tuple[str, ...] = ()
    family: str = ""
    group: str = ""  # "" for a part
    nyu40: int = 0
    place: Place = Place.SURFACE
    variants: int = 0  # of the generated catalogue
    size: Callable[[Scope], Any] | None = None  # width, depth, height of one of them
    set_name: str = ""


class Things:
    """The things of some files, read when the first of them is wanted."""

    def __init__(
        self, files: Sequence[Path], words: Words, constants: Mapping[str, object]
    ) -> None:
        self._files, self._words, self._constants = files, words, constants
        self._entries: dict[str, Description] = {}

    @property
    def entries(self) -> Mapping[str, Description]:
        """Everything that the files describe, by name; BadInput names the file and the entry."""
        if not self._entries:
            tables = [(path.name, _read(path)) for path in self._files]
            rng = np.random.default_rng(0)
            known = {**self._constants, **self._words(rng, style_for(rng))}
            for file, table in tables:
                for name, entry in table.items():
                    if isinstance(entry, dict) and "group" not in entry:
                        if name in known:
                            raise BadInput(file, name, "is the name of a word already")
                        known[name] = _signature(entry.get("takes", ()))
            tables_by_name = {name: entry for _f, table in tables for name, entry in table.items()}
            found = {
                name: _DescriptionReader(file, name, known).entry(entry, tables_by_name)
                for file, table in tables
                for name, entry in table.items()
            }
            self._entries = found
        return self._entries

    @property
    def names(self) -> tuple[str, ...]:
        """Those that are things of themselves: a style and a generator make them."""
        return tuple(
            e.name for e in self.entries.values() if e.group and not e.takes and not e.variants
        )

    def size(
        self, name: str, rng: np.random.Generator, style: Style, known: Mapping[str, object]
    ) -> tuple[float, float, float]:
        """Width, depth and height of a variation, metres, without making it; known: as of make."""
        entry = self.entries[name]
        if entry.size is None:
            raise BadInput(entry.file, name, "has no size")
        scope = {"__builtins__": {}, **self._constants, **self._words(rng, style), **known}
        width, depth, height = (round(float(v), 4) for v in entry.size(scope))
        return width, depth, height

    def values(self, name: str, rng: np.random.Generator, style: Style) -> Scope:
        """What the steps of an entry without solids name: the common taste of a set."""
        entry = self.entries[name]
        base = {**self._constants, **self._words(rng, style)}
        scope = _scope(entry, base, ())
        for step in entry.steps:
            step(scope, Loose())
        return {key: v for key, v in scope.items() if key not in base and key not in _OWN}

    def make(
        self, name: str, rng: np.random.Generator, style: Style, *given: object,
        textures: Iterable[Texture] = (), known: Mapping[str, object] | None = None,
    ) -> Made:  # fmt: skip
        """The thing of that name in a style; given: what its entry takes, in that order.

        known: further values by name, those of its set.
        """
        entry = self.entries[name]
        base = {**self._constants, **self._words(rng, style)}
        base.update(
            (part.name, partial(_call, part, base))
            for part in self.entries.values()
            if not part.group
        )
        scope, loose = {**_scope(entry, base, given), **(known or {})}, Loose()
        for step in entry.steps:
            step(scope, loose)
        parts = [(surface, material) for surface, material in loose if material is not None]
        if not parts or len(parts) != len(loose):
            raise BadInput(entry.file, name, "has nothing in it, or a part without a material")
        family, group, nyu40 = scope["family"], entry.group, entry.nyu40
        if entry.place in (Place.WALL, Place.CEILING):
            return hung(family, group, nyu40, parts, tuple(textures), entry.place)
        return made(family, parts, group=group, nyu40=nyu40, place=entry.place, textures=textures)


def _scope(entry: Description, base: Scope, given: Sequence[object]) -> Scope:
    return {
        "__builtins__": {}, **base, "family": entry.family,
        **dict(zip(entry.takes, given, strict=True)),
    }  # fmt: skip


def _call(entry: Description, base: Scope, *given: object) -> Loose:
    # A part: its steps see their arguments and the words, not the names of the thing that uses it.
    loose, scope = Loose(), _scope(entry, base, given)
    for step in entry.steps:
        step(scope, loose)
    return loose


def _signature(takes: Sequence[str]) -> inspect.Signature:
    kind = inspect.Parameter.POSITIONAL_ONLY
    return inspect.Signature([inspect.Parameter(name, kind) for name in takes])


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BadInput(path.name, "", str(error)) from error


class _DescriptionReader:
    """Reads one entry: every expression is checked and compiled once."""

    def __init__(self, file: str, name: str, known: Mapping[str, object]) -> None:
        self._file, self._name, self._known = file, name, known
        self._names = {*known, "family"}

    def entry(self, table: object, tables: Mapping[str, object]) -> Description:
        """The entry of that table; tables: all of them, for the set that it may name."""
        if not isinstance(table, dict):
            raise self._bad("is no table")
        self._only(table, _HEADER)
        text = {key: table.get(key, "") for key in ("about", "group", "class", "place", "family")}
        text |= {key: table.get(key, "") for key in ("size", "set")}
        for key, value in text.items():
            if not isinstance(value, str):
                raise self._bad(f"{key} is no text")
        variants = table.get("variants", 0)
        if not isinstance(variants, int) or (variants > 0) != bool(text["size"]):
            raise self._bad("a family says how many variants it has, and their size")
        self._names |= self._named_by(text["set"], tables)
        size = self._expression(text["size"]) if variants else None
        takes, steps = table.get("takes", []), table.get("make")
        if not isinstance(takes, list) or not all(str(name).isidentifier() for name in takes):
            raise self._bad("takes is no list of names")
        label, place = text["class"] or "otherprop", text["place"] or "surface"
        if label not in NYU40_NAMES:
            raise self._bad(f"class {label!r} is none of NYU40", did_you_mean(label, NYU40_NAMES))
        if place not in list(Place):
            raise self._bad(f"place {place!r} is none", did_you_mean(place, list(Place)))
        if variants:
            takes = ["size", *takes]
        self._names |= set(takes)
        return Description(
            self._file, self._name, self._steps(steps), tuple(takes),
            text["family"] or self._name, text["group"], NYU40_NAMES.index(label), Place(place),
            variants, size, text["set"],
        )  # fmt: skip

    def _named_by(self, name: str, tables: Mapping[str, object]) -> set[str]:
        """The names of the values that a set's entry draws."""
        if not name:
            return set()
        told = tables.get(name)
        steps = told.get("make", []) if isinstance(told, dict) else None
        if not isinstance(steps, list):
            raise self._bad(f"{name} is no set")
        found = (_LET.fullmatch(step) for step in steps if isinstance(step, str))
        return {n.strip() for let in found if let for n in let[1].split(",")}

    def _steps(self, steps: object) -> tuple[Step, ...]:
        if not isinstance(steps, list):
            raise self._bad("has no list of steps where one belongs (make, do, else)")
        return tuple(self._let(s) if isinstance(s, str) else self._table(s) for s in steps)

    def _let(self, text: str) -> Step:
        """A step that names values."""
        found = _LET.fullmatch(text)
        if not found:
            raise self._bad(f"{text!r} is no step: it names no value")
        names = tuple(n.strip() for n in found[1].split(","))
        value = self._expression(found[3])
        if found[2]:
            value = self._expression(f"{self._known_name(found[1])} + ({found[3]})")
        if taken := [n for n in names if n in self._known]:
            raise self._bad(f"{text!r}: {taken[0]} is a word of its own")
        self._names |= set(names)

        def let(scope: Scope, _loose: Loose) -> None:
            if len(names) == 1:
                scope[names[0]] = value(scope)
            else:
                scope.update(self._zipped(names, value(scope), text))

        return let

    def _table(self, table: object) -> Step:
        """A step that puts solids there, in a loop or where something holds."""
        if not isinstance(table, dict):
            raise self._bad(f"{table!r} is no step")
        names = tuple(n.strip() for n in str(table.get("for", "")).split(","))
        within = self._expression(table["in"]) if "for" in table and "in" in table else None
        if within:
            self._names |= set(names)
        repeat, when = (
            self._expression(table[k]) if k in table else None for k in ("while", "when")
        )
        body = self._body({k: v for k, v in table.items() if k not in _STEP[:5]})
        other = self._steps(table.get("else", []))

        def once(scope: Scope, loose: Loose) -> None:
            if when is None or when(scope):
                body(scope, loose)
            else:
                for step in other:
                    step(scope, loose)

        def loop(scope: Scope, loose: Loose) -> None:
            for value in within(scope) if within else ():
                scope.update(self._zipped(names, value) if len(names) > 1 else {names[0]: value})
                once(scope, loose)
            while repeat and repeat(scope):
                once(scope, loose)

        return loop if within or repeat else once

    def _body(self, table: Mapping[str, Any]) -> Step:
        """The solid or the steps of a table, and what becomes of them."""
        solids = [key for key in table if key not in _STEP]
        if len(solids) + ("do" in table) != 1:
            raise self._bad(f"a step has one solid or `do`, this one {', '.join(table) or 'none'}")
        inner = self._steps(table["do"]) if "do" in table else ()
        # Evaluate in the order of the file.
        values = {
            key: self._expression(f"{self._known_name(key)}({v})" if key in solids else v)
            for key, v in table.items()
            if key not in ("do", "named")
        }
        solid, named = (solids or [""])[0], str(table.get("named", ""))

        def body(scope: Scope, loose: Loose) -> None:
            said = {key: value(scope) for key, value in values.items()}
            parts = self._parts(said[solid], solid) if solid else Loose()
            for step in inner:
                step(scope, parts)
            material, turn, at = said.get("of"), said.get("turn"), said.get("at", (0, 0, 0))
            if not isinstance(material, Material | None):
                raise self._bad(f"of = {table['of']!r} is no material")
            moved = "turn" in said or "at" in said
            for surface, own in parts:
                if moved:
                    surface = self._moved(surface, np.eye(3) if turn is None else turn, at)
                if named:
                    surface = replace(surface, name=named)
                loose.append((surface, material if own is None else own))

        return body

    def _parts(self, value: Any, solid: str) -> Loose:
        parts: Loose = [(value, None)] if isinstance(value, Surface) else value
        if not isinstance(parts, list) or not all(isinstance(p[0], Surface) for p in parts):
            raise self._bad(f"{solid} gives no solid")
        return parts

    def _moved(self, surface: Surface, turn: Any, at: Any) -> Surface:
        try:
            return transformed(surface, turn, at)
        except _WRONG as error:
            raise self._bad(f"turn or at: {error}") from error

    def _zipped(self, names: Sequence[str], values: Any, text: str = "for") -> Scope:
        try:
            return dict(zip(names, values, strict=True))
        except _WRONG as error:
            raise self._bad(f"{text!r}: {error}") from error

    def _expression(self, text: object) -> Callable[[Scope], Any]:
        """The expression checked and compiled; what goes wrong with it later names it."""
        code = self._compiled(str(text))

        def value(scope: Scope) -> Any:
            try:
                return eval(code, scope)
            except _WRONG as error:
                raise self._bad(f"{text!r}: {error}") from error

        return value

    def _compiled(self, text: str) -> CodeType:
        try:
            tree = ast.parse(f"({text})", self._file, "eval")
        except (SyntaxError, ValueError) as error:
            raise self._bad(f"{text!r} is no expression: {error.args[0]}") from error
        for node in ast.walk(tree.body):
            if not isinstance(node, _ALLOWED):
                raise self._bad(f"{text!r}: {type(node).__name__} is not part of the language")
            if isinstance(node, ast.Name):
                self._known_name(node.id)
            if isinstance(node, ast.Call):
                self._check_call(node, text)
        return compile(tree, self._file, "eval")

    def _check_call(self, call: ast.Call, text: str) -> None:
        """Whether what is called takes so many arguments, of those names."""
        if not isinstance(call.func, ast.Name) or call.func.id not in self._known:
            raise self._bad(f"{text!r} calls what is no word of the language")
        called: Any = self._known[call.func.id]
        try:
            told = called if isinstance(called, inspect.Signature) else inspect.signature(called)
            told.bind(*call.args, **{k.arg or "": k.value for k in call.keywords})
        except ValueError:  # some of Python's own do not tell
            return
        except TypeError as error:
            raise self._bad(f"{text!r}: {call.func.id}: {error}") from error

    def _known_name(self, name: str) -> str:
        if name not in self._names:
            raise self._bad(f"{name} is not known", did_you_mean(name, self._names))
        return name

    def _only(self, table: Mapping[str, Any], keys: Iterable[str]) -> None:
        for key in table:
            if key not in keys:
                raise self._bad(f"{key} is not known", did_you_mean(key, tuple(keys)))

    def _bad(self, message: str, hint: str = "") -> BadInput:
        return BadInput(self._file, self._name, message, hint=hint)
