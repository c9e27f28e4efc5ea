"""Typed access to XML attributes, every fault named with its file and place. No effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import M_FROM_CM

Rgb = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Attributes:
    """One element's attributes."""

    file: str
    place: str  # what to call the element in a message
    element: Element
    max_extent_m: float  # bound of lengths and coordinates

    def fail(self, message: str) -> BadHouse:
        """The error that names the file and this element, for the caller to raise."""
        return BadHouse(self.file, self.place, message)

    def text(self, name: str, default: str = "") -> str:
        """The attribute, unconverted."""
        return self.element.get(name, default)

    def optional(self, name: str) -> float | None:
        """A finite number, or None if the attribute is missing or empty."""
        text = self.element.get(name)
        if text is None or not text.strip():
            return None
        try:
            value = float(text)
        except ValueError:
            raise self.fail(f"{name}='{text[:40]}' is not a number") from None
        if not math.isfinite(value):
            raise self.fail(f"{name}='{text[:40]}' is not a finite number")
        return value

    def number(self, name: str, default: float | None = None) -> float:
        """A finite number; without a default the attribute must be there."""
        value = self.optional(name)
        if value is not None:
            return value
        if default is None:
            raise self.fail(f"attribute {name} is missing")
        return default

    def within(self, name: str, default: float, low: float, high: float) -> float:
        """A finite number, drawn into low..high."""
        return min(max(self.number(name, default), low), high)

    def metres(self, name: str, default_m: float | None = None) -> float:
        """A length or coordinate given in centimetres, in metres.

        default: in metres, None = required. Raises BadHouse, naming the element, for an invalid number and
        for one beyond read.max_extent_m.
        """
        value = self.optional_metres(name)
        if value is not None:
            return value
        if default_m is None:
            raise self.fail(f"attribute {name} is missing")
        return default_m

    def optional_metres(self, name: str) -> float | None:
        """As metres, or None if the attribute is missing."""
        value = self.optional(name)
        if value is None:
            return None
        value *= M_FROM_CM
        if abs(value) > self.max_extent_m:
            limit = f"{self.max_extent_m:.0f} m (recipe field read.max_extent_m)"
            raise self.fail(f"{name} is {value:.0f} m, farther than {limit}")
        return value

    def length(self, name: str, default_m: float | None = None) -> float:
        """As metres, and not negative."""
        value = self.metres(name, default_m)
        if value < 0:
            raise self.fail(f"{name} is negative")
        return value

    def flag(self, name: str, default: bool) -> bool:
        """true or false."""
        text = self.element.get(name)
        return default if text is None else text.strip().lower() == "true"

    def numbers(self, name: str, count: int) -> tuple[float, ...] | None:
        """count numbers of at most 1e6 separated by spaces, or None if missing."""
        text = self.element.get(name)
        if text is None:
            return None
        try:
            values = tuple(float(w) for w in text.split())
        except ValueError:
            values = ()
        # NaN fails the comparison, too.
        if len(values) != count or not all(abs(v) <= 1e6 for v in values):
            raise self.fail(f"{name} must be {count} finite numbers")
        return values

    def argb(self, name: str) -> tuple[int, Rgb] | None:
        """Alpha 0..255 and the sRGB-encoded colour in 0..1 of a hex AARRGGBB, or None."""
        text = self.element.get(name)
        if text is None or not text.strip():
            return None
        try:
            value = int(text, 16)
        except ValueError:
            raise self.fail(f"{name}='{text[:40]}' is not a colour AARRGGBB") from None
        if not 0 <= value <= 0xFFFFFFFF:
            raise self.fail(f"{name}='{text[:40]}' is not a colour AARRGGBB")
        # The program keeps colours as Java does: alpha, red, green, blue from the top byte.
        r, g, b = ((value >> shift & 255) / 255 for shift in (16, 8, 0))
        return value >> 24, (r, g, b)
