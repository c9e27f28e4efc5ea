"""A data set as described by its file: rendered parts, their forms, a card. No effects.

A part is a run with one recipe, so each has an output root. commands/set_file.py reads the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares
from pbrs_farm.core.number_ranges import range_of
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.run.request import Wanted
from pbrs_farm.views.packing.packing_plan import Packing

SHIPPED: Final = Path(__file__).parent
"""The folder of the package's sets: indoor-1k.toml and others."""

WHOLE: Final = (1, 1)
"""The shard that is all homes."""


@dataclass(frozen=True, slots=True)
class SetPart:
    """Homes with the same rendering options.

    homes: a word each, as `run` takes them. rules: of `select --by`; they leave views out of the forms. values: the entries of the file by option's name, for `submit`.
    """

    name: str
    homes: tuple[str, ...]
    recipe: Recipe
    want: Wanted
    dress_seeds: tuple[int, ...] = ()  # none: by the recipe's
    models: str = ""
    rules: tuple[str, ...] = ()
    values: Mapping[str, Any] = field(default_factory=dict)

    @property
    def n_houses(self) -> int:
        """Number of homes times number of seeds of dressing."""
        return len(self.homes) * max(1, len(self.dress_seeds))

    def homes_of(self, shard: tuple[int, int]) -> tuple[str, ...]:
        """The homes of shard (k, n), k from 1: every n-th, all variants of a home in one shard.

        The shards of all k are the whole, each home in one.
        """
        k, n = shard
        return self.homes[k - 1 :: n]


@dataclass(frozen=True, slots=True)
class SetForm:
    """A form of some parts: of `export`, or of `pack` if it has a packing."""

    name: str  # of its folder
    to: str
    parts: tuple[str, ...]
    choice: Choice = field(default_factory=Choice)
    packing: Packing | None = None


@dataclass(frozen=True, slots=True)
class SetCard:
    """The head of the set's README, from its file."""

    title: str
    text: str = ""
    licence: str = ""


@dataclass(frozen=True, slots=True)
class DataSet:
    """A data set."""

    name: str
    data: bytes  # of the file
    card: SetCard
    shares: SplitShares | None
    parts: tuple[SetPart, ...]
    forms: tuple[SetForm, ...]

    @property
    def file(self) -> str:
        """The file's name in the set's folder."""
        return f"{self.name}.toml"


def shipped_sets() -> tuple[str, ...]:
    """The names of the sets that come with the package.

    >>> "indoor-1k" in shipped_sets()
    True
    """
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def shard_from_text(text: str | None) -> tuple[int, int]:
    """`3/16` as (3, 16); all homes, (1, 1), of None. BadInput for any other word.

    >>> shard_from_text("3/16")
    (3, 16)
    """
    if text is None:
        return WHOLE
    first, slash, last = text.partition("/")
    k, n = range_of(f"{first}..{last}") or (0, 0)
    if not slash or not 1 <= k <= n:
        raise BadInput("--shard", text, "expected K/N", hint="e.g. 3/16")
    return k, n
