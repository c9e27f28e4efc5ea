"""Rules of the form "this field equals that field, within a tolerance": the rows of rules.csv.

Effects: reads the table. A check binds names to the objects that it compares and calls `judge` with a scope.

A field is a path (`row.box.centre`) into one of these objects: keys of JSON objects, numbers of list entries or
attributes. A key that ends in `?` may be missing and is None then. Several paths with spaces between are a tuple;
a number or `true` is a value.
"""

from __future__ import annotations

import functools
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from pbrs_farm.check.certificate import Tally
from pbrs_farm.core.record import Record, read_csv


class Rule(Record):
    """A field that must equal another."""

    scope: str  # the rules that a check judges together
    check: str  # as the certificate calls it
    field: str
    equals: str
    within: float = 0.0  # absolute tolerance; 0 = equal, of any type
    share: float = 0.0  # tolerance relative to `equals`, added to `within`
    fault: str  # may hold {field}, {equals}, {off} and the bound names, as for str.format

    @property
    def is_exact(self) -> bool:
        """Compared by ==, not as numbers."""
        return self.within == self.share == 0


@functools.cache
def rules_by_scope() -> dict[str, tuple[Rule, ...]]:
    """The rows of rules.csv, in their order."""
    rows = defaultdict(list)
    for rule in read_csv(Path(__file__).with_name("rules.csv"), Rule):
        rows[rule.scope].append(rule)
    return {scope: tuple(rules) for scope, rules in rows.items()}


def judge(scope: str, place: str, tally: Tally, **names: Any) -> None:
    """Expect every rule of a scope to hold, each as one fact of its check.

    names: the objects that paths begin with. Raises KeyError for a missing field without `?`.
    """
    for rule in rules_by_scope()[scope]:
        field, equals = _value(rule.field, names), _value(rule.equals, names)
        if rule.is_exact:
            off, holds = 0.0, bool(field == equals)
        else:
            off = _difference(field, equals)
            size = float(np.abs(equals).max()) if rule.share and equals is not None else 0.0
            holds = off <= rule.within + rule.share * size
        fault = "" if holds else rule.fault.format(field=field, equals=equals, off=off, **names)
        tally.expect(rule.check, place, holds, fault)


def _difference(a: Any, b: Any) -> float:
    """The largest difference of two numbers or arrays; inf if their shapes differ or one is missing."""
    if a is None or b is None:
        return 0.0 if a is b else np.inf
    first, second = np.array(a, np.float64), np.array(b, np.float64)
    return float(np.abs(first - second).max()) if first.shape == second.shape else np.inf


def _value(paths: str, names: dict[str, Any]) -> Any:
    values = tuple(_value_at(path, names) for path in paths.split())
    return values[0] if len(values) == 1 else values


def _value_at(path: str, names: dict[str, Any]) -> Any:
    if path == "true" or path[0].isdigit():
        return True if path == "true" else float(path)
    first, *keys = path.split(".")
    value = names[first.rstrip("?")]
    for key in keys:
        name = key.rstrip("?")
        if value is None:
            return None
        if isinstance(value, list | tuple):
            value = value[int(name)]
        elif not isinstance(value, dict):
            value = getattr(value, name)
        else:
            value = value.get(name) if key.endswith("?") else value[name]
    return value
