"""Plugins of other packages, by entry points: homes, readers, layers, pictures, exports and more.

Effects: reads the installed packages' metadata; imports a plugin's code at its first use. A plugin's package
and version are part of the digest of the steps that use it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final

from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.number_ranges import range_of
from pbrs_farm.core.shown_text import hint_of_choice

# fmt: off
GROUPS: Final = (
    "homes", "readers", "layers", "cameras", "passes", "furniture", "pictures", "exports",
)
# fmt: on
"""Of entry points, each `pbrs_farm.<group>`; docs/plugins.md says what each function takes."""

PREFIX: Final = "plugin:"
"""Of the words that name homes of a plugin: plugin:kitchen,1..100,option=x."""

MAX_HOMES: Final = 1_000_000  # of one word
_HINT: Final = "plugin:NAME,1..100 or plugin:NAME,7,option=x"

LOADED: Final[set[str]] = set()
"""Marks of the plugins whose code this process has imported; it may have started threads."""


@dataclass(frozen=True, slots=True)
class Plugin:
    """An installed plugin."""

    group: str
    name: str
    package: str
    version: str
    entry: EntryPoint

    @property
    def mark(self) -> str:
        """Its name in digests and messages."""
        return f"{self.name} of {self.package} {self.version}"

    def load(self) -> Any:
        """Import its object; MachineFailed for any error of the import."""
        LOADED.add(self.mark)
        try:
            return self.entry.load()
        except Exception as error:
            text = f"plugin {self.mark} cannot be loaded: {type(error).__name__}: {error}"
            raise MachineFailed(text) from error


@cache
def plugins(group: str) -> Mapping[str, Plugin]:
    """The installed plugins of a group by name, the first of equal ones; cached, runs no plugin's code."""
    by_name: dict[str, Plugin] = {}
    for entry in sorted(entry_points(group=f"pbrs_farm.{group}"), key=_order):
        package = entry.dist.name if entry.dist else "?"
        version = entry.dist.version if entry.dist else "?"
        by_name.setdefault(entry.name, Plugin(group, entry.name, package, version, entry))
    return by_name


@cache
def installed_marks() -> tuple[str, ...]:
    """The marks of all installed plugins."""
    return tuple(plugin.mark for group in GROUPS for plugin in plugins(group).values())


def _order(entry: EntryPoint) -> tuple[str, str]:
    return entry.name, entry.dist.name if entry.dist else ""


def plugin(group: str, name: str) -> Plugin:
    """The plugin of that name, not loaded; MachineFailed without one, with the nearest known name."""
    installed = plugins(group)
    if name not in installed:
        hint = (
            hint_of_choice(name, tuple(installed))
            if installed
            else "install the package that has it"
        )
        raise MachineFailed(f"no plugin {name!r} for {group} is installed here", hint=hint)
    return installed[name]


def marks_in_digest(group: str, names: Iterable[str]) -> list[str]:
    """The marks of plugins in the order of their names, for a digest.

    The one way in which a plugin becomes part of a digest, so that its next version makes its results anew:
    `homes` and `readers` in the source (prepare/source.py), `passes` in the house (prepare/passes.py),
    `furniture` in the catalogue (furnishings/things/families.py), `cameras`, `layers` and `pictures` in their
    steps (run/step_cache.py). Raises MachineFailed for a name that no installed plugin has.
    """
    return [plugin(group, name).mark for name in names]


def checked_names(group: str, names: str) -> str:
    """The text, if it is plugins' names or "" joined by ':'; ValueError, for validators of fields."""
    installed = plugins(group)
    for name in filter(None, names.split(":")):
        if name not in installed:
            raise ValueError(
                f"no plugin {name!r} for {group}, {hint_of_choice(name, tuple(installed))}"
            )
    return names


@dataclass(frozen=True, slots=True)
class PluginHome:
    """A home that a plugin makes from a seed."""

    name: str
    seed: int
    options: tuple[tuple[str, str], ...] = ()

    @property
    def word(self) -> str:
        """The word that names this home alone."""
        return ",".join(
            [f"{PREFIX}{self.name}", str(self.seed), *(f"{k}={v}" for k, v in self.options)]
        )

    def make(self) -> Any:
        """The plugin's Home; MachineFailed if the plugin is not installed. Errors of the plugin pass through."""
        function: Callable[..., Any] = plugin("homes", self.name).load()
        return function(self.seed, **dict(self.options))


def is_plugin(word: str) -> bool:
    """Whether a word names homes of a plugin."""
    return word.startswith(PREFIX)


def plugin_homes(word: str) -> list[PluginHome]:
    """The homes that a word names; BadInput for one that is not written like that.

    The form is plugin:NAME,FIRST..LAST,key=value,... with a single seed as a range of one. Whether
    the plugin is installed, and knows the options, is asked only when a home is made. BadInput also
    for a range longer than MAX_HOMES.
    """
    name, *parts = word.removeprefix(PREFIX).split(",")
    numbers = [part for part in parts if "=" not in part]
    options = [part.partition("=") for part in parts if "=" in part]
    ends = range_of(numbers[0]) if len(numbers) == 1 else None
    if not name.isidentifier() or ends is None:
        raise BadInput(word, "", "names no homes of a plugin", hint=_HINT)
    low, high = ends
    if not low <= high < low + MAX_HOMES:
        raise BadInput(word, numbers[0], f"is not a range of up to {MAX_HOMES:,} homes", hint=_HINT)
    for key, _, _value in options:
        if not key.isidentifier():
            raise BadInput(word, key, "is not an option name", hint=_HINT)
    pairs = tuple((key, value) for key, _, value in options)
    return [PluginHome(name, seed, pairs) for seed in range(low, high + 1)]
