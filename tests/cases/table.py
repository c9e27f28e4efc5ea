"""Every case, in one table for the tests beside and for `make bench NAME=cases`; no effects.

A module `*_cases.py` of this folder with a function `cases()` adds its cases.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Final

import tests.cases
from tests.cases.case import Case

_MODULES: Final = sorted(
    module.name for module in iter_modules(tests.cases.__path__) if module.name.endswith("_cases")
)
_EVERY: Final = [case for name in _MODULES if name != "test_cases" for case in import_module(f"tests.cases.{name}").cases()]  # fmt: skip
CASES: Final[dict[str, Case]] = {case.name: case for case in _EVERY}
"""By name."""
if len(CASES) != len(_EVERY):
    raise ValueError("tests/cases: two cases have one name")
