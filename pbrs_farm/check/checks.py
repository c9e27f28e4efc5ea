"""The table of checks: each module `*_checks.py` of this package, imported at first use, ends with its `CHECKS`."""

from __future__ import annotations

import functools
import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Subject = Literal["root", "files", "house", "camera", "view", "views", "set", "form"]
"""What a check looks at: a root, the files of a house, its documents, a view's camera, a view, all views of a house; a set, a part's form."""


@dataclass(frozen=True, slots=True)
class Check:
    """An entry of the table."""

    name: str
    of: Subject
    function: Callable[[Any], None]  # takes the case of its subject: see cases.py
    cost: int  # order among the checks of a subject: cheap ones run first
    needs: tuple[str, ...] = ()  # layers or files, one of which must be present; () = always runs
    files: Mapping[str, str] = field(default_factory=dict)
    """File of a view that only this check recomputes -> how, for the certificate's list."""

    def is_needed(self, case: Any) -> bool:
        """True if the case has anything to check."""
        return not self.needs or any(case.has(name) for name in self.needs)


def checks(of: Subject) -> tuple[Check, ...]:
    """The checks of a subject, cheap ones first."""
    return tuple(check for check in all_checks() if check.of == of)


def all_checks() -> tuple[Check, ...]:
    """Every entry of the table, cheap ones first."""
    package = importlib.import_module(__package__)
    names = sorted(
        m.name for m in pkgutil.iter_modules(package.__path__) if m.name.endswith("_checks")
    )
    return _entries(tuple(names))


@functools.cache
def _entries(names: tuple[str, ...]) -> tuple[Check, ...]:
    modules = [importlib.import_module(f"{__package__}.{name}") for name in names]
    return tuple(sorted((c for m in modules for c in m.CHECKS), key=lambda check: check.cost))
