"""Views of an export with given facts, without files."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.formats.output_folder import ViewEntry


def made_view(
    facts: dict[str, Any],
    *,
    choice: Choice | None = None,
    array: Callable[[str], Any] | None = None,
    **entry: Any,
) -> ChosenView:
    """A view with these facts; array: its layers by name. entry: fields of its ViewEntry."""
    fields = {"id": "v", "house": SimpleNamespace(id="h"), "file": lambda _name: None} | entry
    view = ChosenView(cast(ViewEntry, SimpleNamespace(**fields)), choice or Choice())
    vars(view).update({"facts": facts} | ({} if array is None else {"array": array}))
    return view
