"""The words that name homes to generate, `made:12` or `made:1..1000,rooms=2..4`; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.number_ranges import range_of

PREFIX: Final = "made:"
VERSION: Final = 15
"""Of the generator: part of a made home's id. Raised when it makes another home of a seed."""

STREAM: Final = 11
"""Names the random numbers of made homes. Changed, all homes are drawn anew; VERSION alone changes some."""

VERSION_OF_STOREYS: Final = 3
"""The same of what only homes of two storeys have: raised, it leaves the others what they are."""

MAX_SEED: Final = 2**31 - 1
MAX_HOMES: Final = 1_000_000
"""Of one word."""

STYLES: Final = ("classic", "mixed", "modern", "nordic", "vintage")
"""Of furniture; none named: one of them by seed."""

PLANS: Final = ("flat", "alpine", "japanese", "loft", "mediterranean", "nordic", "old_town", "us")
"""Families of plans (generate/plan_families.toml); none named: one of them by seed."""

_AREA_OF_HOMES: Final = ((28, 60), (36, 85), (48, 115), (62, 150), (76, 180))
"""Smallest and largest floor of all rooms, square metres, by the number of bedrooms."""

AREA_OF_TWO_STOREYS: Final = {2: (76, 150), 3: (84, 190), 4: (96, 230)}
"""The same of both storeys together."""

_HINT: Final = "made:12, made:1..1000 or made:1..100,rooms=2..4,area=60..90"


@dataclass(frozen=True, slots=True)
class MadeHome:
    """A home to generate."""

    seed: int
    bedrooms: tuple[int, int] = (0, 4)
    area: tuple[int, int] = (20, 250)  # of all rooms, square metres
    style: str = ""  # of furniture and paints; "" = drawn by seed
    furniture: bool = True
    storeys: int = 1
    plans: str = ""  # the family of its plan; "" = drawn by seed
    offices: int | None = None  # number of bedrooms used as offices; None = by chance

    @property
    def word(self) -> str:
        """The word, without defaults, that names this home; its form is part of the digest and may not change."""
        parts = [f"{PREFIX}{self.seed}"]
        plain = MadeHome(self.seed)
        for name, key in (("bedrooms", "rooms"), ("area", "area")):
            low, high = getattr(self, name)
            if (low, high) != getattr(plain, name):
                parts.append(f"{key}={low}..{high}")
        if self.style:
            parts.append(f"style={self.style}")
        if self.plans:
            parts.append(f"plans={self.plans}")
        if self.storeys != plain.storeys:
            parts.append(f"storeys={self.storeys}")
        if self.offices is not None:
            parts.append(f"offices={self.offices}")
        if not self.furniture:
            parts.append("furniture=none")
        return ",".join(parts)

    @property
    def name(self) -> str:
        """The name of its file, without the ending."""
        return f"made-{self.seed}"

    @property
    def version(self) -> int | str:
        """Of what makes it."""
        return VERSION if self.storeys == 1 else f"{VERSION}.{VERSION_OF_STOREYS}"

    @property
    def stream(self) -> int | str:
        """Name of its random numbers."""
        return STREAM if self.storeys == 1 else f"{STREAM}.{VERSION_OF_STOREYS}"

    @property
    def digest(self) -> str:
        """Digest of all that makes it, but for the furniture's catalogue."""
        return keys.digest("made", self.version, self.word)


def is_made(word: str) -> bool:
    """Whether a word names homes to generate."""
    return word.startswith(PREFIX)


