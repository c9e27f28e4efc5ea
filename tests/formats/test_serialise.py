"""Refusals of JSON files in our wording, without Python's."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.formats.serialise import pretty_json

PYTHONS_WORDS = ("literal", "codec", "integer string", "maximum recursion", "Traceback", "0x")


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b'{"a": ' + b"9" * 5000 + b"}", "a number has too many digits"),
        (b'{"a": "\xff"}', "not UTF-8"),
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a": NaN}', "NaN is not a number"),
        (b'{"a" 1}', "line 1 column 6"),
        (b"", "not valid JSON"),
    ],
)
def test_invalid_json_is_refused_without_pythons_words(data, said):
    with pytest.raises(BadHouse) as caught:
        json_from_bytes(data, "a.arch.json")
    text = str(caught.value)
    assert "a.arch.json" in text
    assert said in text
    assert not any(words in text for words in PYTHONS_WORDS)


@given(
    st.recursive(
        st.none()
        | st.booleans()
        | st.integers()
        | st.text()
        | st.floats(allow_nan=False, allow_infinity=False),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
def test_pretty_json_equals_json(value):
    text = pretty_json(value)
    assert json.loads(text) == value
    assert "".join(text.split()) == "".join(json.dumps(value, sort_keys=True).split())
