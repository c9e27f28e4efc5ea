"""Tables of entries, one a module of a package and those of plugins, imported when first asked for."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.plugins import marks_in_digest, plugins


@dataclass(frozen=True, slots=True)
class EntryTable:
    """The entries of one kind, such as the forms of an export or the sources of cameras.

    package: dotted name. Each of its modules defines one entry and has the entry's name, with `_`
    for a dash. attribute: the variable that holds the entry. group: entry points of plugins.
    types: names of the classes that a plugin's entry may have.
    """

    package: str
    attribute: str
    group: str
    types: tuple[str, ...]

    def own_names(self) -> tuple[str, ...]:
        """Names of the entries of the package; imports none of its modules."""
        modules = pkgutil.iter_modules(import_module(self.package).__path__)
        return tuple(sorted(module.name.replace("_", "-") for module in modules))

    def names(self) -> tuple[str, ...]:
        """Names of all entries, those of plugins last; imports no entry."""
        own_names = self.own_names()
        return (*own_names, *(name for name in plugins(self.group) if name not in own_names))

    def entry(self, name: str) -> Any:
        """The entry of that name, KeyError without; MachineFailed if that of a plugin is wrong or misnamed."""
        if name in self.own_names():
            module = import_module(f"{self.package}.{name.replace('-', '_')}")
            return getattr(module, self.attribute)
        plugin = plugins(self.group)[name]
        entry = plugin.load()
        if type(entry).__name__ not in self.types or entry.name != name:
            types = " or ".join(self.types)
            raise MachineFailed(f"plugin {plugin.mark} has no {types} named {name}")
        return entry

    def marks(self, names: Iterable[str]) -> list[str]:
        """Marks of the plugins among these names, for a digest."""
        own_names = self.own_names()
        return marks_in_digest(self.group, (name for name in names if name not in own_names))
