"""Which views train, which choose, which judge: by house, so that rooms of a home stay together; pure.

The share of a home follows from its name alone: a new home moves no other one, a home drawn again
(another digest) stays where it was, and all its dressed variants (-d3) stay with it.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from pbrs_farm.core.errors import BadInput

SPLITS: Final = ("train", "val", "test")
# Suffixes that keys.house_id and keys.dressed_id add to a home's name.
_DIGEST_AND_VARIANT: Final = re.compile(r"(-[0-9a-f]{8})?(-d[0-9]+)?")


@dataclass(frozen=True, slots=True)
class SplitShares:
    """How large each split is: shares of 1, together 1."""

    train: float = 0.8
    val: float = 0.1
    test: float = 0.1

    def __post_init__(self) -> None:
        values = (self.train, self.val, self.test)
        if min(values) < 0 or abs(sum(values) - 1) > 1e-9:
            text = f"expected three shares that sum to 1, got {values}"
            raise BadInput("split", "", text, hint="80/10/10")


def shares_from_text(text: str) -> SplitShares:
    """80/10/10 (or 8/1/1) as shares of a sum above 0; raises BadInput."""
    try:
        train, val, test = (float(part) for part in text.split("/"))
    except ValueError:
        raise BadInput("--split", text, "expected train/val/test", hint="80/10/10") from None
    total = train + val + test
    if not 0 < total < float("inf"):
        raise BadInput("--split", text, "expected shares above 0", hint="80/10/10")
    return SplitShares(train / total, val / total, test / total)


def home_of(house: str) -> str:
    """The house's id without digest and variant: `studio` of studio-1a2b3c4d-d3; other ids unchanged."""
    match = re.fullmatch(r"(?P<home>.+?)" + _DIGEST_AND_VARIANT.pattern, house)
    return match["home"] if match else house


def split_of_house(house: str, shares: SplitShares | None = None) -> str:
    """ "train", "val" or "test" by the sha256 of the home's name; the shares hold on average."""
    shares = shares or SplitShares()
    # Take a number of 0..1 from the home's name.
    digest = hashlib.sha256(home_of(house).encode()).digest()
    position = int.from_bytes(digest[:8], "big") / 2**64
    if position < shares.train:
        return "train"
    return "val" if position < shares.train + shares.val else "test"


def empty_splits(houses: Iterable[str], shares: SplitShares) -> list[str]:
    """The splits with a share above 0 that get none of the houses, as few houses leave some.

    >>> empty_splits(["studio"], SplitShares(0.5, 0.5, 0))
    ['val']
    """
    used = {split_of_house(house, shares) for house in houses}
    return [name for name in SPLITS if getattr(shares, name) > 0 and name not in used]
