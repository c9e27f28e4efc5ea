"""Description of a format of homes or plans: how its files are recognised, its contents. No effects."""

from __future__ import annotations

from dataclasses import dataclass
from re import Pattern


@dataclass(frozen=True, slots=True, kw_only=True)
class DataFormat:
    """An entry of the table that `pbrs-farm inputs` lists; a format's package ends with its own.

    The suffix decides; for a .json its keys. If files of other kinds share the suffix (`shared_suffixes`),
    `contains` checks the head: in a folder such a file is a home only if its head matches. A file named on a
    command line is tried in any case, so that the reader can explain the problem.
    """

    title: str
    files: str  # how its files are called, for a reader of the list
    brings: str
    where: str  # one gets the data
    licence: str  # of the data
    needs: str = ""  # packages to install, in words
    library: str = ""  # the module without which it cannot be read
    order: int = 500  # in which formats are asked and listed, lowest first
    suffixes: tuple[str, ...] = ()
    shared_suffixes: frozenset[str] = frozenset()
    contains: Pattern[bytes] | None = None  # in the first megabytes of such a file
    lines: tuple[
        bytes, ...
    ] = ()  # beginnings of lines of the whole file, among which `contains` is sought instead
    keys: tuple[tuple[str, ...], ...] = ()  # all names of one of these occur in its JSON
    beside: tuple[str, ...] = ()  # patterns of names of files that lie beside one and are no homes

    def is_sure_of(self, suffix: str, head: bytes) -> bool:
        """True if the suffix (lower case) and, if `shared_suffixes` has it, the head prove this format."""
        if suffix not in self.suffixes:
            return False
        return suffix not in self.shared_suffixes or (
            self.contains is not None and self.contains.search(head) is not None
        )

    def has_keys(self, names: set[str]) -> bool:
        """True if a JSON file that contains these names is of this format: one set of its keys is complete."""
        return any(names.issuperset(keys) for keys in self.keys)
