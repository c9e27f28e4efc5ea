"""The realistic house of each common format, damaged in the same dozen ways. No effects until written."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from typing import Any, Final

from tests.hostile.case import TINY, Case, Place, Words, run
from tests.hostile.verdict import FORGED
from tests.inputs.sound_files import SoundFile, sound_files

_SMALL: Final = 300  # triangles
_MILLION: Final = 10**6
_NUMBER: Final = re.compile(rb"-?\b\d+\.?\d*(?:[eE][-+]?\d+)?")
_NAME: Final = re.compile(rb"(?<=[\"'=])[A-Za-z][A-Za-z0-9 _|/-]{2,40}(?=[\"'])")

Mend = Callable[[bytes], bytes]


def cases() -> Iterator[Case]:
    """A dozen faults for each format; the first of a format runs beside a sound home."""
    for title, sound in sound_files(_SMALL).items():
        family = re.sub(r"\W+", "_", title.lower())
        for k, (name, mend) in enumerate(FAULTS.items()):
            yield Case(
                f"input/{family}_{name}", "format", _written(sound, mend, whole=k == 0), int(k == 0)
            )


def _written(sound: SoundFile, mend: Mend, *, whole: bool) -> Callable[[Place], list[Words]]:
    def write(place: Place) -> list[Words]:
        path = sound.write(place.folder)
        path.write_bytes(mend(path.read_bytes()))
        if whole:
            return [run(place, path)]
        return [("repair", str(path), "--out", str(place.out), *TINY)]

    return write


def _every(n: int, pattern: re.Pattern[bytes], word: bytes) -> Mend:
    """Replace every n-th match."""

    def mend(data: bytes) -> bytes:
        count = iter(range(len(data)))
        return pattern.sub(lambda m: word if next(count) % n == n // 2 else m[0], data)

    return mend


def _of_json(change: Callable[[Any], Any], otherwise: Mend) -> Mend:
    """A change of a JSON file's value; of another file `otherwise` changes the bytes."""

    def mend(data: bytes) -> bytes:
        try:
            value = json.loads(data)
        except ValueError:
            return otherwise(data)
        return json.dumps(change(value)).encode()

    return mend


def _lists_twice(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _lists_twice(v) for key, v in value.items()}
    if isinstance(value, list):
        doubled = [_lists_twice(v) for v in value]
        return doubled + doubled if value and isinstance(value[0], dict) else doubled
    return value


def _crowd(value: Any) -> Any:
    """The longest list of objects, extended to a million."""
    if not isinstance(value, dict):
        return value
    lists = {k: v for k, v in value.items() if isinstance(v, list) and v and isinstance(v[0], dict)}
    if not lists:
        return {key: _crowd(v) for key, v in value.items()}
    longest = max(lists, key=lambda key: len(lists[key]))
    longest_list = lists[longest][0]
    small = longest_list if len(json.dumps(longest_list)) < 200 else {"id": 1}
    return value | {longest: [*lists[longest], *([small] * _MILLION)]}


def _times(factor: float) -> Mend:
    def mend(data: bytes) -> bytes:
        return _NUMBER.sub(
            lambda m: repr(float(m[0]) * factor).encode() if b"." in m[0] else m[0], data
        )

    return mend


def _lines_again(data: bytes) -> bytes:
    lines = data.splitlines(keepends=True)
    middle = lines[len(lines) // 2]
    return b"".join([*lines[:-1], *([middle] * (_MILLION // 10)), lines[-1]])


FAULTS: Final[dict[str, Mend]] = {
    "cut": lambda data: data[: len(data) // 2],
    "empty": lambda data: b"",
    "other_json": lambda data: b'{"hello": [1, 2, 3]}',
    "nan": _every(9, _NUMBER, b"NaN"),
    "infinity": _every(9, _NUMBER, b"1e400"),
    "huge": _every(9, _NUMBER, b"1e30"),
    "negative": _every(5, _NUMBER, b"-7"),
    "centimetres": _times(100.0),
    "millimetres_for_metres": _times(0.001),
    "zeros_inside": lambda data: data[: len(data) // 3] + b"\0" * 64 + data[len(data) // 3 :],
    "deep": _of_json(lambda value: value, lambda data: data + b"(" * 100_000),
    "nested": lambda data: b"[" * 100_000 + data,
    "twice": _of_json(_lists_twice, lambda data: data + data),
    "crowd": _of_json(_crowd, _lines_again),
    "leading_out": _every(3, _NAME, b"../../../../etc/passwd"),
    "forged": _every(3, _NAME, b"x\\n" + FORGED.encode()),
}  # fmt: skip
"""Name of a fault -> function that applies it to the bytes of a sound file."""
