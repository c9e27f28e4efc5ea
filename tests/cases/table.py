"""Every case, in one table for the tests beside and for `make bench NAME=cases`; no effects."""

from __future__ import annotations

from typing import Final

from tests.cases import house_cases, surface_cases, trajectory_cases
from tests.cases.case import Case

CASES: Final[dict[str, Case]] = {
    case.name: case
    for module in (surface_cases, house_cases, trajectory_cases)
    for case in module.cases()
}
"""By name."""