def made_homes(word: str) -> list[MadeHome]:
    """The homes of a word, one a seed. Raises BadInput for a word that names none.

    A word is made:FIRST..LAST,key=value,... with keys rooms, area, style, plans, storeys,
    offices and furniture=none; a single seed is a range of one. Every home of the word shares its options.
    BadInput also for a range longer than MAX_HOMES and for wishes that no home meets
    (`check_wishes`).
    """
    seeds, *options = word.removeprefix(PREFIX).split(",")
    first, last = _checked_range(word, seeds, MAX_SEED)
    if last - first >= MAX_HOMES:
        raise BadInput(word, "", f"names {last - first + 1} homes, at most {MAX_HOMES}")
    home = MadeHome(first)
    for option in options:
        key, _, value = option.partition("=")
        if key == "rooms":
            home = replace(home, bedrooms=_checked_range(word, value, 4))
        elif key == "area":
            home = replace(home, area=_checked_range(word, value, 1000))
        elif key == "style":
            home = replace(home, style=_one_of(STYLES, word, option, "no such style"))
        elif key == "plans":
            home = replace(home, plans=_one_of(PLANS, word, option, "no such family of plans"))
        elif key == "storeys":
            home = replace(home, storeys=_checked_number(word, option))
        elif key == "offices":
            home = replace(home, offices=_checked_number(word, option))
        elif key == "furniture" and value == "none":
            home = replace(home, furniture=False)
        else:
            raise BadInput(word, option, "is not an option of made homes", hint=_HINT)
    check_wishes(home.bedrooms, home.area, home.storeys, home.offices or 0)
    return [replace(home, seed=seed) for seed in range(first, last + 1)]


def check_wishes(
    bedrooms: tuple[int, int], area: tuple[float, float], storeys: int = 1, offices: int = 0
) -> None:
    """Raise BadInput for a number of bedrooms, an area, storeys and offices that no home meets.

    bedrooms and area (m2) are inclusive ranges. A home must exist whose area overlaps the range,
    for a number of bedrooms within it; two storeys need at least the bedrooms for which plans of
    two storeys exist, and beside its offices a home has a bedroom. The error names the range that would do.
    """
    low, high = bedrooms
    if not 0 <= low <= high <= len(_AREA_OF_HOMES) - 1:
        text = "homes have 0 to 4 bedrooms"
        raise BadInput("rooms", f"{low}..{high}", text, hint="rooms=2..4")
    if not 0 < area[0] <= area[1]:
        raise BadInput("area", f"{area[0]:g}..{area[1]:g}", "is not a range", hint="area=60..90")
    if storeys not in (1, 2):
        raise BadInput("storeys", str(storeys), "homes have one storey or two", hint="storeys=2")
    if offices and high <= offices:
        text, most_rooms = ("at least one bedroom must stay", len(_AREA_OF_HOMES) - 1)
        hint = f"rooms={min(offices + 1, most_rooms)}..{most_rooms}, offices=1..{most_rooms - 1}"
        raise BadInput("offices", f"{offices} of {high} bedrooms", text, hint=hint)
    low = max(low, offices + 1 if offices else 0)
    least, most = _AREA_OF_HOMES[low][0], _AREA_OF_HOMES[high][1]
    if storeys == 2:
        if high < min(AREA_OF_TWO_STOREYS):
            text = "homes of two storeys have 2 to 4 bedrooms"
            raise BadInput("rooms", f"{low}..{high}", text, hint="rooms=2..4")
        low = max(low, min(AREA_OF_TWO_STOREYS))
        least, most = AREA_OF_TWO_STOREYS[low][0], AREA_OF_TWO_STOREYS[high][1]
    if area[1] < least or area[0] > most:
        of = f"{low}" if low == high else f"{low} to {high}"
        raise BadInput(
            "area",
            f"{area[0]:g}..{area[1]:g}",
            f"homes of {of} bedrooms have {least:g} to {most:g} m2",
            hint=f"area={least:g}..{most:g}",
        )


def _one_of(names: tuple[str, ...], word: str, option: str, text: str) -> str:
    value = option.partition("=")[2]
    if value not in names:
        raise BadInput(word, option[:60], text, hint=f"one of {', '.join(names)}")
    return value


def _checked_number(word: str, option: str) -> int:
    key, _, value = option.partition("=")
    low, high = _checked_range(word, value, 99)
    if low != high:
        raise BadInput(word, option, "is a range, expected a number", hint=f"{key}={high}")
    return low


def _checked_range(word: str, text: str, most: int) -> tuple[int, int]:
    ends = range_of(text)
    if ends is None:
        raise BadInput(word, text[:40], "is neither a number nor a range LOW..HIGH", hint=_HINT)
    low, high = ends
    if low > high:
        raise BadInput(word, text, "runs downwards", hint=f"{high}..{low}")
    if high > most:
        raise BadInput(word, text, f"is above {most}", hint=_HINT)
    return low, high
