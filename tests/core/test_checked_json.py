"""Refusals of JSON: file, place and our wording, without pydantic's."""

import re
from typing import Annotated, Literal

import pytest
from pydantic import Field, TypeAdapter

from pbrs_farm.core.checked_json import Finite, checked, exactly
from pbrs_farm.core.errors import BadHouse, BadInput
from pbrs_farm.core.record import Record

PYDANTICS_WORDS = re.compile(r"[Ii]nput|pydantic|https?:|valid (string|number|int)|type=|[{}\n]")


class Part(Record):
    name: str = Field("", max_length=5)
    at: Annotated[tuple[Finite, Finite, Finite], exactly(3)] = (0.0, 0.0, 0.0)
    share: Finite = Field(0.5, ge=0, lt=1)
    kind: Literal["door", "window"] = "door"
    pair: tuple[int, int] = (1, 2)
    words: dict[str, bool] = Field(default_factory=dict)


class Whole(Record):
    parts: list[Part]


@pytest.mark.parametrize(
    ("part", "place", "text"),
    [
        (3, "parts[0]", "expected an object, got 3"),
        ({"name": 3}, "parts[0].name", "expected a text, got 3"),
        ({"name": "x" * 99}, "parts[0].name", "expected 5 characters at most"),
        ({"at": [1, 2]}, "parts[0].at", "expected 3 numbers"),
        ({"at": [1, 2, "3"]}, "parts[0].at[2]", 'expected a number, got "3"'),
        ({"at": [1, 2, True]}, "parts[0].at[2]", "expected a number, got true"),
        ({"at": [1, 2, float("inf")]}, "parts[0].at[2]", "is not a finite number"),
        ({"at": [1, 2, 10**400]}, "parts[0].at[2]", "expected a number, got a number of many"),
        ({"share": -1}, "parts[0].share", "expected 0 or more, got -1"),
        ({"share": [1]}, "parts[0].share", "expected a number, got a list"),
        ({"kind": "dor"}, "parts[0].kind", "expected 'door' or 'window', got \"dor\""),
        ({"pair": [1]}, "parts[0].pair[1]", "is missing"),
        ({"pair": [1, 2, 3]}, "parts[0].pair", "expected 2 values at most, got 3"),
        ({"words": {"a": []}}, "parts[0].words.a", "expected true or false, got a list"),
        ({"nam": ""}, "parts[0].nam", "no such field (did you mean name?"),
    ],
)
def test_an_invalid_value_is_one_line_with_its_place(part, place, text):
    with pytest.raises(BadHouse) as caught:
        checked(Whole, {"parts": [part]}, "a.json", "room 1", error=BadHouse, hint="again")
    assert caught.value.place == f"room 1, {place}"
    assert text in str(caught.value)
    assert str(caught.value).startswith("a.json: ")
    assert not PYDANTICS_WORDS.search(str(caught.value).replace("a.json", ""))


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "a.json: not valid JSON: the text is empty"),
        (b"[1, 2", "a.json: line 1 column 6: not valid JSON"),
        (b"[" * 500, "a.json: line 1 column 501: not valid JSON"),
        (b"[" * 500 + b"]" * 500, "a.json: not valid JSON: nested too deeply"),
        (b"[1, NaN]", "a.json: list[1]: is not a finite number"),
        (b'[1, "\xff"]', "a.json: byte 5: not valid JSON: the text is not UTF-8"),
        (b"[1, []]", "a.json: list[1]: expected a number, got a list"),
    ],
)
def test_invalid_bytes_are_one_line_with_their_place(data, text):
    with pytest.raises(BadInput, match=re.escape(text)) as caught:
        checked(TypeAdapter(list[Finite]), data, "a.json", "list")
    assert not PYDANTICS_WORDS.search(str(caught.value).replace("a.json", ""))


def test_valid_json_is_read_unchanged():
    part = {"name": "a", "at": [1, 2.5, 3], "share": 0}
    assert checked(Part, part, "a.json") == Part(name="a", at=(1.0, 2.5, 3.0), share=0.0)
    assert checked(TypeAdapter(list[Finite]), b"[1, 2.5]", "a.json") == [1.0, 2.5]
    assert checked(TypeAdapter(list[Finite]), b"\xef\xbb\xbf[1]", "a.json") == [1.0]
